"""A phone's orientation: found from its motion reading by reading, and nothing of it depends on what comes later."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusion_core import Samples, Sensor
from pipeline.sessions.phone import CARRIED, FOUND, IN_LOG, Imu, aligned
from pipeline.sessions.tilt import Reading, Tilt, step, tilts
from pipeline.statistics.arrays import FloatArray
from pipeline.study.streams import AccelerationStream

GRAVITY = np.array([0.0, -9806.65, 0.0])
STREAM = AccelerationStream(kind="acceleration", topic="/imu", gravity_mm_s2=(0.0, -9806.65, 0.0), noise_sd_mm_s2=100)
IMU = Sensor("acceleration", 100.0)
TRACKER = Sensor("position", 8.0, 0.1)
Rows = tuple[FloatArray, FloatArray, FloatArray]


def turns(time: FloatArray) -> Rotation:
    """How the hand holds the phone: it sways about every axis."""
    about = [0.4 * np.sin(3.1 * time), 0.7 * np.sin(2.1 * time), 0.5 * np.sin(5.7 * time + 1)]
    return Rotation.from_rotvec(np.stack(about, axis=1))


def swaying(seconds: float, rate_hz: float, random: np.random.Generator) -> Rows:
    """Times, angular velocities and specific forces of a hand that sways and turns, in an IMU with bias and noise."""
    time = np.arange(0.0, seconds, 1 / rate_hz)
    time = time + random.uniform(0, 0.3 / rate_hz, len(time))
    gyroscope = (turns(time - 1e-4).inv() * turns(time + 1e-4)).as_rotvec() / 2e-4
    moved = np.stack([np.sin(5 * time), 0.4 * np.cos(7 * time), 0.3 * np.sin(4 * time)], axis=1) * 1500
    force = turns(time).inv().apply(moved - GRAVITY)
    return (
        time,
        gyroscope + np.array([0.02, -0.01, 0.03]) + random.normal(0, 0.005, (len(time), 3)),
        force + random.normal(0, 50, (len(time), 3)),
    )


def seen(seconds: float) -> tuple[Samples, Sensor]:
    """What a tracker sees of that hand, a tenth of a second late."""
    time = np.arange(0.0, seconds, 1 / 30)
    where = np.stack([-np.sin(5 * time) / 25, -0.4 * np.cos(7 * time) / 49, -0.3 * np.sin(4 * time) / 16], axis=1)
    return Samples(time, time + 0.1, 1500 * where), TRACKER


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 100.0, 400.0])
def test_the_vertical_is_found_as_well_at_any_rate(rate_hz: float) -> None:
    time, gyroscope, force = swaying(40.0, rate_hz, np.random.default_rng(1))
    up = Rotation.from_quat(tilts(time, gyroscope, force)).inv().apply([0.0, 0.0, 1.0])
    true = turns(time).inv().apply([0.0, 1.0, 0.0])
    off = np.degrees(np.arccos(np.clip(np.sum(up * true, axis=1), -1, 1)))
    assert np.sqrt(np.mean(off[time > 20] ** 2)) < 1.5  # the gyroscope's bias is found by then


def test_step_by_step_is_the_same_as_a_whole_recording() -> None:
    rows = swaying(6.0, 90.0, np.random.default_rng(2))
    state, found = Tilt(), []
    for at, gyroscope, force in zip(*rows, strict=True):
        state, orientation = step(state, Reading(float(at), gyroscope, force))
        found.append(orientation)
    np.testing.assert_array_equal(tilts(*rows), found)


def test_a_state_is_not_changed_by_what_comes_after_it() -> None:
    time, gyroscope, force = swaying(2.0, 90.0, np.random.default_rng(3))
    readings = [Reading(float(at), turn, push) for at, turn, push in zip(time, gyroscope, force, strict=True)]
    state = Tilt()
    for reading in readings[:-1]:
        state, _ = step(state, reading)
    once, again = step(state, readings[-1])[1], step(state, readings[-1])[1]
    assert once is not None and again is not None
    np.testing.assert_array_equal(once, again)


def test_a_late_reading_is_left_out_and_changes_nothing() -> None:
    time, gyroscope, force = swaying(3.0, 90.0, np.random.default_rng(4))
    late = np.insert(np.arange(len(time)), 100, 50)  # the reading of row 50 comes once more behind row 99
    found = tilts(time[late], gyroscope[late], force[late])
    assert np.isnan(found[100]).all()
    np.testing.assert_array_equal(np.delete(found, 100, axis=0), tilts(time, gyroscope, force))


def test_a_year_without_readings_takes_no_steps_and_the_vertical_is_found_again() -> None:
    time, gyroscope, force = swaying(20.0, 90.0, np.random.default_rng(5))
    late = time > 10
    up = Rotation.from_quat(tilts(time + 3e7 * late, gyroscope, force)).inv().apply([0.0, 0.0, 1.0])
    true = turns(time).inv().apply([0.0, 1.0, 0.0])
    assert np.degrees(np.arccos(np.clip(np.sum(up * true, axis=1), -1, 1)))[time > 18].max() < 3.0


@settings(max_examples=25, deadline=None)
@given(
    cut=st.integers(1, 900),
    seed=st.integers(0, 20),
    logged_from=st.sampled_from([0, 300, 10_000]),
    swapped=st.booleans(),
)
def test_cut_the_log_and_nothing_before_it_changes(cut: int, seed: int, logged_from: int, swapped: bool) -> None:
    random = np.random.default_rng(seed)
    time, gyroscope, force = swaying(10.0, 90.0, random)
    arrival = time.copy()
    if swapped:  # a few readings overtake others, and some come twice
        time, gyroscope, force = (each[_jumbled(len(time), random)] for each in (time, gyroscope, force))
    logged = np.full((len(time), 4), np.nan)
    logged[logged_from::3] = turns(time[logged_from::3]).as_quat() if logged_from < len(time) else 0
    whole = aligned(Imu(time, arrival, force, gyroscope, IMU), logged, STREAM, seen(10.0))
    part = aligned(Imu(time, arrival, force, gyroscope, IMU).until(cut), logged[:cut], STREAM, seen(10.0))
    count = len(part.body.time)
    np.testing.assert_array_equal(part.body.time, whole.body.time[:count])
    np.testing.assert_array_equal(part.body.rotation, whole.body.rotation[:count])
    assert not np.any(whole.body.arrival[count:] < arrival[:cut][-1])


def _jumbled(count: int, random: np.random.Generator) -> npt.NDArray[np.int64]:
    order = np.arange(count)
    for row in random.choice(count - 1, 20, replace=False):
        order[row], order[row + 1] = order[row + 1], order[row]
    order[random.choice(count, 5)] = order[0]
    return order


def test_orientations_are_found_until_the_log_has_one() -> None:
    time, gyroscope, force = swaying(10.0, 90.0, np.random.default_rng(6))
    logged = np.full((len(time), 4), np.nan)
    logged[600] = turns(time[600:601]).as_quat()[0]
    found = aligned(Imu(time, time, force, gyroscope, IMU), logged, STREAM, seen(10.0))
    assert found.origins[IN_LOG] == 1
    assert found.origins[CARRIED] > 80  # for a second
    assert found.origins[FOUND] > 300
    assert sum(found.origins.values()) + found.left_out == len(time)
