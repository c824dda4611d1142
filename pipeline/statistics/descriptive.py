"""n, mean, SD, median and the interval of the mean, which depends on what kind of values there are.

The t interval takes a mean for something without bounds. Of answers 0 or 1 it can run below 0 or above 1, and has no
width where all answer alike, so they have Wilson's (1927) instead. Shares of each participant's answers keep t, for
participants differ by more than chance; what lies beyond 0 or 1 is cut off, where the true mean cannot be, so that the
interval holds it as often as before.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.statistics import NONE_OF_ALIKE, T_BEYOND, T_OF_SHARES, WILSON, T
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.tails import t_quantile
from pipeline.statistics.with_statsmodels import wilson_interval


def interval_method(values: FloatArray, shares: bool = False, has_unit: bool = False) -> str:
    """T, WILSON or T_OF_SHARES for a measure with these values (n,) of participants in all conditions.

    `shares`: is each value a participant's share of answers 0 or 1? What has a unit is no answer.
    """
    if has_unit or not len(values):
        return T
    if np.isin(values, (0.0, 1.0)).all():
        return WILSON
    return T_OF_SHARES if shares else T


def mean_interval(values: FloatArray, method: str = T) -> tuple[float, float] | None:
    """The 95 % interval of the mean of `values` (n,); None where there is none, as of a single measurement."""
    n = len(values)
    if method == WILSON and n:
        return wilson_interval(int(values.sum()), n)
    if n < 2 or (method == T_OF_SHARES and np.ptp(values) == 0):
        return None
    mean, margin = float(values.mean()), t_quantile(0.975, n - 1) * float(np.std(values, ddof=1)) / np.sqrt(n)
    low, high = mean - margin, mean + margin
    return (max(low, 0.0), min(high, 1.0)) if method == T_OF_SHARES else (low, high)


def summarize(values: FloatArray, method: str = T) -> dict[str, Any]:
    """Of `values` (n,), n ≥ 1: n, mean, median and, from two values on, sd, and ci_low and ci_high where there are."""
    row: dict[str, Any] = {"n": len(values), "mean": float(values.mean()), "median": float(np.median(values))}
    if len(values) > 1:
        row["sd"] = float(np.std(values, ddof=1))
    bounds = mean_interval(values, method)
    if bounds is not None:
        row |= {"ci_low": bounds[0], "ci_high": bounds[1]}
    return row


def described(values: FloatArray, method: str, within_unit: bool = False) -> dict[str, Any]:
    """`summarize` with the method of the interval named in `interval`, null where there is none to speak of.

    `within_unit`: are all values of the measure from 0 to 1, though nothing says that they are shares?
    """
    row = summarize(values, method)
    if "ci_low" not in row:
        return {**row, "interval": NONE_OF_ALIKE if method == T_OF_SHARES and len(values) > 1 else None}
    beyond = within_unit and method == T and (row["ci_low"] < 0 or row["ci_high"] > 1)
    return {**row, "interval": T_BEYOND if beyond else method}
