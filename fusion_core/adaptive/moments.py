"""Mean and covariance of the large filter's state, a Kalman filter: moved over an interval, corrected by a position.

The covariance is kept symmetric by writing both halves: what is not would grow from round-off.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive.layout import ARM, BIAS, DRIFT, INPUTS, POSITION, SIZE, VELOCITY, Model, State
from fusion_core.adaptive.rows import SILENT_PSD
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_MOVED = 6  # position and velocity
COAST_S = 0.3  # a third of a reach: so long a velocity lasts of which nothing more is known
_COAST_VARIANCE = SILENT_PSD * COAST_S / 2.0


@compiled(inner=True)
def inputs_of(state: State, total: FloatArray, coupling: FloatArray, net: FloatArray) -> None:
    """Integrals (2, ROW) of the readings less what the input states put into them, into `net` (2, 3)."""
    for order in range(2):
        for axis in range(3):
            left = total[order, axis]
            for one in range(INPUTS):
                left -= coupling[order, axis, one] * state.mean[BIAS + one]
            net[order, axis] = left


@compiled(inner=True)
def move(model: Model, state: State, dt: float, net: FloatArray, coupling: FloatArray, psd: float) -> None:
    """Both moved over `dt` seconds. `net` (2, 3) and `coupling` (2, 3, INPUTS) are of first and second integrals.

    p + dt v + ∫∫a and v + ∫a, with white noise of density `psd` on the acceleration; the input states drift by `walk`.
    """
    mean, covariance, moved = state.mean, state.covariance, np.empty((_MOVED, SIZE))
    for axis in range(3):
        mean[POSITION + axis] += dt * mean[VELOCITY + axis] + net[1, axis]
        mean[VELOCITY + axis] += net[0, axis]
    for axis in range(3):
        for column in range(SIZE):
            speed = covariance[VELOCITY + axis, column]
            place = covariance[POSITION + axis, column] + dt * speed
            for one in range(INPUTS):
                of_input = covariance[BIAS + one, column]
                place -= coupling[1, axis, one] * of_input
                speed -= coupling[0, axis, one] * of_input
            moved[POSITION + axis, column], moved[VELOCITY + axis, column] = place, speed
    for row in range(_MOVED):
        for column in range(_MOVED, SIZE):
            covariance[row, column] = covariance[column, row] = moved[row, column]
    for row in range(_MOVED):
        for axis in range(3):
            speed = moved[row, VELOCITY + axis]
            place = moved[row, POSITION + axis] + dt * speed
            for one in range(INPUTS):
                place -= moved[row, BIAS + one] * coupling[1, axis, one]
                speed -= moved[row, BIAS + one] * coupling[0, axis, one]
            covariance[row, POSITION + axis], covariance[row, VELOCITY + axis] = place, speed
    for row in range(_MOVED):
        for column in range(row):
            both = (covariance[row, column] + covariance[column, row]) / 2.0
            covariance[row, column] = covariance[column, row] = both
    _add_noise(model, state, dt, psd)


@compiled
def _add_noise(model: Model, state: State, dt: float, psd: float) -> None:
    covariance = state.covariance
    for axis in range(3):
        place, speed = POSITION + axis, VELOCITY + axis
        covariance[place, place] += psd * dt * dt * dt / 3.0
        covariance[place, speed] += psd * dt * dt / 2.0
        covariance[speed, place] += psd * dt * dt / 2.0
        covariance[speed, speed] += psd * dt
    for one in range(BIAS, DRIFT):
        covariance[one, one] += model.walk[one] * dt


@compiled(inner=True)
def fade(state: State, dt: float, variance: float, time_s: float) -> None:
    """The tracker's correlated noise, a first-order autoregression, moved over `dt` seconds."""
    mean, covariance = state.mean, state.covariance
    kept = np.exp(-dt / time_s) if time_s > 0.0 else 0.0
    for axis in range(3):
        row = DRIFT + axis
        mean[row] *= kept
        for column in range(DRIFT):
            covariance[row, column] *= kept
            covariance[column, row] = covariance[row, column]
        for other in range(3):
            covariance[row, DRIFT + other] *= kept * kept
        covariance[row, row] += (1.0 - kept * kept) * variance


@compiled(inner=True)
def coast(state: State, seconds: float) -> None:
    """The last `seconds` of a move had no acceleration: the velocity dies away, and is as uncertain as any hand's.

    A velocity of Ornstein and Uhlenbeck's kind, whose acceleration has the density `rows.SILENT_PSD` at first.
    """
    mean, covariance, left = state.mean, state.covariance, left_of_speed(seconds)
    lost = seconds - COAST_S * (1.0 - left)
    for axis in range(3):
        place, speed = POSITION + axis, VELOCITY + axis
        mean[place] -= lost * mean[speed]
        mean[speed] *= left
        for column in range(SIZE):
            covariance[place, column] -= lost * covariance[speed, column]
            covariance[speed, column] *= left
    for axis in range(3):
        place, speed = POSITION + axis, VELOCITY + axis
        for row in range(SIZE):
            covariance[row, place] -= lost * covariance[row, speed]
            covariance[row, speed] *= left
        both = _COAST_VARIANCE * COAST_S * (1.0 - left) ** 2
        covariance[place, place] += coasted(seconds)
        covariance[speed, speed] += _COAST_VARIANCE * (1.0 - left * left)
        covariance[place, speed] += both
        covariance[speed, place] += both


@compiled(inner=True)
def left_of_speed(seconds: float) -> float:
    """The share of a velocity that is left after seconds without acceleration."""
    return float(np.exp(-seconds / COAST_S))


@compiled(inner=True)
def coasted(seconds: float) -> float:
    """The variance, an axis, that seconds without acceleration add to the position."""
    left = left_of_speed(seconds)
    return float(_COAST_VARIANCE * COAST_S**2 * (2.0 * seconds / COAST_S - 3.0 + 4.0 * left - left * left))


@compiled(inner=True)
def to_phone(state: State, turned: FloatArray) -> None:
    """From the tracked point to the phone, once its rotation (3, 3) is known: p − R r, with r the lever arm."""
    mean, covariance = state.mean, state.covariance
    for axis in range(3):
        for arm in range(3):
            share = turned[axis, arm]
            mean[POSITION + axis] -= share * mean[ARM + arm]
            for column in range(SIZE):
                covariance[POSITION + axis, column] -= share * covariance[ARM + arm, column]
    for axis in range(3):
        for arm in range(3):
            for row in range(SIZE):
                covariance[row, POSITION + axis] -= turned[axis, arm] * covariance[row, ARM + arm]


@compiled(inner=True)
def correct(model: Model, state: State, ago: float, turned: FloatArray, position: FloatArray, variance: float) -> None:
    """A position taken in that was measured `ago` seconds before the state's time.

    It observes p − ago·v + R r + correlated noise. Where νᵀS⁻¹ν is above the model's `surprise`, the noise is taken for
    as much larger as brings it there: a robust update, after Huber (1964).
    """
    dimension, mean, covariance = model.dimension, state.mean, state.covariance
    shared, innovation, spread = np.empty((SIZE, 3)), np.empty(3), np.empty((3, 3))
    factor, white, own = np.empty((3, 3)), np.empty(3), 0.0
    for axis in range(dimension):
        expected = mean[POSITION + axis] - ago * mean[VELOCITY + axis] + mean[DRIFT + axis]
        for arm in range(3):
            expected += turned[axis, arm] * mean[ARM + arm]
        innovation[axis] = position[axis] - expected
        for one in range(SIZE):
            total = covariance[one, POSITION + axis] - ago * covariance[one, VELOCITY + axis]
            total += covariance[one, DRIFT + axis]
            for arm in range(3):
                total += turned[axis, arm] * covariance[one, ARM + arm]
            shared[one, axis] = total
    for axis in range(dimension):
        for other in range(dimension):
            total = shared[POSITION + axis, other] - ago * shared[VELOCITY + axis, other] + shared[DRIFT + axis, other]
            for arm in range(3):
                total += turned[axis, arm] * shared[ARM + arm, other]
            spread[axis, other] = total
        own += spread[axis, axis] / dimension
    squared = whiten(dimension, spread, variance, innovation, factor, white)
    if squared > model.surprise:
        more = squared / model.surprise * (own + variance) - own
        whiten(dimension, spread, more, innovation, factor, white)
    _gain(dimension, mean, covariance, shared, factor, white)


@compiled(inner=True)
def whiten(
    dimension: int,
    spread: FloatArray,
    variance: float,
    innovation: FloatArray,
    factor: FloatArray,
    white: FloatArray,
) -> float:
    """L⁻¹ν into `white`, with L, Cholesky's factor of the innovation's covariance, into `factor`; returns |L⁻¹ν|²."""
    squared = 0.0
    for row in range(dimension):
        for column in range(row + 1):
            rest = spread[row, column] + (variance if row == column else 0.0)
            for k in range(column):
                rest -= factor[row, k] * factor[column, k]
            factor[row, column] = np.sqrt(rest) if row == column else rest / factor[column, column]
        rest = innovation[row]
        for k in range(row):
            rest -= factor[row, k] * white[k]
        white[row] = rest / factor[row, row]
        squared += white[row] * white[row]
    return squared


@compiled
def _gain(
    dimension: int,
    mean: FloatArray,
    covariance: FloatArray,
    shared: FloatArray,
    factor: FloatArray,
    white: FloatArray,
) -> None:
    """The correction: with A = shared L⁻ᵀ, the mean moves by A L⁻¹ν and the covariance loses A Aᵀ."""
    for one in range(SIZE):
        for axis in range(dimension):
            rest = shared[one, axis]
            for k in range(axis):
                rest -= factor[axis, k] * shared[one, k]
            shared[one, axis] = rest / factor[axis, axis]
            mean[one] += shared[one, axis] * white[axis]
        for other in range(one + 1):
            left = covariance[one, other]
            for axis in range(dimension):
                left -= shared[one, axis] * shared[other, axis]
            covariance[one, other] = covariance[other, one] = left


@compiled(inner=True)
def begin(model: Model, state: State, position: FloatArray) -> None:
    """Both at the first position."""
    mean, covariance = state.mean, state.covariance
    for one in range(SIZE):
        mean[one] = 0.0
        for other in range(SIZE):
            covariance[one, other] = 0.0
        covariance[one, one] = model.prior[one]
    for axis in range(model.dimension):
        mean[POSITION + axis] = position[axis]


@compiled(inner=True)
def begin_again(model: Model, state: State, position: FloatArray) -> None:
    """The motion is forgotten and begins at a position; what is known of phone and tracker stays."""
    mean, covariance = state.mean, state.covariance
    for one in range(_MOVED):
        for other in range(SIZE):
            covariance[one, other] = covariance[other, one] = 0.0
        covariance[one, one] = model.prior[one]
        mean[one] = 0.0
    for axis in range(model.dimension):
        mean[POSITION + axis] = position[axis]
