"""Parts of sentences that captions share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from pipeline.report.figures.style import mean_and_interval
from pipeline.statistics import T
from pipeline.statistics.arrays import FloatArray
from pipeline.words.numbers import interval, number

_LISTED_MAX = 8  # a sentence with more parts is hard to read


def mean_with_interval(values: FloatArray, method: str = T, digits: int = 2) -> str:
    """`12.30 [10.10, 14.50]`: a mean, with its 95 % interval if there is one."""
    mean, low, high = mean_and_interval(values, method)
    return number(mean, digits) + ("" if np.isnan(low) else f" {interval(low, high, digits)}")


def listed(parts: Iterable[str], joint: str = "; ") -> str:
    """The parts in a row; of more than eight the first eight, and how many there are."""
    every = list(parts)
    more = f"{joint}… ({len(every)} in all)" if len(every) > _LISTED_MAX else ""
    return joint.join(every[:_LISTED_MAX]) + more


def spaced(unit: str) -> str:
    """A unit as it follows a number; nothing for a measure without one."""
    return f" {unit}" if unit else ""


def counts_of_columns(wide: Mapping[str, pd.DataFrame]) -> str:
    """`n = 12`, or `n = 10 to 12` where columns differ in how many participants have a value in them."""
    counts = [int(count) for table in wide.values() for count in table.count()]
    low, high = min(counts), max(counts)
    return f"n = {low}" if low == high else f"n = {low} to {high}"


def complete_counts(wide: Mapping[str, pd.DataFrame]) -> str:
    """`n = 12 complete`, or `n = 10 to 12 complete` where the measures differ in how many are complete."""
    complete = [len(table.dropna()) for table in wide.values()]
    low, high = min(complete), max(complete)
    return f"n = {low} complete" if low == high else f"n = {low} to {high} complete"
