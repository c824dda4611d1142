"""The Kalman filters against printed figures and against one dense least-squares problem."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import FusionKalman, PositionKalman, Sample, Samples, Sensor
from fusion_core.kalman import position_steps
from tests.fusion_core.kalman.reference import wiener_acceleration

TRACKER = Sensor("position", 8.0, 0.1, 1)
IMU = Sensor("acceleration", 100.0, 0.0, 1)


def test_sd_of_the_papers_prediction() -> None:
    """Table 1 prints 15.84 mm for the Kalman filter: a prediction 0.1 s ahead at a jerk PSD of about 3.4e6."""
    frames = np.arange(0, 10, 1 / 30)
    samples = {"tracker": Samples(frames, frames, np.zeros((len(frames), 1)))}
    sensors = {"tracker": TRACKER}
    ahead = PositionKalman(sensors, ahead_s=0.1).replay(samples, frames[-1:]).sd[0, 0]
    filtered = PositionKalman(sensors).replay(samples, frames[-1:]).sd[0, 0]
    assert ahead == pytest.approx(15.84, abs=0.05)
    assert filtered == pytest.approx(5.7, abs=0.05)


def test_process_noise_adds_up_over_steps() -> None:
    """Two steps are one step of twice the length, mean and noise: the law a discretisation must keep."""
    mean, covariance = np.array([[3.0], [200.0], [-900.0]]), np.diag([64.0, 9e4, 1e6])
    twice = position_steps.predict(*position_steps.predict(mean, covariance, 0.01, 1e6), 0.01, 1e6)
    once = position_steps.predict(mean, covariance, 0.02, 1e6)
    np.testing.assert_allclose(twice[0], once[0], rtol=1e-12)
    np.testing.assert_allclose(twice[1], once[1], rtol=1e-12)


def test_the_position_filter_is_the_textbooks() -> None:
    """Each frame predicted and taken in by the printed matrices, at irregular arrivals."""
    random = np.random.default_rng(4)
    arrival = np.cumsum(random.uniform(0.01, 0.06, 40))
    value = np.cumsum(random.normal(0, 20, (40, 1)), axis=0)
    estimator, mean, covariance = PositionKalman({"tracker": TRACKER}), np.zeros(3), np.zeros((3, 3))
    for index, now in enumerate(arrival):
        if index == 0:
            mean = np.array([value[0, 0], 0, 0])
            covariance = np.diag([64.0, estimator.initial_speed_sd_mm_s**2, estimator.initial_acceleration_sd_mm_s2**2])
            continue
        move, noise = wiener_acceleration(now - arrival[index - 1], estimator.jerk_psd_mm2_s5)
        mean, covariance = move @ mean, move @ covariance @ move.T + noise
        gain = covariance[:, 0] / (covariance[0, 0] + 64.0)
        mean, covariance = mean + gain * (value[index, 0] - mean[0]), covariance - np.outer(gain, covariance[0])
    move, noise = wiener_acceleration(0.05, estimator.jerk_psd_mm2_s5)
    samples = {"tracker": Samples(arrival, arrival, value)}
    track = estimator.replay(samples, np.array([arrival[-1] + 0.05]))
    assert track.mean[0, 0] == pytest.approx((move @ mean)[0], abs=1e-8)
    assert track.sd[0, 0] == pytest.approx(np.sqrt((move @ covariance @ move.T + noise)[0, 0]), abs=1e-8)


def dense_posterior(
    estimator: FusionKalman, readings: list[tuple[Sensor, Sample]], now: float, at: float | None = None
) -> tuple[float, float]:
    """Mean and SD of the position at `now`, or at `at`, by one least-squares problem over all states at once.

    States stand at the times of the readings, at `at` and at `now`; rows are the first state's prior, the process
    between neighbours, and the readings, each divided by its SD.
    """
    if at is not None:  # a reading that says nothing
        nothing = Sensor("position", 1e6, 0.0, 1), Sample(at, at, np.zeros(1))
        readings = sorted([*readings, nothing], key=lambda item: item[1].time)
    times = [reading.time for _, reading in readings] + [now]
    n = len(times)
    rows, right = [], []

    def add(block: np.ndarray, covariance: np.ndarray, value: np.ndarray) -> None:
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        rows.append(whiten @ block)
        right.append(whiten @ value)

    first = np.zeros((4, 4 * n))
    first[:, :4] = np.eye(4)
    start = readings[0][1].value[0]
    spread = (
        8.0,
        estimator.initial_speed_sd_mm_s,
        estimator.initial_acceleration_sd_mm_s2,
        estimator.initial_bias_sd_mm_s2,
    )
    add(first, np.diag(np.square(spread)), np.array([start, 0, 0, 0]))
    for index in range(1, n):
        step = max(times[index] - times[index - 1], 1e-9)
        move, noise = np.eye(4), np.zeros((4, 4))
        move[:3, :3], noise[:3, :3] = wiener_acceleration(step, estimator.jerk_psd_mm2_s5)
        noise[3, 3] = estimator.bias_walk_mm_s2_per_sqrt_s**2 * step
        block = np.zeros((4, 4 * n))
        block[:, 4 * index : 4 * index + 4] = np.eye(4)
        block[:, 4 * index - 4 : 4 * index] = -move
        add(block, noise + 1e-16 * np.eye(4), np.zeros(4))
    for index, (sensor, reading) in enumerate(readings[1:], 1):
        block = np.zeros((1, 4 * n))
        block[0, 4 * index + (sensor.order or 0)] = 1
        if sensor.order == 2:
            block[0, 4 * index + 3] = 1
        add(block, np.array([[sensor.noise_sd**2]]), reading.value)
    matrix, values = np.vstack(rows), np.concatenate(right)
    q, r = np.linalg.qr(matrix)
    solution = np.linalg.solve(r, q.T @ values)
    covariance = np.linalg.inv(r)
    wanted = 4 * (n - 1 if at is None else times.index(at))
    return float(solution[wanted]), float(np.linalg.norm(covariance[wanted]))


def test_fusion_is_the_posterior_of_all_readings_whatever_their_order_of_arrival() -> None:
    random = np.random.default_rng(5)
    sensors = {"tracker": TRACKER, "imu": IMU}
    estimator = FusionKalman(sensors, history_s=2.0, gate_sd=0.0, adaptation=0.0)
    frames = np.arange(0, 0.5, 1 / 30)
    forces = np.arange(0.004, 0.6, 1 / 90)
    arrivals = [("tracker", Sample(t, t + 0.1, random.normal(50, 8, 1))) for t in frames]
    arrivals += [("imu", Sample(t, t + random.uniform(0, 0.03), random.normal(0, 100, 1))) for t in forces]
    arrivals.sort(key=lambda item: item[1].arrival)
    state = estimator.start()
    for name, sample in arrivals:
        state = estimator.update(state, name, sample)
    mean, sd = estimator.predict(state, 0.62)
    ordered = sorted(arrivals, key=lambda item: item[1].time)
    expected = dense_posterior(estimator, [(sensors[name], sample) for name, sample in ordered], 0.62)
    assert mean[0] == pytest.approx(expected[0], abs=1e-4)
    assert sd[0] == pytest.approx(expected[1], rel=1e-4)


def test_a_bias_of_the_accelerometer_is_learned() -> None:
    """A 1° tilt leaks 171 mm/s² of gravity into the acceleration; the estimate must not drift away with it."""
    random = np.random.default_rng(1)
    frames, forces = np.arange(0, 20, 1 / 30), np.arange(0, 20, 1 / 90)
    samples = {
        "tracker": Samples(frames, frames + 0.1, random.normal(0, 8, (len(frames), 1))),
        "imu": Samples(forces, forces, random.normal(171, 100, (len(forces), 1))),
    }
    track = FusionKalman({"tracker": TRACKER, "imu": IMU}).replay(samples, np.arange(10, 20, 0.01))
    assert abs(track.mean.mean()) < 1.5
    assert np.sqrt(np.mean(track.mean**2)) < 6


def test_a_reading_too_late_is_left_out_and_counted() -> None:
    estimator = FusionKalman({"tracker": TRACKER})
    state = estimator.start()
    for time in np.arange(0, 3, 1 / 30):
        state = estimator.update(state, "tracker", Sample(time, time + 0.1, np.zeros(1)))
    late = estimator.update(state, "tracker", Sample(0.5, 3.2, np.full(1, 1e6)))
    assert late.too_late == 1
    np.testing.assert_array_equal(estimator.predict(late, 3.2)[0], estimator.predict(state, 3.2)[0])


def test_history_must_cover_the_latency() -> None:
    with pytest.raises(ValueError, match=r"history_s must cover the latency .* tracker is 0.7 s late"):
        FusionKalman({"tracker": Sensor("position", 8.0, 0.7, 1)})
