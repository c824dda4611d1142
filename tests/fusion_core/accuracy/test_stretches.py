"""Stretches over which something holds, and the longest in which a phone lies still, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import Samples
from fusion_core.accuracy import BoolArray, noise, stretches
from pipeline.statistics.arrays import FloatArray


def test_a_stretch_ends_at_a_gap_and_where_it_holds_no_more() -> None:
    """At 25 Hz; 0.48 s to 0.60 s are missing, and at 1.00 s it does not hold."""
    time = np.concatenate([np.arange(0, 12), np.arange(15, 41)]) * 0.04
    holds = np.abs(time - 1.0) > 0.01
    found = list(stretches(time, holds, 0.3))
    assert found == [pytest.approx((0.0, 0.44)), pytest.approx((0.6, 0.96)), pytest.approx((1.04, 1.6))]


def test_a_stretch_lasts_as_long_as_is_asked_for() -> None:
    time = np.array([0.0, 0.04, 0.08, 0.12, 0.16, 0.2])
    holds = np.array([True, True, False, True, True, True])
    assert list(stretches(time, holds, 0.0)) == [(0.0, 0.04), (0.12, 0.2)]
    assert list(stretches(time, holds, 0.06)) == [(0.12, 0.2)]
    assert list(stretches(time, holds, 0.1)) == []


def test_the_longest_stretch_is_not_the_latest() -> None:
    assert noise.longest([(0.0, 1.0), (2.0, 5.0), (7.0, 8.0)]) == (2.0, 5.0)
    assert noise.longest([]) is None


def held(time: FloatArray, still: BoolArray, rest: FloatArray) -> Samples:
    """Accelerations that go to and fro by 1 mm/s² where the hand is still and by 3000 mm/s² elsewhere."""
    fro = np.where(np.arange(len(time)) % 2 == 0, 1.0, -1.0)
    return Samples(time, time, (rest + fro * np.where(still, 1.0, 3000.0))[:, None])


def test_a_still_stretch_is_that_of_the_middles_of_half_seconds_that_are_still_throughout() -> None:
    """At 90 Hz half a second is 45 readings: the first whole one is about the 23rd still reading."""
    time = np.arange(0, 20 * 90) / 90
    still = (time > 7.99) & (time < 12.01)
    found = noise.still_by_acceleration(held(time, still, 0 * time))
    assert found == pytest.approx((8 + 22 / 90, 12 - 22 / 90))


def test_a_phone_that_is_turned_over_is_still_before_and_after() -> None:
    """Gravity points the other way afterwards, which is no unrest; the second rest is the longer one."""
    time = np.arange(0, 20 * 90) / 90
    still = (time < 6.005) | (time > 8.995)
    found = noise.still_by_acceleration(held(time, still, np.where(time < 7.5, -9806.65, 9806.65)))
    assert found == pytest.approx((9 + 22 / 90, time[-1] - 22 / 90))
