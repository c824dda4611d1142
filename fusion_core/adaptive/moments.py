"""Mean and covariance of the large filter's state, a Kalman filter: moved over an interval, corrected by a position.

The covariance is kept symmetric by writing both halves: what is not would grow from round-off.
"""

from __future__ import annotations

import numpy as np

from fusion_core.adaptive.layout import ARM, BIAS, DRIFT, INPUTS, POSITION, SIZE, VELOCITY
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_MOVED = 6  # position and velocity


@compiled
def inputs_of(mean: FloatArray, total: FloatArray, coupling: FloatArray, net: FloatArray) -> None:
    """An integral (ROW,) of the readings less what the input states put into it, into `net` (3,)."""
    for axis in range(3):
        net[axis] = total[axis]
        for state in range(INPUTS):
            net[axis] -= coupling[axis, state] * mean[BIAS + state]


@compiled
def move(
    mean: FloatArray,
    covariance: FloatArray,
    dt: float,
    net: FloatArray,
    coupling: FloatArray,
    psd: float,
    walk: FloatArray,
) -> None:
    """Both moved over `dt` seconds. `net` (2, 3) and `coupling` (2, 3, INPUTS) are of first and second integrals.

    p + dt v + ∫∫a and v + ∫a, with white noise of density `psd` on the acceleration; the input states drift by `walk`.
    """
    for axis in range(3):
        mean[POSITION + axis] += dt * mean[VELOCITY + axis] + net[1, axis]
        mean[VELOCITY + axis] += net[0, axis]
    moved = np.empty((_MOVED, SIZE))
    for axis in range(3):
        for column in range(SIZE):
            speed = covariance[VELOCITY + axis, column]
            place = covariance[POSITION + axis, column] + dt * speed
            for state in range(INPUTS):
                of_input = covariance[BIAS + state, column]
                place -= coupling[1, axis, state] * of_input
                speed -= coupling[0, axis, state] * of_input
            moved[POSITION + axis, column], moved[VELOCITY + axis, column] = place, speed
    for row in range(_MOVED):
        for column in range(_MOVED, SIZE):
            covariance[row, column] = covariance[column, row] = moved[row, column]
    for row in range(_MOVED):
        for axis in range(3):
            speed = moved[row, VELOCITY + axis]
            place = moved[row, POSITION + axis] + dt * speed
            for state in range(INPUTS):
                place -= moved[row, BIAS + state] * coupling[1, axis, state]
                speed -= moved[row, BIAS + state] * coupling[0, axis, state]
            covariance[row, POSITION + axis], covariance[row, VELOCITY + axis] = place, speed
    for row in range(_MOVED):
        for column in range(row):
            both = (covariance[row, column] + covariance[column, row]) / 2.0
            covariance[row, column] = covariance[column, row] = both
    _add_noise(covariance, dt, psd, walk)


@compiled
def _add_noise(covariance: FloatArray, dt: float, psd: float, walk: FloatArray) -> None:
    for axis in range(3):
        place, speed = POSITION + axis, VELOCITY + axis
        covariance[place, place] += psd * dt * dt * dt / 3.0
        covariance[place, speed] += psd * dt * dt / 2.0
        covariance[speed, place] += psd * dt * dt / 2.0
        covariance[speed, speed] += psd * dt
    for state in range(BIAS, DRIFT):
        covariance[state, state] += walk[state] * dt


@compiled
def fade(mean: FloatArray, covariance: FloatArray, dt: float, variance: float, time_s: float) -> None:
    """The tracker's correlated noise, a first-order autoregression, moved over `dt` seconds."""
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


@compiled
def to_phone(mean: FloatArray, covariance: FloatArray, turned: FloatArray) -> None:
    """From the tracked point to the phone, once its rotation (3, 3) is known: p − R r, with r the lever arm."""
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


@compiled
def correct(
    dimension: int,
    mean: FloatArray,
    covariance: FloatArray,
    ago: float,
    turned: FloatArray,
    position: FloatArray,
    variance: float,
    surprise: float,
) -> float:
    """A position taken in that was measured `ago` seconds before the state's time; returns νᵀS⁻¹ν.

    It observes p − ago·v + R r + correlated noise. Where νᵀS⁻¹ν is above `surprise`, the noise is taken for as much
    larger as brings it there: a robust update, after Huber (1964).
    """
    shared, innovation = np.empty((SIZE, 3)), np.empty(3)
    for axis in range(dimension):
        expected = mean[POSITION + axis] - ago * mean[VELOCITY + axis] + mean[DRIFT + axis]
        for arm in range(3):
            expected += turned[axis, arm] * mean[ARM + arm]
        innovation[axis] = position[axis] - expected
        for state in range(SIZE):
            shared[state, axis] = _observed(covariance[state], axis, ago, turned)
    spread, own = np.zeros((3, 3)), 0.0
    for axis in range(dimension):
        for other in range(dimension):
            spread[axis, other] = _observed(shared[:, other], axis, ago, turned)
        own += spread[axis, axis] / dimension
    factor, squared = np.empty((3, 3)), 0.0
    white = _whiten(dimension, spread, variance, innovation, factor)
    for axis in range(dimension):
        squared += white[axis] * white[axis]
    if squared > surprise:
        more = squared / surprise * (own + variance) - own
        white = _whiten(dimension, spread, more, innovation, factor)
    _gain(dimension, mean, covariance, shared, factor, white)
    return squared


@compiled
def _observed(states: FloatArray, axis: int, ago: float, turned: FloatArray) -> float:
    """What an axis of a position makes of a vector of all states: a row of its observation matrix times that."""
    total = states[POSITION + axis] - ago * states[VELOCITY + axis] + states[DRIFT + axis]
    for arm in range(3):
        total += turned[axis, arm] * states[ARM + arm]
    return float(total)


@compiled
def _whiten(
    dimension: int, spread: FloatArray, variance: float, innovation: FloatArray, factor: FloatArray
) -> FloatArray:
    """L⁻¹ν, with L (into `factor`) Cholesky's factor of the innovation's covariance."""
    white = np.empty(3)
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
    return white


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
    for state in range(SIZE):
        for axis in range(dimension):
            rest = shared[state, axis]
            for k in range(axis):
                rest -= factor[axis, k] * shared[state, k]
            shared[state, axis] = rest / factor[axis, axis]
            mean[state] += shared[state, axis] * white[axis]
        for other in range(state + 1):
            left = covariance[state, other]
            for axis in range(dimension):
                left -= shared[state, axis] * shared[other, axis]
            covariance[state, other] = covariance[other, state] = left


@compiled
def begin(dimension: int, mean: FloatArray, covariance: FloatArray, prior: FloatArray, position: FloatArray) -> None:
    """Both at the first position."""
    mean[:], covariance[:] = 0.0, 0.0
    for state in range(SIZE):
        covariance[state, state] = prior[state]
    for axis in range(dimension):
        mean[POSITION + axis] = position[axis]


@compiled
def begin_again(
    dimension: int, mean: FloatArray, covariance: FloatArray, prior: FloatArray, position: FloatArray
) -> None:
    """The motion is forgotten and begins at a position; what is known of phone and tracker stays."""
    for state in range(_MOVED):
        for other in range(SIZE):
            covariance[state, other] = covariance[other, state] = 0.0
        covariance[state, state] = prior[state]
        mean[state] = 0.0
    for axis in range(dimension):
        mean[POSITION + axis] = position[axis]
