"""When no lag or lead is claimed, and what has no say in one."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import Samples, accuracy
from pipeline.statistics.arrays import FloatArray


def moving(time: FloatArray) -> FloatArray:
    return np.column_stack([100 * np.sin(3 * time) + 20 * np.sin(11 * time), 50 * np.cos(4 * time)])


def of(time: FloatArray, value: FloatArray) -> Samples:
    return Samples(time, time, value)


def lag(time: FloatArray, estimate: FloatArray, reference: Samples) -> list[float]:
    """The lag and its interval, always by the same resamples."""
    found = accuracy.lag(time, estimate, reference, np.random.default_rng(0))
    return [found.value, found.low, found.high]


@pytest.mark.parametrize(("lasting_s", "claimed"), [(0.9, False), (1.1, True)])
def test_a_lag_takes_a_second_of_track(lasting_s: float, claimed: bool) -> None:
    known = np.arange(-1, 4, 1 / 100)
    time = np.arange(0, lasting_s + 0.005, 1 / 100)
    found = lag(time, moving(time - 0.06), of(known, moving(known)))
    if claimed:
        assert found[0] == pytest.approx(0.06, abs=0.002)
    else:
        assert np.isnan(found).all()


@pytest.mark.parametrize(("trembling_mm", "claimed"), [(1e-3, False), (1.0, True)])
def test_a_lag_is_not_read_from_a_tremble_below_a_millionth_of_the_error(trembling_mm: float, claimed: bool) -> None:
    """Beside an error of 10 mm, 100 mm² an instant, a shift of the first tremble changes 1e-6 mm², of the second 1."""
    time = np.arange(0, 10, 1 / 90)
    tremble = trembling_mm * np.sin(9 * time)
    late = trembling_mm * np.sin(9 * (time - 0.06))
    found = lag(time, np.column_stack([late, 10 + 0 * time]), of(time, np.column_stack([tremble, 0 * time])))
    if claimed:
        assert found[0] == pytest.approx(0.06, abs=0.002)
    else:
        assert np.isnan(found).all()


def test_what_the_reference_does_not_surround_has_no_say_in_the_lag() -> None:
    """Of a reference from 1 s to 6 s all shifts are known from 1.5 s to 5.5 s; the track is far off elsewhere."""
    known, time = np.linspace(1.0, 6.0, 501), np.arange(0, 7, 1 / 60)
    reference = of(known, moving(known))
    surrounded = (time >= 1.5) & (time <= 5.5)
    good = moving(time - 0.08) + np.random.default_rng(1).normal(0, 3, (len(time), 2))
    track = np.where(surrounded[:, None], good, 1000.0)
    found = lag(time, track, reference)
    assert found == lag(time[surrounded], good[surrounded], reference)
    assert found[0] == pytest.approx(0.08, abs=0.005)


@pytest.mark.parametrize("ahead_s", [0.7, -0.9])
def test_no_lead_is_claimed_where_it_would_lie_beyond_half_a_second(ahead_s: float) -> None:
    time = np.arange(0, 40, 1 / 90)
    tracker = of(time, np.sin(time)[:, None])
    assert np.isnan(accuracy.lead_by_cross_correlation(time, np.sin(time + ahead_s)[:, None], tracker))


def test_a_track_that_goes_the_other_way_leads_by_nothing() -> None:
    """The correlation at a shift of s is −cos(s) / 2 + cos(20 s) / 8: below 0 within half a second, its peak too."""
    time = np.arange(0, 40 * np.pi, 1 / 90)
    slow, fast = np.sin(time), 0.5 * np.sin(20 * time)
    tracker, track = of(time, (slow + fast)[:, None]), (fast - slow)[:, None]
    curve = accuracy.lead_curve(time, track, tracker)
    assert curve is not None
    near = curve[1][np.abs(curve[0]) <= 0.5]
    assert (near < 0).all()
    assert 0 < int(np.argmax(near)) < len(near) - 1
    assert np.isnan(accuracy.lead_by_cross_correlation(time, track, tracker))


@pytest.mark.parametrize(("shared_s", "known"), [(0.9, False), (1.1, True)])
def test_a_lead_takes_a_second_that_track_and_tracker_share(shared_s: float, known: bool) -> None:
    """The track lasts until 5 s, and the tracker begins a little before that."""
    time = np.arange(0, 5, 1 / 100)
    frames = np.arange(time[-1] - shared_s, 8, 1 / 30)
    assert (accuracy.lead_curve(time, moving(time), of(frames, moving(frames))) is not None) == known
