"""The paired t test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import stats

from pipeline.statistics import ALL_ZERO, NO_ERROR
from pipeline.statistics.effect_size import cohen_dz, dz_interval, hedges_correction
from pipeline.statistics.result import FloatArray, Result, negligible, rounded_differences, too_few


def t_paired(first: FloatArray, second: FloatArray, effect: str = "condition") -> Result:
    """Student's t of the differences first − second, two-sided; effect size d_z with its noncentral-t interval."""
    n = len(first)
    blank = Result(effect, "t", "paired t test, two-sided", "Cohen's d_z", n)
    both = np.stack([first, second])
    differences = rounded_differences(first, second)
    status = too_few(n)
    if status is None and not np.any(differences):
        status = ALL_ZERO
    elif status is None and negligible(float(np.sum((differences - differences.mean()) ** 2)), both):
        status = NO_ERROR
    if status is not None:
        return replace(blank, status=status)
    sd = float(np.std(differences, ddof=1))
    mean, error = float(np.mean(differences)), sd / np.sqrt(n)
    statistic, margin = mean / error, float(stats.t.ppf(0.975, n - 1)) * error
    dz = cohen_dz(differences)
    low, high = dz_interval(dz, n)
    correction = hedges_correction(n - 1)
    pooled = float(np.sqrt((np.var(first, ddof=1) + np.var(second, ddof=1)) / 2))
    shapiro = stats.shapiro(differences) if n >= 3 else None
    details = {
        "hedges_gz": None if correction is None else correction * dz,
        "d_av": mean / pooled if pooled > 0 else None,
        "ci_difference": [mean - margin, mean + margin],
        "shapiro_w": None if shapiro is None else float(shapiro.statistic),
        "shapiro_p": None if shapiro is None else float(shapiro.pvalue),
    }
    p = float(2 * stats.t.sf(abs(statistic), n - 1))
    return replace(
        blank,
        statistic=float(statistic),
        df2=float(n - 1),
        p=p,
        effect_size=dz,
        ci_low=low,
        ci_high=high,
        details=details,
    )
