"""How far the tracker's clock is off: small filters that take each frame for earlier or later than its stamp says.

All have one covariance, since the same readings reach each, only elsewhere in time; they differ in their means. Their
log likelihoods, with forgetting, are a parabola about the true offset, whose vertex and bend are the offset and its SD.
A hand at rest says nothing of it; the prior then mostly believes the stated latency, or each start would be uncertain.
As a state of the large filter the offset would hang on an estimated velocity, and what is wrong with that (noise that
is heavier or longer than thought) pulls it away; a likelihood is not pulled.

Only the *difference* of the two clocks shows. The phone's is believed, unless its stamps are ahead of their arrival.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive import rows
from fusion_core.adaptive.bank import weighed
from fusion_core.adaptive.layout import (
    AT,
    BEGAN,
    CLOCK_S,
    CLOCK_VARIANCE,
    NOISE,
    NOISE_DRIFT,
    NOISE_DRIFT_S,
    OFFSETS,
    ROWS,
    STAMP,
    TRUST,
    VELOCITY,
    Model,
    Phone,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

STEP_S = 0.02  # between the offsets tried: less than the width of the likelihood of any motion but a thrust
FIRST_S = -0.14  # the tracker is later than stated by so much, at the most; and up to 60 ms earlier
_FORGET_S = 10.0  # as the bank does
_EXACT, _EXACT_SD_S = 0.7, 0.005  # so often a stated latency is right as far as any latency is constant
_PRIOR_SD_S = 0.02  # else it is right within a frame or so
_LEAST_SD_S = 0.002  # the past is forgotten so far as to leave no more certainty: a latency wanders
_RATE_SD, _RATE_PSD = 1000.0, 900.0  # of the acceleration error, as in the bank


@compiled(inner=True)
def begin(model: Model, state: State, position: FloatArray) -> None:
    """At the first position."""
    for one in range(OFFSETS):
        state.clock_weight[one] = 0.0
    begin_again(model, state, position)
    judge(state)


@compiled(inner=True)
def begin_again(model: Model, state: State, position: FloatArray) -> None:
    """The motion begins anew at a position; weights stay."""
    own, drift = state.clock_covariance, state.fact[NOISE_DRIFT]
    for row in range(4):
        for column in range(4):
            own[row, column] = 0.0
    own[0, 0], own[1, 1], own[2, 2] = state.fact[NOISE] + drift, model.prior[VELOCITY], _RATE_SD**2
    own[3, 3], own[0, 3], own[3, 0] = drift, -drift, -drift
    for one in range(OFFSETS):
        for axis in range(3):
            for row in range(4):
                state.clock_mean[one, row, axis] = 0.0
            if axis < model.dimension:
                state.clock_mean[one, 0, axis] = position[axis]


@compiled(inner=True)
def take_in(
    model: Model,
    state: State,
    phone: Phone,
    stamp: float,
    value: FloatArray,
    more_psd: float,
    more: float,
    news: int,
) -> None:
    """All moved to the stamp of a frame, each by its own offset; and with `news` the position taken in."""
    before = state.fact[STAMP]
    dt = stamp - before
    if dt > 0.0:
        state.fact[STAMP] = stamp
        apart = np.empty((OFFSETS, 3))
        _move(state, dt, more_psd)
        _move_means(model, state, phone, before, stamp, value, apart)
        if news:
            _correct(model, state, apart, more, dt)
    if news:
        judge(state)


@compiled(inner=True)
def _move_means(
    model: Model, state: State, phone: Phone, before: float, stamp: float, value: FloatArray, apart: FloatArray
) -> None:
    """The means moved from the stamp `before` to another; how far the position is from each goes into `apart`."""
    mean, net, arm, count = state.clock_mean, np.empty((2, 3)), np.empty(3), state.count[ROWS]
    dt = stamp - before
    rows.correct(state, phone, rows.row_before(phone, count, before + FIRST_S), model.dimension)
    kept = np.exp(-dt / state.fact[NOISE_DRIFT_S]) if state.fact[NOISE_DRIFT_S] > 0.0 else 0.0
    for one in range(OFFSETS):
        begin, end = before + (FIRST_S + one * STEP_S), stamp + (FIRST_S + one * STEP_S)
        rows.integrate(phone.time, count, phone.corrected, begin, end, net)
        rows.between(phone, count, end, arm)
        for axis in range(model.dimension):
            mean[one, 0, axis] += dt * mean[one, 1, axis] + dt * dt / 2.0 * mean[one, 2, axis] + net[1, axis]
            mean[one, 1, axis] += dt * mean[one, 2, axis] + net[0, axis]
            mean[one, 3, axis] *= kept
            apart[one, axis] = value[axis] - mean[one, 0, axis] - mean[one, 3, axis] - arm[axis]


@compiled(inner=True)
def _move(state: State, dt: float, more_psd: float) -> None:
    """The covariance of all moved over `dt` seconds, as that of a member of the bank."""
    own = state.clock_covariance
    drift_s, half, psd = state.fact[NOISE_DRIFT_S], dt * dt / 2.0, state.fact[TRUST] + more_psd
    kept = np.exp(-dt / drift_s) if drift_s > 0.0 else 0.0
    for column in range(4):
        own[0, column] += dt * own[1, column] + half * own[2, column]
        own[1, column] += dt * own[2, column]
        own[3, column] *= kept
    for row in range(4):
        own[row, 0] += dt * own[row, 1] + half * own[row, 2]
        own[row, 1] += dt * own[row, 2]
        own[row, 3] *= kept
    own[0, 0] += psd * dt * half * 2.0 / 3.0
    own[0, 1] += psd * half
    own[1, 0] += psd * half
    own[1, 1] += psd * dt
    own[2, 2] += _RATE_PSD * dt
    own[3, 3] += (1.0 - kept * kept) * state.fact[NOISE_DRIFT]


@compiled(inner=True)
def _correct(model: Model, state: State, apart: FloatArray, more: float, dt: float) -> None:
    """A position taken in by all, with one gain, and their weights moved by how likely it was to each."""
    kept = np.exp(-dt / min(_FORGET_S, 1.0 + (state.fact[AT] - state.fact[BEGAN]) / 2.0))
    own, shared = state.clock_covariance, np.empty(4)
    for row in range(4):
        shared[row] = own[0, row] + own[3, row]
    variance = shared[0] + shared[3] + state.fact[NOISE] + more
    best = np.inf
    for one in range(OFFSETS):
        squared = 0.0
        for axis in range(model.dimension):
            squared += apart[one, axis] ** 2 / variance
        best = min(best, squared)
        state.clock_weight[one] = kept * state.clock_weight[one] + weighed(model, squared, variance)
    variance *= max(best / model.surprise, 1.0)
    for row in range(4):
        for one in range(OFFSETS):
            for axis in range(model.dimension):
                state.clock_mean[one, row, axis] += shared[row] / variance * apart[one, axis]
    for row in range(4):
        for column in range(4):
            own[row, column] -= shared[row] * shared[column] / variance


@compiled(inner=True)
def judge(state: State) -> None:
    """The offset and its variance: the parabola of the log weights about the highest, with the prior."""
    broad, best, highest = 1.0 / _PRIOR_SD_S**2, 0, -np.inf
    for one in range(1, OFFSETS - 1):
        offset = FIRST_S + one * STEP_S
        log_weight = state.clock_weight[one] - 0.5 * broad * offset * offset
        if log_weight > highest:
            best, highest = one, log_weight
    before, here, after = state.clock_weight[best - 1], state.clock_weight[best], state.clock_weight[best + 1]
    bend = max(-(before - 2.0 * here + after) / STEP_S**2, 0.0)
    most = 1.0 / _LEAST_SD_S**2
    if bend > most:
        for one in range(OFFSETS):
            state.clock_weight[one] *= most / bend
    offset = FIRST_S + best * STEP_S
    _add_prior(state, bend, bend * offset + (after - before) / (2.0 * STEP_S))
    state.fact[CLOCK_S] = min(max(state.fact[CLOCK_S], offset - STEP_S), offset + STEP_S)


@compiled(inner=True)
def _add_prior(state: State, bend: float, pull: float) -> None:
    """Mean and variance of an offset o whose log likelihood is pull·o − bend·o²/2, by a prior of two normals.

    With precision λ a normal gives it the mean pull / (bend + λ), the variance 1 / (bend + λ) and the evidence
    √(λ / (bend + λ)) exp(pull² / (bend + λ) / 2); the two are mixed by their evidence.
    """
    exact, broad = 1.0 / _EXACT_SD_S**2, 1.0 / _PRIOR_SD_S**2
    first, second = pull / (bend + exact), pull / (bend + broad)
    log_odds = np.log(_EXACT / (1.0 - _EXACT)) + 0.5 * pull * (first - second)
    log_odds += 0.5 * np.log(exact / (bend + exact) * (bend + broad) / broad)
    share = 1.0 / (1.0 + np.exp(-log_odds))
    state.fact[CLOCK_S] = share * first + (1.0 - share) * second
    variance = share / (bend + exact) + (1.0 - share) / (bend + broad)
    state.fact[CLOCK_VARIANCE] = variance + share * (1.0 - share) * (first - second) ** 2
