"""Which of a stream's readings are taken, without a copy of a long stream where all of them are."""

from __future__ import annotations

import numpy as np

from pipeline.sessions.growing import let_go, parts_of
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
    found = np.empty(len(values), np.bool_)
    for part in parts_of(len(values)):
        found[part] = np.isfinite(values[part, :width]).all(axis=1)
        let_go(values)
    return found


def usable(readings: Readings, which: BoolArray) -> Readings:
    """The times and values of those that are marked (n,)."""
    if which.all():
        return Readings(readings.stamp_ns, readings.arrival_ns, readings.values)
    return Readings(readings.stamp_ns[which], readings.arrival_ns[which], readings.values[which])
