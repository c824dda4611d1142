"""Regular windows, compiled: which readings are in a window, whether they keep to the rates, and their weighted sum."""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray
from fusion_core.window.kernels import IntArray

_REGULAR_NS = 2.0  # stamps in whole ns cannot keep to a rate more exactly
_MOST_PATTERNS = 256  # in one batch; windows of further patterns are computed one by one


@compiled
def in_ns(seconds: float) -> int:
    """Seconds as whole nanoseconds, rounded to the nearest."""
    return int(np.rint(seconds * 1e9))


@compiled
def is_regular(measured: FloatArray, n_positions: int, tracker_rate_hz: float, other_rate_hz: float) -> bool:
    """Whether all steps of a window keep to the rates; `measured`: times in s of positions, then of other readings."""
    for row in range(1, len(measured)):
        if row != n_positions:
            rate_hz = tracker_rate_hz if row < n_positions else other_rate_hz
            if abs(measured[row] - measured[row - 1] - 1.0 / rate_hz) > _REGULAR_NS * 1e-9:
                return False
    return True


@compiled
def spans(
    times: FloatArray,
    frame_time: FloatArray,
    frame_arrival: FloatArray,
    other_time: FloatArray,
    other_arrival: FloatArray,
    window: int,
    horizon_s: float,
) -> IntArray:
    """Which readings are in the window at each of `times`: positions first:last and other readings begin:end.

    Returns (4, n): first, last, begin and end for each time.
    """
    window_spans = np.zeros((4, len(times)), np.int64)
    last, begin, end = 0, 0, 0
    for index in range(len(times)):
        now = times[index]
        if index > 0 and now < times[index - 1]:
            last, begin, end = 0, 0, 0
        while last < len(frame_arrival) and frame_arrival[last] <= now:
            last += 1
        while end < len(other_arrival) and other_arrival[end] <= now:
            end += 1
        first = max(last - window, 0)
        if last > 0:
            since = max(frame_time[first], now - horizon_s)
            while begin > 0 and other_time[begin - 1] >= since:
                begin -= 1
            while begin < end and other_time[begin] < since:
                begin += 1
        window_spans[0, index], window_spans[1, index] = first, last
        window_spans[2, index], window_spans[3, index] = begin, end
    return window_spans


@compiled
def _runs(time: FloatArray, rate_hz: float) -> IntArray:
    """For each reading, how many steps in a row before it keep to the rate."""
    runs, period_s, run = np.zeros(len(time), np.int64), 1.0 / rate_hz, 0
    for row in range(1, len(time)):
        regular = abs(time[row] - time[row - 1] - period_s) <= _REGULAR_NS * 1e-9
        run = run + 1 if regular else 0
        runs[row] = run
    return runs


@compiled
def patterns(
    times: FloatArray,
    frame_time: FloatArray,
    other_time: FloatArray,
    window_spans: IntArray,
    tracker_rate_hz: float,
    other_rate_hz: float,
) -> tuple[IntArray, IntArray]:
    """The pattern of each window (n,), −1 for an irregular one, and the k different patterns (k, 4).

    A pattern is the number of positions and of other readings, and the ages of the newest of each in ns.
    """
    which, known = np.full(len(times), -1), np.empty((_MOST_PATTERNS, 4), np.int64)
    follows = np.zeros(
        _MOST_PATTERNS, np.int64
    )  # the pattern that last came after each: patterns recur in the same order, so this is a good guess
    frame_runs, other_runs = _runs(frame_time, tracker_rate_hz), _runs(other_time, other_rate_hz)
    count, before = 0, 0
    for index in range(len(times)):
        first, last = window_spans[0, index], window_spans[1, index]
        begin, end = window_spans[2, index], window_spans[3, index]
        if last == 0 or frame_runs[last - 1] < last - first - 1:
            continue
        if end > begin and other_runs[end - 1] < end - begin - 1:
            continue
        newest = in_ns(times[index] - frame_time[last - 1])
        newest_other = in_ns(times[index] - other_time[end - 1]) if end > begin else 0
        row = follows[before]
        if count == 0 or not _same_pattern(known[row], last - first, end - begin, newest, newest_other):
            row = 0
            while row < count and not _same_pattern(known[row], last - first, end - begin, newest, newest_other):
                row += 1
            if row == _MOST_PATTERNS:
                continue
            if row == count:
                known[row, 0], known[row, 1] = last - first, end - begin
                known[row, 2], known[row, 3] = newest, newest_other
                count += 1
            follows[before] = row
        which[index] = before = row
    return which, known[:count]


@compiled(inline="always")
def _same_pattern(pattern: IntArray, positions: int, others: int, newest: int, newest_other: int) -> bool:
    return bool(
        pattern[2] == newest and pattern[3] == newest_other and pattern[0] == positions and pattern[1] == others
    )


@compiled(fastmath=True)
def apply(
    which: IntArray,
    window_spans: IntArray,
    weights: FloatArray,
    spread: FloatArray,
    frames: FloatArray,
    others: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
) -> None:
    """Writes the weighted sums of regular windows into their rows of `mean` and `sd` (n, d).

    `frames` and `others` are values (d, m), `weights` (k, m) and `spread` (k,) the weights and SD of each pattern.
    """
    for index in range(len(which)):
        pattern = which[index]
        if pattern < 0:
            continue
        first, last = window_spans[0, index], window_spans[1, index]
        begin, end = window_spans[2, index], window_spans[3, index]
        of_frames, of_others = weights[pattern, : last - first], weights[pattern, last - first :]
        for axis in range(mean.shape[1]):
            frame, other = frames[axis, first:last], others[axis, begin:end]  # slices, whose loops need no checks
            total, rest = 0.0, 0.0
            for reading in range(len(frame)):
                total += of_frames[reading] * frame[reading]
            for reading in range(len(other)):
                rest += of_others[reading] * other[reading]
            mean[index, axis], sd[index, axis] = total + rest, spread[pattern]
