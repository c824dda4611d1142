"""What two sensors measured, brought onto one grid and into the band in which hands move: see `motion`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.by_parts import parts_of, sums_before
from pipeline.statistics.arrays import FloatArray

STEP_S = 0.04
BAND_HZ = _LOW_HZ, _HIGH_HZ = 0.3, 4.0


def rising(time: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times and values in the order of time, the first of each time; no copy where they are that already."""
    if (time[1:] > time[:-1]).all():
        return time, value
    time, first = np.unique(time, return_index=True)
    return time, value[first]


def averaged(grid: FloatArray, time: FloatArray, value: FloatArray) -> FloatArray:
    """Values on the grid: the mean over a grid step, so that what is faster than the grid does not fold into the band.

    Of the straight lines between readings, by differences of their running integral.
    """
    edges = np.append(grid - STEP_S / 2, grid[-1] + STEP_S / 2)
    needed = int(np.searchsorted(time, edges[-1], side="right")) + 2  # of a long session the grid covers a part
    time, value = time[:needed], value[:needed]
    at = np.clip(np.searchsorted(time, edges, side="right") - 1, 0, len(time) - 2)
    lasting = (time[at + 1] - time[at])[:, None]
    since = np.clip((edges - time[at])[:, None], 0.0, lasting)
    slope = (value[at + 1] - value[at]) / lasting
    inside = sums_before(_areas(time, value), at) + since * (value[at] + slope * since / 2)
    width = np.diff(np.clip(edges, time[0], time[-1]))[:, None]
    found: FloatArray = np.diff(inside, axis=0) / np.maximum(width, STEP_S / 4)
    return found


def _areas(time: FloatArray, value: FloatArray) -> Iterator[FloatArray]:
    """The integral from each reading to the next (n - 1, d), some readings at a time."""
    for part in parts_of(len(time) - 1):
        end = slice(part.start + 1, part.stop + 1)
        later, since = value[end], time[end]
        yield (later + value[part][: len(later)]) * (since - time[part][: len(since)])[:, None] / 2


def filtered(value: FloatArray, order: int) -> FloatArray:
    """Values (n, d) on the grid in the band, integrated `order` times."""
    length = even_length(len(value) + round(4 / _LOW_HZ / STEP_S))
    frequency = np.fft.rfftfreq(length, STEP_S)
    low, high = (frequency / _LOW_HZ) ** 4, (frequency / _HIGH_HZ) ** 4
    shape = (low / (1 + low) / (1 + high)).astype(complex)
    shape[1:] /= (2j * np.pi * frequency[1:]) ** order
    padded = np.zeros((value.shape[1], length))
    padded[:, : len(value)] = (value - _without(value, order)).T
    return np.ascontiguousarray(np.fft.irfft(np.fft.rfft(padded) * shape, length)[:, : len(value)].T)


def _without(value: FloatArray, order: int) -> FloatArray:
    """What is taken off first: of accelerations the mean, of positions a line, so that neither end is a jump."""
    if order:
        return np.asarray(value.mean(axis=0))
    edge = min(5, len(value))
    first, last = value[:edge].mean(axis=0), value[-edge:].mean(axis=0)
    found: FloatArray = first + (last - first) * np.linspace(0.0, 1.0, len(value))[:, None]
    return found


def even_length(least: int) -> int:
    """The next length whose only factors are 2, 3 and 5, for which the transform is quick."""
    best = 1 << (least - 1).bit_length()
    for odd in (3, 5, 9, 15):
        power = odd << max(0, (-(-least // odd) - 1).bit_length())
        if power >= least:
            best = min(best, power)
    return best
