"""What is shown at a time, and how good what was shown has turned out to be.

Three answers stand beside each other: the fusion's, and what positions alone say, gone on with along their motion or
held. Whatever was shown for the time of a frame is compared with the frame once that arrives, a latency later; the
squared errors of the last seconds weigh the answers, and where errors are larger than stated, the stated SD grows by as
much.

While a hand rests, the position held is a better answer than any filter's, by a little, and a bad one as soon as the
hand moves. So the answers of positions alone are judged by frames in which it moves; of a rest only the beginning
counts, where nothing else is known.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive import bank, seen
from fusion_core.adaptive.layout import (
    AHEAD,
    ARM,
    AT,
    BIAS,
    CLIPPED,
    CLOCK_S,
    CLOCK_VARIANCE,
    DRIFT,
    ERROR,
    FUSED,
    HELD,
    INPUTS,
    KNOWN,
    KNOWS_ARM,
    MIXED,
    NEITHER,
    ORIENTED,
    POSITION,
    ROW,
    ROWS,
    SCORED,
    SHOWN,
    STATED,
    SURPRISE,
    TAKEN,
    THE_TRACKER,
    TRUST,
    TURNED,
    VELOCITY,
    Model,
    Phone,
    State,
)
from fusion_core.adaptive.moments import COAST_S, coasted, left_of_speed
from fusion_core.adaptive.rows import HOLD_S, couple, row_before
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_ANSWERS = 3
_STEADY_SD_S = 0.003  # of a phone's stamps, and of a tracker's whose latency is known
_UNKNOWN_SD_S = 0.05  # of a tracker's whose latency is not
_SCORES = 150  # over how many frames errors are averaged
_SURPRISES = 300  # and surprises, which are noisier
_ENOUGH = 60  # frames scored, before which nothing is made of it
_SHARPNESS = 20.0  # thirteen independent errors of three axes in the time that is averaged over
_DOUBT = 7.0  # log odds against the answers of positions alone
_MOST_SURPRISE = 9.0  # of one frame, three SDs: a stray one says little about the others
_LEAST_OF_NOISE = 0.2  # of the noise's variance, in positions alone: five frames averaged


@compiled(inner=True)
def fused(model: Model, state: State, phone: Phone, time: float, answers: FloatArray) -> float:
    """The fusion's position at a time, into `answers`; returns its variance, the mean over axes."""
    dimension, newest, at = model.dimension, state.count[ROWS] - 1, state.fact[AT]
    dt = max(time - at, 0.0)
    total, coupling, row = np.zeros((1, ROW)), np.zeros((1, 3, INPUTS)), np.empty(DRIFT)
    silent, held = dt, 0.0
    if newest >= 0:
        silent = max(time - max(phone.time[newest], at), 0.0)
        held = min(silent, HOLD_S)
    unheard = silent - held
    gone = held + COAST_S * (1.0 - left_of_speed(unheard))  # as if the velocity had lasted so many seconds
    if newest >= 0:
        for column in range(ROW):
            total[0, column] = state.head[1, column] + gone * state.head[0, column]
            total[0, column] += (gone - held / 2.0) * held * phone.row[newest, column]
        couple(state, phone, total, 0, dt * dt / 2.0, dimension, coupling)
    turned = newest >= 0 and state.count[KNOWS_ARM] and phone.row[newest, KNOWN] >= ORIENTED
    variance = 0.0
    for axis in range(dimension):
        for one in range(DRIFT):
            row[one] = 0.0
        row[POSITION + axis], row[VELOCITY + axis] = 1.0, dt - silent + gone
        for part in range(INPUTS):
            row[BIAS + part] = -coupling[0, axis, part]
        if turned:
            for arm in range(3):
                row[ARM + arm] = phone.row[newest, TURNED + 3 * axis + arm]
        position = total[0, axis]
        for one in range(DRIFT):
            if row[one] != 0.0:
                position += row[one] * state.mean[one]
                for other in range(DRIFT):
                    variance += row[one] * state.covariance[one, other] * row[other]
        answers[FUSED + axis] = position
    psd_dt2 = state.fact[TRUST] * dt**2 + 2.0 * total[0, CLIPPED]  # ∫∫ψ is ψ dt²/2 where ψ lasts
    return float(variance / dimension + psd_dt2 * dt / 3.0 + coasted(unheard))


@compiled(inner=True)
def answer(model: Model, state: State, phone: Phone, time: float, answers: FloatArray) -> None:
    """What is shown at a time, and what it is mixed of, as a row of `Phone.shown`."""
    for axis in range(3):
        answers[FUSED + axis] = 0.0
    own, weight = fused(model, state, phone, time, answers), np.empty(_ANSWERS)
    own = seen.draw(model, state, time, own, answers)
    bank.by_positions(model, state, max(time - state.fact[AT], 0.0), answers)
    _add_arm(state, phone, answers)
    _weights(model, state, weight)
    answers[STATED] = own * weight[0]
    for other in range(1, _ANSWERS):
        apart = state.fact[ERROR + other] - bank.noise(state)
        answers[STATED] += weight[other] * max(apart, _LEAST_OF_NOISE * bank.noise(state))
    for axis in range(3):
        answers[MIXED + axis] = weight[0] * answers[FUSED + axis]
        answers[MIXED + axis] += weight[1] * answers[AHEAD + axis] + weight[2] * answers[HELD + axis]


@compiled
def _add_arm(state: State, phone: Phone, answers: FloatArray) -> None:
    """The lever arm, as the newest row turns it, added to what positions alone say of the phone."""
    newest = state.count[ROWS] - 1
    if newest >= 0 and state.count[KNOWS_ARM] and phone.row[newest, KNOWN] >= ORIENTED:
        for axis in range(3):
            arm = 0.0
            for part in range(3):
                arm += phone.row[newest, TURNED + 3 * axis + part] * state.mean[ARM + part]
            answers[AHEAD + axis] += arm
            answers[HELD + axis] += arm


@compiled
def _weights(model: Model, state: State, weight: FloatArray) -> None:
    """The answers' weights by their squared errors: as of normal errors whose variance is what was seen.

    As many errors as were seen, in as many axes, speak.
    """
    weight[0], weight[1], weight[2] = 1.0, 0.0, 0.0
    if state.fact[SCORED] < _ENOUGH:
        return
    total, sharpness = 1.0, _SHARPNESS * min(state.fact[SCORED] / _SCORES, 1.0) * model.dimension / 3.0
    for other in range(1, _ANSWERS):
        worse = np.log(state.fact[ERROR] / max(state.fact[ERROR + other], 1e-12))
        weight[other] = np.exp(min(sharpness * worse - _DOUBT, 50.0))
        total += weight[other]
    for one in range(_ANSWERS):
        weight[one] /= total


@compiled(inner=True)
def score(model: Model, state: State, phone: Phone, time: float, position: FloatArray) -> None:
    """What was shown for `time` held against the position that has now come."""
    row, shown = row_before(phone, state.count[ROWS], time), phone.shown
    if row + 1 >= state.count[ROWS] or phone.time[row] > time:
        return
    if np.isnan(shown[row, STATED]) or np.isnan(shown[row + 1, STATED]):
        return
    share = (time - phone.time[row]) / (phone.time[row + 1] - phone.time[row])
    state.fact[SCORED] += 1.0
    newer = max(1.0 / state.fact[SCORED], 1.0 / _SCORES)
    of_positions = max(1.0 / state.fact[SCORED], _moving(model, state, shown, row, share) / _SCORES)
    for one in range(_ANSWERS + 1):
        squared = 0.0
        for axis in range(model.dimension):
            at = 3 * one + axis
            there = (1.0 - share) * shown[row, at] + share * shown[row + 1, at]
            squared += (position[axis] - there) ** 2 / model.dimension
        if one < _ANSWERS:
            state.fact[ERROR + one] += (newer if one == 0 else of_positions) * (squared - state.fact[ERROR + one])
        else:
            newer = max(1.0 / state.fact[SCORED], 1.0 / _SURPRISES)
            surprise = min(squared / (shown[row, STATED] + bank.noise(state)), _MOST_SURPRISE)
            state.fact[SURPRISE] += newer * (surprise - state.fact[SURPRISE])


@compiled
def _moving(model: Model, state: State, shown: FloatArray, row: int, share: float) -> float:
    """How far the hand moved in a latency beside the noise: 0 at rest, 1 where it went many times as far."""
    squared = 0.0
    for axis in range(model.dimension):
        ahead, held = AHEAD + axis, HELD + axis
        first, second = shown[row, ahead] - shown[row, held], shown[row + 1, ahead] - shown[row + 1, held]
        squared += ((1.0 - share) * first + share * second) ** 2 / model.dimension
    return float(squared / (squared + bank.noise(state)))


@compiled
def _of_clocks(model: Model, state: State) -> float:
    """The variance of not knowing when frames were measured, nor whose clock is wrong.

    No frame shows it, since all are off by as much. As likely as not it is the phone's; the hand is then where it was
    shown to be so much earlier or later. That is off along the motion, and one SD is stated for every axis, however
    the axes lie: so it is that along the motion.
    """
    off, squared = state.fact[CLOCK_VARIANCE], 0.0
    if model.trusted == NEITHER:
        off += 0.5 * state.fact[CLOCK_S] ** 2
    for axis in range(model.dimension):
        squared += (state.mean[VELOCITY + axis] + state.head[0, axis]) ** 2
    return float(squared * off)


@compiled
def _of_the_phone(state: State) -> float:
    """The share of what the clocks disagree by that is likely the phone's.

    Of a millisecond or two as much as the tracker's, as far as it is known at all; of a twentieth of a second nothing:
    no phone's clock is so far off as a latency that nobody has measured. As likely as not, the tracker's was.
    """
    found, squared, phone = state.fact[CLOCK_VARIANCE], state.fact[CLOCK_S] ** 2, _STEADY_SD_S**2
    known, unknown = phone + _STEADY_SD_S**2 + found, phone + _UNKNOWN_SD_S**2 + found
    likely, other = np.exp(-0.5 * squared / known) / np.sqrt(known), np.exp(-0.5 * squared / unknown) / np.sqrt(unknown)
    return float(phone * (likely / known + other / unknown) / (likely + other))


@compiled(inner=True)
def expect(model: Model, state: State, phone: Phone, time: float, mean: FloatArray, sd: FloatArray, at: int) -> None:
    """Position and SD at a time, into row `at` of `mean` and `sd`; NaN before the first position."""
    if state.count[TAKEN] == 0:
        for axis in range(model.dimension):
            mean[at, axis], sd[at, axis] = np.nan, np.nan
        return
    if model.trusted == THE_TRACKER:
        time += state.fact[CLOCK_S]
    elif model.trusted == NEITHER:
        time += _of_the_phone(state) * state.fact[CLOCK_S]
    answers = np.empty(SHOWN)
    answer(model, state, phone, time, answers)
    variance = answers[STATED]
    if state.fact[SCORED] >= _ENOUGH and state.fact[SURPRISE] > 1.0:
        variance += (state.fact[SURPRISE] - 1.0) * (variance + bank.noise(state))
    variance += _of_clocks(model, state)
    for axis in range(model.dimension):
        mean[at, axis], sd[at, axis] = answers[MIXED + axis], np.sqrt(variance)
