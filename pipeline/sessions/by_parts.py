"""Long arrays gone through some rows at a time, so that what is in between takes no memory worth mentioning."""

from __future__ import annotations

import mmap
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from pipeline.sessions.logs.log import IntArray
from pipeline.statistics.arrays import FloatArray

AT_ONCE = 2**16

Array = np.ndarray[Any, Any]


def parts_of(count: int) -> Iterator[slice]:
    """Slices of so many rows, some at a time."""
    for begin in range(0, count, AT_ONCE):
        yield slice(begin, begin + AT_ONCE)


def let_go(rows: Array) -> None:
    """Rows that are mapped from a file, or a view of them, take no memory until they are looked at again."""
    mapped = getattr(rows, "_mmap", None)
    if mapped is not None and hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)


def each_part(rows: Array) -> Iterator[Array]:
    """The rows part by part, of which those that are mapped are let go again."""
    for part in parts_of(len(rows)):
        yield rows[part]
        let_go(rows)


def in_memory(rows: Array) -> Array:
    """The rows themselves, or a copy where they are mapped from a file."""
    if getattr(rows, "_mmap", None) is None:
        return rows
    found, end = np.empty(rows.shape, rows.dtype), 0
    for part in each_part(rows):
        found[end : end + len(part)] = part
        end += len(part)
    return found


def taken(rows: Array, which: IntArray) -> Array:
    """The rows `which` (k,), in rising order."""
    found = np.empty((len(which), *rows.shape[1:]), rows.dtype)
    begin = 0
    for part in each_part(rows):
        first, last = np.searchsorted(which, (begin, begin + len(part)))
        found[first:last] = part[which[first:last] - begin]
        begin += len(part)
    return found


def sums_before(parts: Iterable[FloatArray], which: IntArray) -> FloatArray:
    """The sum (k, d) of the values before each of rising rows `which` (k,); the values come in parts (…, d)."""
    found: list[FloatArray] = []
    begin, before = 0, np.zeros(1)
    for part in parts:
        total = np.concatenate([np.broadcast_to(before, (1, part.shape[1])), part])
        np.cumsum(total, axis=0, out=total)
        first, last = np.searchsorted(which, (begin, begin + len(part)), side="right")
        if begin == 0:
            first = 0
        found.append(total[which[first:last] - begin])
        begin, before = begin + len(part), total[-1]
    return np.concatenate(found)
