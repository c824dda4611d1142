"""Which of a stream's readings are taken, without a copy of a long stream where all of them are."""

from __future__ import annotations

import numpy as np

from pipeline.sessions.by_parts import each_part
from pipeline.sessions.logs.log import BoolArray, IntArray, Readings
from pipeline.statistics.arrays import FloatArray

_DAY_NS = 86_400e9


def within_a_day(times_ns: IntArray) -> BoolArray:
    """Which times (n,) are within a day of most."""
    off = times_ns.astype(np.float64)
    off -= float(np.median(times_ns))
    np.abs(off, out=off)
    found: BoolArray = off <= _DAY_NS
    return found


def finite(values: FloatArray, width: int) -> BoolArray:
    """Which rows (n,) of values (n, …) have finite figures in their first columns."""
    known = [np.isfinite(part[:, :width]).all(axis=1) for part in each_part(values)]
    return np.concatenate([np.zeros(0, np.bool_), *known])


def usable(readings: Readings, which: BoolArray) -> Readings:
    """The times and values of those that are marked (n,)."""
    if which.all():
        return Readings(readings.stamp_ns, readings.arrival_ns, readings.values)
    return Readings(readings.stamp_ns[which], readings.arrival_ns[which], readings.values[which])
