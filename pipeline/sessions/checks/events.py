"""Events against the task, the streams and the display."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pipeline.sessions.checks.finding import Finding, Status
from pipeline.sessions.checks.recorded import Positions, Recorded
from pipeline.sessions.logs.log import BoolArray
from pipeline.statistics.arrays import FloatArray

TARGETS, SPAN, SHOWN = "targets", "span of the events", "selections"

_AT_LEAST_MM = 10.0
_EDGE_S = 2.0
_FAR = 20.0  # times the extent of the movement
_SHIFTS_S = np.arange(-5.0, 5.001, 0.05)
_OFF_MM, _OFF_RED_MM = 10.0, 50.0
_SELECTIONS_MIN = 3
_AS_LOW_MM = 0.5
_OTHER_SIZE = 3.0  # times as wide as the task
_FRAME_MIN, _FRAME_FLAT = 6, 0.02  # selections; the second dimension beside the first
_LEFT_MM = 100.0  # at most, where a mistake is the right one
_EXPLAINS = 0.4  # of the distance that is left once a mistake is undone


def targets(recorded: Recorded) -> Iterator[Finding]:
    """The events' targets compared with those of the task; without a task, with the places where the hand was."""
    if recorded.events is None:
        return
    there = recorded.events.target_mm[np.isfinite(recorded.events.target_mm[:, :2]).all(axis=1)]
    if not len(there):
        return
    if recorded.targets_mm is not None and len(recorded.targets_mm):
        tolerance_mm = max(recorded.target_size_mm, _AT_LEAST_MM)
        yield from _against_task(there[:, :2], recorded.targets_mm, tolerance_mm, recorded.px_per_mm)
    else:
        yield from _against_reach(recorded, there)


def _against_task(
    there: FloatArray, task: FloatArray, tolerance_mm: float, px_per_mm: float | None
) -> Iterator[Finding]:
    off = _nearest_mm(there, task)
    wrong = int(np.sum(off > tolerance_mm))
    found, expected = f"{wrong} of {len(there)} where the task has none", "0"
    if wrong == 0:
        yield Finding(TARGETS, "green", found, expected)
        return
    tried = mistakes(there, px_per_mm)
    shift = np.unique(there, axis=0).mean(axis=0) - task.mean(axis=0)
    tried[f"all are off by ({shift[0]:.0f}, {shift[1]:.0f}) mm; log them in the tracker's frame"] = there - shift
    left = {cause: float(np.mean(_nearest_mm(points, task) > tolerance_mm)) for cause, points in tried.items()}
    cause = min(left, key=lambda one: left[one])
    if left[cause] > 0.5 * wrong / len(there):
        size = float(np.std(there)) / max(float(np.std(task)), 1e-9)
        cause = "they are of another frame or task; correct task: in study.yaml or the events"
        if not 1 / _OTHER_SIZE < size < _OTHER_SIZE:
            cause = f"they spread {size:.3g} times as far: pixels or another unit; log metres in the tracker's frame"
    status: Status = "red" if wrong > len(there) / 2 else "amber"
    example = ", ".join(f"{value:.0f}" for value in there[int(np.argmax(off))])
    message = f"{wrong} of {len(there)} targets are where the task has none, such as ({example}) mm: {cause}"
    yield Finding(TARGETS, status, found, expected, message)


def mistakes(points: FloatArray, px_per_mm: float | None) -> dict[str, FloatArray]:
    """Points (n, 2) with each mistake undone, by its words and remedy."""
    tried = {
        "they are in millimetres where metres are expected; log metres": points / 1e3,
        "they are in centimetres where metres are expected; log metres": points / 1e2,
        "x and y are exchanged; log them in the tracker's order": points[:, ::-1],
        "y points the other way; log it in the tracker's frame": points * np.array([1.0, -1.0]),
        "x points the other way; log it in the tracker's frame": points * np.array([-1.0, 1.0]),
        "x and y point the other way; log them in the tracker's frame": -points,
    }
    if px_per_mm is not None:
        pixels = points / 1e3 / px_per_mm
        tried["they are in pixels where metres are expected; log metres"] = pixels
        tried["they are in pixels with y downwards; log metres in the tracker's frame"] = pixels * np.array([1.0, -1.0])
    return tried


def _nearest_mm(points: FloatArray, task: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points[:, None] - task[None], axis=2).min(axis=1))


def _against_reach(recorded: Recorded, there: FloatArray) -> Iterator[Finding]:
    hand = recorded.of_kind("reference") or recorded.of_kind("display") or recorded.tracker
    if hand is None or len(hand.value_mm) < 10:
        return
    low, high = np.percentile(hand.value_mm[:, :2], [2, 98], axis=0)
    extent = max(float(np.max(high - low)), 100.0)
    off = np.linalg.norm(np.clip(there[:, :2], low, high) - there[:, :2], axis=1)
    far = int(np.sum(off > _FAR * extent))
    found, expected = f"{far} of {len(there)} far from any movement", "0"
    if far == 0:
        yield Finding(TARGETS, "green", found, expected)
        return
    message = (
        f"{far} of {len(there)} targets are {np.median(off) / 1e3:.3g} m from where the hand ever was: they are "
        "probably in millimetres where metres are expected; log metres"
    )
    yield Finding(TARGETS, "red" if far > len(there) / 2 else "amber", found, expected, message)


def span(recorded: Recorded) -> Iterator[Finding]:
    """Selections outside the time in which anything was measured: the events are of another clock."""
    events = recorded.events
    times = [one.times.arrival_s for one in recorded.streams if len(one.times.arrival_s)]
    if events is None or not times or not events.selects.any():
        return
    begin, end = min(float(one.min()) for one in times), max(float(one.max()) for one in times)
    at = events.time_s[events.selects]
    outside = (at < begin - _EDGE_S) | (at > end + _EDGE_S)
    count = int(outside.sum())
    found, expected = f"{count} of {len(at)} selections outside the streams", "0"
    if count == 0:
        yield Finding(SPAN, "green", found, expected)
        return
    by_s = float(np.median(at) - (begin + end) / 2)
    by = f"{by_s / 3600:+.1f} h" if abs(by_s) > 1000 else f"{by_s:+.0f} s"
    message = (
        f"{count} of {len(at)} selections are outside the time in which the streams were recorded, by about {by}: the "
        "events are of another clock or time zone; log them with the recorder's clock"
    )
    yield Finding(SPAN, "red", found, expected, message)


class _Path(NamedTuple):
    """What was displayed: rising times (n,) in s and positions (n, 2) in mm."""

    time_s: FloatArray
    value_mm: FloatArray
    is_display: bool

    def at(self, time_s: FloatArray) -> FloatArray:
        """The positions (m, 2) in mm at these times (m,)."""
        return np.column_stack([np.interp(time_s, self.time_s, self.value_mm[:, axis]) for axis in (0, 1)])


def selections(recorded: Recorded) -> Iterator[Finding]:
    """The recorded selections compared with what was displayed then, or with the tracker if nothing was displayed.

    Another clock, unit or axis shows at once, because the hand is somewhere else a moment later. A display that is late
    by less time than the hand takes to move 10 mm is not noticed.
    """
    events = recorded.events
    shown = recorded.of_kind("display") or recorded.of_kind("reference") or recorded.tracker
    if events is None or shown is None or len(shown.value_mm) < 10:
        return
    rows = events.selects & np.isfinite(events.selected_mm[:, :2]).all(axis=1)
    time, at = events.time_s[rows], events.selected_mm[rows][:, :2]
    known = _within(shown, time)
    if known.sum() < _SELECTIONS_MIN:
        return
    time, at = time[known], at[known]
    path = _path(shown)
    here = float(np.median(_apart(path, time, at)))
    found, expected = f"{here:.3g} mm from {shown.name}", "as displayed"
    cause = _selection_cause(path, time, at, here, recorded.px_per_mm) if here > _limit(shown) else ""
    if not cause:
        yield Finding(SHOWN, "green", found, expected)
        return
    message = f'the recorded selections are {here:.3g} mm from "{shown.name}" at that instant: {cause}'
    yield Finding(SHOWN, "red" if here > _OFF_RED_MM else "amber", found, expected, message)


def _limit(shown: Positions) -> float:
    """How far apart they may be, in mm: 10 mm, or four times its noise for a sensor."""
    if shown.kind == "display":
        return _OFF_MM
    return max(_OFF_MM, 4.0 * float(np.sqrt(2.0)) * (shown.noise_sd_mm or 0.0))


def _selection_cause(path: _Path, time: FloatArray, at: FloatArray, here: float, px_per_mm: float | None) -> str:
    """The mistake that explains most of the distance, in words; "" if none does."""
    shifts = np.array([float(np.mean(_apart(path, time + shift, at))) for shift in _SHIFTS_S])
    best = _middle_of_lowest(shifts)
    tried = mistakes(at, px_per_mm)
    left = {cause: float(np.median(_apart(path, time, points))) for cause, points in tried.items()}
    likely = min(left, key=lambda one: left[one])
    if left[likely] < min(_EXPLAINS * here, float(shifts[best]), _LEFT_MM):
        return likely
    if shifts[best] < _EXPLAINS * here and abs(_SHIFTS_S[best]) >= 0.1:
        by = _SHIFTS_S[best]
        return (
            f"they fit {abs(by):.1f} s {'earlier' if by < 0 else 'later'}, so the events' clock is "
            f"{'late' if by < 0 else 'early'}; log events with the recorder's clock"
        )
    found = _other_frame(path.at(time), at, here, px_per_mm)
    if found:
        return found
    if here > _OFF_RED_MM and path.is_display:
        return "they are of another clock or frame; log what was displayed, with the recorder's clock"
    return ""


def _middle_of_lowest(cost: FloatArray) -> int:
    """The index of the lowest cost; the middle of a stretch that is equally low, as while the hand rests."""
    low = high = int(np.argmin(cost))
    enough = cost[low] + _AS_LOW_MM
    while low > 0 and cost[low - 1] <= enough:
        low -= 1
    while high < len(cost) - 1 and cost[high + 1] <= enough:
        high += 1
    return (low + high) // 2


def _within(shown: Positions, time: FloatArray) -> BoolArray:
    stamps = shown.times.stamp_s
    found: BoolArray = (time >= stamps.min()) & (time <= stamps.max())
    return found


def _path(shown: Positions) -> _Path:
    stamps, first = np.unique(shown.times.stamp_s - shown.times.late_s, return_index=True)
    return _Path(stamps, shown.value_mm[first, :2], shown.kind == "display")


def _apart(path: _Path, time: FloatArray, at: FloatArray) -> FloatArray:
    """Distances (n,) in mm between the points `at` (n, 2) and the displayed positions at `time` (n,)."""
    return np.asarray(np.linalg.norm(path.at(time) - at, axis=1))


def _other_frame(there: FloatArray, at: FloatArray, here: float, px_per_mm: float | None) -> str:
    """Size, turn and shift that bring the displayed positions (n, 2) to the selections, in words; "" if none do.

    The best similarity by the singular values of the cross-products (Umeyama 1991).
    """
    if len(at) < _FRAME_MIN:
        return ""
    shown, chosen = there - there.mean(axis=0), at - at.mean(axis=0)
    left, strength, right = np.linalg.svd(chosen.T @ shown)
    power = float(np.sum(shown**2))
    turn, size = left @ right, float(strength.sum()) / power if power > 0 else 0.0
    if size == 0 or strength[1] < _FRAME_FLAT * strength[0]:
        return ""
    rest = float(np.median(np.linalg.norm(chosen / size - shown @ turn.T, axis=1)))
    if rest > min(_OFF_MM * 2, _EXPLAINS * here / size):
        return ""
    shift = np.median(at / size - there @ turn.T, axis=0)
    parts = []
    if abs(size - 1) > 0.1:
        pixels = px_per_mm is not None and abs(size / (1e3 * px_per_mm) - 1) < 0.1
        parts.append("in pixels" if pixels else f"{size:.3g} times as large{' (pixels?)' if size > 1 else ''}")
    angle = float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0])))
    if np.linalg.det(turn) < 0:
        parts.append("mirrored")
    elif abs(angle) > 5:
        parts.append(f"turned by {angle:.0f}°")
    if np.linalg.norm(shift) > _OFF_MM:
        parts.append(f"off by ({shift[0]:.0f}, {shift[1]:.0f}) mm")
    named = " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
    return f"they are of another frame, {named}; log metres in the tracker's frame" if parts else ""
