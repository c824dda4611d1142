"""Whatever departs from study.yaml: never worse than the tracker as it comes or a filter of positions alone."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import Estimator, FusionAdaptive, PositionKalman, Raw, replay_loop
from tests.benchmarks.departures import DEPARTURES, SENSORS, Recorded, recorded, simulated

_SECONDS = 30.0
FUSION = FusionAdaptive(SENSORS)


def _rmse(estimator: Estimator, whole: Recorded) -> float:
    error = estimator.replay(whole.samples, whole.times).mean - whole.truth
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def _after(seconds: float, whole: Recorded) -> Recorded:
    late = whole.times > whole.times[0] + seconds
    return Recorded(whole.samples, whole.times[late], whole.truth[late])


@pytest.mark.parametrize("name", list(DEPARTURES))
def test_fusion_never_loses(name: str) -> None:
    whole = recorded(simulated(_SECONDS), DEPARTURES[name])
    fused = _rmse(FUSION, whole)
    assert fused <= _rmse(Raw(SENSORS), whole)
    assert fused <= _rmse(PositionKalman(SENSORS), whole)


@pytest.mark.parametrize(
    "name", ["as stated", "tracker noise 20 mm", "AR(1) noise, 0.2 s", "mounting 5°", "latency 130 ms"]
)
def test_the_stated_interval_holds_the_hand(name: str) -> None:
    whole = recorded(simulated(40.0), DEPARTURES[name])
    track = FUSION.replay(whole.samples, whole.times)
    assert np.mean(np.abs(track.mean - whole.truth) <= 1.96 * track.sd) > 0.9


def test_a_trusted_tracker_puts_an_early_phone_right() -> None:
    """As well as if its clock were right, once ten seconds of motion have shown how early it is."""
    early, as_stated = (
        _after(10.0, recorded(simulated(40.0), DEPARTURES[name])) for name in ("phone clock -30 ms", "as stated")
    )
    by_tracker = FusionAdaptive(SENSORS, trusted_clock="tracker")
    assert _rmse(by_tracker, early) < 1.15 * _rmse(by_tracker, as_stated)
    assert _rmse(by_tracker, early) < 0.7 * _rmse(FUSION, early)


def test_a_trusted_phone_changes_the_interval_and_only_where_the_clocks_disagree() -> None:
    """The estimate as well, by its share of some milliseconds; of the thirty that the tracker is late by, nothing."""
    late = recorded(simulated(20.0), DEPARTURES["latency 130 ms"])
    either, phone = (one.replay(late.samples, late.times) for one in (FUSION, FusionAdaptive(SENSORS, 0.5, "imu")))
    assert np.abs(either.mean[-300:] - phone.mean[-300:]).max() < 0.1 * SENSORS["tracker"].noise_sd
    assert np.all(either.sd[-300:] >= phone.sd[-300:])
    assert np.mean(either.sd[-300:]) > 1.05 * np.mean(phone.sd[-300:])


@pytest.mark.parametrize("trusted", [None, "tracker", "imu"])
def test_live_is_replay_whoever_is_trusted(trusted: str | None) -> None:
    whole = recorded(simulated(8.0), DEPARTURES["latency 130 ms"])
    estimator = FusionAdaptive(SENSORS, trusted_clock=trusted)
    times = whole.times[::7]
    live, replay = replay_loop(estimator, whole.samples, times), estimator.replay(whole.samples, times)
    np.testing.assert_allclose(live.mean, replay.mean, rtol=0, atol=1e-9)
    np.testing.assert_allclose(live.sd, replay.sd, rtol=0, atol=1e-9)


def test_a_clock_of_neither_sensor_is_refused() -> None:
    with pytest.raises(ValueError, match="trusted_clock must be one of tracker, imu, got kinect"):
        FusionAdaptive(SENSORS, trusted_clock="kinect")
