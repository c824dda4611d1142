"""Parts of sentences that captions share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from pipeline.report.figures.style import mean_and_interval
from pipeline.statistics.arrays import FloatArray
from pipeline.words import interval, number

_NAMED = 8  # what a sentence can list


def mean_with_interval(values: FloatArray, digits: int = 2) -> str:
    """A mean, and its 95 % interval where there is one."""
    mean, half = mean_and_interval(values)
    return number(mean, digits) + ("" if np.isnan(half) else f" {interval(mean - half, mean + half, digits)}")


def listed(parts: Iterable[str], joint: str = "; ") -> str:
    every = list(parts)
    more = f"{joint}… ({len(every)} in all)" if len(every) > _NAMED else ""
    return joint.join(every[:_NAMED]) + more


def spaced(unit: str) -> str:
    return f" {unit}" if unit else ""


def complete_counts(wide: Mapping[str, pd.DataFrame]) -> str:
    """How many participants are complete, from the fewest to the most where measures differ."""
    complete = [len(table.dropna()) for table in wide.values()]
    low, high = min(complete), max(complete)
    return f"n = {low} complete" if low == high else f"n = {low} to {high} complete"
