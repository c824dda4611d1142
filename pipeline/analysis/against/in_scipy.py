"""The comparisons in SciPy, as its users call it."""

from __future__ import annotations

from pipeline.analysis.against.problems import Groups, Paired, Within
from pipeline.analysis.against.theirs import Call, Calls, Found
from pipeline.study.comparison import Comparison


def version() -> str:
    """The program and its version."""
    import scipy

    return f"SciPy {scipy.__version__}"


def _ttest_rel(data: Paired, _entry: Comparison) -> Found:
    from scipy import stats

    found = stats.ttest_rel(data.first, data.second)
    interval = found.confidence_interval()
    return {
        "statistic": found.statistic,
        "df2": found.df,
        "p": found.pvalue,
        "ci_difference_low": interval.low,
        "ci_difference_high": interval.high,
    }


def _wilcoxon(data: Paired, entry: Comparison) -> Found:
    from scipy import stats

    ranked = entry.zeros == "pratt"
    found = stats.wilcoxon(data.first, data.second, zero_method="pratt" if ranked else "wilcox")
    return {"statistic": float(found.statistic), "p": float(found.pvalue)}


def _friedman(data: Within, _entry: Comparison) -> Found:
    from scipy import stats

    found = stats.friedmanchisquare(*data.values.T)
    return {"statistic": float(found.statistic), "p": float(found.pvalue)}


def _ttest_ind(data: Groups, _entry: Comparison) -> Found:
    from scipy import stats

    found = stats.ttest_ind(*data.groups, equal_var=False)
    return {"statistic": found.statistic, "df2": found.df, "p": found.pvalue}


def _mannwhitneyu(data: Groups, _entry: Comparison) -> Found:
    from scipy import stats

    first, second = data.groups
    found = stats.mannwhitneyu(first, second)
    return {"statistic": float(found.statistic), "p": float(found.pvalue)}


def _kruskal(data: Groups, _entry: Comparison) -> Found:
    from scipy import stats

    found = stats.kruskal(*data.groups)
    return {"statistic": found.statistic, "p": found.pvalue}


CALLS: Calls = {
    "t_paired": (Call("scipy.stats.ttest_rel(x, y)", _ttest_rel),),
    "wilcoxon": (Call("scipy.stats.wilcoxon(x, y)", _wilcoxon),),
    "friedman": (Call("scipy.stats.friedmanchisquare(x, y, …)", _friedman),),
    "t_welch": (Call("scipy.stats.ttest_ind(x, y, equal_var=False)", _ttest_ind),),
    "mann_whitney": (Call("scipy.stats.mannwhitneyu(x, y)", _mannwhitneyu),),
    "kruskal": (Call("scipy.stats.kruskal(x, y, …)", _kruskal),),
}
"""SciPy's functions for each procedure."""
