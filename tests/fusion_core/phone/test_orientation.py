"""Orientation, heading, mounting and lever arm, from motion whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusion_core import Samples, Sensor
from fusion_core.phone.calibration import Body, calibrate, with_mounting
from fusion_core.phone.heading import HeadingFilter
from fusion_core.phone.orientation import (
    carry_forward,
    heading,
    level_rotation,
    rotate,
    rotation,
    rotations,
    turn_about_vertical,
)
from pipeline.statistics.arrays import FloatArray

TRACKER, IMU = Sensor("position", 8.0, 0.1), Sensor("acceleration", 100.0)
GRAVITY = np.array([0.0, 0.0, -9806.65])


def hand(time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Position and acceleration of a hand that sways by some 100 mm on all axes."""
    rate, phase, size = np.array([5.0, 4.0, 3.0]), np.array([0.0, 1.0, 2.0]), np.array([80.0, 100.0, 60.0])
    angle = time[:, None] * rate + phase
    return size * np.sin(angle), -size * rate**2 * np.sin(angle)


def turns(time: FloatArray) -> Rotation:
    """How the phone is held: it sways too."""
    angles = np.stack([0.4 * np.sin(1.3 * time), 0.5 * np.sin(1.7 * time), 0.6 * np.sin(0.9 * time)], axis=1)
    return Rotation.from_euler("xyz", angles)


def tracker(seconds: float, random: np.random.Generator, arm: FloatArray | None = None) -> Samples:
    frames = np.arange(0, seconds, 1 / 30)
    seen = hand(frames)[0] + random.normal(0, 8, (len(frames), 3))
    if arm is not None:
        seen += turns(frames).apply(arm)
    return Samples(frames, frames + 0.1, seen)


def test_rotations_turn_as_quaternions_do() -> None:
    quaternion = Rotation.random(20, random_state=1).as_quat()
    vectors = np.random.default_rng(1).normal(0, 1, (20, 3))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", rotations(quaternion), vectors), rotate(quaternion, vectors))


def test_one_rotation_alone_is_as_among_many() -> None:
    turned = turns(np.arange(0.0, 3.0, 0.1)).as_quat() * 1.1
    np.testing.assert_allclose([rotation(one) for one in turned], rotations(turned), atol=1e-15)


def test_a_gap_in_the_orientation_is_carried_on_by_the_gyroscope_for_a_second() -> None:
    time = np.arange(0, 4, 1 / 100)
    true = turns(time)
    step = (true[:-1].inv() * true[1:]).as_rotvec() * 100
    gyroscope = np.vstack([step, step[-1:]])
    logged = true.as_quat()
    logged[:30] = np.nan  # before the first known one
    logged[100:150] = np.nan
    logged[200:350] = np.nan  # longer than a second
    found = carry_forward(time, logged, gyroscope)
    assert np.isnan(found[:30]).all()
    assert np.isnan(found[305:350]).all()
    for part in (slice(100, 150), slice(200, 299)):
        off = (Rotation.from_quat(found[part]).inv() * true[part]).magnitude()
        assert np.degrees(off.max()) < 1.0


@settings(deadline=None, max_examples=30)
@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda g: sum(x * x for x in g) > 0.01))
def test_level_turns_up_into_up(gravity: tuple[float, ...]) -> None:
    down = np.array(gravity)
    up = rotate(level_rotation(down), np.array([[0.0, 0.0, 1.0]]))[0]
    np.testing.assert_allclose(up, -down / np.linalg.norm(down), atol=1e-9)


@pytest.mark.parametrize("angle_deg", [0.0, 75.0, -170.0])
def test_the_heading_is_found_from_the_motion(angle_deg: float) -> None:
    random, time = np.random.default_rng(7), np.arange(0, 20, 1 / 90)
    angle = np.radians(angle_deg)
    off = Rotation.from_rotvec([0, 0, -angle]).apply(hand(time)[1]) + random.normal(0, 100, (len(time), 3))
    found, sd = heading(tracker(20, random), TRACKER, Samples(time, time, off), IMU)
    apart = np.angle(np.exp(1j * (found - angle)))
    assert sd[np.searchsorted(time, 0.2)] > 0.5  # it takes some motion
    assert abs(apart[-1]) < 0.02
    settled = time > 3
    assert sd[settled].max() < 0.1
    assert np.mean(np.abs(apart[settled]) < 1.96 * sd[settled]) > 0.85
    turned = rotate(turn_about_vertical(np.array([[0.0, 0.0, 0.0, 1.0]]), np.array([angle])), off[:1])
    np.testing.assert_allclose(turned, Rotation.from_rotvec([0, 0, angle]).apply(off[:1]), atol=1e-6)


def test_a_still_hand_tells_no_heading() -> None:
    random, time = np.random.default_rng(8), np.arange(0, 20, 1 / 90)
    frames = np.arange(0, 20, 1 / 30)
    still = Samples(frames, frames + 0.1, random.normal(0, 8, (len(frames), 3)))
    _, sd = heading(still, TRACKER, Samples(time, time, random.normal(0, 30, (len(time), 3))), IMU)
    assert sd[np.isfinite(sd)].min() > 0.3


def test_the_heading_knows_no_future() -> None:
    random, time = np.random.default_rng(9), np.arange(0, 8, 1 / 90)
    frames, forces = tracker(8, random), hand(time)[1] + random.normal(0, 100, (len(time), 3))
    whole, _ = heading(frames, TRACKER, Samples(time, time, forces), IMU)
    early, cut = frames.arrival <= 5.0, time <= 5.0
    past = Samples(frames.time[early], frames.arrival[early], frames.value[early])
    part, _ = heading(past, TRACKER, Samples(time[cut], time[cut], forces[cut]), IMU)
    np.testing.assert_allclose(part[1:], whole[cut][1:], atol=1e-9)


def test_mounting_and_lever_arm_are_found_with_intervals_that_hold_them() -> None:
    random, time = np.random.default_rng(10), np.arange(0, 30, 1 / 90)
    off, arm = np.radians([1.5, -1.0, 0.8]), np.array([40.0, -25.0, 10.0])
    true = turns(time)
    own = true * Rotation.from_rotvec(off)  # the accelerometer's axes
    force = own.inv().apply(hand(time)[1] - GRAVITY) + random.normal(0, 100, (len(time), 3)) + np.array([150, 0, -80])
    body = Body(time, time, force, true.as_matrix(), GRAVITY)
    found = calibrate(tracker(30, random, arm), TRACKER, body, IMU, until_s=29.9)
    assert found is not None
    assert np.all(np.abs(found.mounting_rad - off) < 3 * found.mounting_sd_rad)
    assert np.all(np.abs(found.lever_arm_mm - arm) < 3 * found.lever_arm_sd_mm)
    assert np.all(found.mounting_sd_rad < np.radians(0.5))
    assert np.all(found.lever_arm_sd_mm < 10)
    turned = Rotation.from_matrix(with_mounting(body.rotation, found.mounting_rad))
    assert np.degrees((turned.inv() * own).magnitude()).max() < 0.5


def test_nothing_is_learned_before_the_first_position() -> None:
    random, time = np.random.default_rng(11), np.arange(0, 1, 1 / 90)
    body = Body(time, time, np.tile(-GRAVITY, (len(time), 1)), np.tile(np.eye(3), (len(time), 1, 1)), GRAVITY)
    assert calibrate(tracker(1, random), TRACKER, body, IMU, until_s=0.05) is None


@pytest.mark.parametrize("late_s", [0.0, 0.1])
def test_the_heading_reading_by_reading_is_that_of_the_whole_recording(late_s: float) -> None:
    time = np.arange(0.0, 6.0, 0.01)
    moved = Rotation.from_rotvec([0, 0, 0.7]).inv().apply(hand(time)[1])
    frames, felt = tracker(6.0, np.random.default_rng(2)), Samples(time, time + 0.004, moved)
    frames = Samples(frames.time, frames.time + late_s, frames.value)
    of_tracker, of_phone = Sensor("position", 8.0, late_s), Sensor("acceleration", 100.0)
    angle, sd = heading(frames, of_tracker, felt, of_phone)
    steps = HeadingFilter(of_tracker, of_phone)
    state, upcoming = steps.start(), 0
    for row in range(len(felt)):
        while upcoming < len(frames) and frames.arrival[upcoming] <= felt.arrival[row]:
            at, there = float(frames.time[upcoming]), float(frames.arrival[upcoming])
            state = steps.position(state, at, there, frames.value[upcoming])
            upcoming += 1
        state = steps.acceleration(state, float(felt.time[row]), float(felt.arrival[row]), felt.value[row])
        now = steps.angle(state)
        if np.isfinite(sd[row]):
            assert now == pytest.approx((angle[row], sd[row]), rel=1e-9, abs=1e-9)
    assert now[0] == pytest.approx(0.7, abs=0.1)
