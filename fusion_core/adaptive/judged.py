"""What a frame is taken for: a measurement, nothing of the hand's, or the place where the motion begins anew.

A tracker repeats itself, says zero, or follows another body for a while; a frame is then far from where the hand was
expected. The expectation can be wrong as well: accelerations beyond the phone's range send the fusion away within a
second. What positions alone expected tells the two apart. From another body they are as far, a hand they followed.

Where the fusion soon knows little, as with an orientation that is itself found from the motion, its gate widens until
another body fits. That one came by a leap from the hand, and goes on from there; by that it is told for as long.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive import bank, rows
from fusion_core.adaptive.layout import (
    AHEAD,
    ARM,
    ASTRAY,
    DRIFT,
    ELSEWHERE,
    HAS_DIFFERED,
    KNOWS_ARM,
    LAST,
    LAST_S,
    POSITION,
    SEEN,
    SEEN_S,
    SHOWN,
    STRANGE,
    STRANGE_MM,
    STRANGE_SINCE,
    Model,
    Phone,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.phone.sightings import BELIEVED_AFTER_S, FASTEST_MM_S, LEAP_SDS, LEAST_FRAME_S
from fusion_core.samples import FloatArray

NOTHING, MEASURED, BELIEVED_AGAIN = 0, 1, 2
_JUMP_MM = 60.0  # and six SDs: no hand goes further from where it was expected
_GATE = 6.0
_RUNAWAY = 2.0  # times as far off as at first: another body stays where it is, a wrong speed runs away
_NEAR = 0.5  # times as far from positions alone as from the fusion
_ASTRAY_AFTER = 3  # frames in a row: one may have been late, and the next with it


@compiled(inner=True)
def judge(
    model: Model,
    state: State,
    phone: Phone,
    time: float,
    value: FloatArray,
    turned: FloatArray,
    of_phone: FloatArray,
) -> int:
    """What a frame is to be taken for; the phone's rotation and position by it are written on the way."""
    step_mm, step_s = _since_last(model, state, value, time)
    if not _is_news(model, state, value, time):
        return NOTHING
    for axis in range(3):
        of_phone[axis] = value[axis]
    if state.count[KNOWS_ARM]:
        rows.turned_at(state, phone, time, turned)
        for axis in range(model.dimension):
            for part in range(3):
                of_phone[axis] -= turned[axis, part] * state.mean[ARM + part]
    if _is_elsewhere(model, state, of_phone, time, step_mm, step_s):
        return NOTHING
    return _verdict(model, state, time, value, of_phone)


@compiled
def _verdict(model: Model, state: State, time: float, value: FloatArray, of_phone: FloatArray) -> int:
    """What a frame that is news, and goes on from no other body's, is to be taken for."""
    if state.count[STRANGE] == 0 and _is_astray(model, state, time, value, of_phone):
        state.count[ASTRAY] += 1
        if state.count[ASTRAY] < _ASTRAY_AFTER:
            return MEASURED
        state.count[ASTRAY] = 0
        return BELIEVED_AGAIN
    state.count[ASTRAY] = 0
    if _is_strange(model, state, of_phone, value, time):
        return NOTHING
    if state.count[STRANGE] > 0:
        state.count[STRANGE] = 0
        return BELIEVED_AGAIN
    return MEASURED


@compiled
def _from_expected(model: Model, state: State, of_phone: FloatArray) -> tuple[float, float]:
    """The squared distance of a position from where the fusion expected it, and how far a hand goes at the most."""
    squared, variance = 0.0, 0.0
    for axis in range(model.dimension):
        apart = of_phone[axis] - state.mean[POSITION + axis] - state.mean[DRIFT + axis]
        squared += apart * apart
        variance += state.covariance[POSITION + axis, POSITION + axis] / model.dimension
    return squared, float(_JUMP_MM + _GATE * np.sqrt(variance + bank.noise(state)))


@compiled
def _is_astray(model: Model, state: State, time: float, value: FloatArray, of_phone: FloatArray) -> bool:
    """Far from where the fusion expected it, and near where positions alone did: the last one, where it is long ago."""
    answers, apart, lost = np.empty(SHOWN), 0.0, time - state.fact[SEEN_S] > model.history_s
    squared, most_mm = _from_expected(model, state, of_phone)
    if squared <= most_mm * most_mm:
        return False
    bank.by_positions(model, state, 0.0, answers)
    for axis in range(model.dimension):
        of_alone, of_last = of_phone[axis] - answers[AHEAD + axis], value[axis] - state.fact[SEEN + axis]
        apart += of_last**2 if lost else of_alone**2
    return apart < _NEAR**2 * squared


@compiled
def _since_last(model: Model, state: State, value: FloatArray, time: float) -> tuple[float, float]:
    """How far a frame is from the one before, in mm, and how much later it was measured."""
    squared = 0.0
    for axis in range(model.dimension):
        squared += (value[axis] - state.fact[LAST + axis]) ** 2
    return float(np.sqrt(squared)), float(time - state.fact[LAST_S])


@compiled
def _is_news(model: Model, state: State, value: FloatArray, time: float) -> bool:
    """A tracker that has lost its target repeats the last position or says zero: no noise does that on all axes.

    Unless it never said anything else.
    """
    repeated, zero = True, True
    for axis in range(model.dimension):
        repeated &= value[axis] == state.fact[LAST + axis]
        zero &= value[axis] == 0.0
        state.fact[LAST + axis] = value[axis]
    state.fact[LAST_S] = time
    if not (repeated or zero):
        state.count[HAS_DIFFERED] = 1
    return not (repeated or zero) or state.count[HAS_DIFFERED] == 0


@compiled
def _is_elsewhere(model: Model, state: State, of_phone: FloatArray, time: float, step_mm: float, step_s: float) -> bool:
    """Does a frame, so far from the one before, go on from another body's, and not from where the hand was expected?"""
    if state.count[STRANGE] == 0 or state.count[ELSEWHERE] == 0:
        return False
    squared, _ = _from_expected(model, state, of_phone)
    recent = time - state.fact[STRANGE_SINCE] < BELIEVED_AFTER_S
    has_leapt_back = step_mm > _reach(state, step_s)
    if recent and not has_leapt_back and step_mm * step_mm < squared:
        state.count[STRANGE] += 1
        return True
    state.count[ELSEWHERE] = 0
    if has_leapt_back:
        state.count[STRANGE] = 0
    return False


@compiled
def _reach(state: State, seconds: float) -> float:
    """How far two of a hand's frames can be apart."""
    return float(FASTEST_MM_S * max(seconds, LEAST_FRAME_S) + LEAP_SDS * np.sqrt(bank.noise(state)))


@compiled
def _has_leapt(model: Model, state: State, value: FloatArray, time: float) -> bool:
    """Further from where the hand was seen last than any hand goes."""
    squared = 0.0
    for axis in range(model.dimension):
        squared += (value[axis] - state.fact[SEEN + axis]) ** 2
    return bool(squared > _reach(state, time - state.fact[SEEN_S]) ** 2)


@compiled
def _is_strange(model: Model, state: State, of_phone: FloatArray, value: FloatArray, time: float) -> bool:
    """Further from what was expected than a hand goes: another body's, for as long as that can be.

    Leaves the count of strange frames above zero with the first that is believed again where it is.
    """
    squared, most_mm = _from_expected(model, state, of_phone)
    leapt = state.count[STRANGE] == 0 and _has_leapt(model, state, value, time)
    if squared <= most_mm * most_mm and not leapt:
        state.count[STRANGE] = 0
        return False
    if state.count[STRANGE] == 0:
        state.fact[STRANGE_SINCE], state.fact[STRANGE_MM] = time, np.sqrt(squared)
        state.count[ELSEWHERE] = int(leapt)
    state.count[STRANGE] += 1
    if state.count[STRANGE] > 2 and squared > (_RUNAWAY * state.fact[STRANGE_MM]) ** 2:
        return False
    return bool(time - state.fact[STRANGE_SINCE] < BELIEVED_AFTER_S)
