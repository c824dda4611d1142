"""The compiled steps of the sliding window: which readings stand in it, whether they are regular, their sum."""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray
from fusion_core.window.kernels import IntArray

_REGULAR_NS = 2.0  # stamps in whole ns keep to a rate no better
_MOST_PATTERNS = 256  # in one batch; windows of others are computed one by one


@compiled
def in_ns(seconds: float) -> int:
    """To the nearest nanosecond."""
    return int(np.rint(seconds * 1e9))


@compiled
def is_regular(measured: FloatArray, n_positions: int, tracker_rate_hz: float, other_rate_hz: float) -> bool:
    """Do all steps of a window, first of positions and then of other readings, keep to the rates?"""
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
    """Rows (first, last, begin, end) by time: positions first:last and other readings begin:end are in its window."""
    found = np.zeros((4, len(times)), np.int64)
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
        found[0, index], found[1, index], found[2, index], found[3, index] = first, last, begin, end
    return found


@compiled
def _runs(time: FloatArray, rate_hz: float) -> IntArray:
    """How many steps in a row, up to each reading, keep to the rate."""
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
    """Each window's pattern, −1 where it has none, and the patterns (k, 4): counts, and ages of the newest in ns."""
    which, known = np.full(len(times), -1), np.empty((_MOST_PATTERNS, 4), np.int64)
    follows = np.zeros(_MOST_PATTERNS, np.int64)  # patterns come round in the same order: the one that came after it
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
        if count == 0 or not _is(known[row], last - first, end - begin, newest, newest_other):
            row = 0
            while row < count and not _is(known[row], last - first, end - begin, newest, newest_other):
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
def _is(pattern: IntArray, positions: int, others: int, newest: int, newest_other: int) -> bool:
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
    """The weighted sums of regular windows into their rows; `frames` and `others` (d, n)."""
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
