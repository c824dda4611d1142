"""The result of a test of one effect, and the statuses where it is undefined."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.statistics import ALL_ZERO, NO_COMPLETE, NO_VARIATION, OK, ONE_COMPLETE
from pipeline.statistics.arrays import FloatArray

IntArray = npt.NDArray[np.int64]

_ROUND_OFF = 1e-12  # of the largest value: what arithmetic on decimal data leaves behind
_ROUND_OFF_STEPS = 64
_DISTINGUISHABLE = 4  # spacings of floats: decimals closer than that are lost in their own round-off
_KNOWN_TO = 1e-6


@dataclass(frozen=True)
class Result:
    """One row of `comparisons`, without what the study adds (measure, family, adjusted p). None: figure not defined."""

    effect: str
    statistic_name: str
    method: str
    effect_size_name: str
    n: int
    statistic: float | None = None
    df1: float | None = None
    df2: float | None = None
    p: float | None = None
    effect_size: float | None = None
    ci_low: float | None = None
    ci_high: float | None = None
    contrast: str | None = None
    status: str = OK
    details: Mapping[str, Any] = field(default_factory=dict)


def too_few(n: int) -> str | None:
    """The status where fewer than two participants are complete, else None."""
    return {0: NO_COMPLETE, 1: ONE_COMPLETE}.get(n)


def room_of(sizes: FloatArray, step: float = 0.0) -> FloatArray:
    """How far round-off can have moved figures that were computed from values of these sizes, each by its own.

    64 times the spacing of floats at that size, which a mean of dozens of values stays below, and no less than their
    spacing at the median size. Where floats still tell the data's decimals apart (`step`, one in the last of them), it
    is no more than half a step: microseconds since 1970 have sixteen digits, and all of them count. Whole numbers
    below 2⁵³ are exact.
    """
    spacing = np.spacing(np.abs(sizes))
    room: FloatArray = np.maximum(_ROUND_OFF_STEPS * spacing, np.spacing(np.median(np.abs(sizes))) if sizes.size else 0)
    told_apart = (step >= _DISTINGUISHABLE * spacing) | ((step >= 1) & (spacing <= 1))
    return np.where(told_apart, np.minimum(room, step / 2), room)


def tied(values: FloatArray, room: FloatArray) -> FloatArray:
    """Values (n,) in which those that differ by round-off alone are made equal in size, and those within `room` zero.

    No other value moves by more than a millionth of itself: a value known less well than that ties with nothing.
    """
    sizes = np.abs(values)
    sizes = np.where(sizes <= room, 0.0, sizes)
    order = np.argsort(sizes, kind="stable")
    ascending, near = sizes[order], np.minimum(room, _KNOWN_TO * sizes)[order]
    apart = np.diff(ascending) > np.maximum(near[1:], near[:-1])
    group = np.concatenate([np.zeros(min(1, len(values)), dtype=np.int64), np.cumsum(apart)])
    result = np.empty_like(sizes)
    result[order] = ascending[np.searchsorted(group, group)]
    return np.copysign(result, values) + 0.0


def step_of(*arrays: FloatArray) -> float:
    """One in the last decimal that any of the values is written with: 0.001 for 1.5 and 2.375."""
    values = {value for array in arrays for value in array.ravel().tolist()}
    return float(10.0 ** min(map(_exponent, values), default=0))


@lru_cache(maxsize=4096)  # the values of a study are looked at once for each test and pair
def _exponent(value: float) -> int:
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    return exponent if isinstance(exponent, int) else 0


def rounded_differences(first: FloatArray, second: FloatArray) -> FloatArray:
    """first − second, zero and tied where the data's decimals say so: 0.3 − 0.2 and 0.2 − 0.1 are one difference.

    What counts as round-off is a matter of each pair's own size, so that one giant value does not level the others.
    """
    return tied(first - second, room_of(np.maximum(np.abs(first), np.abs(second)), step_of(first, second)))


def from_first(values: FloatArray) -> FloatArray:
    """Values (n, k) less each row's first, zero and tied as `rounded_differences` has it: what within-tests rest on."""
    first, *others = values.T
    return np.column_stack([np.zeros(len(values)), *(rounded_differences(column, first) for column in others)])


def negligible(sum_of_squares: float, values: FloatArray) -> bool:
    """Whether a sum of squares is nothing but round-off of the values that it was computed from."""
    return sum_of_squares <= values.size * (_ROUND_OFF * float(np.max(np.abs(values), initial=0.0))) ** 2


def degenerate(values: FloatArray) -> str | None:
    """The status for data (n, k) without any difference between conditions, else None."""
    if np.any(from_first(values)):
        return None
    alike = not np.any(from_first(values[:, :1].T))
    return NO_VARIATION if alike and values.shape[1] > 2 else ALL_ZERO
