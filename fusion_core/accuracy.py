"""How good a track is against a reference: error, lag, jitter, and whether its stated SD is honest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusion_core import lag_steps
from fusion_core.samples import FloatArray, Samples

BoolArray = npt.NDArray[np.bool_]

GAP_S = 0.05  # a reference is not interpolated over more than this
LAG_RANGE_S = 0.5
_LAG_STEP_S = 0.005
_BLOCK_S = 0.5  # of the bootstrap: longer than an estimator's errors are correlated
_RESAMPLES = 1000
_ROUND_OFF = 1e-9  # of a cost, what the order of a sum may change


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval; NaN where there is none."""

    value: float
    low: float
    high: float


NO_INTERVAL = Interval(np.nan, np.nan, np.nan)


def interpolate(samples: Samples, time: FloatArray) -> FloatArray:
    """Linear interpolation by measurement time, (n, d); NaN outside the samples and in gaps over 50 ms."""
    order = np.argsort(samples.time, kind="stable")
    known, value = samples.time[order], samples.value[order]
    result = np.full((len(time), value.shape[1]), np.nan)
    if len(known) == 0:
        return result
    for axis in range(value.shape[1]):
        result[:, axis] = np.interp(time, known, value[:, axis], left=np.nan, right=np.nan)
    following = np.clip(np.searchsorted(known, time, side="left"), 1, max(len(known) - 1, 1))
    if len(known) > 1:
        in_gap = known[following] - known[following - 1] > GAP_S
        on_sample = (known[following] == time) | (known[following - 1] == time)
        result[in_gap & ~on_sample] = np.nan
    return result


def rmse(estimate: FloatArray, reference: FloatArray) -> float:
    """Root mean square Euclidean distance in mm between (n, d) and (n, d)."""
    return float(np.sqrt(np.mean(np.sum((estimate - reference) ** 2, axis=1))))


def stated_sd(sd: FloatArray) -> float:
    """Root mean over time of the stated variances summed over axes, in mm: what `rmse` would be if they are right."""
    return float(np.sqrt(np.mean(np.sum(sd**2, axis=1))))


def coverage_95(estimate: FloatArray, sd: FloatArray, reference: FloatArray) -> float:
    """Share of (instant, axis) where the reference is within 1.96 stated SDs of the estimate."""
    return float(np.mean(np.abs(estimate - reference) <= 1.96 * sd))


def lag(time: FloatArray, estimate: FloatArray, reference: Samples, random: np.random.Generator) -> Interval:
    """The shift in s within ±0.5 s that minimises Σ‖estimate(t) − reference(t − lag)‖², positive = late.

    Sub-sample by a parabola through the smallest squared distance and its neighbours; the 95 % interval is the
    2.5 and 97.5 percentile of 1000 resamples of moving blocks of 0.5 s. NaN with less than 1 s of usable track, or
    where the smallest distance sits at the edge of the range. A resample at the edge counts as the edge, so that an
    interval that reaches ±0.5 s says the data cannot tell; one in which the hand never moves says nothing of the lag
    and does not count.
    """
    shifts = np.arange(-LAG_RANGE_S, LAG_RANGE_S + _LAG_STEP_S / 2, _LAG_STEP_S)
    order = np.argsort(reference.time, kind="stable")
    distance = lag_steps.squared_distances(
        np.asarray(time, dtype=np.float64),
        np.ascontiguousarray(estimate, dtype=np.float64),
        np.asarray(reference.time[order], dtype=np.float64),
        np.ascontiguousarray(reference.value[order], dtype=np.float64),
        shifts,
        GAP_S,
    )
    usable = np.isfinite(distance).all(axis=1)
    if not usable.any() or np.ptp(time[usable]) < 1.0:
        return NO_INTERVAL
    distance = distance if usable.all() else distance[usable]
    summed = distance.sum(axis=0)[None, :]
    whole = _lowest(shifts, summed)[0]
    if _flat(summed)[0] or not shifts[0] < whole < shifts[-1]:
        return NO_INTERVAL
    block = max(1, round(_BLOCK_S / float(np.median(np.diff(time[usable])))))
    sums = lag_steps.block_sums(distance, block)
    picks = random.integers(len(sums), size=(_RESAMPLES, max(1, len(distance) // block)))
    resampled = lag_steps.resampled(sums, picks)
    resampled = resampled[~_flat(resampled)]
    if len(resampled) < _RESAMPLES // 2:
        return Interval(float(whole), np.nan, np.nan)
    lows = _lowest(shifts, resampled)
    low, high = np.percentile(lows, [2.5, 97.5])
    return Interval(float(whole), float(low), float(high))


def _flat(cost: FloatArray) -> BoolArray:
    """Rows that are the same at every shift but for round-off: while the reference is still, any shift fits."""
    highest = cost.max(axis=1)
    flat: BoolArray = highest - cost.min(axis=1) <= 1e-6 * highest
    return flat


def _lowest(shifts: FloatArray, cost: FloatArray) -> FloatArray:
    """Where each row of `cost` is lowest, refined by a parabola unless that is at an edge.

    Where a stretch of shifts fits equally well but for round-off the first of them is taken.
    """
    scale = np.maximum(cost.max(axis=1), np.finfo(float).tiny)
    at = np.argmax(cost <= (cost.min(axis=1) + _ROUND_OFF * scale)[:, None], axis=1)
    inside = np.clip(at, 1, len(shifts) - 2)
    row = np.arange(len(cost))
    before, here, after = cost[row, inside - 1], cost[row, inside], cost[row, inside + 1]
    bend = before - 2 * here + after
    sharp = (at == inside) & (bend > _ROUND_OFF * scale)
    step = np.divide(before - after, 2 * bend, out=np.zeros_like(bend), where=sharp)
    lowest: FloatArray = shifts[at] + step * (shifts[1] - shifts[0])
    return lowest


def cross_correlation(first: FloatArray, second: FloatArray) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Unbiased cross-correlation of two (n, d) signals, each axis less its mean, summed over axes.

    Returns shifts in samples, −(n−1) … n−1, and at each the mean of first[t]·second[t + shift] over the overlap:
    the peak sits at a positive shift where `first` is ahead of `second` (paper, Fig. 9).
    """
    from scipy.signal import correlate

    n = len(first)
    a, b = first - first.mean(axis=0), second - second.mean(axis=0)
    total = sum(correlate(b[:, axis], a[:, axis], mode="full") for axis in range(a.shape[1]))
    shifts = np.arange(-(n - 1), n)
    return shifts, np.asarray(total / (n - np.abs(shifts)), dtype=np.float64)


def lead_by_cross_correlation(time: FloatArray, estimate: FloatArray, tracker: Samples) -> float:
    """How far in s the track is ahead of the tracker *as it arrived*, by the paper's Fig. 9, within ±0.5 s.

    Both are brought to one regular grid at the track's median step; the tracker is held between arrivals, as it was
    seen. NaN where the peak sits at the edge of the range or there is no motion.
    """
    found = lead_curve(time, estimate, tracker)
    if found is None:
        return np.nan
    lead, correlation = found
    inside = np.abs(lead) <= LAG_RANGE_S
    peak = int(np.argmax(correlation[inside]))
    if peak in (0, int(inside.sum()) - 1) or not correlation[inside][peak] > 0:
        return np.nan
    return float(lead[inside][peak])


def lead_curve(time: FloatArray, estimate: FloatArray, tracker: Samples) -> tuple[FloatArray, FloatArray] | None:
    """The curve behind `lead_by_cross_correlation`: leads in s and correlations in mm²; None without overlap."""
    if len(time) < 3 or len(tracker) < 2:
        return None
    step = float(np.median(np.diff(time)))
    begin, end = max(time[0], tracker.arrival[0]), min(time[-1], tracker.arrival[-1])
    if end - begin < 2 * LAG_RANGE_S:
        return None
    grid = np.arange(begin, end, step)
    track = estimate[np.searchsorted(time, grid + step * 1e-3, side="right") - 1]
    arrived = tracker.value[np.searchsorted(tracker.arrival, grid + step * 1e-3, side="right") - 1]
    shifts, correlation = cross_correlation(track, arrived)
    return np.asarray(shifts * step, dtype=np.float64), correlation


def slow_stretches(
    reference: Samples, speed_limit_mm_s: float = 20.0, shortest_s: float = 0.5
) -> Iterator[tuple[float, float]]:
    """Stretches (begin, end) in s in which the reference, over 50 ms, moves slower than the limit."""
    order = np.argsort(reference.time, kind="stable")
    time = reference.time[order]
    half = GAP_S / 2
    moved = interpolate(reference, time + half) - interpolate(reference, time - half)
    slow = np.linalg.norm(moved, axis=1) / GAP_S < speed_limit_mm_s
    return stretches(time, slow, shortest_s)


def stretches(time: FloatArray, holds: BoolArray, shortest_s: float) -> Iterator[tuple[float, float]]:
    """Stretches (begin, end) of at least `shortest_s` over which `holds` is true without a gap over 50 ms."""
    if len(time) == 0:
        return
    broken = np.flatnonzero(~holds[1:] | ~holds[:-1] | (np.diff(time) > GAP_S))
    first, last = np.concatenate([[0], broken + 1]), np.concatenate([broken, [len(time) - 1]])
    long_enough = holds[last] & (time[last] - time[first] >= shortest_s)
    yield from zip(time[first[long_enough]].tolist(), time[last[long_enough]].tolist(), strict=True)


def jitter(time: FloatArray, estimate: FloatArray, reference: Samples) -> float:
    """SD in mm of the track within slow stretches of the reference, pooled over them, axes summed; NaN if none."""
    total, freedom = 0.0, 0
    for begin, end in slow_stretches(reference):
        inside = estimate[(time >= begin) & (time <= end)]
        if len(inside) > 1:
            total += float(np.sum((inside - inside.mean(axis=0)) ** 2))
            freedom += len(inside) - 1
    return float(np.sqrt(total / freedom)) if freedom else np.nan
