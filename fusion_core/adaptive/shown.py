"""What is shown at a time, and how good what was shown has turned out to be.

Three answers stand beside each other: the fusion's, and what positions alone say, gone on with along their motion or
held. Whatever was shown for the time of a frame is compared with the frame once that arrives, a latency later; the
squared errors of the last seconds weigh the answers (in all ordinary cases that is the fusion alone), and where errors
are larger than stated, the stated SD grows by as much.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive import bank
from fusion_core.adaptive.layout import (
    AHEAD,
    ARM,
    AT,
    BIAS,
    CLIPPED,
    DRIFT,
    ERROR,
    FUSED,
    HELD,
    INPUTS,
    KNOWS_ARM,
    MIXED,
    NOISE,
    NOISE_DRIFT,
    ORIENTED,
    POSITION,
    ROW,
    ROWS,
    SCORED,
    SHOWN,
    STATED,
    SURPRISE,
    TAKEN,
    TRUST,
    TURNED,
    VELOCITY,
    Model,
    State,
)
from fusion_core.adaptive.rows import HOLD_S, SILENT_PSD, couple, row_before
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_ANSWERS = 3
_SCORES = 150  # over how many frames errors are averaged
_SURPRISES = 300  # and surprises, which are noisier
_ENOUGH = 60  # frames scored, before which nothing is made of it
_SHARPNESS = 20.0  # ten independent errors of three axes in the time that is averaged over
_DOUBT = 3.0  # log odds against the answers of positions alone
_MOST_SURPRISE = 9.0  # of one frame, three SDs: a stray one says little about the others
_LEAST_OF_NOISE = 0.2  # of the noise's variance, in positions alone: five frames averaged


@compiled
def fused(model: Model, state: State, time: float, position: FloatArray) -> float:
    """The fusion's position (3,) at a time; returns its variance, the mean over axes."""
    dimension, newest, at = model.dimension, state.count[ROWS] - 1, state.fact[AT]
    dt = max(time - at, 0.0)
    total, coupling, row = np.zeros(ROW), np.zeros((3, INPUTS)), np.zeros(POSITION + ARM + 3)
    silent, turned = dt, np.zeros((3, 3))
    if newest >= 0:
        silent = max(time - max(state.time[newest], at), 0.0)
        held = min(silent, HOLD_S)
        for column in range(ROW):
            of = held if column < TURNED else silent
            total[column] = state.head[1, column] + silent * state.head[0, column]
            total[column] += (silent - of / 2.0) * of * state.row[newest, column]
        couple(state, total, dt * dt / 2.0, dimension, coupling)
        if state.count[KNOWS_ARM] and state.force[newest, 3] >= ORIENTED:
            for axis in range(3):
                for arm in range(3):
                    turned[axis, arm] = state.row[newest, TURNED + 3 * axis + arm]
    variance = 0.0
    for axis in range(dimension):
        row[:] = 0.0
        row[POSITION + axis], row[VELOCITY + axis] = 1.0, dt
        for part in range(INPUTS):
            row[BIAS + part] = -coupling[axis, part]
        for arm in range(3):
            row[ARM + arm] = turned[axis, arm]
        position[axis] = total[axis]
        for one in range(DRIFT):
            if row[one] != 0.0:
                position[axis] += row[one] * state.mean[one]
                for other in range(DRIFT):
                    variance += row[one] * state.covariance[one, other] * row[other]
    psd_dt2 = state.fact[TRUST] * dt**2 + 2.0 * total[CLIPPED]  # ∫∫ψ is ψ dt²/2 where ψ lasts
    of_silence = SILENT_PSD * max(silent - HOLD_S, 0.0) ** 3 / 3.0
    return float(variance / dimension + psd_dt2 * dt / 3.0 + of_silence)


@compiled
def answer(model: Model, state: State, time: float, answers: FloatArray) -> None:
    """What is shown at a time, and what it is mixed of, as a row of `State.shown`."""
    position, turned = np.zeros(3), np.zeros(3)
    answers[STATED] = fused(model, state, time, position)
    ahead, held, weight = np.zeros(3), np.zeros(3), np.empty(_ANSWERS)
    bank.by_positions(model, state, max(time - state.fact[AT], 0.0), ahead, held)
    _arm(state, turned)
    _weights(state, weight)
    answers[STATED] *= weight[0]
    for other in range(1, _ANSWERS):
        seen = state.fact[ERROR + other] - _noise(state)
        answers[STATED] += weight[other] * max(seen, _LEAST_OF_NOISE * _noise(state))
    for axis in range(3):
        answers[FUSED + axis] = position[axis]
        answers[AHEAD + axis], answers[HELD + axis] = ahead[axis] + turned[axis], held[axis] + turned[axis]
        answers[MIXED + axis] = weight[0] * position[axis]
        answers[MIXED + axis] += weight[1] * answers[AHEAD + axis] + weight[2] * answers[HELD + axis]


@compiled
def _arm(state: State, arm: FloatArray) -> None:
    """The lever arm as the newest row turns it."""
    newest = state.count[ROWS] - 1
    if newest >= 0 and state.count[KNOWS_ARM] and state.force[newest, 3] >= ORIENTED:
        for axis in range(3):
            for part in range(3):
                arm[axis] += state.row[newest, TURNED + 3 * axis + part] * state.mean[ARM + part]


@compiled
def _weights(state: State, weight: FloatArray) -> None:
    """The answers' weights by their squared errors: as of normal errors whose variance is what was seen."""
    weight[0], weight[1], weight[2] = 1.0, 0.0, 0.0
    if state.fact[SCORED] < _ENOUGH:
        return
    total = 1.0
    for other in range(1, _ANSWERS):
        worse = np.log(state.fact[ERROR] / max(state.fact[ERROR + other], 1e-12))
        weight[other] = np.exp(min(_SHARPNESS * worse - _DOUBT, 50.0))
        total += weight[other]
    for one in range(_ANSWERS):
        weight[one] /= total


@compiled
def score(model: Model, state: State, time: float, position: FloatArray) -> None:
    """What was shown for `time` held against the position that has now come."""
    row = row_before(state, time)
    if row + 1 >= state.count[ROWS] or state.time[row] > time:
        return
    share = (time - state.time[row]) / (state.time[row + 1] - state.time[row])
    before, after = state.shown[row], state.shown[row + 1]
    if np.isnan(before[STATED]) or np.isnan(after[STATED]):
        return
    state.fact[SCORED] += 1.0
    shares = max(1.0 / state.fact[SCORED], 1.0 / _SCORES), max(1.0 / state.fact[SCORED], 1.0 / _SURPRISES)
    for one in range(_ANSWERS + 1):
        squared = 0.0
        for axis in range(model.dimension):
            shown = (1.0 - share) * before[3 * one + axis] + share * after[3 * one + axis]
            squared += (position[axis] - shown) ** 2 / model.dimension
        if one < _ANSWERS:
            state.fact[ERROR + one] += shares[0] * (squared - state.fact[ERROR + one])
        else:
            expected = before[STATED] + _noise(state)
            surprise = min(squared / expected, _MOST_SURPRISE)
            state.fact[SURPRISE] += shares[1] * (surprise - state.fact[SURPRISE])


@compiled
def _noise(state: State) -> float:
    """The variance of a position's noise, as found."""
    return float(state.fact[NOISE] + state.fact[NOISE_DRIFT])


@compiled
def expect(model: Model, state: State, time: float, mean: FloatArray, sd: FloatArray) -> None:
    """Position and SD at a time, (d,) each; NaN before the first position."""
    if state.count[TAKEN] == 0:
        mean[:], sd[:] = np.nan, np.nan
        return
    answers = np.empty(SHOWN)
    answer(model, state, time, answers)
    variance = answers[STATED]
    if state.fact[SCORED] >= _ENOUGH and state.fact[SURPRISE] > 1.0:
        variance += (state.fact[SURPRISE] - 1.0) * (variance + _noise(state))
    for axis in range(model.dimension):
        mean[axis], sd[axis] = answers[MIXED + axis], np.sqrt(variance)
