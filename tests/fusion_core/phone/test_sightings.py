"""Which frames of a tracker are the hand's, where it repeats itself, says zero or follows another body."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from fusion_core import Samples
from fusion_core.phone.sightings import BELIEVED_AFTER_S, sightings

NOISE_SD_MM = 8.0
AWAY_MM = np.array([400.0, -300.0, 100.0])


def moving(seconds: float = 6.0, speed: float = 1.0) -> Samples:
    """A hand on a circle, noisily, at 30 Hz."""
    time = np.arange(0.0, seconds, 1 / 30)
    place = 150.0 * np.column_stack([np.cos(speed * time), np.sin(speed * time), 0.2 * np.sin(3 * time)])
    noise = np.random.default_rng(1).normal(0.0, NOISE_SD_MM, place.shape)
    return Samples(time, time + 0.1, np.array([0.0, 500.0, 900.0]) + place + noise)


def with_values(frames: Samples, rows: npt.NDArray[np.bool_], value: np.ndarray) -> Samples:
    """The frames with others' values in some rows."""
    changed = frames.value.copy()
    changed[rows] = value
    return Samples(frames.time, frames.arrival, changed)


def between(frames: Samples, begin: float, end: float) -> npt.NDArray[np.bool_]:
    return (frames.time >= begin) & (frames.time < end)


def test_frames_of_a_hand_are_all_kept_as_they_are() -> None:
    frames = moving()
    kept = sightings(frames, NOISE_SD_MM)
    np.testing.assert_array_equal(kept.value, frames.value)
    np.testing.assert_array_equal(kept.arrival, frames.arrival)


def test_a_fast_hand_is_a_hand() -> None:
    """6 m/s on a circle, as fast as a runner's."""
    frames = moving(speed=40.0)
    assert len(sightings(frames, NOISE_SD_MM)) == len(frames)


def test_repeats_and_zeros_say_nothing() -> None:
    frames = moving()
    held, zero = between(frames, 2.0, 2.5), between(frames, 4.0, 4.5)
    odd = with_values(with_values(frames, held, frames.value[59]), zero, np.zeros(3))
    kept = sightings(odd, NOISE_SD_MM)
    np.testing.assert_array_equal(kept.time, frames.time[~(held | zero)])
    np.testing.assert_array_equal(kept.value, frames.value[~(held | zero)])


def test_another_body_for_a_second_is_left_out_and_the_hand_is_taken_up_again() -> None:
    frames = moving()
    other = between(frames, 2.0, 3.0)
    kept = sightings(with_values(frames, other, frames.value[other] + AWAY_MM), NOISE_SD_MM)
    np.testing.assert_array_equal(kept.time, frames.time[~other])
    np.testing.assert_array_equal(kept.value, frames.value[~other])


def test_one_stray_frame_is_left_out_alone() -> None:
    frames = moving()
    stray = np.arange(len(frames)) == 70
    kept = sightings(with_values(frames, stray, frames.value[stray] + AWAY_MM), NOISE_SD_MM)
    np.testing.assert_array_equal(kept.time, frames.time[~stray])


def test_a_hand_that_was_set_aside_goes_on_from_where_it_was() -> None:
    """As far as its motion tells, it has not moved by the leap; the frames until it is believed are left out."""
    frames = moving()
    later = between(frames, 2.0, np.inf)
    kept = sightings(with_values(frames, later, frames.value[later] + AWAY_MM), NOISE_SD_MM)
    left_out = frames.time[~np.isin(frames.time, kept.time)]
    assert left_out[0] == 2.0
    assert np.ptp(left_out) == pytest.approx(BELIEVED_AFTER_S, abs=0.04)
    assert len(left_out) + len(kept) == len(frames)
    step_mm = np.linalg.norm(np.diff(kept.value, axis=0), axis=1)
    assert step_mm[np.searchsorted(kept.time, 2.0) - 1] == 0.0
    np.testing.assert_allclose(np.diff(kept.value[-30:], axis=0), np.diff(frames.value[-30:], axis=0), atol=1e-9)


def test_a_hand_that_was_lost_may_come_back_elsewhere() -> None:
    """In two seconds it may have gone anywhere."""
    frames = moving()
    lost, later = between(frames, 2.0, 4.0), between(frames, 4.0, np.inf)
    moved = with_values(frames, later, frames.value[later] + AWAY_MM)
    seen = Samples(moved.time[~lost], moved.arrival[~lost], moved.value[~lost])
    assert len(sightings(seen, NOISE_SD_MM)) == len(seen)
