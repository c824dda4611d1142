"""How good a track is compared with a reference: error, lag, jitter, and whether its stated SD is right."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.accuracy import lag_steps
from fusion_core.samples import FloatArray, Samples

BoolArray = npt.NDArray[np.bool_]

GAP_S = 0.05  # a reference is not interpolated over longer gaps
LAG_RANGE_S = 0.5
_LAG_STEP_S = 0.005
_BLOCK_S = 0.5  # of the bootstrap: longer than an estimator's errors are correlated
_RESAMPLES = 1000
BLOCKS_MAX = 200_000  # to draw from: 2 kB each, and those a few ms apart are nearly the same
ROWS_AT_ONCE = 2**18  # of what is gone through part by part
TRANSFORMED = 2**22  # instants, of which the spectra of two signals take 0.5 GB
_FLAT = 1e-6  # costs that differ by less than this share say nothing: while the reference is still, any shift fits


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
    return float(np.sqrt(np.mean(squared_distances(estimate, reference))))


def squared_distances(estimate: FloatArray, reference: FloatArray) -> FloatArray:
    """Squared Euclidean distances (n,) in mm² between (n, d) and (n, d)."""
    found: FloatArray = np.sum((estimate - reference) ** 2, axis=1)
    return found


def stated_sd(sd: FloatArray) -> float:
    """Root mean over time of the stated variances summed over axes, in mm: the `rmse` to expect if they are right."""
    return float(np.sqrt(np.mean(np.sum(sd**2, axis=1))))


def coverage_95(estimate: FloatArray, sd: FloatArray, reference: FloatArray) -> float:
    """Share of (instant, axis) where the reference is within 1.96 stated SDs of the estimate."""
    return float(np.mean(covered_95(estimate, sd, reference)))


def covered_95(estimate: FloatArray, sd: FloatArray, reference: FloatArray) -> BoolArray:
    """Where (n, d) the reference is within 1.96 stated SDs of the estimate."""
    found: BoolArray = np.abs(estimate - reference) <= 1.96 * sd
    return found


def lag(time: FloatArray, estimate: FloatArray, reference: Samples, random: np.random.Generator) -> Interval:
    """The shift in s within ±0.5 s that minimises Σ‖estimate(t) − reference(t − lag)‖²; positive = late.

    `time` (n,) rises, `estimate` is (n, d) in mm. The lag is refined below the step of 5 ms by a parabola through the
    smallest squared distance and its neighbours. The 95 % interval is the 2.5 and 97.5 percentile over 1000 resamples
    of moving blocks of 0.5 s; of a long recording, of those that begin at every k-th instant. NaN with less than 1 s of
    usable track, or where the smallest distance is at the edge of the range. A resample whose smallest distance is at
    the edge counts with the edge, so an interval that reaches ±0.5 s means that the data do not determine the lag. A
    resample in which the hand never moves says nothing about the lag and is left out.
    """
    order = np.argsort(reference.time, kind="stable")
    known, value = reference.time[order], reference.value[order]
    usable = _surrounded(known, time)
    if not usable.any():
        return NO_INTERVAL
    first, last = int(np.argmax(usable)), len(usable) - int(np.argmax(usable[::-1]))
    if not usable[first:last].all():
        time, estimate = time[usable], estimate[usable]
    else:  # most often: only the ends are not, and nothing is copied
        time, estimate = time[first:last], estimate[first:last]
    if time[-1] - time[0] < 1.0:
        return NO_INTERVAL
    estimate = np.ascontiguousarray(estimate, dtype=np.float64)
    block = min(max(1, round(_BLOCK_S / float(np.median(np.diff(time))))), len(time))
    shifts = np.arange(-LAG_RANGE_S, LAG_RANGE_S + _LAG_STEP_S / 2, _LAG_STEP_S)
    every = -(-len(time) // BLOCKS_MAX)
    blocks = lag_steps.block_costs(_segments(known, value), time, estimate, shifts, block, every)
    scale = float(blocks.total.max())
    whole = lag_steps.best(blocks.total, scale)
    if scale - blocks.total.min() <= _FLAT * scale or not 0 < whole < len(shifts) - 1:
        return NO_INTERVAL
    each, resampled = max(1, len(time) // block), np.empty(_RESAMPLES)
    at_once = max(1, ROWS_AT_ONCE // each)
    for begin in range(0, _RESAMPLES, at_once):
        own = resampled[begin : begin + at_once]
        own[:] = lag_steps.best_of_resamples(blocks, random.integers(len(blocks.still), size=(len(own), each)))
    resampled = resampled[np.isfinite(resampled)]
    low, high = np.percentile(resampled, [2.5, 97.5]) if len(resampled) >= _RESAMPLES // 2 else (np.nan, np.nan)
    return Interval(*(float(shifts[0] + steps * _LAG_STEP_S) for steps in (whole, low, high)))


def _surrounded(known: FloatArray, time: FloatArray) -> BoolArray:
    """Whether the reference, sampled at rising times `known`, covers every shift of each instant without a gap."""
    if len(known) < 2:
        return np.zeros(len(time), dtype=np.bool_)
    gaps = np.concatenate([[0], np.cumsum(np.diff(known) > GAP_S)])
    surrounded = np.empty(len(time), dtype=np.bool_)
    for first in range(0, len(time), ROWS_AT_ONCE):
        part = slice(first, first + ROWS_AT_ONCE)
        begin = np.searchsorted(known, time[part] - LAG_RANGE_S, side="right") - 1
        end = np.searchsorted(known, time[part] + LAG_RANGE_S, side="left")
        inside = (begin >= 0) & (end < len(known))
        surrounded[part] = inside & (gaps[begin] == gaps[np.minimum(end, len(known) - 1)])
    return surrounded


def _segments(known: FloatArray, value: FloatArray) -> lag_steps.Segments:
    """The reference as straight pieces between its samples; the slope of a piece without duration is set to 0."""
    lasting, rise = np.diff(known), np.diff(value.T)
    slope = np.divide(rise, lasting, out=np.zeros_like(rise), where=lasting > 0)
    return lag_steps.Segments(
        np.ascontiguousarray(known, dtype=np.float64),
        np.ascontiguousarray(value[:-1].T, dtype=np.float64),
        np.ascontiguousarray(slope, dtype=np.float64),
    )


class _Signal(NamedTuple):
    """The rows `at` (n,) of `value` (m, d), which are not copied: a long signal's would take gigabytes."""

    value: FloatArray
    at: npt.NDArray[np.int32]

    def means(self) -> FloatArray:
        """The mean of each column (d,), to the last bit as `value[at].mean(axis=0)`."""
        if self.value.shape[1] == 1:  # NumPy adds a single column up in pairs
            return np.asarray(self.value[self.at].mean(axis=0))
        total = np.zeros(self.value.shape[1])
        for begin in range(0, len(self.at), ROWS_AT_ONCE):
            rows = self.value[self.at[begin : begin + ROWS_AT_ONCE]]
            total = np.add.reduce(np.vstack([total, rows]) if begin else rows, axis=0)
        return total / len(self.at)

    def spectrum(self, axis: int, mean: float, length: int) -> npt.NDArray[np.complex128]:
        """The transform of one column less its mean, filled up with zeros to `length`."""
        from scipy import fft

        padded = np.zeros(length)
        for begin in range(0, len(self.at), ROWS_AT_ONCE):
            rows = self.at[begin : begin + ROWS_AT_ONCE]
            padded[begin : begin + len(rows)] = self.value[rows, axis] - mean
        return np.asarray(fft.rfft(padded, overwrite_x=True))


def cross_correlation(
    first: FloatArray, second: FloatArray, farthest: int | None = None
) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Unbiased cross-correlation of two (n, d) signals, summed over axes, after subtracting each axis's mean.

    Returns shifts in samples, −(n−1) … n−1, or those up to `farthest`, and at each the mean of first[t]·second[t +
    shift] over the overlap: the peak sits at a positive shift where `first` is ahead of `second` (paper, Fig. 9).
    """
    rows = np.arange(len(first), dtype=np.int32)
    return _correlation(_Signal(first, rows), _Signal(second, rows), farthest)


def _correlation(first: _Signal, second: _Signal, farthest: int | None) -> tuple[npt.NDArray[np.int64], FloatArray]:
    n, means = len(first.at), (first.means(), second.means())
    most = n - 1 if farthest is None else min(n - 1, farthest)
    sums = _sums_of_parts if n > TRANSFORMED and most < ROWS_AT_ONCE else _sums
    shifts = np.arange(-most, most + 1)
    return shifts, np.asarray(sums(first, second, means, shifts) / (n - np.abs(shifts)), dtype=np.float64)


def _sums(
    first: _Signal, second: _Signal, means: tuple[FloatArray, FloatArray], shifts: npt.NDArray[np.int64]
) -> FloatArray:
    """Σ first[t]·second[t + shift] less their means, by a transform of the whole signals."""
    from scipy import fft

    length = fft.next_fast_len(2 * len(first.at) - 1, real=True)
    spectrum: Any = None
    for axis in range(first.value.shape[1]):  # one after the other: the spectra take six times the signals' memory
        a = first.spectrum(axis, means[0][axis], length)
        np.conj(a, out=a)
        a *= second.spectrum(axis, means[1][axis], length)
        spectrum = a if spectrum is None else np.add(spectrum, a, out=spectrum)
        del a
    circular: FloatArray = fft.irfft(spectrum, length)  # negative shifts are at its end
    return circular[shifts]


def _sums_of_parts(
    first: _Signal, second: _Signal, means: tuple[FloatArray, FloatArray], shifts: npt.NDArray[np.int64]
) -> FloatArray:
    """The same but for round-off, part by part, for signals whose transform would take gigabytes."""
    from scipy.signal import correlate

    n, most, total = len(first.at), int(shifts[-1]), np.zeros(len(shifts))
    for begin in range(0, n, ROWS_AT_ONCE):
        end = min(begin + ROWS_AT_ONCE, n)
        low, high = max(begin - most, 0), min(end + most, n)
        around = np.zeros(end - begin + 2 * most)
        there = slice(low - begin + most, high - begin + most)
        for axis in range(first.value.shape[1]):
            around[there] = second.value[second.at[low:high], axis] - means[1][axis]
            own = first.value[first.at[begin:end], axis] - means[0][axis]
            total += correlate(around, own, "valid", "fft")
    return total


def lead_by_cross_correlation(time: FloatArray, estimate: FloatArray, tracker: Samples) -> float:
    """How far in s the track is ahead of the tracker *as it arrived*, by the paper's Fig. 9, within ±0.5 s.

    Both are resampled to one regular grid at the track's median step; the tracker holds its value between arrivals, as
    it was seen. NaN where the peak is at the edge of the range or there is no motion.
    """
    curve = lead_curve(time, estimate, tracker)
    if curve is None:
        return np.nan
    lead, correlation = curve
    inside = np.abs(lead) <= LAG_RANGE_S
    peak = int(np.argmax(correlation[inside]))
    if peak in (0, int(inside.sum()) - 1) or not correlation[inside][peak] > 0:
        return np.nan
    return float(lead[inside][peak])


def lead_curve(time: FloatArray, estimate: FloatArray, tracker: Samples) -> tuple[FloatArray, FloatArray] | None:
    """The curve behind `lead_by_cross_correlation`: leads in s and correlations in mm²; None without overlap.

    Of leads of up to 0.5 s and a step more.
    """
    if len(time) < 3 or len(tracker) < 2:
        return None
    step = float(np.median(np.diff(time)))
    begin, end = max(time[0], tracker.arrival[0]), min(time[-1], tracker.arrival[-1])
    if end - begin < 2 * LAG_RANGE_S:
        return None
    grid = np.arange(begin, end, step)
    grid += step * 1e-3
    track = _Signal(estimate, _newest(time, grid))
    arrived = _Signal(tracker.value, _newest(tracker.arrival, grid))
    del grid
    shifts, correlation = _correlation(track, arrived, int(LAG_RANGE_S / step) + 1)
    return np.asarray(shifts * step, dtype=np.float64), correlation


def _newest(time: FloatArray, wanted: FloatArray) -> npt.NDArray[np.int32]:
    """The row (n,) of the newest of rising `time` that is not after each of the times `wanted` (n,); −1 if none is."""
    found = np.empty(len(wanted), np.int32)
    for begin in range(0, len(wanted), ROWS_AT_ONCE):
        part = slice(begin, begin + ROWS_AT_ONCE)
        found[part] = np.searchsorted(time, wanted[part], side="right") - 1
    return found


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
    """SD in mm of the track within slow stretches of the reference, pooled over them, axes summed; NaN if none.

    `time` (n,) rises.
    """
    total, freedom = 0.0, 0
    for begin, end in slow_stretches(reference):
        inside = estimate[np.searchsorted(time, begin) : np.searchsorted(time, end, side="right")]
        if len(inside) > 1:
            total += float(np.sum((inside - inside.mean(axis=0)) ** 2))
            freedom += len(inside) - 1
    return float(np.sqrt(total / freedom)) if freedom else np.nan
