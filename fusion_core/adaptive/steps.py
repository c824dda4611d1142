"""A reading arrives: the one door for live and replay. The package's theory of operation says what a frame does."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusion_core.adaptive import bank, clock, moments, rows, shown
from fusion_core.adaptive.layout import (
    ARM,
    AT,
    BEGAN,
    CLIPPED,
    CLOCK_S,
    CLOCK_VARIANCE,
    DRIFT,
    HAS_DIFFERED,
    INPUTS,
    KNOWS_ARM,
    LAST,
    NOISE,
    NOISE_DRIFT,
    NOISE_DRIFT_S,
    PHONE_AHEAD,
    POSITION,
    ROW,
    ROWS,
    STAMP,
    STRANGE,
    STRANGE_MM,
    STRANGE_SINCE,
    TAKEN,
    TOO_LATE,
    TRUST,
    VELOCITY,
    WAITING,
    Model,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_WAIT_S = 0.05  # a frame waits so long for the phone's readings up to its time, where these are late
_SILENT_S = 0.2  # unless the phone has been silent for longer
_BACK_S = 0.12  # a frame may be measured so long before the state
_KEPT_S = 0.25  # rows are kept so long before the state, for such a frame
_JUMP_MM = 60.0  # and six SDs: no hand goes further from where it was expected
_GATE = 6.0
_RUNAWAY = 2.0  # times as far off as at first: another body stays where it is, a wrong speed runs away
_BELIEVED_AFTER_S = 1.3  # a jump that stays so long is where the hand is now
_MOST_AHEAD_S = 0.2
_AHEAD_TAKEN, _AHEAD_KEPT = 0.2, 0.9997  # of a reading that is ahead; of what is known, from reading to reading
_ROUND_OFF_S = 1e-6


@compiled
def arrive(
    model: Model,
    state: State,
    is_frame: bool,
    time: float,
    arrival: float,
    value: FloatArray,
    rotation: FloatArray,
    force: FloatArray,
    known: float,
) -> None:
    """A reading taken in. There must be room for a row."""
    newest = -1
    if is_frame:
        _queue(model, state, time, arrival, value)
    else:
        _correct_clock(state, time - arrival)
        newest = rows.put_in(state, time - state.fact[PHONE_AHEAD], value, rotation, force, known)
    before = state.fact[AT]
    _take_waiting(model, state, arrival)
    if state.count[ROWS] > 0 and state.count[TAKEN] > 0:
        oldest = state.time[state.count[ROWS] - 1] - model.history_s
        if oldest > state.fact[AT]:
            _advance(model, state, oldest)
        if newest == state.count[ROWS] - 1 and newest > 0 and before == state.fact[AT]:
            _extend_head(state)
        else:
            _rebuild_head(state)
        if newest == state.count[ROWS] - 1:
            shown.answer(model, state, state.time[newest], state.shown[newest])


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
def _queue(model: Model, state: State, time: float, arrival: float, value: FloatArray) -> None:
    """A frame among those that wait, in order of measurement."""
    if state.count[WAITING] == len(state.waiting):
        _take_first(model, state)
    at = state.count[WAITING]
    while at > 0 and state.waiting[at - 1, 0] > time:
        state.waiting[at] = state.waiting[at - 1]
        at -= 1
    state.waiting[at, 0], state.waiting[at, 1] = time, arrival
    for axis in range(model.dimension):
        state.waiting[at, 2 + axis] = value[axis]
    state.count[WAITING] += 1


@compiled
def _take_waiting(model: Model, state: State, now: float) -> None:
    """The frames that need wait no longer: the phone has said what it felt up to then, or is not going to."""
    while state.count[WAITING] > 0:
        time = state.waiting[0, 0] + state.fact[CLOCK_S]
        newest = state.time[state.count[ROWS] - 1] if state.count[ROWS] > 0 else -np.inf
        if newest < time and newest >= time - _SILENT_S and now - state.waiting[0, 1] < _WAIT_S:
            return
        _take_first(model, state)


@compiled
def _take_first(model: Model, state: State) -> None:
    """The first of the frames that wait is taken in."""
    time, value = state.waiting[0, 0], state.waiting[0, 2:].copy()
    for at in range(1, state.count[WAITING]):
        state.waiting[at - 1] = state.waiting[at]
    state.count[WAITING] -= 1
    if state.count[TAKEN] == 0:
        _begin(model, state, time, value)
    elif time + state.fact[CLOCK_S] < state.fact[AT] - _BACK_S:
        state.count[TOO_LATE] += 1
    else:
        _take_in(model, state, time, time + state.fact[CLOCK_S], value)


@compiled
def _begin(model: Model, state: State, time: float, value: FloatArray) -> None:
    """The first frame."""
    moments.begin(model.dimension, state.mean, state.covariance, model.prior, value)
    state.fact[AT], state.fact[BEGAN] = time, time
    bank.begin(model, state, value)
    clock.begin(model, state, value)
    state.fact[STAMP] = time
    state.count[TAKEN] = 1
    for axis in range(model.dimension):
        state.fact[LAST + axis] = value[axis]


@compiled
def _advance(model: Model, state: State, time: float) -> tuple[float, float, float]:
    """Everything moved to `time`; returns the duration, and what the small filters are to consider: a variance
    of positions and a density of accelerations."""
    dt = time - state.fact[AT]
    if dt <= 0.0:
        return 0.0, 0.0, 0.0
    total, coupling, net = np.zeros((2, ROW)), np.zeros((2, 3, INPUTS)), np.zeros((2, 3))
    count = state.count[ROWS]
    unknown = rows.integrate(state.time[:count], state.row[:count], state.fact[AT], time, total)
    for order in range(2):
        rows.couple(state, total[order], dt if order == 0 else dt * dt / 2.0, model.dimension, coupling[order])
        moments.inputs_of(state.mean, total[order], coupling[order], net[order])
    unknown += total[0, CLIPPED] / dt
    trust, drift, drift_s = state.fact[TRUST], state.fact[NOISE_DRIFT], state.fact[NOISE_DRIFT_S]
    moments.move(state.mean, state.covariance, dt, net, coupling, trust + unknown, model.walk)
    moments.fade(state.mean, state.covariance, dt, drift, drift_s)
    state.fact[AT] = time
    turned = np.zeros((3, 3))
    if rows.turned_at(state, time, turned) and not state.count[KNOWS_ARM]:
        state.count[KNOWS_ARM] = 1
        moments.to_phone(state.mean, state.covariance, turned)
    of_positions, of_accelerations = bank.considered(model, state, turned, coupling[0], dt)
    bank.move(model, state, dt, net, unknown + of_accelerations)
    return dt, of_positions, unknown + of_accelerations


@compiled
def _take_in(model: Model, state: State, stamp: float, time: float, value: FloatArray) -> None:
    """A frame measured at `time`, or a little before the state, if it is a measurement at all."""
    ago = max(state.fact[AT] - time, 0.0)
    dt, of_positions, of_accelerations = _advance(model, state, time)
    of_positions += _of_clock(model, state)
    state.count[TAKEN] += 1
    if not _is_news(model, state, value):
        _move_clock(model, state, stamp, value, of_accelerations, 0.0, False)
        return
    turned, of_phone = np.zeros((3, 3)), value.copy()
    if state.count[KNOWS_ARM]:
        rows.turned_at(state, time, turned)
        for axis in range(model.dimension):
            for part in range(3):
                of_phone[axis] -= turned[axis, part] * state.mean[ARM + part]
    if _is_strange(model, state, of_phone, time):
        _move_clock(model, state, stamp, value, of_accelerations, 0.0, False)
        return
    if state.count[STRANGE] > 0:
        state.count[STRANGE] = 0
        moments.begin_again(model.dimension, state.mean, state.covariance, model.prior, of_phone)
        bank.begin_again(model, state, of_phone)
        clock.begin_again(model, state, of_phone)
        state.fact[STAMP] = stamp
        return
    if ago == 0.0:
        shown.score(model, state, time, value)
        bank.take_in(model, state, of_phone, of_positions, max(dt, 1e-3))
        bank.judge(model, state)
        _move_clock(model, state, stamp, value, of_accelerations, of_positions, True)
    variance = state.fact[NOISE] + _of_clock(model, state)
    moments.correct(model.dimension, state.mean, state.covariance, ago, turned, value, variance, model.surprise)


@compiled
def _move_clock(
    model: Model, state: State, stamp: float, value: FloatArray, more_psd: float, more: float, news: bool
) -> None:
    """The tries of the tracker's clock moved to a frame's stamp, and what they say of it."""
    clock.take_in(model, state, state.fact[STAMP], stamp, value, more_psd, more, news)
    state.fact[STAMP] = max(stamp, state.fact[STAMP])
    if news:
        clock.judge(state)


@compiled
def _of_clock(model: Model, state: State) -> float:
    """How much of a position's noise comes of not knowing when it was measured."""
    squared = 0.0
    for axis in range(model.dimension):
        squared += state.mean[VELOCITY + axis] ** 2 / model.dimension
    return float(squared * state.fact[CLOCK_VARIANCE])


@compiled
def _is_news(model: Model, state: State, value: FloatArray) -> bool:
    """A tracker that has lost its target repeats the last position or says zero: no noise does that on all axes.

    Unless it never said anything else.
    """
    repeated, zero = True, True
    for axis in range(model.dimension):
        repeated &= value[axis] == state.fact[LAST + axis]
        zero &= value[axis] == 0.0
        state.fact[LAST + axis] = value[axis]
    if not (repeated or zero):
        state.count[HAS_DIFFERED] = 1
    return not (repeated or zero) or state.count[HAS_DIFFERED] == 0


@compiled
def _is_strange(model: Model, state: State, of_phone: FloatArray, time: float) -> bool:
    """Further from what was expected than a hand goes: another body's, for as long as that can be.

    Leaves the count of strange frames above zero with the first that is believed again where it is.
    """
    squared, variance = 0.0, 0.0
    for axis in range(model.dimension):
        apart = of_phone[axis] - state.mean[POSITION + axis] - state.mean[DRIFT + axis]
        squared += apart * apart
        variance += state.covariance[POSITION + axis, POSITION + axis] / model.dimension
    most = _JUMP_MM + _GATE * np.sqrt(variance + state.fact[NOISE] + state.fact[NOISE_DRIFT])
    if squared <= most * most:
        state.count[STRANGE] = 0
        return False
    if state.count[STRANGE] == 0:
        state.fact[STRANGE_SINCE], state.fact[STRANGE_MM] = time, np.sqrt(squared)
    state.count[STRANGE] += 1
    if state.count[STRANGE] > 2 and squared > (_RUNAWAY * state.fact[STRANGE_MM]) ** 2:
        return False
    return bool(time - state.fact[STRANGE_SINCE] < _BELIEVED_AFTER_S)


@compiled
def _extend_head(state: State) -> None:
    """The integrals from the state on go on to a new newest row."""
    newest = state.count[ROWS] - 1
    begin, end = max(state.time[newest - 1], state.fact[AT]), state.time[newest]
    if begin == state.fact[AT]:
        _rebuild_head(state)
        return
    dt = end - begin
    for column in range(ROW):
        first, last = state.row[newest - 1, column], state.row[newest, column]
        state.head[1, column] += dt * state.head[0, column] + dt * dt / 6.0 * (2.0 * first + last)
        state.head[0, column] += dt / 2.0 * (first + last)


@compiled
def _rebuild_head(state: State) -> None:
    count = state.count[ROWS]
    rows.integrate(state.time[:count], state.row[:count], state.fact[AT], state.time[count - 1], state.head)


@compiled
def oldest_needed(model: Model, state: State) -> int:
    """The first row that a reading may still ask for."""
    count, first = state.count[ROWS], 0
    if count > 0:
        since = state.fact[AT] - _KEPT_S if state.count[TAKEN] else state.time[count - 1] - 2.0 * model.history_s
        while first + 1 < count and state.time[first + 1] <= since:
            first += 1
    return first


@compiled
def copied(model: Model, state: State, room: State) -> None:
    """`state` into `room`, which has room for its rows, less those that are no longer needed."""
    first, count = oldest_needed(model, state), state.count[ROWS]
    kept = count - first
    room.time[:kept], room.row[:kept] = state.time[first:count], state.row[first:count]
    room.force[:kept], room.shown[:kept] = state.force[first:count], state.shown[first:count]
    room.count[:], room.fact[:], room.mean[:], room.covariance[:] = (
        state.count,
        state.fact,
        state.mean,
        state.covariance,
    )
    room.head[:], room.weight[:], room.usual[:], room.waiting[:] = state.head, state.weight, state.usual, state.waiting
    room.clock_mean[:], room.clock_covariance[:] = state.clock_mean, state.clock_covariance
    room.clock_weight[:] = state.clock_weight
    room.share[:], room.kept[:] = state.share, state.kept
    room.bank_mean[:], room.bank_covariance[:] = state.bank_mean, state.bank_covariance
    room.count[ROWS] = count - first


@compiled
def replay(
    model: Model,
    state: State,
    is_frame: npt.NDArray[np.bool_],
    time: FloatArray,
    arrival: FloatArray,
    value: FloatArray,
    rotation: FloatArray,
    force: FloatArray,
    known: FloatArray,
    times: FloatArray,
    traced: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (n, dimension) at `times`, which rise, of readings in order of arrival.

    `traced` (n, FACTS + 2 SIZE), unless it is empty, takes the facts, the mean and its SDs at each time.
    """
    mean = np.full((len(times), model.dimension), np.nan)
    sd, upcoming = mean.copy(), 0
    for index in range(len(times)):
        while upcoming < len(arrival) and arrival[upcoming] <= times[index]:
            if state.count[ROWS] == len(state.time):
                rows.let_go(state, oldest_needed(model, state))
            arrive(
                model,
                state,
                is_frame[upcoming],
                time[upcoming],
                arrival[upcoming],
                value[upcoming],
                rotation[upcoming],
                force[upcoming],
                known[upcoming],
            )
            upcoming += 1
        shown.expect(model, state, times[index], mean[index], sd[index])
        if len(traced):
            _trace(state, traced[index])
    return mean, sd


@compiled
def _trace(state: State, into: FloatArray) -> None:
    facts, size = len(state.fact), len(state.mean)
    for at in range(facts):
        into[at] = state.fact[at]
    for at in range(size):
        into[facts + at] = state.mean[at]
        into[facts + size + at] = np.sqrt(max(state.covariance[at, at], 0.0))
