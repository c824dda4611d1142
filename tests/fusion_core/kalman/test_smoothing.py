"""Smoothing against one dense least-squares problem, and what waiting buys."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import FusionKalman, Samples, fixed_lag, smooth
from pipeline.statistics.arrays import FloatArray
from tests.benchmarks import floor
from tests.fusion_core.kalman.test_fusion import PLAIN, SPACE
from tests.fusion_core.kalman.test_kalman import IMU, TRACKER, dense_posterior
from tests.fusion_core.test_conformance import recording
from tests.fusion_core.window.test_gp import RATED


def until(samples: dict[str, Samples], now: float) -> dict[str, Samples]:
    """What had arrived by then."""
    found = {}
    for name, stream in samples.items():
        here = stream.arrival <= now
        found[name] = Samples(stream.time[here], stream.arrival[here], stream.value[here])
    return found


def small() -> dict[str, Samples]:
    """Half a second of one axis."""
    random = np.random.default_rng(3)
    frames, forces = np.arange(0, 0.5, 1 / 30), np.arange(0.004, 0.5, 1 / 90)
    return {
        "tracker": Samples(frames, frames + 0.1, random.normal(50, 8, (len(frames), 1))),
        "imu": Samples(forces, forces, random.normal(0, 100, (len(forces), 1))),
    }


def test_a_smoothed_position_is_the_posterior_given_every_reading() -> None:
    """A reading of next to no weight at the wanted time makes the dense problem say what is known there."""
    sensors = {"tracker": TRACKER, "imu": IMU}
    estimator = FusionKalman(sensors, **PLAIN)
    samples, wanted = small(), np.array([0.111, 0.25, 0.402])
    track = smooth(estimator, samples, wanted)
    ordered = sorted(
        ((name, stream[index]) for name, stream in samples.items() for index in range(len(stream))),
        key=lambda reading: reading[1].time,
    )
    readings = [(sensors[name], sample) for name, sample in ordered]
    for index, time in enumerate(wanted):
        mean, sd = dense_posterior(estimator, readings, 0.5, at=float(time))
        assert track.mean[index, 0] == pytest.approx(mean, abs=1e-3)
        assert track.sd[index, 0] == pytest.approx(sd, rel=1e-3)


def test_a_fixed_lag_is_the_smoother_on_what_had_arrived() -> None:
    estimator = FusionKalman(SPACE, adaptation=0.0, gate_sd=0.0)
    samples = recording(3, regular=False)
    times = np.array([0.7, 1.1, 1.6])
    for lag_s in (0.05, 0.15):
        track = fixed_lag(estimator, samples, times, lag_s)
        for index, time in enumerate(times):
            whole = smooth(estimator, until(samples, time), np.array([time - lag_s]))
            np.testing.assert_allclose(track.mean[index], whole.mean[0], atol=1e-6)
            np.testing.assert_allclose(track.sd[index], whole.sd[0], rtol=1e-6)


def test_no_lag_is_the_estimate_itself() -> None:
    estimator, samples, times = FusionKalman(SPACE), recording(4), np.arange(0.2, 1.9, 0.1)
    np.testing.assert_array_equal(fixed_lag(estimator, samples, times, 0.0).mean, estimator.replay(samples, times).mean)


def test_waiting_makes_steadier_and_all_readings_steadiest() -> None:
    """A display that may wait 0.2 s comes down to 2.3 mm, the smoother to 1.44 (method); the estimate to 3.4."""
    estimator = FusionKalman(floor.SENSORS, bias_walk_mm_s2_per_sqrt_s=0.0, initial_bias_sd_mm_s2=0.0)

    def rmse(errors: list[FloatArray]) -> float:
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))

    waited: dict[str, list[FloatArray]] = {"now": [], "0.2 s": [], "all": []}
    for seed in range(30):
        samples, times, truth = floor.run(floor.reach, floor.Trouble(), seed)
        scored = (times > 8) & (times < 11)
        times, truth = times[scored], truth[scored]
        waited["now"].append(estimator.replay(samples, times).mean[:, 0] - truth)
        before = floor.reach(times - 0.2)[0]
        waited["0.2 s"].append(fixed_lag(estimator, samples, times, 0.2).mean[:, 0] - before)
        waited["all"].append(smooth(estimator, samples, times).mean[:, 0] - truth)
    assert rmse(waited["0.2 s"]) == pytest.approx(2.3, abs=0.2)
    assert rmse(waited["all"]) == pytest.approx(1.44, abs=0.15)
    assert 3.2 < rmse(waited["now"]) < 3.7


def test_what_cannot_be_smoothed_is_said() -> None:
    fixed = FusionKalman(RATED, **PLAIN, path="fixed_gain")
    with pytest.raises(ValueError, match='smoothing needs the covariance of every step: path="event_time"'):
        smooth(fixed, recording(), np.array([1.0]))
    with pytest.raises(ValueError, match=r"lag_s must be within the estimator's history_s of 0.5, got 0.6"):
        fixed_lag(FusionKalman(SPACE), recording(), np.array([1.0]), 0.6)


def test_outside_the_readings_nothing_is_known() -> None:
    track = smooth(FusionKalman(SPACE), recording(), np.array([-1.0, 1.0, 9.0]))
    assert np.isnan(track.mean[[0, 2]]).all()
    assert np.isfinite(track.mean[1]).all()
    assert np.isnan(smooth(FusionKalman(SPACE), {}, np.array([1.0])).mean).all()
