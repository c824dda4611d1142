"""The weights of a window's readings in the estimate of "now", compiled: eqs. (19) to (24) by a Cholesky factor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import objmode

from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray
from fusion_core.window.kernels import Covariances, IntArray, covariance

ZERO, CONSTANT, WINDOW = 0, 1, 2  # the mean of the prior


class Prior(NamedTuple):
    """What is assumed before any reading; arrays (sensors,) are in the order of the estimator's sensors."""

    signal_variance_mm2: float
    mean: int
    covariances: Covariances
    noise_variance: FloatArray
    constant: FloatArray  # what each sensor would read if the hand stayed at 1 mm
    is_tracker: npt.NDArray[np.bool_]


@compiled
def gains(prior: Prior, time: FloatArray, now: FloatArray, sensor: IntArray) -> tuple[FloatArray, FloatArray]:
    """Weights (n, m) and variance (n,) in mm² of n windows of m readings at `time` (n, m), when it is `now` (n,), in s.

    `sensor` (m,) is each reading's sensor, as an index into `prior`.
    """
    count, size = time.shape
    weights, variance = np.empty((count, size)), np.empty(count)
    among, with_now, constant = np.empty((size, size)), np.empty(size), np.empty(size)
    of_constant, signal_variance = np.empty(size), prior.signal_variance_mm2
    for row in range(size):
        constant[row] = prior.constant[sensor[row]]
    for index in range(count):
        _covariances(prior, time[index], now[index], sensor, among, with_now)
        _solve(among, with_now, constant, weights[index], of_constant)
        explained, missing, precision, positions = 0.0, 1.0, 0.0, 0
        for row in range(size):
            explained += with_now[row] * weights[index, row]
            missing -= weights[index, row] * constant[row]
            precision += of_constant[row] * constant[row]
            positions += prior.is_tracker[sensor[row]]
        variance[index] = signal_variance - explained
        if prior.mean == CONSTANT:
            variance[index] += missing * missing / precision
            for row in range(size):
                weights[index, row] += of_constant[row] * (missing / precision)
        elif prior.mean == WINDOW:
            for row in range(size):
                if prior.is_tracker[sensor[row]]:
                    weights[index, row] += missing / positions
        variance[index] = max(variance[index], 0.0)  # round-off may leave it below 0
    return weights, variance


@compiled
def _covariances(
    prior: Prior, time: FloatArray, now: float, sensor: IntArray, among: FloatArray, with_now: FloatArray
) -> None:
    """Writes the covariances of readings among themselves (lower triangle of `among`) and with the position now."""
    inverse_scale, begins, shift, polynomial, shared = prior.covariances
    noise, position = prior.noise_variance, len(prior.noise_variance)
    for row in range(len(time)):
        own, at = sensor[row], time[row]
        for column in range(row + 1):
            among[row, column] = covariance(
                inverse_scale, begins, shift, polynomial, shared, own, sensor[column], at - time[column]
            )
        among[row, row] += noise[own]
        with_now[row] = covariance(inverse_scale, begins, shift, polynomial, shared, own, position, at - now)


def _least_squares(
    among: FloatArray, first: FloatArray, second: FloatArray, of_first: FloatArray, of_second: FloatArray
) -> None:
    """The shortest solutions; `among` is known by its lower triangle."""
    whole = np.tril(among) + np.tril(among, -1).T
    solution = np.linalg.lstsq(whole, np.column_stack([first, second]), rcond=np.finfo(np.float64).eps)[0]
    of_first[:], of_second[:] = solution.T


@compiled(fastmath={"reassoc", "contract"})  # otherwise the additions could not run in parallel
def _solve(
    among: FloatArray, first: FloatArray, second: FloatArray, of_first: FloatArray, of_second: FloatArray
) -> None:
    """Solves for two right-hand sides by a Cholesky factor; by least squares if `among` is singular to round-off."""
    size = len(first)
    factor = among.copy()
    for row in range(size):
        for column in range(row + 1):
            own, other, explained = factor[row, :column], factor[column, :column], 0.0
            for k in range(column):
                explained += own[k] * other[k]
            rest = factor[row, column] - explained
            if row != column:
                factor[row, column] = rest / factor[column, column]
            elif rest > 0.0:
                factor[row, row] = np.sqrt(rest)
            else:
                with objmode():  # seldom needed, and the compiled form takes a fifth of what compiling a window takes
                    _least_squares(among, first, second, of_first, of_second)
                return
    for right, solution in ((first, of_first), (second, of_second)):
        for row in range(size):
            rest = right[row]
            for k in range(row):
                rest -= factor[row, k] * solution[k]
            solution[row] = rest / factor[row, row]
        for row in range(size - 1, -1, -1):
            solution[row] /= factor[row, row]
            for k in range(row):
                solution[k] -= factor[row, k] * solution[row]
