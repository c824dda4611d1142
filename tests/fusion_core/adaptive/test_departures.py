"""Whatever departs from study.yaml: never worse than the tracker as it comes or a filter of positions alone."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import Estimator, FusionAdaptive, PositionKalman, Raw
from tests.benchmarks.departures import DEPARTURES, SENSORS, Recorded, recorded, simulated

_SECONDS = 30.0
FUSION = FusionAdaptive(SENSORS)


def _rmse(estimator: Estimator, whole: Recorded) -> float:
    error = estimator.replay(whole.samples, whole.times).mean - whole.truth
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


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
