"""A sensor's noise, measured while the hand is still; the paper found its two noise SDs in the same way."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fusion_core.accuracy import stretches
from fusion_core.samples import FloatArray, Samples

_SPAN_S = 0.5
_EDGE_S = 0.1  # a hand that has just stopped, or is about to start, is slow but not unaccelerated


def still_by_acceleration(acceleration: Samples, shortest_s: float = 1.0) -> tuple[float, float] | None:
    """The longest stretch (begin, end) in s in which the accelerations hardly vary; None if there is none.

    That is where the SD over 0.5 s is below twice the 5th percentile of all such SDs, so the phone's own noise sets
    the scale.
    """
    if len(acceleration) < 3 or np.ptp(acceleration.time) < 2 * shortest_s:
        return None
    order = np.argsort(acceleration.time, kind="stable")
    time, value = acceleration.time[order], acceleration.value[order]
    span = max(3, round(_SPAN_S / float(np.median(np.diff(time)))))
    if len(time) <= span:
        return None
    spread = _moving_sd(value, span)
    middle = time[span // 2 : span // 2 + len(spread)]
    return longest(stretches(middle, spread < 2 * np.percentile(spread, 5), shortest_s))


def longest(stretches_s: Iterable[tuple[float, float]]) -> tuple[float, float] | None:
    """The longest of some stretches (begin, end) in s; None if there are none."""
    return max(stretches_s, key=lambda stretch: stretch[1] - stretch[0], default=None)


def _moving_sd(value: FloatArray, span: int) -> FloatArray:
    """SD over every `span` consecutive rows, axes summed."""
    centred = value - value.mean(axis=0)
    zero = np.zeros((1, value.shape[1]))
    first = np.vstack([zero, np.cumsum(centred, axis=0)])
    second = np.vstack([zero, np.cumsum(centred**2, axis=0)])
    mean = (first[span:] - first[:-span]) / span
    variance = (second[span:] - second[:-span]) / span - mean**2
    sd: FloatArray = np.sqrt(np.maximum(variance.sum(axis=1), 0.0))
    return sd


def residuals(samples: Samples, begin: float, end: float) -> FloatArray:
    """The readings (n, d) in the stretch from `begin` to `end` s, less a slow drift: a parabola per axis.

    The first and last 0.1 s of the stretch are left out, because the hand may already or still be accelerating there.
    The residuals are scaled by √(n / (n − 3)), so that their root mean square estimates the SD. Empty with fewer than
    10 readings.
    """
    inside = (samples.time >= begin + _EDGE_S) & (samples.time <= end - _EDGE_S)
    value = samples.value[inside]
    if len(value) < 10:
        return np.empty((0, samples.value.shape[1]))
    unit = (samples.time[inside] - begin) / (end - begin)
    powers = np.stack([np.ones_like(unit), unit, unit**2], axis=1)
    fitted = powers @ np.linalg.lstsq(powers, value, rcond=None)[0]
    left: FloatArray = (value - fitted) * np.sqrt(len(value) / (len(value) - 3))
    return left
