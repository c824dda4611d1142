"""Estimates of many windows one after the other, compiled: what a window has in common with the one before is kept.

Theory of operation
===================

Each estimate is a Gaussian process over its own window: the last L positions and every acceleration since the first
of them. Solving each window anew costs the cube of its readings; but the next window is nearly the last one.

    window at t      p1  a1 a2 p2 a3 a4 p3 a5
    window at t'         a2 p2 a3 a4 p3 a5 a6        one reading fewer at the begin, one more at the end

Three things are kept from window to window:

- Covariances of readings among themselves do not depend on "now": each pair is computed once, when the later of the
  two comes into the window, and stands in a table whose rows take turns (`_place`), so nothing is moved.
- Cholesky's factor L. A window that only gained readings at its end goes on with the rows it has (`_factor`); where
  its first readings changed, the factor is begun again (`_factor_anew`).
- What follows from the factor for the values: L⁻¹v and L⁻¹c, with c what each reading reads of a constant mean.

With k the covariances of the readings with the position now, the estimate is (L⁻¹k)·(L⁻¹v): weights are never needed,
eqs. (19) to (24) of the paper as in `weights`. Its variance is the prior's less ‖L⁻¹k‖².

What must stay true. (1) The result is that of `weights` for every window, whatever came before; the tests hold each
window against a dense solve. (2) Where times go back, or readings say the same but for round-off so that no factor
exists, the window is solved by itself, by least squares (`_by_weights`). (3) Rows of the factor are used only as far
as they were computed from the readings that stand there now (`_goes_on`).

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
    """Positions and other readings, by time (n,) in s, values (n, d); which sensors of a prior they are."""

    tracker: int
    frame_time: FloatArray
    frames: FloatArray
    other: int
    other_time: FloatArray
    others: FloatArray


class _Held(NamedTuple):
    """Room for what is known of the readings in a window.

    Covariances stand by slots, which a reading keeps while it is in the window: positions in the first `positions` of
    them, by turns, and others in the rest. All else stands by rows: positions and then others, by time.
    """

    positions: int
    among: FloatArray  # (m, m) by slot
    slot: IntArray  # (m,)
    time: FloatArray  # (m,)
    centred: FloatArray  # (d, m): values less what they read of the origin
    constant: FloatArray  # (m,): what each reads of a hand that stays at 1 mm
    factor: FloatArray  # (m, m): Cholesky's, transposed: the upper triangle, with reciprocals on its diagonal
    of_constant: FloatArray  # (m,): L⁻¹c
    of_values: FloatArray  # (d, m): L⁻¹v


@compiled
def _room(positions: int, others: int, dimension: int) -> _Held:
    most = positions + others
    return _Held(
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
    """Fills the rows `wanted` of mean and sd (n, d); `window_spans` (4, n) are those of `regular.spans`."""
    most, most_others, dimension = 0, 0, mean.shape[1]
    for index in wanted:
        first, last, begin, end = window_spans[:, index]
        most, most_others = max(most, last - first), max(most_others, end - begin)
    held = _room(most, most_others, dimension)
    with_now, origin = np.empty(most + most_others), np.zeros(dimension)
    known = np.zeros(4, np.int64)  # the span whose covariances are held
    factored = 0  # rows of the factor that stand
    for index in wanted:
        span = window_spans[:, index]
        positions = span[1] - span[0]
        size = positions + span[3] - span[2]
        if not _goes_on(known, span):
            known[:] = 0
        if span[0] != known[0] or span[1] != known[1] or span[2] != known[2]:
            factored = 0
            if prior.mean != ZERO:
                origin[:] = streams.frames[span[1] - 1]
        _take_in(prior, streams, held, span, factored, size, origin)
        _covariances(prior, streams, held, known, span)
        known[:] = span
        factored = _factor(held, factored, size)
        _covariances_with_now(prior, streams, held, positions, times[index], with_now[:size])
        if factored < size:
            _by_weights(prior, streams, held, positions, size, times[index], origin, mean[index], sd[index])
            known[:] = 0
        else:
            _solve(held.factor, with_now[:size], size)
            _conclude(prior, held, with_now[:size], positions, origin, mean[index], sd[index])


@compiled
def _goes_on(known: IntArray, span: IntArray) -> bool:
    """Has a window only lost readings at its begin, and gained some at its end? Not so where times go back."""
    return bool(span[0] >= known[0] and span[1] >= known[1] and span[2] >= known[2] and span[3] >= known[3])


@compiled
def _take_in(
    prior: Prior, streams: Streams, held: _Held, span: IntArray, begin: int, end: int, origin: FloatArray
) -> None:
    """The readings of a window into the rows begin:end."""
    first, since, positions = span[0], span[2], span[1] - span[0]
    middle = max(begin, min(positions, end))
    _copy(held, begin, middle, first, streams.frame_time, streams.frames, prior.constant[streams.tracker], origin)
    _copy(
        held,
        middle,
        end,
        since - positions,
        streams.other_time,
        streams.others,
        prior.constant[streams.other],
        origin,
    )
    _place(held.slot[begin:middle], first + begin, 0, held.positions)
    _place(held.slot[middle:end], since + middle - positions, held.positions, len(held.among) - held.positions)


@compiled
def _copy(
    held: _Held,
    begin: int,
    end: int,
    apart: int,
    time: FloatArray,
    value: FloatArray,
    constant: float,
    origin: FloatArray,
) -> None:
    """A sensor's readings into the rows begin:end, each of which is `apart` from its own."""
    times, centred, constants = held.time, held.centred, held.constant
    for row in range(begin, end):
        times[row], constants[row] = time[row + apart], constant
        for axis in range(len(origin)):
            centred[axis, row] = value[row + apart, axis] - constant * origin[axis]


@compiled
def _place(slot: IntArray, at: int, begin: int, count: int) -> None:
    """The slots of consecutive readings from `at` on, which take turns in `count` slots from `begin` on."""
    turn = at % count if count else 0
    for row in range(len(slot)):
        slot[row] = begin + turn
        turn = turn + 1 if turn + 1 < count else 0


@compiled
def _covariances(prior: Prior, streams: Streams, held: _Held, known: IntArray, span: IntArray) -> None:
    """Covariances of the readings that come into the window, with all that are in it."""
    inverse_scale, begins, shift, polynomial, shared = prior.covariances
    among, slot, time, noise = held.among, held.slot, held.time, prior.noise_variance
    tracker, other, positions = streams.tracker, streams.other, span[1] - span[0]
    size = positions + span[3] - span[2]
    there, there_others = max(known[1] - span[0], 0), positions + max(known[3] - span[2], 0)
    for row in range(there, size):
        if positions <= row < there_others:
            continue
        own, place, since = tracker if row < positions else other, slot[row], time[row]
        for column in range(positions):
            found = covariance(inverse_scale, begins, shift, polynomial, shared, own, tracker, since - time[column])
            among[place, slot[column]] = among[slot[column], place] = found
        for column in range(positions, size):
            found = covariance(inverse_scale, begins, shift, polynomial, shared, own, other, since - time[column])
            among[place, slot[column]] = among[slot[column], place] = found
        among[place, place] += noise[own]


@compiled
def _covariances_with_now(
    prior: Prior, streams: Streams, held: _Held, positions: int, now: float, with_now: FloatArray
) -> None:
    """Covariances of the readings of a window with the position now."""
    inverse_scale, begins, shift, polynomial, shared = prior.covariances
    time, position = held.time, len(prior.noise_variance)
    for row in range(len(with_now)):
        own = streams.tracker if row < positions else streams.other
        with_now[row] = covariance(inverse_scale, begins, shift, polynomial, shared, own, position, time[row] - now)


@compiled
def _factor(held: _Held, begin: int, size: int) -> int:
    """Rows begin:size of the factor, and of what follows from it; how many stand, fewer where round-off left none."""
    if begin == 0:
        return _factor_anew(held, size)
    factor, among, slot = held.factor, held.among, held.slot
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
        held.of_constant[row] = (held.constant[row] - _dot(column[:row], held.of_constant[:row])) * inverse
        for axis in range(len(held.of_values)):
            explained = _dot(column[:row], held.of_values[axis, :row])
            held.of_values[axis, row] = (held.centred[axis, row] - explained) * inverse
    return size


@compiled(fastmath={"contract"})
def _factor_anew(held: _Held, size: int) -> int:
    """All rows of the factor; as `_factor`."""
    factor, among, slot = held.factor, held.among, held.slot
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
        found, inverse = factor[row, row:size], 1.0 / np.sqrt(own[0])
        for column in range(len(own)):
            found[column] = own[column] * inverse
        found[0] = inverse
    held.of_constant[:size] = held.constant[:size]
    _solve(factor, held.of_constant[:size], size)
    for axis in range(len(held.of_values)):
        held.of_values[axis, :size] = held.centred[axis, :size]
        _solve(factor, held.of_values[axis, :size], size)
    return size


@compiled(fastmath={"contract"})
def _solve(factor: FloatArray, right: FloatArray, size: int) -> None:
    """L⁻¹ of a right-hand side, in its place."""
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


@compiled(fastmath={"reassoc", "contract"})  # or sums of products take a step each
def _dot(first: FloatArray, second: FloatArray) -> float:
    total = 0.0
    for index in range(len(first)):
        total += first[index] * second[index]
    return total


@compiled
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
            total += missing * float(np.mean(held.centred[axis, :positions]))
        mean[axis], sd[axis] = origin[axis] + total, np.sqrt(max(variance, 0.0))  # round-off may leave less


@compiled
def _by_weights(
    prior: Prior,
    streams: Streams,
    held: _Held,
    positions: int,
    size: int,
    now: float,
    origin: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
) -> None:
    """One window's estimate where there is no factor."""
    time, sensor = np.empty((1, size)), np.full(size, streams.other)
    time[0], sensor[:positions] = held.time[:size], streams.tracker
    weights, variance = gains(prior, time, np.array([now]), sensor)
    for axis in range(len(mean)):
        mean[axis] = origin[axis] + np.sum(weights[0] * held.centred[axis, :size])
        sd[axis] = np.sqrt(variance[0])
