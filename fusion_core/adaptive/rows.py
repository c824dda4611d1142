"""The phone's readings in order of measurement, and their integrals between any two times.

A reading y of the accelerometer, in the tracker's frame, is taken for

    a = y − R b − R [f]× m − w − h y₁ − (g × h) y₂

with the bias b and mounting error m in the body's frame, the error w in the tracker's, and heading and scale (y₁, y₂):
h is the reading's horizontal part, g the unit vector up. All of it is linear in the states, so that an interval's
integrals of y, R and R [f]× hold everything; h follows from y. Between readings everything is taken for straight lines.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive.layout import (
    ARM,
    AT_LARGEST,
    BIAS,
    CLIPPED,
    CROSSED,
    FELT,
    KNOWS_ARM,
    LARGEST,
    MOUNTING,
    OFFSET,
    ORIENTED,
    ROWS,
    TURN,
    TURNED,
    VALUE,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

HOLD_S = 0.05  # a reading is held no longer than that
_GAP_S = 0.03  # beyond it the hand's own jerk is what is not known between two readings
_JERK_PSD = 1e8  # mm²/s⁵, of a quick hand
_SAME_S = 1e-6
SILENT_PSD = 1e6  # mm²/s³: a hand's acceleration, about which the phone says nothing
CLIPPED_PSD = 3e7  # mm²/s³: 2 g more than is shown, for 0.04 s at each peak
_MAY_CLIP_MM_S2 = 15000.0  # accelerometers go to 2 g at least; a phone at rest shows 1 g over and over
_CLIPS_AFTER = 2  # readings as large as the largest: of a coarse one two may agree by chance
_ROUND_OFF = 1e-9


@compiled
def put_in(state: State, time: float, value: FloatArray, rotation: FloatArray, force: FloatArray, known: float) -> int:
    """A reading put in at its time; returns where, −1 if there is one of that time. There must be room."""
    count = state.count[ROWS]
    at = count
    while at > 0 and state.time[at - 1] > time:
        at -= 1
    if at > 0 and time - state.time[at - 1] < _SAME_S:
        return -1
    for to in range(count, at, -1):
        _copy_row(state, to - 1, to)
    state.time[at], state.force[at, 3], state.shown[at, :] = time, known, np.nan
    for axis in range(3):
        state.force[at, axis] = force[axis]
    _write_row(state.row[at], value, rotation, force, known)
    if known == FELT and _is_clipped(state, force):
        state.row[at, CLIPPED] = CLIPPED_PSD
    state.count[ROWS] = count + 1
    return int(at)


@compiled
def _is_clipped(state: State, force: FloatArray) -> bool:
    """Is a component the very largest there was, and not for the first times? A motion's peaks differ, a range ends."""
    largest = 0.0
    for axis in range(3):
        largest = max(largest, abs(force[axis]))
    if largest > state.fact[LARGEST] * (1.0 + _ROUND_OFF):
        state.fact[LARGEST], state.fact[AT_LARGEST] = largest, 0.0
        return False
    if largest < state.fact[LARGEST] * (1.0 - _ROUND_OFF):
        return False
    state.fact[AT_LARGEST] += 1.0
    return bool(largest > _MAY_CLIP_MM_S2 and state.fact[AT_LARGEST] >= _CLIPS_AFTER)


@compiled
def _write_row(row: FloatArray, value: FloatArray, rotation: FloatArray, force: FloatArray, known: float) -> None:
    row[:] = 0.0
    for axis in range(len(value)):
        row[VALUE + axis] = value[axis]
        x, y, z = rotation[axis, 0], rotation[axis, 1], rotation[axis, 2]
        row[TURNED + 3 * axis], row[TURNED + 3 * axis + 1], row[TURNED + 3 * axis + 2] = x, y, z
        if known == FELT:
            row[CROSSED + 3 * axis] = y * force[2] - z * force[1]
            row[CROSSED + 3 * axis + 1] = z * force[0] - x * force[2]
            row[CROSSED + 3 * axis + 2] = x * force[1] - y * force[0]


@compiled
def _copy_row(state: State, of: int, to: int) -> None:
    state.time[to], state.row[to] = state.time[of], state.row[of]
    state.force[to], state.shown[to] = state.force[of], state.shown[of]


@compiled
def let_go(state: State, first: int) -> None:
    """The rows before `first` are no longer kept."""
    count = state.count[ROWS]
    for row in range(first, count):
        _copy_row(state, row, row - first)
    state.count[ROWS] = count - first


@compiled
def row_before(state: State, time: float) -> int:
    """The newest row that is not after a time; the first if all are."""
    return _before(state.time, state.count[ROWS], time)


@compiled
def _before(times: FloatArray, count: int, time: float) -> int:
    at = max(count - 1, 0)
    while at > 0 and times[at] > time:
        at -= 1
    return at


@compiled
def integrate(times: FloatArray, values: FloatArray, begin: float, end: float, total: FloatArray) -> float:
    """First and second integrals of the columns of `values` (n, k) from `begin` to `end` into `total` (2, k).

    The first three are accelerations, which end where no reading says they go on. Returns the density, in mm²/s³, of
    what gaps leave unknown of the acceleration.
    """
    total[:] = 0.0
    count = len(times)
    if end <= begin or count == 0:
        return SILENT_PSD
    unknown, at, row = 0.0, begin, _before(times, count, begin)
    if times[row] > begin:
        row -= 1  # before the first row: −1
    while at < end:
        until = end if row + 1 >= count else min(end, times[row + 1])
        if 0 <= row < count - 1:
            unknown += _straight(times, values, row, at, until, end, total)
        else:
            unknown += _held(times, values, row, at, until, end, total)
        at = until
        row += 1
    return unknown / (end - begin)


@compiled
def _straight(
    times: FloatArray, values: FloatArray, row: int, at: float, until: float, end: float, total: FloatArray
) -> float:
    """A piece between two rows: x(s) straight, ∫x = dt (x₀ + x₁) / 2 and ∫∫x = dt² (2 x₀ + x₁) / 6."""
    begin, step = times[row], times[row + 1] - times[row]
    dt, rest = until - at, end - until
    first, last = (at - begin) / step, (until - begin) / step
    share, early = (first + last) / 2.0, (2.0 * first + last) / 3.0
    for column in range(values.shape[1]):
        here = values[row, column]
        rise = values[row + 1, column] - here
        once = dt * (here + share * rise)
        total[0, column] += once
        total[1, column] += rest * once + dt * dt / 2.0 * (here + early * rise)
    return dt * _JERK_PSD * step * step / 12.0 if step > _GAP_S else 0.0


@compiled
def _held(
    times: FloatArray, values: FloatArray, row: int, at: float, until: float, end: float, total: FloatArray
) -> float:
    """A piece before the first row or after the last: the reading held for a while, then no acceleration."""
    source = max(row, 0)
    dt, rest = until - at, end - until
    held = dt if row < 0 else min(max(times[source] + HOLD_S - at, 0.0), dt)
    for column in range(values.shape[1]):
        of = held if column < TURNED else dt  # what turns the bias goes on
        here = values[source, column]
        total[0, column] += of * here
        total[1, column] += (rest + dt - of) * of * here + of * of / 2.0 * here
    return (dt - held) * SILENT_PSD


@compiled
def between(times: FloatArray, values: FloatArray, time: float, found: FloatArray) -> None:
    """The columns of `values` (n, k) at a time, by a straight line between rows; the first or last outside."""
    if len(times) == 0:
        found[:] = 0.0
        return
    row = _before(times, len(times), time)
    following, share = min(row + 1, len(times) - 1), 0.0
    if following > row:
        share = min(max((time - times[row]) / (times[following] - times[row]), 0.0), 1.0)
    for column in range(values.shape[1]):
        found[column] = (1.0 - share) * values[row, column] + share * values[following, column]


@compiled
def corrected(state: State, first: int, dimension: int, accelerations: FloatArray, arms: FloatArray) -> None:
    """From the row `first` on: accelerations less what the input states put into them, and lever arms, (n, 3) each."""
    mean, up, level, felt = state.mean, np.zeros(3), np.zeros(3), False
    if dimension == 3 and len(accelerations) > 0:
        newest = state.count[ROWS] - 1
        felt = state.force[newest, 3] == FELT
        _upward(state, newest, up)
    for row in range(len(accelerations)):
        own = state.row[first + row]
        turned = state.count[KNOWS_ARM] and state.force[first + row, 3] >= ORIENTED
        for axis in range(3):
            total, arm = own[VALUE + axis] - mean[OFFSET + axis], 0.0
            for part in range(3):
                share = own[TURNED + 3 * axis + part]
                arm += share * mean[ARM + part]
                total -= share * mean[BIAS + part] + own[CROSSED + 3 * axis + part] * mean[MOUNTING + part]
            accelerations[row, axis], arms[row, axis] = total, arm if turned else 0.0
        if felt:
            rise = own[VALUE] * up[0] + own[VALUE + 1] * up[1] + own[VALUE + 2] * up[2]
            for axis in range(3):
                level[axis] = own[VALUE + axis] - rise * up[axis]
            for axis in range(3):
                one, two = (axis + 1) % 3, (axis + 2) % 3
                across = up[one] * level[two] - up[two] * level[one]
                accelerations[row, axis] -= mean[TURN] * level[axis] + mean[TURN + 1] * across


@compiled
def couple(state: State, total: FloatArray, span: float, dimension: int, coupling: FloatArray) -> None:
    """How far each input state enters an integral (ROW,) of the accelerations, into `coupling` (3, INPUTS).

    `span` is the same integral of 1: the duration, or half its square.
    """
    coupling[:] = 0.0
    for axis in range(3):
        for column in range(3):
            coupling[axis, column] = total[TURNED + 3 * axis + column]
            coupling[axis, MOUNTING - BIAS + column] = total[CROSSED + 3 * axis + column]
        coupling[axis, OFFSET - BIAS + axis] = span
    newest = state.count[ROWS] - 1
    if dimension < 3 or newest < 0 or state.force[newest, 3] != FELT:
        return  # without all three axes there is no telling which way is up
    up, level = np.empty(3), np.empty(3)
    _upward(state, newest, up)
    rise = total[0] * up[0] + total[1] * up[1] + total[2] * up[2]
    for axis in range(3):
        level[axis] = total[axis] - rise * up[axis]
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        coupling[axis, TURN - BIAS] = level[axis]
        coupling[axis, TURN - BIAS + 1] = up[one] * level[two] - up[two] * level[one]


@compiled
def _upward(state: State, row: int, up: FloatArray) -> None:
    """Against gravity, which was added to R f to make the row's acceleration; zeros where there was none."""
    squared = 0.0
    for axis in range(3):
        up[axis] = -state.row[row, axis]
        for column in range(3):
            up[axis] += state.row[row, TURNED + 3 * axis + column] * state.force[row, column]
        squared += up[axis] * up[axis]
    if squared > 0.0:
        up /= np.sqrt(squared)


@compiled
def turned_at(state: State, time: float, turned: FloatArray) -> bool:
    """The phone's rotation at a time into `turned` (3, 3), between rows by a straight line; false where unknown."""
    turned[:] = 0.0
    if state.count[ROWS] == 0:
        return False
    row = row_before(state, time)
    if state.force[row, 3] < ORIENTED:
        return False
    following = min(row + 1, state.count[ROWS] - 1)
    step, share = state.time[following] - state.time[row], 0.0
    if 0.0 < step < 2 * HOLD_S and state.force[following, 3] >= ORIENTED:
        share = min(max((time - state.time[row]) / step, 0.0), 1.0)
    for axis in range(3):
        for column in range(3):
            at = TURNED + 3 * axis + column
            turned[axis, column] = (1.0 - share) * state.row[row, at] + share * state.row[following, at]
    return True
