"""Maximum likelihood finds what recordings were made with, and says where they cannot tell."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from fusion_core import FusionKalman, Samples, WindowGP
from fusion_core.likelihood import log_likelihood_by_replay, maximise, position_log_likelihood
from pipeline.statistics.arrays import FloatArray
from tests.fusion_core.kalman.test_kalman import IMU, TRACKER
from tests.fusion_core.kalman.test_smoothing import small
from tests.fusion_core.window.test_gp import RATED, regular


def test_the_log_density_is_that_of_each_position_given_those_before() -> None:
    """By replaying up to each position and asking for it, one at a time."""
    estimator = FusionKalman({"tracker": TRACKER, "imu": IMU}, gate_sd=0.0, adaptation=0.0)
    samples = small()
    at_once = {name: Samples(stream.time, stream.time, stream.value) for name, stream in samples.items()}
    expected = 0.0
    for index in range(1, len(samples["tracker"])):
        frame = samples["tracker"][index]
        track = estimator.replay(at_once, np.array([np.nextafter(frame.time, -np.inf)]))
        spread = np.hypot(track.sd[0, 0], 8.0)
        expected += float(stats.norm.logpdf(frame.value[0], track.mean[0, 0], spread))
    assert position_log_likelihood(estimator, samples).sum() == pytest.approx(expected, abs=1e-6)
    of_first = log_likelihood_by_replay(estimator, samples).sum()
    assert of_first == pytest.approx(expected, abs=1e-6)


def drawn(seed: int, seconds: float = 60.0, late_s: float = 0.1) -> dict[str, Samples]:
    """A hand whose jerk is white noise of 1e8 mm²/s⁵, one axis, held near zero; noise of 6 mm and 100 mm/s²."""
    random = np.random.default_rng(seed)
    step = 1 / 900
    time = np.arange(0, seconds, step)
    state, path = np.zeros(3), np.empty((len(time), 2))
    for index in range(len(time)):
        pull = -40.0 * state[0] - 40.0 * state[1] - 12.0 * state[2]
        state = state + step * np.array([state[1], state[2], pull])
        state[2] += random.normal(0, np.sqrt(1e8 * step))
        path[index] = state[0], state[2]
    frames, forces = slice(0, None, 30), slice(5, None, 10)
    seen = path[frames, 0] + random.normal(0, 6.0, len(time[frames]))
    felt = path[forces, 1] + random.normal(0, 100.0, len(time[forces]))
    return {
        "tracker": Samples(time[frames], time[frames] + late_s, seen[:, None]),
        "imu": Samples(time[forces], time[forces], felt[:, None]),
    }


def test_noise_and_latency_are_found_and_the_accelerometers_noise_is_not_told() -> None:
    """The tracker's stamps are 30 ms off what is said; smooth motion cannot tell 100 mm/s² from 60."""
    samples = drawn(1)
    tracker = samples["tracker"]

    def blocks(values: FloatArray) -> FloatArray:
        noise_mm, jerk_psd, late_s, imu = values
        from dataclasses import replace

        sensors = {"tracker": replace(TRACKER, noise_sd=float(noise_mm)), "imu": replace(IMU, noise_sd=float(imu))}
        estimator = FusionKalman(
            sensors,
            jerk_psd_mm2_s5=float(jerk_psd),
            gate_sd=0.0,
            adaptation=0.0,
            initial_bias_sd_mm_s2=0.0,
            bias_walk_mm_s2_per_sqrt_s=0.0,
        )
        moved = Samples(tracker.arrival - late_s, tracker.arrival, tracker.value)
        return position_log_likelihood(estimator, {"tracker": moved, "imu": samples["imu"]})

    noise, _, late, imu = maximise(blocks, [8.0, 1e7, 0.07, 100.0], [np.inf, np.inf, np.inf, 0.7])
    assert noise.low < 6.0 < noise.high and noise.identified
    assert noise.value == pytest.approx(6.0, rel=0.1)
    assert late.value == pytest.approx(0.1, abs=0.003)
    assert late.identified
    assert imu.low < 100.0 < imu.high


def test_a_parameter_that_nothing_depends_on_is_not_told() -> None:
    random = np.random.default_rng(0)
    data = random.normal(0, 3.0, (20, 50))

    def blocks(values: FloatArray) -> FloatArray:
        return np.asarray(stats.norm.logpdf(data, 0, values[0]).sum(axis=1))

    spread, idle = maximise(blocks, [1.0, 5.0], [np.inf, 0.7])
    assert spread.identified and spread.low < 3.0 < spread.high
    # σ̂ of n normal values has SD σ/√(2n): the interval of a model that is right
    assert (spread.high - spread.low) / 2 == pytest.approx(1.96 * 3.0 / np.sqrt(2 * data.size), rel=0.4)
    assert not idle.identified


def test_window_parameters_have_a_likelihood_too() -> None:
    samples, _ = regular()
    near, far = (WindowGP(RATED, inverse_scale_s2=w) for w in (4.0, 400.0))
    assert log_likelihood_by_replay(near, samples).sum() > log_likelihood_by_replay(far, samples).sum()


def test_a_start_at_zero_is_an_error() -> None:
    with pytest.raises(ValueError, match="parameters must start above 0"):
        maximise(lambda values: values, [0.0], [1.0])
