"""How people moved: throughput of sequences of selections, and the hand's path within a trial."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from pipeline.statistics import fitts
from pipeline.statistics.arrays import FloatArray

CUTOFF_HZ = 5.0
GAP_S = 1.0 / CUTOFF_HZ  # a longer gap splits a path: it is a period of the fastest motion that is kept
SEQUENCE_MIN = 5
PAUSE_MAX_S = 1.0  # if a trial begins later after the last selection, the hand may have moved in between
_STEP_S = 0.01
_PASSES = 2  # there and back
_SETTLING = 50  # steps by which a path is mirrored at its ends before it is filtered
_NOMINAL = 1.1 / 0.9  # from the least to the greatest of amplitudes within 10 % of one
_ROUND_OFF = 1e-9
_SPEED_MIN_MM_S = 20.0
_PROMINENCE_MIN = 0.1  # of the trial's peak speed


@dataclass(frozen=True)
class Aimed:
    """Movements (n,) from one target to the next, in mm; NaN where a figure is unknown.

    `amplitude_mm` is the distance between the targets, `moved_mm` the distance covered along that axis, and `along_mm`
    how far along it the selection was beyond the target.
    """

    amplitude_mm: FloatArray
    moved_mm: FloatArray
    along_mm: FloatArray


@dataclass(frozen=True)
class Path:
    """Where the hand was: `time_s` (n,), rising, and `position_mm` (n, d)."""

    time_s: FloatArray
    position_mm: FloatArray


def aimed(target_mm: FloatArray, selected_mm: FloatArray, left_mm: FloatArray, pause_s: FloatArray) -> Aimed:
    """The movements of successive trials: targets, selections, and where each trial was left, all (n, d).

    The axis of a movement goes from the previous target to its own (ISO 9241-411). The first movement of a session, and
    one whose target is where the previous one was, have none. `pause_s` (n,) is the time between the previous trial and
    this one; after more than 1 s it is unknown where the movement began. A missing coordinate is NaN; an axis on which
    the target has no coordinate does not count.
    """
    before, left = previous(target_mm), previous(left_mm)
    counts = ~np.isnan(target_mm)

    def between(begin: FloatArray, end: FloatArray) -> FloatArray:
        return np.where(counts, end - begin, 0.0)

    axis, off, moved = between(before, target_mm), between(target_mm, selected_mm), between(left, selected_mm)
    amplitude = np.linalg.norm(axis, axis=1)
    amplitude = np.where(np.isfinite(amplitude) & (amplitude > 0), amplitude, np.nan)
    unit = axis / amplitude[:, None]
    along = np.sum(off * unit, axis=1)
    covered = np.where(pause_s <= PAUSE_MAX_S, np.sum(moved * unit, axis=1), np.nan)
    return Aimed(amplitude, covered, along)


def previous(values: FloatArray) -> FloatArray:
    """Each row's (n, …) predecessor; the first has NaN."""
    return np.concatenate([np.full_like(values[:1], np.nan), values[:-1]])


def throughputs(
    amplitude_mm: FloatArray,
    moved_mm: FloatArray,
    along_mm: FloatArray,
    duration_s: FloatArray,
    width_mm: FloatArray | None = None,
) -> FloatArray:
    """Throughput in bit/s of each sequence: movements (n,) of one nominal amplitude and width, at least five.

    The effective index of difficulty over the mean movement time (ISO 9241-411; Soukoreff and MacKenzie 2004,
    equations 2 to 5). A sequence without spread, distance or time has no throughput.
    """
    known = np.isfinite(np.column_stack([amplitude_mm, moved_mm, along_mm, duration_s])).all(axis=1)
    moved, along, duration = moved_mm[known], along_mm[known], duration_s[known]
    width = np.full(len(amplitude_mm), np.nan) if width_mm is None else width_mm
    blocks = [
        fitts.effective(moved[rows], along[rows], duration[rows], [""] * len(rows))
        for rows in sequences(amplitude_mm[known], width[known])
    ]
    return np.concatenate([np.empty(0), *(block.difficulty / block.time_s for block in blocks)])


def sequences(amplitude_mm: FloatArray, width_mm: FloatArray) -> list[npt.NDArray[np.intp]]:
    """The rows of each sequence of movements (n,): one width of the target, and amplitudes within 10 % of one.

    Widths that are not known, NaN, count as one.
    """
    found = []
    for width in np.unique(width_mm):
        own = np.flatnonzero(np.isnan(width_mm) if np.isnan(width) else width_mm == width)
        found += [own[rows] for rows in _of_one_amplitude(amplitude_mm[own])]
    return found


def _of_one_amplitude(amplitude_mm: FloatArray) -> list[npt.NDArray[np.intp]]:
    """The rows of each sequence: the largest set of amplitudes within 10 % of one, then the largest of the others."""
    order = np.argsort(amplitude_mm, kind="stable")
    found = []
    while len(order):
        left = amplitude_mm[order]
        until = np.searchsorted(left, left * _NOMINAL * (1 + _ROUND_OFF), side="right")
        first = int(np.argmax(until - np.arange(len(left))))
        if until[first] - first < SEQUENCE_MIN:
            break
        found.append(order[first : until[first]])
        order = np.delete(order, np.s_[first : until[first]])
    return found


def smoothed(time_s: FloatArray, position_mm: FloatArray) -> list[Path]:
    """The hand's paths, low-passed at 5 Hz, one for each stretch without a gap over 0.2 s; from (n,) s and (n, d) mm.

    By a second-order Butterworth filter at 100 Hz, applied forwards and backwards and so without phase, whose cut-off
    is corrected for the two passes (Winter 2009, Biomechanics and Motor Control of Human Movement, section 3.4.4.2).
    """
    from scipy.signal import sosfiltfilt

    time_s, first = np.unique(time_s, return_index=True)
    found = []
    for rows in np.split(np.arange(len(time_s)), np.flatnonzero(np.diff(time_s) > GAP_S) + 1):
        if len(rows) < 2 or time_s[rows[-1]] - time_s[rows[0]] < 2 * _STEP_S:
            continue
        grid = np.arange(time_s[rows[0]], time_s[rows[-1]] + _STEP_S / 2, _STEP_S)
        values = position_mm[first[rows]]
        even = np.column_stack([np.interp(grid, time_s[rows], values[:, axis]) for axis in range(values.shape[1])])
        found.append(Path(grid, sosfiltfilt(_low_pass(), even, axis=0, padlen=min(_SETTLING, len(grid) - 1))))
    return found


@cache
def _low_pass() -> FloatArray:
    """The filter's second-order sections, with the cut-off that leaves 5 Hz after two passes."""
    from scipy.signal import butter

    corrected_hz = CUTOFF_HZ / (2 ** (1 / _PASSES) - 1) ** 0.25
    sections: FloatArray = butter(2, corrected_hz, fs=1 / _STEP_S, output="sos")
    return sections


def between(paths: list[Path], begin_s: float, end_s: float) -> Path | None:
    """The path from one instant (s) to another; None where there is a gap over 0.2 s in it or at its ends."""
    for path in paths:
        begin, end = max(begin_s, float(path.time_s[0])), min(end_s, float(path.time_s[-1]))
        if begin - begin_s <= GAP_S and end_s - end <= GAP_S and begin < end:
            inside = path.time_s[(path.time_s > begin) & (path.time_s < end)]
            time = np.concatenate([[begin], inside, [end]])
            position = [np.interp(time, path.time_s, values) for values in path.position_mm.T]
            return Path(time, np.column_stack(position))
    return None


def length_mm(points_mm: FloatArray) -> float:
    """The length of a line through points (n, d)."""
    return float(np.linalg.norm(np.diff(points_mm, axis=0), axis=1).sum())


def route(line_mm: FloatArray, begin_mm: FloatArray, end_mm: FloatArray) -> FloatArray:
    """The part (k, d) of a line (n, d) between its points nearest to `begin_mm` (d,) and to `end_mm` (d,)."""
    (leg, share), (last, end_share) = _place(line_mm, begin_mm), _place(line_mm, end_mm)
    if (leg, share) > (last, end_share):
        return route(line_mm, end_mm, begin_mm)[::-1]
    first, final = _point(line_mm, leg, share), _point(line_mm, last, end_share)
    return np.vstack([first, line_mm[leg + 1 : last + 1], final])


def _place(line_mm: FloatArray, point_mm: FloatArray) -> tuple[int, float]:
    """The line's leg that is nearest to a point (the first, if several are), and the share of the leg before it."""
    begin, leg = line_mm[:-1], np.diff(line_mm, axis=0)
    square = np.maximum(np.sum(leg**2, axis=1), np.finfo(float).tiny)
    share = np.clip(np.sum((point_mm - begin) * leg, axis=1) / square, 0.0, 1.0)
    apart = np.linalg.norm(begin + share[:, None] * leg - point_mm, axis=1)
    nearest = int(np.argmin(apart))
    return nearest, float(share[nearest])


def _point(line_mm: FloatArray, leg: int, share: float) -> FloatArray:
    point: FloatArray = line_mm[leg] + share * (line_mm[leg + 1] - line_mm[leg])
    return point


def overshoot_mm(position_mm: FloatArray, route_mm: FloatArray) -> float:
    """How far the hand (n, d) was beyond the end of a route (k, d), along its last leg; 0 if never, NaN without a leg.

    If the route has several legs, only positions after the hand was nearest to the begin of the last leg count.
    """
    distinct = np.concatenate([[True], np.linalg.norm(np.diff(route_mm, axis=0), axis=1) > _ROUND_OFF])
    points = route_mm[distinct]
    if len(points) < 2:
        return np.nan
    leg = points[-1] - points[-2]
    since = int(np.argmin(np.linalg.norm(position_mm - points[-2], axis=1))) if len(points) > 2 else 0
    beyond = (position_mm[since:] - points[-1]) @ (leg / np.linalg.norm(leg))
    return max(0.0, float(beyond.max()))


def corrections(path: Path) -> int:
    """How many submovements follow the first: local maxima of speed, less one (Meyer et al. 1988).

    A maximum counts above 20 mm/s that stands out by 10 % of the peak speed.
    """
    from scipy.signal import find_peaks

    if len(path.time_s) < 3:
        return 0
    step = np.linalg.norm(np.diff(path.position_mm, axis=0), axis=1)
    duration = np.diff(path.time_s)
    speed = np.divide(step, duration, out=np.zeros_like(step), where=duration > _STEP_S * _ROUND_OFF)
    peaks, _ = find_peaks(speed, height=_SPEED_MIN_MM_S, prominence=_PROMINENCE_MIN * float(speed.max()))
    return max(0, len(peaks) - 1)
