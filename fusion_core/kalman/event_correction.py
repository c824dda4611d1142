"""The correction step of the event-time filter, compiled: what a reading was expected to be, and the moments after it.

These are the innermost steps. They take plain arrays rather than structures and views, because handing on a structure
costs as much as the step itself.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray


@compiled(inner=True)
def observe(
    states: tuple[int, ...],
    axes: tuple[int, ...],
    constants: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    coupling: FloatArray,
    row: int,
    operators: FloatArray,
    sensor: int,
    axis: int,
    column: FloatArray,
) -> tuple[float, float]:
    """Variance (without the noise) and mean that are expected of one axis of a reading.

    Writes the covariance of that axis with the state into `column` (size,). `coupling` is all zeros for a sensor that
    no constant enters.
    """
    dimension, first_constant = len(axes), len(states) * len(axes)
    expected, variance = 0.0, 0.0
    for other in range(first_constant + len(constants)):
        total = 0.0
        for constant in range(len(constants)):
            total += coupling[row, axis, constant] * covariance[row, first_constant + constant, other]
        for state in range(len(states)):
            total += operators[sensor, state] * covariance[row, state * dimension + axis, other]
        column[other] = total
    for constant in range(len(constants)):
        expected += coupling[row, axis, constant] * mean[row, first_constant + constant]
        variance += coupling[row, axis, constant] * column[first_constant + constant]
    for state in range(len(states)):
        expected += operators[sensor, state] * mean[row, state * dimension + axis]
        variance += operators[sensor, state] * column[state * dimension + axis]
    return variance, expected


@compiled(inner=True)
def correct(
    states: tuple[int, ...],
    axes: tuple[int, ...],
    constants: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    row: int,
    column: FloatArray,
    precision: float,
    innovation: float,
) -> None:
    """Corrects a row's moments by one axis of its reading: the Kalman update for a scalar.

    `column` (size,) is the covariance of that axis with the state, `precision` the inverse of the innovation's
    variance. The covariance is made symmetric on the way, because an asymmetry grows from round-off.
    """
    size = len(states) * len(axes) + len(constants)
    for state in range(size):
        gain = column[state] * precision
        mean[row, state] += gain * innovation
        for other in range(state + 1):
            both = (covariance[row, state, other] + covariance[row, other, state]) / 2.0 - gain * column[other]
            covariance[row, state, other] = covariance[row, other, state] = both


@compiled(inner=True)
def squared_innovation(
    states: tuple[int, ...],
    axes: tuple[int, ...],
    constants: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    coupling: FloatArray,
    row: int,
    operators: FloatArray,
    observes: npt.NDArray[np.bool_],
    sensor: int,
    value: FloatArray,
    noise_variance: float,
    column: FloatArray,
) -> tuple[float, int, float]:
    """νᵀS⁻¹ν of a reading, how many axes it has, and log det S, with innovation ν and its covariance S.

    Unlike the correction, which goes axis by axis, this needs all axes together, before any of them is used.
    """
    dimension, seen = len(axes), 0
    innovation, variance = np.zeros(dimension), np.eye(dimension)
    for axis in range(dimension):
        if not observes[sensor, axis]:
            continue
        seen += 1
        own, expected = observe(
            states, axes, constants, mean, covariance, coupling, row, operators, sensor, axis, column
        )
        innovation[axis] = value[row, axis] - expected
        variance[axis, axis] = own + noise_variance
        for other in range(axis):
            if observes[sensor, other]:
                variance[axis, other] = 0.0
                for state in range(len(states)):
                    variance[axis, other] += operators[sensor, state] * column[state * dimension + other]
                for constant in range(len(constants)):
                    variance[axis, other] += coupling[row, other, constant] * column[len(states) * dimension + constant]
    squared, log_determinant = _whitened(innovation, variance)
    return squared, seen, log_determinant


@compiled
def _whitened(innovation: FloatArray, variance: FloatArray) -> tuple[float, float]:
    """νᵀS⁻¹ν and log det S, by a Cholesky factor of the lower triangle of `variance`; overwrites both arguments."""
    squared, log_determinant = 0.0, 0.0
    for row in range(len(innovation)):
        for column in range(row + 1):
            rest = variance[row, column]
            for k in range(column):
                rest -= variance[row, k] * variance[column, k]
            variance[row, column] = np.sqrt(rest) if row == column else rest / variance[column, column]
        rest = innovation[row]
        for k in range(row):
            rest -= variance[row, k] * innovation[k]
        innovation[row] = rest / variance[row, row]
        squared += innovation[row] ** 2
        log_determinant += 2.0 * np.log(variance[row, row])
    return squared, log_determinant
