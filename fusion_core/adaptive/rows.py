"""The phone's readings in order of measurement, and their integrals between any two times.

A reading y of the accelerometer, in the tracker's frame, is taken for

    a = y − R b − R [f]× m − w − h y₁ − (g × h) y₂

with the bias b and mounting error m in the body's frame, the error w in the tracker's, and heading and scale (y₁, y₂):
h is the reading's horizontal part, g the unit vector up. All of it is linear in the states, so that an interval's
integrals of y, R and R [f]× hold everything; h follows from y. Between readings everything is taken for straight lines.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive import believed
from fusion_core.adaptive.layout import (
    AT_LARGEST,
    BIAS,
    CLIPPED,
    COLUMNS,
    CROSSED,
    FELT,
    FORCE,
    INPUTS,
    KNOWN,
    LARGEST,
    MOUNTING,
    OFFSET,
    ORIENTATION,
    ORIENTED,
    PHONE_AHEAD,
    READ,
    ROTATION,
    ROWS,
    SHOWN,
    SPECIFIC,
    TIME,
    TURN,
    TURNED,
    VALUE,
    Model,
    Phone,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

HOLD_S = 0.05  # a reading is held no longer than that
_GAP_S = 0.03  # beyond it the hand's own jerk is what is not known between two readings
_JERK_PSD = 1e8  # mm²/s⁵, of a quick hand
_SAME_S = 1e-6
SILENT_PSD = 1e6  # mm²/s³: a hand's acceleration, about which the phone says nothing
LONG_S = 0.35  # between two readings: from there on a straight line would be known less well than nothing
CLIPPED_PSD = 3e7  # mm²/s³: 2 g more than is shown, for 0.04 s at each peak
_MAY_CLIP_MM_S2 = 15000.0  # accelerometers go to 2 g at least; a phone at rest shows 1 g over and over
_CLIPS_AFTER = 2  # readings as large as the largest: of a coarse one two may agree by chance
_ROUND_OFF = 1e-9


@compiled(inner=True)
def put_in(model: Model, state: State, phone: Phone, reading: FloatArray) -> int:
    """A reading put in at its time; returns where, −1 if there is one of that time or its orientation is not believed.

    There must be room.
    """
    count, time = state.count[ROWS], reading[TIME] - state.fact[PHONE_AHEAD]
    at = count
    while at > 0 and phone.time[at - 1] > time:
        at -= 1
    if at > 0 and time - phone.time[at - 1] < _SAME_S:
        return -1
    if at == count and not believed.is_believed(model, state, reading):
        return -1
    for to in range(count, at, -1):
        _copy_row(phone, to - 1, to)
    for column in range(SHOWN):
        phone.shown[at, column] = np.nan
    phone.time[at] = time
    _write_row(phone.row, at, reading, model.dimension)
    if reading[ORIENTATION] == FELT and _is_clipped(state, reading):
        phone.row[at, CLIPPED] = CLIPPED_PSD
    state.count[ROWS] = count + 1
    return int(at)


@compiled
def _is_clipped(state: State, reading: FloatArray) -> bool:
    """Is a component the very largest there was, and not for the first times? A motion's peaks differ, a range ends."""
    largest = 0.0
    for axis in range(3):
        largest = max(largest, abs(reading[SPECIFIC + axis]))
    if largest > state.fact[LARGEST] * (1.0 + _ROUND_OFF):
        state.fact[LARGEST], state.fact[AT_LARGEST] = largest, 0.0
        return False
    if largest < state.fact[LARGEST] * (1.0 - _ROUND_OFF):
        return False
    state.fact[AT_LARGEST] += 1.0
    return bool(largest > _MAY_CLIP_MM_S2 and state.fact[AT_LARGEST] >= _CLIPS_AFTER)


@compiled
def _write_row(row: FloatArray, at: int, reading: FloatArray, dimension: int) -> None:
    for column in range(COLUMNS):
        row[at, column] = 0.0
    row[at, KNOWN] = reading[ORIENTATION]
    a, b, c = reading[SPECIFIC], reading[SPECIFIC + 1], reading[SPECIFIC + 2]
    row[at, FORCE], row[at, FORCE + 1], row[at, FORCE + 2] = a, b, c
    for axis in range(dimension):
        row[at, VALUE + axis] = reading[READ + axis]
        x, y, z = reading[ROTATION + 3 * axis], reading[ROTATION + 3 * axis + 1], reading[ROTATION + 3 * axis + 2]
        row[at, TURNED + 3 * axis], row[at, TURNED + 3 * axis + 1], row[at, TURNED + 3 * axis + 2] = x, y, z
        if reading[ORIENTATION] == FELT:
            row[at, CROSSED + 3 * axis] = y * c - z * b
            row[at, CROSSED + 3 * axis + 1] = z * a - x * c
            row[at, CROSSED + 3 * axis + 2] = x * b - y * a


@compiled
def _copy_row(phone: Phone, of: int, to: int) -> None:
    phone.time[to] = phone.time[of]
    for column in range(COLUMNS):
        phone.row[to, column] = phone.row[of, column]
    for column in range(SHOWN):
        phone.shown[to, column] = phone.shown[of, column]


@compiled(inner=True)
def let_go(state: State, phone: Phone, first: int) -> None:
    """The rows before `first` are no longer kept."""
    count = state.count[ROWS]
    for row in range(first, count):
        _copy_row(phone, row, row - first)
    state.count[ROWS] = count - first


@compiled(inner=True)
def row_before(phone: Phone, count: int, time: float) -> int:
    """The newest row that is not after a time; the first if all are."""
    return _before(phone.time, count, time)


@compiled
def _before(times: FloatArray, count: int, time: float) -> int:
    at = max(count - 1, 0)
    while at > 0 and times[at] > time:
        at -= 1
    return at


@compiled(inner=True)
def integrate(times: FloatArray, count: int, values: FloatArray, begin: float, end: float, total: FloatArray) -> float:
    """First and second integrals of the first k columns of `values` from `begin` to `end` into `total` (2, k).

    The first three are accelerations, which end where no reading says they go on. Returns the density, in mm²/s³, of
    what gaps leave unknown of the acceleration.
    """
    for column in range(total.shape[1]):
        total[0, column], total[1, column] = 0.0, 0.0
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
    if step > LONG_S:
        return _held(times, values, row, at, until, end, total)
    dt, rest = until - at, end - until
    first, last = (at - begin) / step, (until - begin) / step
    share, early = (first + last) / 2.0, (2.0 * first + last) / 3.0
    for column in range(total.shape[1]):
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
    """A piece before the first row, after the last or in a long gap: the reading held a while, then no acceleration."""
    source = max(row, 0)
    dt, rest = until - at, end - until
    held = dt if row < 0 else min(max(times[source] + HOLD_S - at, 0.0), dt)
    for column in range(total.shape[1]):
        here = values[source, column]
        total[0, column] += held * here
        total[1, column] += (rest + dt - held / 2.0) * held * here
    return (dt - held) * SILENT_PSD


@compiled(inner=True)
def silence(times: FloatArray, count: int, begin: float, end: float) -> float:
    """For how many seconds from `begin` to `end` no reading says how the phone was accelerated."""
    if count == 0:
        return max(end - begin, 0.0)
    row, total = _before(times, count, begin), 0.0
    while row < count and times[row] < end:
        following = times[row + 1] if row + 1 < count else np.inf
        if following - times[row] > LONG_S:
            total += max(min(following, end) - max(times[row] + HOLD_S, begin), 0.0)
        row += 1
    return total


@compiled(inner=True)
def correct(state: State, phone: Phone, first: int, dimension: int) -> None:
    """From the row `first` on: accelerations less what the input states put into them."""
    mean, up, level, felt, count = state.mean, np.zeros(3), np.zeros(3), False, state.count[ROWS]
    if dimension == 3 and count > 0:
        felt = phone.row[count - 1, KNOWN] == FELT
        _upward(phone, count - 1, up)
    for at in range(first, count):
        own = phone.row[at]
        for axis in range(3):
            total = own[VALUE + axis] - mean[OFFSET + axis]
            for part in range(3):
                total -= own[TURNED + 3 * axis + part] * mean[BIAS + part]
                total -= own[CROSSED + 3 * axis + part] * mean[MOUNTING + part]
            phone.corrected[at, axis] = total
        if felt:
            rise = own[VALUE] * up[0] + own[VALUE + 1] * up[1] + own[VALUE + 2] * up[2]
            for axis in range(3):
                level[axis] = own[VALUE + axis] - rise * up[axis]
            for axis in range(3):
                one, two = (axis + 1) % 3, (axis + 2) % 3
                across = up[one] * level[two] - up[two] * level[one]
                phone.corrected[at, axis] -= mean[TURN] * level[axis] + mean[TURN + 1] * across


@compiled(inner=True)
def couple(
    state: State, phone: Phone, total: FloatArray, order: int, span: float, dimension: int, coupling: FloatArray
) -> None:
    """How far each input state enters an integral of the accelerations, into `coupling[order]` (3, INPUTS).

    `total[order]` (ROW,) is the integral of the rows, `span` that of 1: the duration, or half its square.
    """
    for axis in range(3):
        for one in range(INPUTS):
            coupling[order, axis, one] = 0.0
        for column in range(3):
            coupling[order, axis, column] = total[order, TURNED + 3 * axis + column]
            coupling[order, axis, MOUNTING - BIAS + column] = total[order, CROSSED + 3 * axis + column]
        coupling[order, axis, OFFSET - BIAS + axis] = span
    newest = state.count[ROWS] - 1
    if dimension < 3 or newest < 0 or phone.row[newest, KNOWN] != FELT:
        return  # without all three axes there is no telling which way is up
    up, level = np.empty(3), np.empty(3)
    _upward(phone, newest, up)
    rise = total[order, 0] * up[0] + total[order, 1] * up[1] + total[order, 2] * up[2]
    for axis in range(3):
        level[axis] = total[order, axis] - rise * up[axis]
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        coupling[order, axis, TURN - BIAS] = level[axis]
        coupling[order, axis, TURN - BIAS + 1] = up[one] * level[two] - up[two] * level[one]


@compiled
def _upward(phone: Phone, row: int, up: FloatArray) -> None:
    """Against gravity, which was added to R f to make the row's acceleration; zeros where there was none."""
    own, squared = phone.row[row], 0.0
    for axis in range(3):
        up[axis] = -own[axis]
        for column in range(3):
            up[axis] += own[TURNED + 3 * axis + column] * own[FORCE + column]
        squared += up[axis] * up[axis]
    if squared > 0.0:
        for axis in range(3):
            up[axis] /= np.sqrt(squared)


@compiled(inner=True)
def turned_at(state: State, phone: Phone, time: float, turned: FloatArray) -> bool:
    """The phone's rotation at a time into `turned` (3, 3), between rows by a straight line; false where unknown."""
    count = state.count[ROWS]
    row = _before(phone.time, count, time)
    if count == 0 or phone.row[row, KNOWN] < ORIENTED:
        for axis in range(3):
            for column in range(3):
                turned[axis, column] = 0.0
        return False
    following = min(row + 1, count - 1)
    step, share = phone.time[following] - phone.time[row], 0.0
    if phone.row[following, KNOWN] >= ORIENTED:
        if step > LONG_S:
            share = 1.0  # as `steps` has turned the phone by when it speaks again
        elif 0.0 < step < 2 * HOLD_S:
            share = min(max((time - phone.time[row]) / step, 0.0), 1.0)
    for axis in range(3):
        for column in range(3):
            at = TURNED + 3 * axis + column
            turned[axis, column] = (1.0 - share) * phone.row[row, at] + share * phone.row[following, at]
    return True
