"""Figures as other programs define or approximate them: what a known reason is verified with.

Each takes the arrays of a problem and gives the figure of the other program's own way, from the formulas of its
documentation; several figures come by their names in the table.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from pipeline.analysis.against.problems import Family, Groups, Paired, Within
from pipeline.statistics.anova import contrasts
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.mann_whitney import rank_sum_p
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.result import IntArray, rounded_differences
from pipeline.statistics.sphericity import sphericity
from pipeline.statistics.wilcoxon import signed_rank_p

Figures = dict[str, float | None]


def differences(first: FloatArray, second: FloatArray, as_floats: bool) -> FloatArray:
    """first − second (n,): as floats subtract, or with differences that only round-off parts made equal, as ours."""
    return first - second if as_floats else rounded_differences(first, second)


def _signed_ranks(apart: FloatArray, pratt: bool) -> tuple[FloatArray, FloatArray]:
    """Midranks of the differences that are not zero, and their signs; by Pratt zeros take part in the ranking."""
    ranked = apart if pratt else apart[apart != 0]
    ranks, signs = stats.rankdata(np.abs(ranked)), np.sign(ranked)
    return ranks[signs != 0], signs[signs != 0]


def w_plus(apart: FloatArray, pratt: bool) -> float:
    """The sum of the ranks of positive differences."""
    ranks, signs = _signed_ranks(apart, pratt)
    return float(ranks[signs > 0].sum())


def smaller_w(apart: FloatArray, pratt: bool) -> float:
    """The smaller one of W₊ and W₋."""
    return min(w_plus(apart, pratt), w_plus(-apart, pratt))


def rank_biserial(apart: FloatArray, pratt: bool) -> float:
    """(W₊ − W₋) / (W₊ + W₋)."""
    above, below = w_plus(apart, pratt), w_plus(-apart, pratt)
    return (above - below) / (above + below)


def signed_rank_exact_p(apart: FloatArray, pratt: bool) -> float:
    """Two-sided, over all signs of the midranks."""
    return signed_rank_p(_signed_ranks(apart, pratt)[0], w_plus(apart, pratt))


def signed_rank_table_p(apart: FloatArray, _pratt: bool) -> float:
    """Two-sided, of the smaller sum, as if the n ranks were 1 … n: ties and zeros are not looked at."""
    return signed_rank_p(np.arange(1.0, len(apart) + 1), float(np.floor(smaller_w(apart, pratt=False))))


def signed_rank_normal_p(apart: FloatArray, pratt: bool, correction: float = 0.0) -> float:
    """Two-sided p of W₊ by the normal distribution, with the variance of the midranks."""
    ranks, _ = _signed_ranks(apart, pratt)
    far = abs(w_plus(apart, pratt) - float(ranks.sum()) / 2)
    return float(min(1.0, 2 * stats.norm.sf((far - correction) / np.sqrt(np.sum(ranks**2) / 4))))


def signed_rank_corrected_p(apart: FloatArray, pratt: bool) -> float:
    """The same with ½ taken off the distance, the correction for continuity."""
    return signed_rank_normal_p(apart, pratt, correction=0.5)


def rank_sum_normal_p(data: Groups, correction: float = 0.0) -> Figures:
    """Two-sided p of Mann and Whitney's U by the normal distribution, ties corrected."""
    first, second = data.groups
    n, m = len(first), len(second)
    ranks = stats.rankdata(np.concatenate([first, second]))
    far = abs(float(ranks[:n].sum()) - n * (n + m + 1) / 2)
    sd = float(np.sqrt(n * m / (n + m - 1) * np.var(ranks)))
    return {"p": float(min(1.0, 2 * stats.norm.sf((far - correction) / sd)))}


def rank_sum_corrected_p(data: Groups) -> Figures:
    """The same with ½ taken off the distance, the correction for continuity."""
    return rank_sum_normal_p(data, correction=0.5)


def rank_sum_of_floats(data: Groups) -> Figures:
    """U and its exact p of values ranked as floats have them."""
    first, second = data.groups
    ranks = stats.rankdata(np.concatenate([first, second]))
    n = len(first)
    return {"statistic": float(ranks[:n].sum()) - n * (n + 1) / 2, "p": rank_sum_p(ranks, n)[0]}


def student(data: Groups) -> Figures:
    """Student's t of two groups with one variance for both, and the 95 % interval of the difference."""
    first, second = data.groups
    n, m = len(first), len(second)
    df = float(n + m - 2)
    variance = (np.sum((first - first.mean()) ** 2) + np.sum((second - second.mean()) ** 2)) / df
    difference, error = float(first.mean() - second.mean()), float(np.sqrt(variance * (1 / n + 1 / m)))
    margin = float(stats.t.ppf(0.975, df)) * error
    return {
        "statistic": difference / error,
        "df2": df,
        "p": float(2 * stats.t.sf(abs(difference / error), df)),
        "ci_difference_low": difference - margin,
        "ci_difference_high": difference + margin,
    }


def d_av(data: Paired) -> Figures:
    """The size of the mean difference over the root of the mean of the two variances."""
    variance = (np.var(data.first, ddof=1) + np.var(data.second, ddof=1)) / 2
    return {"effect_size": float(abs(data.first.mean() - data.second.mean()) / np.sqrt(variance))}


def t_of_floats(data: Paired) -> dict[str, float]:
    """t and p of the differences as floats subtract."""
    apart = data.first - data.second
    t = float(apart.mean() / (apart.std(ddof=1) / np.sqrt(len(apart))))
    return {"statistic": t, "p": float(2 * stats.t.sf(abs(t), len(apart) - 1))}


def eta_squared(data: Groups) -> Figures:
    """Squares between groups over all squares: η² of the analysis of variance with one variance for all groups."""
    everything = np.concatenate([*data.groups])
    within = sum(float(np.sum((group - group.mean()) ** 2)) for group in data.groups)
    return {"effect_size": 1 - within / float(np.sum((everything - everything.mean()) ** 2))}


def friedman_of_floats(data: Within) -> Figures:
    """χ² of values (n, k) ranked as floats have them, ties corrected, its p, and Kendall's W."""
    n, k = data.values.shape
    ranks = stats.rankdata(data.values, axis=1)
    spread = np.sum(ranks**2) - n * k * (k + 1) ** 2 / 4
    statistic = float((k - 1) * np.sum((ranks.sum(axis=0) - n * (k + 1) / 2) ** 2) / spread)
    agreement = statistic / (n * (k - 1))
    return {"statistic": statistic, "p": float(stats.chi2.sf(statistic, k - 1)), "effect_size": agreement}


def weighted_within(values: FloatArray, codes: IntArray, effect: tuple[int, ...]) -> Figures:
    """A within-effect of a mixed design tested on the mean over people, so that larger groups count for more.

    These are the sequential squares of R's aov and those of pingouin; of equal groups they are those of type III.
    """
    n, levels = values.shape[0], values.shape[1:]
    scores = values.reshape(n, -1) @ contrasts(levels, effect)
    apart = np.concatenate([scores[codes == code] - scores[codes == code].mean(axis=0) for code in np.unique(codes)])
    d, error_df = scores.shape[1], n - len(np.unique(codes))
    errors = apart.T @ apart
    explained, error = n * float(np.sum(scores.mean(axis=0) ** 2)), float(np.trace(errors))
    statistic = (explained / d) / (error / (d * error_df))
    corrected = sphericity(errors / error_df, error_df, int(np.prod(levels)), statistic, d, d * error_df)
    return {
        "statistic": statistic,
        "p": float(stats.f.sf(statistic, d, d * error_df)),
        "effect_size": explained / (explained + error),
        "p_gg": corrected["p_gg"],
    }


def of_uncorrected(data: Family) -> Figures:
    """The adjusted p of the p values as the table has them."""
    return {"p_adjusted": adjusted(list(data.p_values), data.method)[data.place]}
