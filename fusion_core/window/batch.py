"""Estimates of many windows one after the other, compiled: work that a window shares with the one before is reused.

Theory of operation
===================

Each estimate is a Gaussian process over its own window: the last L positions and every acceleration since the first
of them. Solving each window anew costs the cube of its readings; but the next window is nearly the last one.

    window at t      p1  a1 a2 p2 a3 a4 p3 a5
    window at t'               p2 a3 a4 p3 a5 a6 p4      what came before p2 has left, a6 and p4 have come in

Three things are kept from window to window:

- Covariances of readings among themselves do not depend on "now": each pair is computed once, when the later of the
  two comes into the window. It stands in a table whose rows and columns are reused in turn (`_assign_slots`), so
  nothing needs to be moved when the window moves.
- The Cholesky factor L. A window that only gained readings at its end keeps the rows it has and gets new ones
  (`_factor`); where its first readings changed, the factor is computed anew (`_factor_anew`).
- What follows from the factor for the values v: L⁻¹v, and L⁻¹c with c the readings of a hand that stays at 1 mm.

With k the covariances of the readings with the position now, the estimate is (L⁻¹k)·(L⁻¹v), and its variance is the
prior's less ‖L⁻¹k‖². That is what eqs. (19) to (24) of the paper give, without computing the weights themselves.

What must stay true. (1) The result is that of `weights` for every window, whatever came before; the tests compare each
window with a dense solve. (2) Where times go back, nothing is reused. Where readings repeat each other up to round-off,
so that no Cholesky factor exists, the window is solved by itself, by least squares (`_write_by_weights`). (3) Rows of
the factor are reused only if they were computed from the readings that stand there now (`_moves_forward`).

What may change. The covariance function: it is a polynomial times one exponential (`kernels`), and only `kernels`
knows it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray
from fusion_core.window.kernels import IntArray, covariance
from fusion_core.window.weights import CONSTANT, WINDOW, ZERO, Prior, gains


class Streams(NamedTuple):
    """Positions and other readings: times (n,) in s, values (n, d), and each sensor's index in `Prior`."""

    tracker: int
    frame_time: FloatArray
    frames: FloatArray
    other: int
    other_time: FloatArray
    others: FloatArray


class _Memory(NamedTuple):
    """What is kept from one window to the next; m is the largest number of readings in a window.

    The covariances are indexed by slot. A reading keeps its slot while it is in the window; positions use the first
    `positions` slots in turn, other readings the rest. Everything else is indexed by row: positions and then the other
    readings, each by time.
    """

    positions: int
    among: FloatArray  # (m, m) by slot
    slot: IntArray  # (m,)
    time: FloatArray  # (m,)
    centred: FloatArray  # (d, m): values less what the sensor would read at the origin
    constant: FloatArray  # (m,): what each would read if the hand stayed at 1 mm
    factor: FloatArray  # (m, m): the Cholesky factor's transpose, an upper triangle, with reciprocals on the diagonal
    of_constant: FloatArray  # (m,): L⁻¹c
    of_values: FloatArray  # (d, m): L⁻¹v


@compiled
def _room(positions: int, others: int, dimension: int) -> _Memory:
    most = positions + others
    return _Memory(
        positions,
        np.empty((most, most)),
        np.empty(most, np.int64),
        np.empty(most),
        np.empty((dimension, most)),
        np.empty(most),
        np.empty((most, most)),
        np.empty(most),
        np.empty((dimension, most)),
    )


@compiled
def estimates(
    prior: Prior,
    streams: Streams,
    times: FloatArray,
    window_spans: IntArray,
    wanted: IntArray,
    mean: FloatArray,
    sd: FloatArray,
) -> None:
    """Fills the rows `wanted` of `mean` and `sd` (n, d) in mm, for `times` (n,) in s.

    `window_spans` (4, n) come from `regular.spans`: which positions and other readings are in each window.
    """
    most, largest_others, dimension = 0, 0, mean.shape[1]
    for index in wanted:
        first, last, begin, end = window_spans[:, index]
        most, largest_others = max(most, last - first), max(largest_others, end - begin)
    memory = _room(most, largest_others, dimension)
    with_now, origin = np.empty(most + largest_others), np.zeros(dimension)
    known = np.zeros(4, np.int64)  # the span whose covariances are in memory
    factored = 0  # how many rows of the factor are valid
    for index in wanted:
        span = window_spans[:, index]
        positions = span[1] - span[0]
        size = positions + span[3] - span[2]
        if not _moves_forward(known, span):
            known[:] = 0
        if span[0] != known[0] or span[1] != known[1] or span[2] != known[2]:
            factored = 0
            if prior.mean != ZERO:
                origin[:] = streams.frames[span[1] - 1]
        _load_readings(prior, streams, memory, span, factored, size, origin)
        _covariances(prior, streams, memory, known, span)
        known[:] = span
        factored = _factor(memory, factored, size)
        _covariances_with_now(prior, streams, memory, positions, times[index], with_now[:size])
        if factored < size:
            _write_by_weights(prior, streams, memory, positions, size, times[index], origin, mean[index], sd[index])
            known[:] = 0
        else:
            _solve(memory.factor, with_now[:size], size)
            _write_estimate(prior, memory, with_now[:size], positions, origin, mean[index], sd[index])


@compiled
def _moves_forward(known: IntArray, span: IntArray) -> bool:
    """Whether a window has only lost readings at its begin and gained some at its end; false where times go back."""
    return bool(span[0] >= known[0] and span[1] >= known[1] and span[2] >= known[2] and span[3] >= known[3])


@compiled
def _load_readings(
    prior: Prior, streams: Streams, memory: _Memory, span: IntArray, begin: int, end: int, origin: FloatArray
) -> None:
    """Copies the readings of a window into the rows begin:end of the memory, and assigns their slots."""
    first, since, positions = span[0], span[2], span[1] - span[0]
    middle = max(begin, min(positions, end))
    _copy(memory, begin, middle, first, streams.frame_time, streams.frames, prior.constant[streams.tracker], origin)
    _copy(
        memory,
        middle,
        end,
        since - positions,
        streams.other_time,
        streams.others,
        prior.constant[streams.other],
        origin,
    )
    _assign_slots(memory.slot[begin:middle], first + begin, 0, memory.positions)
    _assign_slots(
        memory.slot[middle:end], since + middle - positions, memory.positions, len(memory.among) - memory.positions
    )


@compiled
def _copy(
    memory: _Memory,
    begin: int,
    end: int,
    apart: int,
    time: FloatArray,
    value: FloatArray,
    constant: float,
    origin: FloatArray,
) -> None:
    """Copies a sensor's readings into the rows begin:end; reading `row + apart` goes into row `row`."""
    times, centred, constants = memory.time, memory.centred, memory.constant
    for row in range(begin, end):
        times[row], constants[row] = time[row + apart], constant
        for axis in range(len(origin)):
            centred[axis, row] = value[row + apart, axis] - constant * origin[axis]


@compiled
def _assign_slots(slot: IntArray, at: int, begin: int, count: int) -> None:
    """Assigns slots to consecutive readings, the first of them number `at`: `count` slots from `begin` on, in turn."""
    turn = at % count if count else 0
    for row in range(len(slot)):
        slot[row] = begin + turn
        turn = turn + 1 if turn + 1 < count else 0


@compiled
def _covariances(prior: Prior, streams: Streams, memory: _Memory, known: IntArray, span: IntArray) -> None:
    """Computes the covariances of the readings that are new in the window with all readings in it."""
    inverse_scale, begins, shift, polynomial, shared = prior.covariances
    among, slot, time, noise = memory.among, memory.slot, memory.time, prior.noise_variance
    tracker, other, positions = streams.tracker, streams.other, span[1] - span[0]
    size = positions + span[3] - span[2]
    there, there_others = max(known[1] - span[0], 0), positions + max(known[3] - span[2], 0)
    for row in range(there, size):
        if positions <= row < there_others:
            continue
        own, place, since = tracker if row < positions else other, slot[row], time[row]
        for column in range(positions):
            shared_variance = covariance(
                inverse_scale, begins, shift, polynomial, shared, own, tracker, since - time[column]
            )
            among[place, slot[column]] = among[slot[column], place] = shared_variance
        for column in range(positions, size):
            shared_variance = covariance(
                inverse_scale, begins, shift, polynomial, shared, own, other, since - time[column]
            )
            among[place, slot[column]] = among[slot[column], place] = shared_variance
        among[place, place] += noise[own]


@compiled
def _covariances_with_now(
    prior: Prior, streams: Streams, memory: _Memory, positions: int, now: float, with_now: FloatArray
) -> None:
    """Computes the covariances `with_now` (m,) of the readings of a window with the position now."""
    inverse_scale, begins, shift, polynomial, shared = prior.covariances
    time, position = memory.time, len(prior.noise_variance)
    for row in range(len(with_now)):
        own = streams.tracker if row < positions else streams.other
        with_now[row] = covariance(inverse_scale, begins, shift, polynomial, shared, own, position, time[row] - now)


@compiled
def _factor(memory: _Memory, begin: int, size: int) -> int:
    """Computes the rows begin:size of the factor, L⁻¹v and L⁻¹c.

    Returns how many rows are valid: fewer than `size` where round-off made the covariances singular.
    """
    if begin == 0:
        return _factor_anew(memory, size)
    factor, among, slot = memory.factor, memory.among, memory.slot
    column = np.empty(size)
    for row in range(begin, size):
        for before in range(row):
            column[before] = among[slot[row], slot[before]]
        _solve(factor, column[:row], row)
        rest = among[slot[row], slot[row]] - _dot(column[:row], column[:row])
        if not rest > 0.0:
            return row
        factor[:row, row] = column[:row]
        factor[row, row] = inverse = 1.0 / np.sqrt(rest)
        memory.of_constant[row] = (memory.constant[row] - _dot(column[:row], memory.of_constant[:row])) * inverse
        for axis in range(len(memory.of_values)):
            explained = _dot(column[:row], memory.of_values[axis, :row])
            memory.of_values[axis, row] = (memory.centred[axis, row] - explained) * inverse
    return size


@compiled(fastmath={"contract"})
def _factor_anew(memory: _Memory, size: int) -> int:
    """Computes all rows; returns how many are valid, as `_factor` does."""
    factor, among, slot = memory.factor, memory.among, memory.slot
    whole = np.empty(size)
    for row in range(size):
        own, covariances = whole[row:], among[slot[row]]
        for column in range(len(own)):
            own[column] = covariances[slot[row + column]]
        fours = row - row % 4
        for at in range(0, fours, 4):  # four rows at once: a sum is loaded and stored a quarter as often
            a, b, c, d = (
                factor[at, row:size],
                factor[at + 1, row:size],
                factor[at + 2, row:size],
                factor[at + 3, row:size],
            )
            of_a, of_b, of_c, of_d = a[0], b[0], c[0], d[0]
            for column in range(len(own)):
                own[column] -= (of_a * a[column] + of_b * b[column]) + (of_c * c[column] + of_d * d[column])
        for at in range(fours, row):
            part = factor[at, row:size]
            of_part = part[0]
            for column in range(len(own)):
                own[column] -= of_part * part[column]
        if not own[0] > 0.0:
            return row
        factor_row, inverse = factor[row, row:size], 1.0 / np.sqrt(own[0])
        for column in range(len(own)):
            factor_row[column] = own[column] * inverse
        factor_row[0] = inverse
    memory.of_constant[:size] = memory.constant[:size]
    _solve(factor, memory.of_constant[:size], size)
    for axis in range(len(memory.of_values)):
        memory.of_values[axis, :size] = memory.centred[axis, :size]
        _solve(factor, memory.of_values[axis, :size], size)
    return size


@compiled(fastmath={"contract"})
def _solve(factor: FloatArray, right: FloatArray, size: int) -> None:
    """Replaces a right-hand side r by L⁻¹r; four columns at once, which loads and stores it a quarter as often."""
    fours = size - size % 4
    for at in range(0, fours, 4):
        a, b, c, d = factor[at, at:size], factor[at + 1, at:size], factor[at + 2, at:size], factor[at + 3, at:size]
        own = right[at:size]
        own[0] *= a[0]
        own[1] = (own[1] - a[1] * own[0]) * b[1]
        own[2] = (own[2] - a[2] * own[0] - b[2] * own[1]) * c[2]
        own[3] = (own[3] - a[3] * own[0] - b[3] * own[1] - c[3] * own[2]) * d[3]
        of_a, of_b, of_c, of_d = own[0], own[1], own[2], own[3]
        for row in range(4, len(own)):
            own[row] -= (of_a * a[row] + of_b * b[row]) + (of_c * c[row] + of_d * d[row])
    for at in range(fours, size):
        right[at] *= factor[at, at]
        for row in range(at + 1, size):
            right[row] -= factor[at, row] * right[at]


@compiled(fastmath={"reassoc", "contract"})  # otherwise the additions could not run in parallel
def _dot(first: FloatArray, second: FloatArray) -> float:
    total = 0.0
    for index in range(len(first)):
        total += first[index] * second[index]
    return total


@compiled
def _write_estimate(
    prior: Prior,
    memory: _Memory,
    of_now: FloatArray,
    positions: int,
    origin: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
) -> None:
    """Writes one window's position (d,) and SD (d,), with the mean that the prior has."""
    size = len(of_now)
    of_constant = memory.of_constant[:size]
    variance, share = prior.signal_variance_mm2 - _dot(of_now, of_now), 0.0
    missing = 1.0 - _dot(of_now, of_constant)
    if prior.mean == CONSTANT:
        precision = _dot(of_constant, of_constant)
        share = missing / precision
        variance += missing * missing / precision
    for axis in range(len(mean)):
        total = _dot(of_now, memory.of_values[axis, :size])
        if prior.mean == CONSTANT:
            total += share * _dot(of_constant, memory.of_values[axis, :size])
        elif prior.mean == WINDOW:
            total += missing * float(np.mean(memory.centred[axis, :positions]))
        mean[axis], sd[axis] = origin[axis] + total, np.sqrt(max(variance, 0.0))  # round-off may leave it below 0


@compiled
def _write_by_weights(
    prior: Prior,
    streams: Streams,
    memory: _Memory,
    positions: int,
    size: int,
    now: float,
    origin: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
) -> None:
    """Writes one window's position and SD where there is no Cholesky factor."""
    time, sensor = np.empty((1, size)), np.full(size, streams.other)
    time[0], sensor[:positions] = memory.time[:size], streams.tracker
    weights, variance = gains(prior, time, np.array([now]), sensor)
    for axis in range(len(mean)):
        mean[axis] = origin[axis] + np.sum(weights[0] * memory.centred[axis, :size])
        sd[axis] = np.sqrt(variance[0])
