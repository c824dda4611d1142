"""How far the tracker's clock is off: small filters that take each frame for earlier or later than its stamp says.

All have one covariance, since the same readings reach each, only elsewhere in time; they differ in their means. Each
has a lever arm of its own: with that of the large filter, which was found with the offset believed so far, the two
hold each other in a place where both are wrong (a recording of circles stood at 25 ms for half a minute). What
their likelihoods say of the offset stands in `offset`. As a state of the large filter it would hang on an estimated
velocity, and what is wrong with that (noise that is heavier or longer than thought) pulls it away; a likelihood is not
pulled.

Only the *difference* of the two clocks shows. The phone's is believed, unless its stamps are ahead of their arrival.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive import moments, offset, rows
from fusion_core.adaptive.bank import weighed
from fusion_core.adaptive.layout import (
    ARM,
    AT,
    BEGAN,
    KNOWS_ARM,
    NOISE,
    NOISE_DRIFT,
    NOISE_DRIFT_S,
    OF_ARM,
    OFFSETS,
    ROWS,
    STAMP,
    TRUST,
    UNSURE,
    VELOCITY,
    Model,
    Phone,
    State,
)
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_FORGET_S = 10.0  # as the bank does
_LEAD = 5.0  # in log likelihood: what is so far behind is out of the question
_RATE_SD, _RATE_PSD = 1000.0, 900.0  # of the acceleration error, as in the bank

# Rows of State.clock_covariance: position, velocity, acceleration error and correlated noise of each axis, lever arm.
_ARM, _STATES = 12, 15


@compiled(inner=True)
def begin(model: Model, state: State, position: FloatArray) -> None:
    """At the first position."""
    offset.begin(state)
    for one in range(OFFSETS):
        for part in range(3):
            state.clock_mean[one, OF_ARM, part] = 0.0
    for row in range(_STATES):
        for column in range(_STATES):
            state.clock_covariance[row, column] = 0.0
    for part in range(3):
        state.clock_covariance[_ARM + part, _ARM + part] = model.prior[ARM + part]
    begin_again(model, state, position, np.zeros((3, 3)))
    offset.judge(state)


@compiled(inner=True)
def begin_again(model: Model, state: State, position: FloatArray, turned: FloatArray) -> None:
    """The motion begins anew at a position of the tracked point; weights and lever arms stay."""
    own, drift = state.clock_covariance, state.fact[NOISE_DRIFT]
    for row in range(_ARM):
        for column in range(_STATES):
            own[row, column] = own[column, row] = 0.0
    for axis in range(3):
        at = 4 * axis
        own[at, at], own[at + 1, at + 1] = state.fact[NOISE] + drift, model.prior[VELOCITY]
        own[at + 2, at + 2], own[at + 3, at + 3], own[at, at + 3], own[at + 3, at] = _RATE_SD**2, drift, -drift, -drift
        for one in range(OFFSETS):
            for row in range(4):
                state.clock_mean[one, row, axis] = 0.0
            if axis < model.dimension:
                state.clock_mean[one, 0, axis] = position[axis]
    state.fact[UNSURE] = 0.0
    to_phone(state, turned)


@compiled(inner=True)
def to_phone(state: State, turned: FloatArray) -> None:
    """From the tracked point to the phone, whose rotation is `turned` (3, 3): p − R r, with each its own lever arm."""
    own = state.clock_covariance
    for axis in range(3):
        for part in range(3):
            share = turned[axis, part]
            for one in range(OFFSETS):
                state.clock_mean[one, 0, axis] -= share * state.clock_mean[one, OF_ARM, part]
            for column in range(_STATES):
                own[4 * axis, column] -= share * own[_ARM + part, column]
    for axis in range(3):
        for part in range(3):
            for row in range(_STATES):
                own[row, 4 * axis] -= turned[axis, part] * own[row, _ARM + part]


@compiled(inner=True)
def take_in(
    model: Model,
    state: State,
    phone: Phone,
    stamp: float,
    value: FloatArray,
    turned: FloatArray,
    news: int,
) -> None:
    """All moved to the stamp of a frame, each by its own offset; and with `news` the position taken in.

    `turned` (3, 3) is the phone's rotation at about that time.
    """
    before = state.fact[STAMP]
    dt = stamp - before
    if dt > 0.0:
        state.fact[STAMP] = stamp
        apart = np.empty((OFFSETS, 3))
        _move(state, dt, state.fact[UNSURE] / dt)
        state.fact[UNSURE] = 0.0
        _move_means(model, state, phone, before, stamp, value, apart)
        if news:
            _correct(model, state, apart, turned, dt)
            _follow(model, state, turned)
    if news:
        offset.judge(state)


@compiled
def _move_means(
    model: Model, state: State, phone: Phone, before: float, stamp: float, value: FloatArray, apart: FloatArray
) -> None:
    """The means moved from the stamp `before` to another; how far the position is from each goes into `apart`."""
    mean, net, turned, count = state.clock_mean, np.empty((2, 3)), np.zeros((3, 3)), state.count[ROWS]
    dt = stamp - before
    rows.correct(state, phone, rows.row_before(phone, count, before + offset.FIRST_S), model.dimension)
    kept = np.exp(-dt / state.fact[NOISE_DRIFT_S]) if state.fact[NOISE_DRIFT_S] > 0.0 else 0.0
    for one in range(OFFSETS):
        begin, end = before + (offset.FIRST_S + one * offset.STEP_S), stamp + (offset.FIRST_S + one * offset.STEP_S)
        rows.integrate(phone.time, count, phone.corrected, begin, end, net)
        if state.count[KNOWS_ARM]:
            rows.turned_at(state, phone, end, turned)
        for axis in range(model.dimension):
            mean[one, 0, axis] += dt * mean[one, 1, axis] + dt * dt / 2.0 * mean[one, 2, axis] + net[1, axis]
            mean[one, 1, axis] += dt * mean[one, 2, axis] + net[0, axis]
            mean[one, 3, axis] *= kept
            expected = mean[one, 0, axis] + mean[one, 3, axis]
            for part in range(3):
                expected += turned[axis, part] * mean[one, OF_ARM, part]
            apart[one, axis] = value[axis] - expected


@compiled
def _move(state: State, dt: float, more_psd: float) -> None:
    """The covariance of all moved over `dt` seconds, as that of a member of the bank."""
    own = state.clock_covariance
    drift_s, half, psd = state.fact[NOISE_DRIFT_S], dt * dt / 2.0, state.fact[TRUST] + more_psd
    kept = np.exp(-dt / drift_s) if drift_s > 0.0 else 0.0
    for at in range(0, _ARM, 4):
        for column in range(_STATES):
            own[at, column] += dt * own[at + 1, column] + half * own[at + 2, column]
            own[at + 1, column] += dt * own[at + 2, column]
            own[at + 3, column] *= kept
    for at in range(0, _ARM, 4):
        for row in range(_STATES):
            own[row, at] += dt * own[row, at + 1] + half * own[row, at + 2]
            own[row, at + 1] += dt * own[row, at + 2]
            own[row, at + 3] *= kept
        own[at, at] += psd * dt * half * 2.0 / 3.0
        own[at, at + 1] += psd * half
        own[at + 1, at] += psd * half
        own[at + 1, at + 1] += psd * dt
        own[at + 2, at + 2] += _RATE_PSD * dt
        own[at + 3, at + 3] += (1.0 - kept * kept) * state.fact[NOISE_DRIFT]


@compiled
def _correct(model: Model, state: State, apart: FloatArray, turned: FloatArray, dt: float) -> None:
    """A position taken in by all, with one gain, and their weights moved by how likely it was to each.

    It observes p + R r + correlated noise, and its white noise is as found.
    """
    kept = np.exp(-dt / min(_FORGET_S, 1.0 + (state.fact[AT] - state.fact[BEGAN]) / 2.0))
    dimension, own, shared, spread = model.dimension, state.clock_covariance, np.empty((_STATES, 3)), np.empty((3, 3))
    for axis in range(dimension):
        for row in range(_STATES):
            total = own[row, 4 * axis] + own[row, 4 * axis + 3]
            for part in range(3):
                total += turned[axis, part] * own[row, _ARM + part]
            shared[row, axis] = total
    for axis in range(dimension):
        for other in range(dimension):
            total = shared[4 * axis, other] + shared[4 * axis + 3, other]
            for part in range(3):
                total += turned[axis, part] * shared[_ARM + part, other]
            spread[axis, other] = total
    factor, white, news, best = np.empty((3, 3)), np.empty((OFFSETS, 3)), np.empty(OFFSETS), np.inf
    for one in range(OFFSETS):
        squared = moments.whiten(dimension, spread, state.fact[NOISE], apart[one], factor, white[one])
        best = min(best, squared)
        variance = 1.0
        for axis in range(dimension):
            variance *= factor[axis, axis] ** (2.0 / dimension)
        news[one] = weighed(model, squared, variance)
    offset.weigh(state, news, kept, dt)
    _gain(state, shared, factor, white, dimension, max(best / model.surprise, 1.0))


@compiled
def _gain(
    state: State, shared: FloatArray, factor: FloatArray, white: FloatArray, dimension: int, robust: float
) -> None:
    """With A = shared L⁻ᵀ the means move by A L⁻¹ν and the covariance loses A Aᵀ, both over `robust`."""
    own, mean = state.clock_covariance, state.clock_mean
    for row in range(_STATES):
        part, axis = (row % 4, row // 4) if row < _ARM else (OF_ARM, row - _ARM)
        for k in range(dimension):
            rest = shared[row, k]
            for before in range(k):
                rest -= factor[k, before] * shared[row, before]
            shared[row, k] = rest / factor[k, k]
            for one in range(OFFSETS):
                mean[one, part, axis] += shared[row, k] * white[one, k] / robust
        for column in range(row + 1):
            left = own[row, column]
            for k in range(dimension):
                left -= shared[row, k] * shared[column, k] / robust
            own[row, column] = own[column, row] = left


@compiled
def _follow(model: Model, state: State, turned: FloatArray) -> None:
    """Those that are out of the question take over the lever arm of the likeliest.

    Their own was bent by positions that they did not expect, and would hold them back when a wandering clock comes by.
    """
    best, mean, weight = 0, state.clock_mean, state.clock_weight[offset.likelier(state)]
    for one in range(OFFSETS):
        if weight[one] > weight[best]:
            best = one
    for one in range(OFFSETS):
        if weight[one] < weight[best] - _LEAD:
            for axis in range(model.dimension):
                for part in range(3):
                    mean[one, 0, axis] -= turned[axis, part] * (mean[best, OF_ARM, part] - mean[one, OF_ARM, part])
            for part in range(3):
                mean[one, OF_ARM, part] = mean[best, OF_ARM, part]
