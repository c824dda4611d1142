"""Estimates that use later readings: all of them (`smooth`), or those that arrive within a fixed lag (`fixed_lag`)."""

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
    """The position at `times` (n,) in s, given every reading before and after it (Rauch, Tung and Striebel 1965).

    Returns mean and SD (n, d) in mm; NaN outside the readings. Not causal: use it as a reference where a study has
    none, never as an estimate to be shown. Memory grows by about 1.3 kB a reading. Raises ValueError for an estimator
    on its fixed-gain path.
    """
    steps = _event_time(estimator)
    require_readings(estimator.sensors, samples)
    order = np.argsort(times, kind="stable")
    mean, sd = np.full((2, len(times), steps.dimension), np.nan)
    history = steps.filtered(samples)
    if history is not None:
        rising = np.asarray(times, dtype=np.float64)[order]
        mean[order], sd[order] = smoothing_steps.smooth(
            steps.model.motion, steps.dimension, steps.model.constant_psd, history, rising
        )
    return Track(times, mean, sd)


def fixed_lag(estimator: FusionKalman, samples: Mapping[str, Samples], times: FloatArray, lag_s: float) -> Track:
    """The position `lag_s` before each of `times` (n,) in s, from what had arrived at that time.

    Returns mean and SD (n, d) in mm: steadier than the estimate of "now", and late by `lag_s`. Raises ValueError for
    a negative lag, one that the estimator's history does not cover, and an estimator on its fixed-gain path.
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
