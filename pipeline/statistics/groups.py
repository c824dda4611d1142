"""Checks and ranks that all tests of groups of participants share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.statistics import (
    EMPTY_GROUP,
    EQUAL_IN_GROUP,
    EQUAL_IN_GROUPS,
    NO_VARIATION,
    ONE_IN_GROUP,
    TOO_FEW_GROUPS,
)
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import IntArray, negligible


def missing(groups: Sequence[FloatArray]) -> str | None:
    """The status where there are no two groups, or one of them is empty, else None."""
    if len(groups) < 2:
        return TOO_FEW_GROUPS
    return EMPTY_GROUP if any(len(group) == 0 for group in groups) else None


def untestable(groups: Sequence[FloatArray]) -> str | None:
    """The status where the means of groups cannot be compared, else None."""
    if status := missing(groups):
        return status
    if not varies(np.concatenate(groups)):
        return NO_VARIATION
    if any(len(group) == 1 for group in groups):
        return ONE_IN_GROUP
    return None if any(varies(group) for group in groups) else EQUAL_IN_GROUPS


def unweightable(groups: Sequence[FloatArray]) -> str | None:
    """As `untestable`, for tests that weight each mean by its precision, which equal values would make infinite."""
    if status := untestable(groups):
        return status
    return None if all(varies(group) for group in groups) else EQUAL_IN_GROUP


def varies(values: FloatArray) -> bool:
    """Whether the values differ by more than round-off."""
    return not negligible(float(np.sum((values - values.mean()) ** 2)), values)


def midranks(values: FloatArray) -> FloatArray:
    """Ranks (n,) from 1; values apart by no more than the round-off of a mean tie and share the mean of their ranks."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    apart = np.diff(ordered) > 8 * np.spacing(np.maximum(np.abs(ordered[:-1]), np.abs(ordered[1:])))
    tie: IntArray = np.concatenate([[0], np.cumsum(apart)])
    counts = np.bincount(tie)
    ranks = np.empty(len(values))
    ranks[order] = (np.cumsum(counts) - (counts - 1) / 2)[tie]
    return ranks
