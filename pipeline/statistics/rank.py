"""Rank tests: exact Wilcoxon signed-rank with ties and zeros, and Friedman."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from scipy import stats

from pipeline.statistics import ALL_ZERO
from pipeline.statistics.result import FloatArray, Result, degenerate, rounded, rounded_differences, too_few


def wilcoxon(
    first: FloatArray,
    second: FloatArray,
    effect: str = "condition",
    zeros: Literal["dropped", "pratt"] = "dropped",
) -> Result:
    """Signed-rank test of first − second, two-sided and exact: the distribution of W₊ over all signs of the midranks.

    Zeros are dropped (Wilcoxon) or ranked and then dropped (Pratt 1959). Effect size: matched-pairs rank-biserial
    correlation (Kerby 2014) with an interval by Fisher's z.
    """
    n = len(first)
    treatment = "zeros dropped" if zeros == "dropped" else "zeros by Pratt"
    blank = Result(effect, "W+", f"exact, midranks, {treatment}", "matched-pairs rank-biserial", n)
    differences = rounded_differences(first, second)
    status = too_few(n) or (None if np.any(differences) else ALL_ZERO)
    if status is not None:
        return replace(blank, status=status)
    nonzero = differences != 0
    if zeros == "dropped":
        ranks = stats.rankdata(np.abs(differences[nonzero]))
        all_ranks = float(ranks.sum())
    else:
        every = stats.rankdata(np.abs(differences))
        ranks, all_ranks = every[nonzero], float(every.sum())
    w_plus = float(ranks[differences[nonzero] > 0].sum())
    w_minus = float(ranks[differences[nonzero] < 0].sum())
    biserial = (w_plus - w_minus) / all_ranks
    low, high = _biserial_interval(biserial, n)
    location, interval = hodges_lehmann(differences)
    details = {
        "w_plus": w_plus,
        "w_minus": w_minus,
        "n_zero": int(n - nonzero.sum()),
        "n_ranked": int(nonzero.sum()),
        "hodges_lehmann": location,
        "hodges_lehmann_ci": None if interval is None else list(interval),
    }
    return replace(
        blank,
        statistic=w_plus,
        p=signed_rank_p(ranks, w_plus),
        effect_size=biserial,
        ci_low=low,
        ci_high=high,
        details=details,
    )


def signed_rank_p(ranks: FloatArray, w_plus: float) -> float:
    """Two-sided exact p: twice the smaller tail of W₊ when every rank takes its sign by a fair coin, at most 1."""
    probability = _signed_rank_distribution(ranks)
    at = round(2 * w_plus)
    return float(min(1.0, 2 * min(probability[: at + 1].sum(), probability[at:].sum())))


def _signed_rank_distribution(ranks: FloatArray) -> FloatArray:
    """Probability of each value of 2·W₊ (midranks are halves, so doubled ranks are whole), by convolution."""
    doubled = np.rint(2 * ranks).astype(np.int64)
    probability = np.zeros(int(doubled.sum()) + 1)
    probability[0], reached = 1.0, 0
    for rank in doubled:
        probability[rank : reached + rank + 1] = (
            probability[rank : reached + rank + 1] + probability[: reached + 1]
        ) / 2
        probability[:rank] /= 2
        reached += int(rank)
    return probability


def _biserial_interval(correlation: float, n: int, level: float = 0.95) -> tuple[float | None, float | None]:
    """By Fisher's z with the variance of the signed-rank statistic; None at ±1, where z is infinite."""
    if abs(correlation) >= 1:
        return None, None
    error = np.sqrt((2 * n**3 + 3 * n**2 + n) / 6) / ((n**2 + n) / 2)
    margin = float(stats.norm.ppf((1 + level) / 2)) * error
    z = np.arctanh(correlation)
    return float(np.tanh(z - margin)), float(np.tanh(z + margin))


def hodges_lehmann(differences: FloatArray, level: float = 0.95) -> tuple[float, tuple[float, float] | None]:
    """Median of all Walsh averages, and its exact interval; None where n is too small for the level."""
    n = len(differences)
    row, column = np.triu_indices(n)
    walsh = np.sort((differences[row] + differences[column]) / 2)
    cumulative = np.cumsum(_signed_rank_distribution(np.arange(1.0, n + 1))[::2])
    outside = int(np.searchsorted(cumulative, (1 - level) / 2 * (1 + 1e-12), side="right"))
    interval = (float(walsh[outside - 1]), float(walsh[-outside])) if outside > 0 else None
    return float(np.median(walsh)), interval


def friedman(values: FloatArray, effect: str = "condition") -> Result:
    """Friedman's test of values (n, k) with ties corrected; effect size Kendall's W; Iman and Davenport's F beside."""
    n, k = values.shape
    blank = Result(effect, "chi2", "Friedman, chi-squared approximation, ties corrected", "Kendall's W", n, df1=k - 1)
    status = too_few(n) or degenerate(values)
    if status is not None:
        return replace(blank, status=status)
    ranks = np.apply_along_axis(stats.rankdata, 1, rounded(values))
    spread = float(np.sum((ranks.sum(axis=0) - n * (k + 1) / 2) ** 2))
    ties = float(np.sum(ranks**2)) - n * k * (k + 1) ** 2 / 4
    statistic = (k - 1) * spread / ties
    agreement = statistic / (n * (k - 1))
    left = n * (k - 1) - statistic
    f = (n - 1) * statistic / left if left > 1e-9 else None
    details = {
        "iman_davenport_f": f,
        "iman_davenport_p": None if f is None else float(stats.f.sf(f, k - 1, (k - 1) * (n - 1))),
    }
    p = float(stats.chi2.sf(statistic, k - 1))
    return replace(
        blank,
        statistic=statistic,
        p=p,
        effect_size=agreement,
        details=details,
    )
