"""A reading arrives. The package's theory of operation says what a frame does.

Each function of any size is called from one place only, and the two largest become part of their caller
(`inline="always"`): LLVM optimises whatever a function calls once more with it.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive import bank, clock, judged, moments, rows, seen, shown
from fusion_core.adaptive.layout import (
    ARRIVAL,
    AT,
    BEGAN,
    CLIPPED,
    CLOCK_S,
    CLOCK_VARIANCE,
    FACTS,
    INPUTS,
    IS_FRAME,
    KNOWN,
    KNOWS_ARM,
    LAST,
    LAST_S,
    MOST_WAITING,
    NOISE,
    NOISE_DRIFT,
    NOISE_DRIFT_S,
    ORIENTED,
    PHONE_AHEAD,
    READ,
    ROW,
    ROWS,
    SIZE,
    STAMP,
    TAKEN,
    TIME,
    TOO_LATE,
    TRUST,
    TURNED,
    UNSURE,
    VELOCITY,
    WAITING,
    Model,
    Phone,
    Records,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_WAIT_S = 0.05  # a frame waits so long for the phone's readings up to its time, where these are late
_SILENT_S = 0.2  # unless the phone has been silent for longer
_BACK_S = 0.12  # a frame may be measured so long before the state
_KEPT_S = 0.25  # rows are kept so long before the state, for such a frame
_MOST_AHEAD_S = 0.2
_AHEAD_TAKEN, _AHEAD_KEPT = 0.2, 0.9997  # of a reading that is ahead; of what is known, from reading to reading
_ROUND_OFF_S = 1e-6


@compiled
def go_through(
    models: Records,
    states: Records,
    phone: Phone,
    readings: FloatArray,
    times: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
    traced: FloatArray,
) -> None:
    """All `readings` (n, READING), in order of arrival, taken in; `mean` and `sd` (m, d) written at `times`.

    The one door for live and replay: a live step has one reading and no time, or one time and no reading. Times rise.
    `traced` (m, FACTS + 2 SIZE), unless it is empty, takes the facts, the mean and its SDs at each time.
    """
    model, state, upcoming, index = models[0], states[0], 0, 0
    while upcoming < len(readings) or index < len(times):
        if upcoming < len(readings) and (index == len(times) or readings[upcoming, ARRIVAL] <= times[index]):
            if state.count[ROWS] == len(phone.time):
                rows.let_go(state, phone, oldest_needed(models, states, phone))
            _arrive(model, state, phone, readings[upcoming])
            upcoming += 1
        else:
            shown.expect(model, state, phone, times[index], mean, sd, index)
            if len(traced):
                _trace(state, traced[index])
            index += 1


@compiled(inline="always")
def _arrive(model: Model, state: State, phone: Phone, reading: FloatArray) -> None:
    """A reading taken in. There must be room for a row."""
    newest = -1
    if reading[IS_FRAME] > 0.0:
        _queue(state, reading)
    else:
        _correct_clock(state, reading[TIME] - reading[ARRIVAL])
        newest = rows.put_in(model, state, phone, reading)
    before = state.fact[AT]
    while _is_due(state, phone, reading[ARRIVAL]):
        _take_first(model, state, phone)
    count = state.count[ROWS]
    if count > 0 and state.count[TAKEN] > 0:
        oldest = phone.time[count - 1] - model.history_s
        speaks_again = newest == count - 1 and newest > 0 and phone.time[newest] - phone.time[newest - 1] > rows.LONG_S
        if speaks_again:
            oldest = phone.time[newest]  # no silence lies in the head: it takes a speed to last
        if oldest > state.fact[AT]:
            _advance(model, state, phone, oldest)
        if speaks_again:
            _turn(model, state, phone, newest)
        extends = newest == count - 1 and newest > 0 and before == state.fact[AT] and phone.time[newest - 1] > before
        if extends:
            _extend_head(state, phone)
        else:
            rows.integrate(phone.time, count, phone.row, state.fact[AT], phone.time[count - 1], state.head)
        if newest == count - 1:
            shown.answer(model, state, phone, phone.time[newest], phone.shown[newest])


@compiled
def _to_phone(model: Model, state: State, turned: FloatArray) -> None:
    """All filters from the tracked point to the phone: p − R r, with the rotation or by how much it has changed."""
    bank.to_phone(model, state, turned)
    moments.to_phone(state, turned)
    clock.to_phone(state, turned)


@compiled
def _turn(model: Model, state: State, phone: Phone, row: int) -> None:
    """The phone has turned while it was silent: the tracked point is where it was thought to be, the phone is not."""
    turn = np.empty((3, 3))
    for axis in range(3):
        for part in range(3):
            at = TURNED + 3 * axis + part
            turn[axis, part] = phone.row[row, at] - phone.row[row - 1, at]
    if state.count[KNOWS_ARM] and min(phone.row[row, KNOWN], phone.row[row - 1, KNOWN]) >= ORIENTED:
        _to_phone(model, state, turn)


@compiled
def _correct_clock(state: State, ahead_s: float) -> None:
    """No reading was measured after it arrived: a phone's stamps that say so are taken back by as much.

    Bit by bit, and forgotten again in time, so that one wrong stamp does not last.
    """
    ahead = state.fact[PHONE_AHEAD] * _AHEAD_KEPT
    if ahead_s > ahead + _ROUND_OFF_S:
        ahead += _AHEAD_TAKEN * (min(ahead_s, _MOST_AHEAD_S) - ahead)
    state.fact[PHONE_AHEAD] = ahead


@compiled
def _queue(state: State, reading: FloatArray) -> None:
    """A frame among those that wait, in order of measurement. There is room for one more than may wait."""
    at, waiting = state.count[WAITING], state.waiting
    while at > 0 and waiting[at - 1, 0] > reading[TIME]:
        for column in range(5):
            waiting[at, column] = waiting[at - 1, column]
        at -= 1
    waiting[at, 0], waiting[at, 1] = reading[TIME], reading[ARRIVAL]
    for axis in range(3):
        waiting[at, 2 + axis] = reading[READ + axis]
    state.count[WAITING] += 1


@compiled
def _is_due(state: State, phone: Phone, now: float) -> bool:
    """Need the first frame wait no longer? The phone has said what it felt up to then, or is not going to."""
    if state.count[WAITING] == 0 or state.count[WAITING] > MOST_WAITING:
        return bool(state.count[WAITING] > 0)
    time = state.waiting[0, 0] + state.fact[CLOCK_S]
    newest = phone.time[state.count[ROWS] - 1] if state.count[ROWS] > 0 else -np.inf
    return bool(newest >= time or newest < time - _SILENT_S or now - state.waiting[0, 1] >= _WAIT_S)


@compiled(inline="always")
def _take_first(model: Model, state: State, phone: Phone) -> None:
    """The first of the frames that wait is taken in."""
    stamp, value, waiting = state.waiting[0, 0], np.empty(3), state.waiting
    for axis in range(3):
        value[axis] = waiting[0, 2 + axis]
    state.count[WAITING] -= 1
    for at in range(state.count[WAITING]):
        for column in range(5):
            waiting[at, column] = waiting[at + 1, column]
    if state.count[TAKEN] == 0:
        _begin(model, state, stamp, value)
    elif stamp + state.fact[CLOCK_S] < state.fact[AT] - _BACK_S:
        state.count[TOO_LATE] += 1
    else:
        _take_in(model, state, phone, stamp, value)


@compiled
def _begin(model: Model, state: State, time: float, value: FloatArray) -> None:
    """The first frame."""
    moments.begin(model, state, value)
    state.fact[AT], state.fact[BEGAN], state.fact[LAST_S] = time, time, time
    bank.begin(model, state, value)
    clock.begin(model, state, value)
    state.fact[STAMP] = time
    state.count[TAKEN] = 1
    seen.see(model, state, time, value)
    for axis in range(3):
        state.fact[LAST + axis] = value[axis]


@compiled
def _advance(model: Model, state: State, phone: Phone, time: float) -> tuple[float, float]:
    """Everything moved to `time`; returns the duration, and the variance of positions that the bank is to consider."""
    dt = time - state.fact[AT]
    if dt <= 0.0:
        return 0.0, 0.0
    total, coupling, net = np.empty((2, ROW)), np.empty((2, 3, INPUTS)), np.empty((2, 3))
    unknown = rows.integrate(phone.time, state.count[ROWS], phone.row, state.fact[AT], time, total)
    for order in range(2):
        rows.couple(state, phone, total, order, dt if order == 0 else dt * dt / 2.0, model.dimension, coupling)
    moments.inputs_of(state, total, coupling, net)
    unknown += total[0, CLIPPED] / dt
    silent = rows.silence(phone.time, state.count[ROWS], state.fact[AT], time)
    heard = unknown - rows.SILENT_PSD * silent / dt
    moments.move(model, state, dt, net, coupling, state.fact[TRUST] + heard)
    if silent > 0.0:
        moments.coast(state, silent)
    moments.fade(state, dt, state.fact[NOISE_DRIFT], state.fact[NOISE_DRIFT_S])
    state.fact[AT] = time
    turned = np.empty((3, 3))
    if rows.turned_at(state, phone, time, turned) and not state.count[KNOWS_ARM]:
        state.count[KNOWS_ARM] = 1
        _to_phone(model, state, turned)
    of_positions, of_accelerations = bank.considered(model, state, turned, coupling, dt)
    bank.move(model, state, dt, net, unknown + of_accelerations)
    state.fact[UNSURE] += dt * (unknown + of_accelerations)
    return dt, of_positions


@compiled
def _take_in(model: Model, state: State, phone: Phone, stamp: float, value: FloatArray) -> None:
    """A frame taken in, measured at its stamp by the tracker's clock, if it is a measurement at all."""
    time = stamp + state.fact[CLOCK_S]
    ago = max(state.fact[AT] - time, 0.0)
    dt, of_positions = _advance(model, state, phone, time)
    of_positions += _of_clock(model, state)
    state.count[TAKEN] += 1
    turned, of_phone = np.zeros((3, 3)), np.empty(3)
    verdict = judged.judge(model, state, phone, time, value, turned, of_phone)
    if verdict == judged.BELIEVED_AGAIN:
        moments.begin_again(model, state, of_phone)
        bank.begin_again(model, state, of_phone)
        clock.begin_again(model, state, value, turned)
        state.fact[STAMP] = stamp
        return
    news = 1 if verdict == judged.MEASURED and ago == 0.0 else 0
    if news:
        shown.score(model, state, phone, time, value)
        bank.take_in(model, state, of_phone, of_positions, max(dt, 1e-3))
        bank.judge(model, state)
    if news or verdict == judged.NOTHING:
        clock.take_in(model, state, phone, stamp, value, turned, news)
    if verdict == judged.MEASURED:
        moments.correct(model, state, ago, turned, value, state.fact[NOISE] + _of_clock(model, state))
        seen.see(model, state, time, value)


@compiled
def _of_clock(model: Model, state: State) -> float:
    """How much of a position's noise comes of not knowing when it was measured."""
    squared = 0.0
    for axis in range(model.dimension):
        squared += state.mean[VELOCITY + axis] ** 2 / model.dimension
    return float(squared * state.fact[CLOCK_VARIANCE])


@compiled
def _extend_head(state: State, phone: Phone) -> None:
    """The integrals from the state on go on to a new newest row."""
    newest = state.count[ROWS] - 1
    dt = phone.time[newest] - phone.time[newest - 1]
    for column in range(ROW):
        first, last = phone.row[newest - 1, column], phone.row[newest, column]
        state.head[1, column] += dt * state.head[0, column] + dt * dt / 6.0 * (2.0 * first + last)
        state.head[0, column] += dt / 2.0 * (first + last)


@compiled
def oldest_needed(models: Records, states: Records, phone: Phone) -> int:
    """The first row that a reading may still ask for."""
    model, state = models[0], states[0]
    count, first = state.count[ROWS], 0
    if count > 0:
        since = state.fact[AT] - _KEPT_S if state.count[TAKEN] else phone.time[count - 1] - 2.0 * model.history_s
        while first + 1 < count and phone.time[first + 1] <= since:
            first += 1
    return first


@compiled
def _trace(state: State, into: FloatArray) -> None:
    for at in range(FACTS):
        into[at] = state.fact[at]
    for at in range(SIZE):
        into[FACTS + at] = state.mean[at]
        into[FACTS + SIZE + at] = np.sqrt(max(state.covariance[at, at], 0.0))
