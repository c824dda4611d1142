"""The search for a lag, compiled: the costs of blocks of instants at each shift, and the best shift of each resample.

Theory of operation
===================

The lag of an estimate is the shift s that minimises Σ‖estimate(t) − reference(t − s)‖² over the instants t; its
interval comes from resampling blocks of instants that follow each other (a moving-block bootstrap), hundreds of
times. Done directly, that takes instants × shifts × resamples distances. Two facts make it cheap:

- The reference is a straight line between its readings, so an instant's squared distance is, within each piece, a
  quadratic of the shift: three numbers a piece instead of a distance a shift (`_squared_distances`).
- A resample's cost is the sum of its blocks' costs. So the costs of every block at every shift are computed once
  (`block_costs`), and a resample only adds rows.

Besides, most shifts cannot be the best. Shifts are in groups of eight, which fill one cache line:

    shifts          | 0 … 7 | 8 … 15 | 16 … 23 | …
    lowest a block  |   4   |    1   |     6   | …        a bound for each block and group

For each group, the sum of the blocks' lowest costs is a lower bound on a resample's cost. A group whose bound is above
a cost that is already known is skipped (`best_of_resamples`); most groups are.

What must stay true. The result is the one that all costs would give, to the last bit: the tests compare it with the sum
over all shifts. Where several neighbouring shifts fit equally well (the hand stands still), the first of them counts. A
resample counts as still only if each of its blocks is (`_STILL`).

What may change. The size of a group, how blocks are picked, and how many are kept of a long recording, each of which
takes 2 kB. The cost must stay a sum over instants, or nothing of this holds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_GROUP = 8  # shifts: one cache line of 64 bytes
_ROUND_OFF = 1e-9  # by how much of a cost the order of a sum may change it
_STILL = 1e-6  # a block whose costs differ by less than this share is the same at every shift


class Segments(NamedTuple):
    """A reference's straight pieces between readings at `time` (n + 1,) in s: begins and slopes (d, n)."""

    time: FloatArray
    begin: FloatArray
    slope: FloatArray


class Blocks(NamedTuple):
    """Costs of blocks of consecutive instants, one from each `every`-th instant that has enough instants after it."""

    cost: FloatArray  # (groups, blocks, 8) mm²; the last group is filled up with inf
    bound: FloatArray  # (blocks, groups) mm²: the lowest of each group
    still: npt.NDArray[np.bool_]  # (blocks,): the cost is the same at every shift but for round-off
    total: FloatArray  # (shifts,) mm²: of all instants


@compiled
def block_costs(
    segments: Segments, time: FloatArray, estimate: FloatArray, shifts: FloatArray, block: int, every: int
) -> Blocks:
    """Σ‖estimate(t) − reference(t − shift)‖² over every `block` consecutive instants, for rising `shifts` in s.

    `time` (n,) rises, `estimate` is (n, d); the reference must cover every shift of each instant. Blocks are kept that
    begin at every `every`-th instant; `total` is of all instants.
    """
    count, groups = len(shifts), (len(shifts) + _GROUP - 1) // _GROUP
    blocks = (len(time) - block) // every + 1
    cost = np.empty((groups, blocks, _GROUP))
    cost[-1] = np.inf
    bound, still, total = np.empty((blocks, groups)), np.empty(blocks, np.bool_), np.zeros(count)
    recent, newest, running = np.zeros((block, count)), np.empty(count), np.zeros(count)
    quadratic, begin = np.empty((3, len(segments.time))), 0
    quadratic[2] = 0.0
    for axis in range(len(segments.slope)):
        for segment in range(segments.slope.shape[1]):
            quadratic[2, segment] += segments.slope[axis, segment] ** 2
    for row in range(len(time)):
        while begin < len(segments.time) - 2 and segments.time[begin + 1] <= time[row] - shifts[-1]:
            begin += 1
        _squared_distances(segments, begin, time[row], estimate[row], shifts, quadratic, newest)
        oldest = recent[row % block]
        for shift in range(count):
            running[shift] += newest[shift] - oldest[shift]
            total[shift] += newest[shift]
            oldest[shift] = newest[shift]
        at = (row - block + 1) // every
        if row >= block - 1 and at * every == row - block + 1:
            still[at] = _into_groups(running, cost[:, at], bound[at])
    return Blocks(cost, bound, still, total)


@compiled
def _squared_distances(
    segments: Segments,
    begin: int,
    time: float,
    estimate: FloatArray,
    shifts: FloatArray,
    quadratic: FloatArray,
    distances: FloatArray,
) -> None:
    """Writes one instant's squared distance at each shift into `distances`, starting at segment `begin`.

    Within a segment the squared distance is a quadratic of time.
    """
    last, end = len(segments.time) - 2, begin
    while end < last and segments.time[end + 1] <= time - shifts[0]:
        end += 1
    constant, linear = quadratic[0, begin : end + 1], quadratic[1, begin : end + 1]
    constant[:], linear[:] = 0.0, 0.0
    for axis in range(len(estimate)):
        start, slope = segments.begin[axis, begin : end + 1], segments.slope[axis, begin : end + 1]
        here = estimate[axis]
        for segment in range(len(start)):
            apart = here - start[segment]
            constant[segment] += apart * apart
            linear[segment] -= 2.0 * apart * slope[segment]
    shift = len(shifts) - 1
    wanted = time - shifts[shift]
    for segment in range(begin, end + 1):
        until = segments.time[segment + 1] if segment < end else np.inf
        while wanted < until:
            since = wanted - segments.time[segment]
            distances[shift] = quadratic[0, segment] + since * (quadratic[1, segment] + since * quadratic[2, segment])
            shift -= 1
            if shift < 0:
                return
            wanted = time - shifts[shift]


@compiled
def _into_groups(running: FloatArray, cost: FloatArray, bound: FloatArray) -> bool:
    """Writes one block's costs by group and their bounds; returns whether all costs are the same up to round-off."""
    lowest, highest = np.inf, -np.inf
    for group in range(len(bound)):
        least = np.inf
        for column in range(min(_GROUP, len(running) - group * _GROUP)):
            own = running[group * _GROUP + column]
            cost[group, column] = own
            least, highest = min(least, own), max(highest, own)
        bound[group], lowest = least, min(lowest, least)
    return highest - lowest <= _STILL * highest


@compiled
def best_of_resamples(blocks: Blocks, picks: npt.NDArray[np.int64]) -> FloatArray:
    """The best shift (resamples,), in steps from the first, of each resample: a row of block numbers `picks` (…, k).

    NaN where all its blocks are still, since any shift fits then.
    """
    groups, count = len(blocks.cost), len(blocks.total)
    scale = 0.0
    for of_all in blocks.total:
        scale = max(scale, of_all)
    best_shift, bound, cost = np.full(len(picks), np.nan), np.empty(groups), np.empty(groups * _GROUP)
    for row in range(len(picks)):
        own = picks[row]
        if _all_still(blocks.still, own):
            continue
        _summed(blocks.bound, own, bound)
        cost[:] = np.inf
        group = _first_of_lowest(bound, groups, 0.0)
        least = _costs_of(blocks, group, own, cost)
        bound[group] = np.inf
        for group in range(groups):
            if bound[group] <= least + _ROUND_OFF * scale:
                least = min(least, _costs_of(blocks, group, own, cost))
                bound[group] = np.inf
        at = _first_of_lowest(cost, count, scale)
        for group in ((at - 1) // _GROUP, (at + 1) // _GROUP):
            if 0 <= group < groups and bound[group] < np.inf:
                _costs_of(blocks, group, own, cost)
        best_shift[row] = best(cost[:count], scale)
    return best_shift


@compiled
def _all_still(still: npt.NDArray[np.bool_], picks: npt.NDArray[np.int64]) -> bool:
    for pick in picks:  # noqa: SIM110 - Numba has no generators
        if not still[pick]:
            return False
    return True


@compiled
def _lowest(cost: FloatArray) -> float:
    lowest = np.inf
    for one in cost:
        lowest = min(lowest, one)
    return lowest


@compiled
def _summed(rows: FloatArray, picks: npt.NDArray[np.int64], total: FloatArray) -> None:
    """Writes the sum of the rows numbered `picks` into `total`."""
    total[:] = 0.0
    fours = len(picks) - len(picks) % 4
    for at in range(0, fours, 4):  # four at once: the sum is loaded and stored a quarter as often
        a, b, c, d = rows[picks[at]], rows[picks[at + 1]], rows[picks[at + 2]], rows[picks[at + 3]]
        for column in range(len(total)):
            total[column] += (a[column] + b[column]) + (c[column] + d[column])
    for at in range(fours, len(picks)):
        part = rows[picks[at]]
        for column in range(len(total)):
            total[column] += part[column]


@compiled
def _costs_of(blocks: Blocks, group: int, picks: npt.NDArray[np.int64], cost: FloatArray) -> float:
    """Writes a resample's costs at one group of shifts; returns the lowest of them."""
    own = cost[group * _GROUP : (group + 1) * _GROUP]
    _summed(blocks.cost[group], picks, own)
    return _lowest(own)


@compiled
def _first_of_lowest(cost: FloatArray, count: int, scale: float) -> int:
    """The index of the lowest of the first `count` costs; the first of those that are equal up to round-off."""
    enough = _lowest(cost[:count]) + _ROUND_OFF * scale
    at = 0
    while cost[at] > enough:
        at += 1
    return at


@compiled
def best(cost: FloatArray, scale: float) -> float:
    """The shift of the lowest cost, in steps from the first, refined by a parabola unless it is at an edge."""
    at = _first_of_lowest(cost, len(cost), scale)
    if 0 < at < len(cost) - 1:
        before, here, after = cost[at - 1], cost[at], cost[at + 1]
        bend = before - 2.0 * here + after
        if bend > _ROUND_OFF * scale:
            return float(at + (before - after) / (2.0 * bend))
    return float(at)
