"""Means of groups whose variances may differ: Welch's t and analysis of variance, and Games and Howell's pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations
from math import sqrt
from typing import Literal

import numpy as np
from scipy import stats

from pipeline.statistics import with_pingouin
from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.diagnostics import normality
from pipeline.statistics.effect_size import hedges_correction, partial_eta_squared_interval, standardized_interval
from pipeline.statistics.groups import untestable, unweightable
from pipeline.statistics.result import Result
from pipeline.statistics.tails import t_above, t_quantile

Interval = tuple[float | None, float | None]

D_AV = "Cohen's d_av"
_GAMES_HOWELL = "Games and Howell's test, p over all pairs"
_SPREADS: dict[str, Literal["mean", "median"]] = {"levene": "mean", "brown_forsythe": "median"}


def t_welch(first: FloatArray, second: FloatArray, effect: str = "group") -> Result:
    """Welch's t of the means of first (n₁,) and second (n₂,), two-sided, with Satterthwaite's degrees of freedom.

    Effect size: Cohen's d_av over the root of the mean of the two variances (Delacre et al. 2021), with the noncentral
    t's interval at Welch's own t and degrees of freedom: it leaves out 0 exactly where p is below .05. The details
    have d_s over the pooled SD, whose interval takes the variances as equal (Lakens 2013) and so can contradict p.
    """
    blank = Result(effect, "t", "Welch's t test, two-sided", D_AV, len(first) + len(second))
    (scaled_first, scaled_second), exponent = at_unit_scale([first, second])
    if status := untestable([scaled_first, scaled_second]):
        return replace(blank, status=status)
    sizes = np.array([len(scaled_first), len(scaled_second)])
    variances = np.array([np.var(scaled_first, ddof=1), np.var(scaled_second, ddof=1)])
    difference = float(scaled_first.mean() - scaled_second.mean())
    shares = variances / sizes
    error = float(np.sqrt(shares.sum()))
    df = float(shares.sum() ** 2 / np.sum(shares**2 / (sizes - 1)))
    statistic, margin = difference / error, t_quantile(0.975, df) * error
    pooled_df = float(sizes.sum() - 2)
    pooled = float(np.sqrt(np.sum((sizes - 1) * variances) / pooled_df))
    d_s, d_s_ci = _standardized(difference, pooled, pooled * float(np.sqrt(np.sum(1 / sizes))), pooled_df)
    d_av, d_av_ci = _standardized(difference, float(np.sqrt(variances.mean())), error, df)
    correction = hedges_correction(pooled_df) or 0.0
    return replace(
        blank,
        statistic=statistic,
        df2=df,
        p=2 * t_above(abs(statistic), df),
        effect_size=d_av,
        ci_low=d_av_ci[0],
        ci_high=d_av_ci[1],
        details={
            "cohen_ds": d_s,
            "cohen_ds_ci": list(d_s_ci),
            "hedges_gs": correction * d_s,
            "hedges_gs_ci": [None if bound is None else correction * bound for bound in d_s_ci],
            "ci_difference": [float(np.ldexp(difference + sign * margin, exponent)) for sign in (-1, 1)],
            "n_groups": [int(size) for size in sizes],
            **spreads([scaled_first, scaled_second]),
            **_normality([scaled_first, scaled_second]),
        },
    )


def _standardized(difference: float, sd: float, error: float, df: float) -> tuple[float, Interval]:
    """A difference over an SD, and its interval from the t that is the difference over its standard error."""
    return difference / sd, standardized_interval(difference / error, df, error / sd)


def anova_welch(groups: Sequence[FloatArray], effect: str = "group") -> Result:
    """Welch's F (1951) of the means of groups (n₁,), (n₂,), …

    Effect size: partial η² as F and its degrees of freedom give it, with the interval of the noncentral F.
    """
    n = sum(len(group) for group in groups)
    blank = Result(effect, "F", "Welch's analysis of variance", "partial eta squared", n, df1=float(len(groups) - 1))
    scaled, _ = at_unit_scale(groups)
    if status := unweightable(scaled):
        return replace(blank, status=status)
    statistic, df1, df2, p = with_pingouin.welch_anova(scaled)
    low, high = partial_eta_squared_interval(statistic, df1, df2)
    return replace(
        blank,
        statistic=statistic,
        df2=df2,
        p=p,
        effect_size=statistic * df1 / (statistic * df1 + df2),
        ci_low=low,
        ci_high=high,
        details={"n_groups": [len(group) for group in groups], **spreads(scaled), **_normality(scaled)},
    )


def games_howell(groups: Sequence[FloatArray], names: Sequence[str], effect: str = "group") -> list[Result]:
    """Every two groups after Welch's analysis, whose p holds for all pairs together (Games and Howell 1976).

    t and the effect size are those of `t_welch`; p and the interval of the difference are of the studentized range.
    """
    pairs = list(combinations(range(len(groups)), 2))
    results = [
        replace(t_welch(groups[i], groups[j], effect), method=_GAMES_HOWELL, contrast=f"{names[i]} - {names[j]}")
        for i, j in pairs
    ]
    scaled, exponent = at_unit_scale(groups)
    if status := unweightable(scaled):
        blank = Result(effect, "t", _GAMES_HOWELL, D_AV, 0, status=status)
        return [replace(blank, n=result.n, contrast=result.contrast) for result in results]
    for at, (t, df, error, p) in enumerate(with_pingouin.games_howell(scaled)):
        margin = _range_of_95(len(groups), df) / np.sqrt(2) * error
        interval = [float(np.ldexp(t * error + sign * margin, exponent)) for sign in (-1, 1)]
        results[at] = replace(results[at], p=p, details={**results[at].details, "ci_difference": interval})
    return results


@lru_cache(maxsize=1024)  # a tenth of a second each; comparisons without the exclusions ask for most of them again
def _range_of_95(groups: int, df: float) -> float:
    """What the studentized range of so many groups stays below in 95 of 100 studies. That of two is √2 |t|."""
    if groups == 2:
        return sqrt(2) * t_quantile(0.975, df)
    return float(stats.studentized_range.ppf(0.95, groups, df))


def spreads(groups: Sequence[FloatArray]) -> dict[str, float | None]:
    """Do the groups spread alike? Levene's F around the means, Brown and Forsythe's around the medians.

    None where the deviations do not vary within any group, as in groups of two.
    """
    tests: dict[str, float | None] = {}
    for name, center in _SPREADS.items():
        middle = np.mean if center == "mean" else np.median
        deviations = [np.abs(group - middle(group)) for group in groups]
        f = p = None
        if untestable(deviations) is None:
            f, p = map(float, stats.levene(*groups, center=center))
        tests |= {f"{name}_f": f, f"{name}_p": p}
    return tests


def _normality(groups: Sequence[FloatArray]) -> dict[str, list[float | None]]:
    """Shapiro and Wilk's W and p of each group."""
    tests = [normality(group) for group in groups]
    return {f"groups_{name}": [test[name] for test in tests] for name in ("shapiro_w", "shapiro_p")}
