"""Estimates that wait: a display may lag on purpose, and afterwards all readings are known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusion_core.checks import require_not_negative
from fusion_core.estimator import require_readings
from fusion_core.kalman import smoothing_steps
from fusion_core.kalman.event_time import EventTime
from fusion_core.kalman.fusion import FusionKalman
from fusion_core.samples import FloatArray, Samples, Track


def smooth(estimator: FusionKalman, samples: Mapping[str, Samples], times: FloatArray) -> Track:
    """The position at `times` in view of every reading, before and after (Rauch, Tung and Striebel 1965).

    Not causal: a reference where a study has none, never an estimate to be shown. NaN outside the readings. Memory
    grows with the readings, about 1.3 kB each. Raises ValueError for an estimator on its fixed-gain path.
    """
    steps = _event_time(estimator)
    require_readings(estimator.sensors, samples)
    order = np.argsort(times, kind="stable")
    mean, sd = np.full((2, len(times), steps.dimension), np.nan)
    history = steps.filtered(samples)
    if history is not None:
        rising = np.asarray(times, dtype=np.float64)[order]
        mean[order], sd[order] = smoothing_steps.smooth(steps.model, history, rising)
    return Track(times, mean, sd)


def fixed_lag(estimator: FusionKalman, samples: Mapping[str, Samples], times: FloatArray, lag_s: float) -> Track:
    """The position `lag_s` before each of `times`, from what had arrived by then: steadier, and late by that much.

    Raises ValueError for a lag that the estimator's history does not cover, or its fixed-gain path.
    """
    steps = _event_time(estimator)
    require_readings(estimator.sensors, samples)
    require_not_negative(lag_s=lag_s)
    if lag_s > estimator.history_s:
        raise ValueError(f"lag_s must be within the estimator's history_s of {estimator.history_s}, got {lag_s}")
    return steps.replay(samples, times, lag_s)


def _event_time(estimator: FusionKalman) -> EventTime:
    if not isinstance(estimator.steps, EventTime):
        raise ValueError('smoothing needs the covariance of every step: path="event_time"')
    return estimator.steps
