"""Stamps as whole seconds and nanoseconds, from two numbers or from one in any unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.logs.mcap.fields import UNFIT, check_stamp, holds_stamps

_NS_PER_S = 1_000_000_000
_LIMIT = 2.0**62  # ns; beyond it is no time
_NO_STAMP = -1  # nanoseconds of a stamp that is none

Numbers = np.ndarray[tuple[int], np.dtype[Any]]


def split_stamp(parts: Sequence[float], unit_s: float) -> tuple[int, int]:
    """One message's stamp: nothing (zero), one number in units of `unit_s`, or seconds and nanoseconds.

    ValueError where it is out of all range.
    """
    seconds, nanoseconds = split_stamps([np.array([part]) for part in parts], unit_s, 1)
    if nanoseconds[0] == _NO_STAMP:
        raise ValueError(UNFIT)
    if len(parts) == 2:
        check_stamp(int(seconds[0]), int(nanoseconds[0]))
    return int(seconds[0]), int(nanoseconds[0])


def split_stamps(parts: Sequence[Numbers], unit_s: float, count: int) -> tuple[IntArray, IntArray]:
    """Those of `count` messages, each part of shape (count,); −1 ns where a stamp is out of all range."""
    if not parts:
        return np.zeros(count, np.int64), np.zeros(count, np.int64)
    if len(parts) == 2:
        with np.errstate(invalid="ignore"):
            seconds, nanoseconds = (part.astype(np.int64) for part in parts)
        return seconds, np.where(holds_stamps(seconds, nanoseconds), nanoseconds, _NO_STAMP)
    per_unit = round(unit_s * _NS_PER_S)
    (number,) = parts
    with np.errstate(invalid="ignore"):
        fits = np.abs(number.astype(np.float64)) * per_unit < _LIMIT
    if number.dtype.kind in "iu":
        ns = np.where(fits, number, 0).astype(np.int64) * per_unit
    else:
        # Whole units and the rest apart: a product of seconds since 1970 would lose 240 ns.
        usable = np.where(fits, number, 0.0).astype(np.float64)
        whole = np.floor(usable)
        ns = whole.astype(np.int64) * per_unit + np.rint((usable - whole) * per_unit).astype(np.int64)
    seconds, nanoseconds = np.divmod(ns, _NS_PER_S)
    return seconds, np.where(fits, nanoseconds, _NO_STAMP)
