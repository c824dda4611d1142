"""The weights of a window's readings in the estimate of "now", compiled: eqs. (19) to (24), a Cholesky factor each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from fusion_core.kernels import IntArray, squared_exponential
from fusion_core.samples import FloatArray

ZERO, CONSTANT, WINDOW = 0, 1, 2  # the mean of the prior


class Prior(NamedTuple):
    """What is known before any reading; arrays are by sensor or by term, in the order of the estimator's sensors."""

    signal_variance_mm2: float
    inverse_scale_s2: float
    mean: int
    noise_variance: FloatArray  # (sensors,)
    bias_variance: FloatArray  # (sensors,): what its readings share
    constant: FloatArray  # (sensors,): what each reads of a hand that stays at 1 mm
    is_tracker: npt.NDArray[np.bool_]  # (sensors,)
    begins: IntArray  # (sensors + 1,): a sensor's terms are begins[s] : begins[s + 1]
    weight: FloatArray  # (terms,)
    derivative: IntArray  # (terms,)
    at_s: FloatArray  # (terms,)


@njit(cache=True)
def gains(prior: Prior, time: FloatArray, now: FloatArray, sensor: IntArray) -> tuple[FloatArray, FloatArray]:
    """Weights (n, m) and variance (n,) of n windows of m readings at `time` (n, m) in s, when it is `now` (n,).

    `sensor` (m,) says whose readings they are.
    """
    count, size = time.shape
    weights, variance = np.empty((count, size)), np.empty(count)
    among, with_now, constant = np.empty((size, size)), np.empty(size), np.empty(size)
    of_constant, signal_variance = np.empty(size), prior.signal_variance_mm2
    for row in range(size):
        constant[row] = prior.constant[sensor[row]]
    for index in range(count):
        _covariances(prior, time[index], sensor, among)
        covariance_with_now(prior, time[index] - now[index], sensor, with_now)
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
    return weights, variance


@njit(cache=True)
def _covariances(prior: Prior, time: FloatArray, sensor: IntArray, among: FloatArray) -> None:
    """Readings among themselves, the lower triangle."""
    for row in range(len(time)):
        for column in range(row + 1):
            among[row, column] = covariance(prior, sensor[row], sensor[column], time[row] - time[column])
        among[row, row] += prior.noise_variance[sensor[row]]


@njit(cache=True)
def covariance_with_now(prior: Prior, lag: FloatArray, sensor: IntArray, with_now: FloatArray) -> None:
    """Readings `lag` (m,) before now, of sensors (m,), with the position now, into the first m of `with_now`."""
    for row in range(len(lag)):
        total = 0.0
        for term in range(prior.begins[sensor[row]], prior.begins[sensor[row] + 1]):
            apart = lag[row] + prior.at_s[term]
            total += prior.weight[term] * squared_exponential(
                apart, prior.derivative[term], 0, prior.signal_variance_mm2, prior.inverse_scale_s2
            )
        with_now[row] = total


@njit(cache=True)
def covariance(prior: Prior, own: int, other: int, lag: float) -> float:
    """A reading of one sensor with one of another, or its own, `lag` s before it; without the noise."""
    total = 0.0
    for term in range(prior.begins[own], prior.begins[own + 1]):
        for its in range(prior.begins[other], prior.begins[other + 1]):
            total += (
                prior.weight[term]
                * prior.weight[its]
                * squared_exponential(
                    lag + prior.at_s[term] - prior.at_s[its],
                    prior.derivative[term],
                    prior.derivative[its],
                    prior.signal_variance_mm2,
                    prior.inverse_scale_s2,
                )
            )
    if own == other:
        total += prior.bias_variance[own]
    return total


@njit(cache=True, fastmath={"reassoc", "contract"})  # or sums of products take a step each
def _solve(
    among: FloatArray, first: FloatArray, second: FloatArray, of_first: FloatArray, of_second: FloatArray
) -> None:
    """Solutions for two right-hand sides by Cholesky's factor; by elimination where round-off leaves none."""
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
                whole = np.tril(among) + np.tril(among, -1).T
                of_first[:], of_second[:] = np.linalg.solve(whole, first), np.linalg.solve(whole, second)
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
