"""A session's first seconds: a rest of two seconds, then a reach, beside the filter that knows what the sensors are."""

from __future__ import annotations

import numpy as np
import pytest

from fusion_core import Estimator, FusionAdaptive, FusionKalman
from tests.benchmarks import floor

_RUNS = 20


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(floor, "MOVES_AT_S", 2.1)
    monkeypatch.setattr(floor, "LENGTH_S", 5.1)


def _rms_mm(estimator: Estimator, trouble: floor.Trouble, begin_s: float, end_s: float) -> float:
    within = slice(round(90 * begin_s), round(90 * end_s))
    return float(np.sqrt(np.mean(floor.errors(estimator, floor.reach, trouble, _RUNS)[:, within] ** 2)))


@pytest.mark.parametrize("second", [0.9, 2.1, 3.1, 4.1])
def test_the_first_reach_is_followed_as_well(second: float) -> None:
    """The rest, the reach, and two seconds after it."""
    adaptive, plain = FusionAdaptive(floor.SENSORS), FusionKalman(floor.SENSORS)
    for trouble in (floor.Trouble(), floor.Trouble(bias_mm_s2=300.0)):
        errors = (_rms_mm(one, trouble, second, second + 1.0) for one in (adaptive, plain))
        assert next(errors) < 1.05 * next(errors)


def test_a_rest_with_stray_frames_is_no_reason_to_hold_the_position() -> None:
    """A held position lags by a latency when the hand sets off: the error was three times the plain filter's."""
    trouble = floor.Trouble(outliers=0.05)
    adaptive, plain = FusionAdaptive(floor.SENSORS), FusionKalman(floor.SENSORS)
    assert _rms_mm(adaptive, trouble, 2.1, 3.1) < 1.5 * _rms_mm(plain, trouble, 2.1, 3.1)
