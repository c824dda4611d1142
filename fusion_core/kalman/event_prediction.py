"""The prediction step of the event-time filter, compiled: moments moved on to the time of the next row."""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.kalman.motion import Motion, add_wiener_noise, step
from fusion_core.samples import FloatArray


@compiled(inner=True)
def move_wiener(
    axes: tuple[int, ...],
    constants: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    row: int,
    dt: float,
    density: float,
) -> None:
    """Writes F m and F P Fᵀ + Q of the row before into a row, for a Wiener-process acceleration.

    F and Q are sparse, so the products are written out: whole matrices take several times as long.
    """
    dimension, size, half = len(axes), 3 * len(axes) + len(constants), dt * dt / 2.0
    for state in range(size):
        mean[row, state] = mean[row - 1, state]
    for axis in range(dimension):
        speed, rate = dimension + axis, 2 * dimension + axis
        mean[row, axis] += dt * mean[row, speed] + half * mean[row, rate]
        mean[row, speed] += dt * mean[row, rate]
        for column in range(size):
            of_speed, of_rate = covariance[row - 1, speed, column], covariance[row - 1, rate, column]
            covariance[row, axis, column] = covariance[row - 1, axis, column] + dt * of_speed + half * of_rate
            covariance[row, speed, column] = of_speed + dt * of_rate
            covariance[row, rate, column] = of_rate
    for constant in range(3 * dimension, size):
        for column in range(size):
            covariance[row, constant, column] = covariance[row - 1, constant, column]
    for line in range(size):
        for axis in range(dimension):
            speed, rate = dimension + axis, 2 * dimension + axis
            of_rate = covariance[row, line, rate]
            covariance[row, line, axis] += dt * covariance[row, line, speed] + half * of_rate
            covariance[row, line, speed] += dt * of_rate
    for axis in range(dimension):
        add_wiener_noise(density, dt, covariance[row], dimension, axis)


@compiled(inner=True)
def whole_step(motion: Motion, dimension: int, size: int, dt: float, density: float) -> tuple[FloatArray, FloatArray]:
    """Transition and process noise (size, size) of all states of all axes over `dt` seconds; constants stay."""
    states = len(motion.stationary)
    of_axis, noise_of_axis = np.empty((states, states)), np.empty((states, states))
    step(motion, dt, density, of_axis, noise_of_axis)
    transition, noise = np.eye(size), np.zeros((size, size))
    for axis in range(dimension):
        for state in range(states):
            for other in range(states):
                transition[state * dimension + axis, other * dimension + axis] = of_axis[state, other]
                noise[state * dimension + axis, other * dimension + axis] = noise_of_axis[state, other]
    return transition, noise


@compiled(inner=True)
def move_anchored(
    motion: Motion, dimension: int, mean: FloatArray, covariance: FloatArray, row: int, dt: float, density: float
) -> None:
    """The same as `move_wiener` for a process that returns to a constant.

    The transition is one axis's for each, and constants stay. P is symmetric, so its rows through F are F P.
    """
    states, size = len(motion.stationary), mean.shape[1]
    of_axis, noise, half = np.empty((states, states)), np.empty((states, states)), np.empty((size, size))
    step(motion, dt, density, of_axis, noise)
    for line in range(size):
        mean[row, line] = _through_states(of_axis, dimension, mean, row - 1, line)
        for column in range(size):
            half[line, column] = _through_states(of_axis, dimension, covariance[row - 1], column, line)
    for line in range(size):
        for column in range(size):
            covariance[row, line, column] = _through_states(of_axis, dimension, half, line, column)
    for state in range(states):
        for other in range(states):
            for axis in range(dimension):
                covariance[row, state * dimension + axis, other * dimension + axis] += noise[state, other]


@compiled
def _through_states(of_axis: FloatArray, dimension: int, rows: FloatArray, row: int, at: int) -> float:
    """Element `at` of F x, with a row of `rows` as x."""
    states, moved = len(of_axis), 0.0
    if at >= states * dimension:
        return float(rows[row, at])
    for other in range(states):
        moved += of_axis[at // dimension, other] * rows[row, other * dimension + at % dimension]
    return moved
