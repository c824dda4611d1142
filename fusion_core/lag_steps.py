"""What the search for a lag computes most often, compiled: distances at each shift, and their sums over resamples."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from fusion_core.samples import FloatArray


@njit(cache=True)
def squared_distances(
    time: FloatArray, estimate: FloatArray, known: FloatArray, value: FloatArray, shifts: FloatArray, gap_s: float
) -> FloatArray:
    """‖estimate(t) − reference(t − shift)‖², (n, shifts), by linear interpolation of `value` at the rising `known`.

    NaN outside the reference and in its gaps longer than `gap_s`, but on a reading of it.
    """
    found = np.full((len(time), len(shifts)), np.nan)
    last = len(known) - 1
    for column in range(len(shifts)):
        after = 0  # the first reading at or after the instant
        for row in range(len(time)):
            wanted = time[row] - shifts[column]
            while after <= last and known[after] < wanted:
                after += 1
            while after > 0 and known[after - 1] >= wanted:
                after -= 1
            if after > last or (after == 0 and known[0] != wanted):
                continue
            total = 0.0
            if known[after] == wanted:
                for axis in range(value.shape[1]):
                    total += (estimate[row, axis] - value[after, axis]) ** 2
            else:
                apart = known[after] - known[after - 1]
                if apart > gap_s:
                    continue
                for axis in range(value.shape[1]):
                    slope = (value[after, axis] - value[after - 1, axis]) / apart
                    there = slope * (wanted - known[after - 1]) + value[after - 1, axis]
                    total += (estimate[row, axis] - there) ** 2
            found[row, column] = total
    return found


@njit(cache=True)
def block_sums(distance: FloatArray, block: int) -> FloatArray:
    """Sums of `block` rows of (n, shifts), from each row on that has so many, (n − block + 1, shifts)."""
    rows, shifts = distance.shape
    cumulative, sums = np.zeros((rows + 1, shifts)), np.empty((rows - block + 1, shifts))
    for row in range(rows):
        before, after, own = cumulative[row], cumulative[row + 1], distance[row]
        for column in range(shifts):
            after[column] = before[column] + own[column]
        begin = row + 1 - block
        if begin >= 0:
            first, part = cumulative[begin], sums[begin]
            for column in range(shifts):
                part[column] = after[column] - first[column]
    return sums


@njit(cache=True)
def resampled(sums: FloatArray, picks: npt.NDArray[np.int64]) -> FloatArray:
    """Σ of the rows of `sums` (n, shifts) that each row of `picks` (resamples, k) names, (resamples, shifts)."""
    found = np.zeros((len(picks), sums.shape[1]))
    count = picks.shape[1]
    fours = count - count % 4
    for row in range(len(picks)):
        total, own = found[row], picks[row]
        for at in range(0, fours, 4):  # four at once: the sum is loaded and stored a quarter as often
            a, b, c, d = sums[own[at]], sums[own[at + 1]], sums[own[at + 2]], sums[own[at + 3]]
            for column in range(len(total)):
                total[column] += (a[column] + b[column]) + (c[column] + d[column])
        for at in range(fours, count):
            part = sums[own[at]]
            for column in range(len(total)):
                total[column] += part[column]
    return found
