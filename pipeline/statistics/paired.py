"""The paired t test, and the summary of differences that all paired tests begin with."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.statistics import ALL_ZERO, NO_ERROR
from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.effect_size import cohen_dz, dz_interval, hedges_correction
from pipeline.statistics.result import Result, rounded_differences, too_few
from pipeline.statistics.tails import t_above, t_quantile


@dataclass(frozen=True)
class Differences:
    """How many, their mean, its standard error, and the mean over their SD."""

    n: int
    mean: float
    error: float
    dz: float


def differences_of(first: FloatArray, second: FloatArray) -> Differences | str:
    """The differences first − second, or the status where they cannot be tested."""
    n = len(first)
    if status := too_few(n):
        return status
    (values,), exponent = at_unit_scale([rounded_differences(first, second)])
    if not np.any(values):
        return ALL_ZERO
    if np.ptp(values) == 0:
        return NO_ERROR
    mean, error = (
        float(np.ldexp(figure, exponent)) for figure in (np.mean(values), np.std(values, ddof=1) / np.sqrt(n))
    )
    return Differences(n, mean, error, cohen_dz(values))


def t_paired(first: FloatArray, second: FloatArray, effect: str = "condition") -> Result:
    """Student's t of the differences first − second, two-sided; effect size d_z with its noncentral-t interval."""
    blank = Result(effect, "t", "paired t test, two-sided", "Cohen's d_z", len(first))
    summary = differences_of(first, second)
    if isinstance(summary, str):
        return replace(blank, status=summary)
    df = summary.n - 1
    statistic, margin = summary.mean / summary.error, t_quantile(0.975, df) * summary.error
    low, high = dz_interval(summary.dz, summary.n)
    correction = hedges_correction(df)
    (scaled_first, scaled_second), exponent = at_unit_scale([first, second])
    pooled = float(np.ldexp(np.sqrt((np.var(scaled_first, ddof=1) + np.var(scaled_second, ddof=1)) / 2), exponent))
    return replace(
        blank,
        statistic=float(statistic),
        df2=float(df),
        p=2 * t_above(abs(statistic), df),
        effect_size=summary.dz,
        ci_low=low,
        ci_high=high,
        details={
            "hedges_gz": None if correction is None else correction * summary.dz,
            "d_av": summary.mean / pooled if pooled > 0 else None,
            "ci_difference": [summary.mean - margin, summary.mean + margin],
        },
    )
