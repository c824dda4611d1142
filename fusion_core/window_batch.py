"""Estimates of many windows one after the other, compiled: what a window has in common with the one before is kept.

Covariances of readings among themselves do not depend on "now". A window that only gained readings at its end goes on
with the Cholesky factor it has; where its first readings changed, the covariances that stay are moved and the factor is
begun again. With the factor L, of covariances k with "now", of c, what each reads of a constant, and of values v, the
estimate is (L⁻¹k)·(L⁻¹v), so that weights are never needed: eqs. (19) to (24) as in `window_gains`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from fusion_core.kernels import IntArray
from fusion_core.samples import FloatArray
from fusion_core.window_gains import CONSTANT, WINDOW, ZERO, Prior, covariance, covariance_with_now, gains


class Streams(NamedTuple):
    """Positions and other readings, by time (n,) in s, values (n, d); which sensors of a prior they are."""

    tracker: int
    frame_time: FloatArray
    frames: FloatArray
    other: int
    other_time: FloatArray
    others: FloatArray


class _Held(NamedTuple):
    """Room for one window's readings, rows in the order of positions and then others, with what is known of them."""

    time: FloatArray  # (m,)
    sensor: IntArray  # (m,)
    centred: FloatArray  # (m, d): values less what they read of the origin
    among: FloatArray  # (m, m): covariances, the lower triangle
    factor: FloatArray  # (m, m): Cholesky's, the lower triangle, with reciprocals on its diagonal
    constant: FloatArray  # (m,): what each reads of a hand that stays at 1 mm
    of_constant: FloatArray  # (m,): L⁻¹c
    of_values: FloatArray  # (d, m): L⁻¹v


@njit(cache=True)
def _room(most: int, dimension: int) -> _Held:
    return _Held(
        np.empty(most),
        np.empty(most, np.int64),
        np.empty((most, dimension)),
        np.empty((most, most)),
        np.empty((most, most)),
        np.empty(most),
        np.empty(most),
        np.empty((dimension, most)),
    )


@njit(cache=True)
def estimates(
    prior: Prior,
    streams: Streams,
    times: FloatArray,
    window_spans: IntArray,
    wanted: IntArray,
    mean: FloatArray,
    sd: FloatArray,
) -> None:
    """Fills the rows `wanted` of mean and sd (n, d); `window_spans` (4, n) are those of `window_steps.spans`."""
    most, dimension = 0, mean.shape[1]
    for index in wanted:
        first, last, begin, end = window_spans[:, index]
        most = max(most, last - first + end - begin)
    held, moved = _room(most, dimension), np.empty((most, most))
    with_now, of_now, origin = np.empty(most), np.empty(most), np.zeros(dimension)
    known = np.zeros(4, np.int64)  # the span whose covariances are held
    factored = 0  # rows of the factor that stand
    for index in wanted:
        span = window_spans[:, index]
        size = span[1] - span[0] + span[3] - span[2]
        before = known[1] - known[0] + known[3] - known[2]
        if not (span[0] == known[0] and span[1] == known[1] and span[2] == known[2] and span[3] >= known[3]):
            if prior.mean != ZERO:
                origin[:] = streams.frames[span[1] - 1]
            _move(held.among, moved, known, span)
            _take_in(prior, streams, held, span, 0, size, origin)
            before = factored = 0
        else:
            _take_in(prior, streams, held, span, before, size, origin)
            held.among[before:size, :size] = np.nan
        _complete(prior, held, size, before)
        known[:] = span
        factored = _factor(held, factored, size)
        covariance_with_now(prior, held.time[:size] - times[index], held.sensor[:size], with_now)
        if factored < size:
            _by_weights(prior, held, size, times[index], origin, mean[index], sd[index])
        else:
            _substitute(held.factor, with_now, of_now, size)
            _conclude(prior, held, of_now[:size], span[1] - span[0], origin, mean[index], sd[index])


@njit(cache=True)
def _take_in(
    prior: Prior, streams: Streams, held: _Held, span: IntArray, begin: int, end: int, origin: FloatArray
) -> None:
    """The readings of a window into the rows begin:end."""
    positions = span[1] - span[0]
    for row in range(begin, end):
        if row < positions:
            sensor, at = streams.tracker, span[0] + row
            held.time[row], value = streams.frame_time[at], streams.frames[at]
        else:
            sensor, at = streams.other, span[2] + row - positions
            held.time[row], value = streams.other_time[at], streams.others[at]
        held.sensor[row], held.constant[row] = sensor, prior.constant[sensor]
        for axis in range(len(origin)):
            held.centred[row, axis] = value[axis] - prior.constant[sensor] * origin[axis]


@njit(cache=True)
def _move(among: FloatArray, moved: FloatArray, known: IntArray, span: IntArray) -> None:
    """The covariances of one span to the places they have in another; NaN where there were none."""
    positions, before = span[1] - span[0], known[1] - known[0]
    size = positions + span[3] - span[2]
    place = np.full(size, -1)
    for row in range(size):
        if row < positions:
            at = span[0] + row
            if known[0] <= at < known[1]:
                place[row] = at - known[0]
        else:
            at = span[2] + row - positions
            if known[2] <= at < known[3]:
                place[row] = before + at - known[2]
    for row in range(size):
        for column in range(row + 1):
            there = place[row] >= 0 and place[column] >= 0
            moved[row, column] = among[place[row], place[column]] if there else np.nan
    among[:size, :size] = moved[:size, :size]


@njit(cache=True)
def _complete(prior: Prior, held: _Held, size: int, begin: int) -> None:
    """The covariances that are not known yet, in the rows from `begin` on."""
    for row in range(begin, size):
        for column in range(row + 1):
            if np.isnan(held.among[row, column]):
                apart = held.time[row] - held.time[column]
                held.among[row, column] = covariance(prior, held.sensor[row], held.sensor[column], apart)
                if row == column:
                    held.among[row, row] += prior.noise_variance[held.sensor[row]]


@njit(cache=True, fastmath={"reassoc", "contract"})  # or sums of products take a step each
def _dot(first: FloatArray, second: FloatArray) -> float:
    total = 0.0
    for index in range(len(first)):
        total += first[index] * second[index]
    return total


@njit(cache=True)
def _factor(held: _Held, begin: int, size: int) -> int:
    """Rows begin:size of the factor, and of what follows from it; how many stand, fewer where round-off left none."""
    factor = held.factor
    for row in range(begin, size):
        own = factor[row]
        for column in range(row):
            rest = held.among[row, column] - _dot(own[:column], factor[column, :column])
            own[column] = rest * factor[column, column]
        rest = held.among[row, row] - _dot(own[:row], own[:row])
        if not rest > 0.0:
            return row
        own[row] = 1.0 / np.sqrt(rest)
        held.of_constant[row] = (held.constant[row] - _dot(own[:row], held.of_constant[:row])) * own[row]
        for axis in range(len(held.of_values)):
            explained = _dot(own[:row], held.of_values[axis, :row])
            held.of_values[axis, row] = (held.centred[row, axis] - explained) * own[row]
    return size


@njit(cache=True)
def _substitute(factor: FloatArray, right: FloatArray, solution: FloatArray, size: int) -> None:
    """L⁻¹ of a right-hand side."""
    for row in range(size):
        solution[row] = (right[row] - _dot(factor[row, :row], solution[:row])) * factor[row, row]


@njit(cache=True)
def _conclude(
    prior: Prior, held: _Held, of_now: FloatArray, positions: int, origin: FloatArray, mean: FloatArray, sd: FloatArray
) -> None:
    """One window's estimate, by the mean of the prior."""
    size = len(of_now)
    of_constant = held.of_constant[:size]
    variance, share = prior.signal_variance_mm2 - _dot(of_now, of_now), 0.0
    missing = 1.0 - _dot(of_now, of_constant)
    if prior.mean == CONSTANT:
        precision = _dot(of_constant, of_constant)
        share = missing / precision
        variance += missing * missing / precision
    for axis in range(len(mean)):
        total = _dot(of_now, held.of_values[axis, :size])
        if prior.mean == CONSTANT:
            total += share * _dot(of_constant, held.of_values[axis, :size])
        elif prior.mean == WINDOW:
            total += missing * float(np.mean(held.centred[:positions, axis]))
        mean[axis], sd[axis] = origin[axis] + total, np.sqrt(variance)


@njit(cache=True)
def _by_weights(
    prior: Prior, held: _Held, size: int, now: float, origin: FloatArray, mean: FloatArray, sd: FloatArray
) -> None:
    """One window's estimate where there is no factor."""
    time = np.empty((1, size))
    time[0] = held.time[:size]
    weights, variance = gains(prior, time, np.array([now]), held.sensor[:size])
    for axis in range(len(mean)):
        total = 0.0
        for row in range(size):
            total += weights[0, row] * held.centred[row, axis]
        mean[axis], sd[axis] = origin[axis] + total, np.sqrt(variance[0])
