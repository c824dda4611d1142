"""What a test says of one effect, and when there is nothing to say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.statistics import ALL_ZERO, NO_COMPLETE, NO_VARIATION, OK, ONE_COMPLETE
from pipeline.statistics.arrays import FloatArray

IntArray = npt.NDArray[np.int64]

_ROUND_OFF = 1e-12  # of the largest value: what arithmetic on decimal data leaves behind


@dataclass(frozen=True)
class Result:
    """One row of `comparisons`, less what the study adds. None where a figure is not defined."""

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


def rounded(values: FloatArray, *beside: FloatArray) -> FloatArray:
    """Values with round-off taken out, so that 0.3 − 0.2 and 0.2 − 0.1 tie.

    12 digits count, of the largest of the values and of what they were made from.
    """
    largest = max(float(np.max(np.abs(array), initial=0.0)) for array in (beside or (values,)))
    if largest == 0:
        return values
    quantum = 10.0 ** (np.floor(np.log10(largest)) - 11)
    result: FloatArray = np.rint(values / quantum) * quantum
    return result


def rounded_differences(first: FloatArray, second: FloatArray) -> FloatArray:
    """first − second, zero and tied where the data's decimals say so."""
    return rounded(first - second, first, second)


def negligible(sum_of_squares: float, values: FloatArray) -> bool:
    """Is a sum of squares nothing but round-off?"""
    return sum_of_squares <= values.size * (_ROUND_OFF * float(np.max(np.abs(values), initial=0.0))) ** 2


def degenerate(values: FloatArray) -> str | None:
    """The status for data (n, k) without any difference between conditions, else None."""
    if negligible(float(np.sum((values - values.mean()) ** 2)), values):
        return NO_VARIATION if values.shape[1] > 2 else ALL_ZERO
    if negligible(float(np.sum((values - values.mean(axis=1, keepdims=True)) ** 2)), values):
        return ALL_ZERO
    return None
