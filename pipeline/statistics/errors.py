"""Errors: answers 0 or 1, one of each participant in each condition. McNemar's test and Cochran's Q."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy import stats

from pipeline.statistics import ALL_ZERO, NOT_BINARY, with_statsmodels
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.friedman import friedman
from pipeline.statistics.result import Result, too_few

ONE_SIDED = "no finite odds ratio: nobody's answer changed in the other direction"


def mcnemar(first: FloatArray, second: FloatArray, effect: str = "condition") -> Result:
    """McNemar's (1947) test of answers 0 or 1 (n,), exact, two-sided: do as many change one way as the other?

    The statistic is b, who have 1 in the first condition only; c, in the second only, is in the details, and so are
    the mid-p (which is less cautious: Fagerland, Lydersen and Laake 2013), χ² and the difference of the proportions
    with Bonett and Price's (2012) interval. Effect size: the odds ratio b/c with its exact interval.
    """
    n = len(first)
    blank = Result(effect, "b", "McNemar's test, exact, two-sided", "odds ratio", n)
    if status := too_few(n) or _not_binary(first, second):
        return replace(blank, status=status)
    b, c = int(np.sum(first > second)), int(np.sum(first < second))
    if b + c == 0:
        return replace(blank, status=ALL_ZERO)
    p = with_statsmodels.mcnemar_p(b, c)
    share = stats.binomtest(b, b + c).proportion_ci(0.95, method="exact")
    low, high = (bound / (1 - bound) if bound < 1 else None for bound in (float(share.low), float(share.high)))
    details: dict[str, Any] = {
        "b": b,
        "c": c,
        "mid_p": p - float(stats.binom.pmf(b, b + c, 0.5)),
        "chi2": (b - c) ** 2 / (b + c),
        "chi2_p": float(stats.chi2.sf((b - c) ** 2 / (b + c), 1)),
        "proportion_first": float(np.mean(first)),
        "proportion_second": float(np.mean(second)),
        "ci_difference": _difference_interval(b, c, n),
        **({"no_effect_size": ONE_SIDED} if c == 0 else {}),
    }
    ratio = b / c if c else None
    return replace(blank, statistic=float(b), p=p, effect_size=ratio, ci_low=low, ci_high=high, details=details)


def _difference_interval(b: int, c: int, n: int) -> list[float]:
    """Interval of the first proportion minus the second: Wald's with 1 added to b and to c, and 2 to n."""
    first, second = (b + 1) / (n + 2), (c + 1) / (n + 2)
    margin = float(stats.norm.ppf(0.975) * np.sqrt((first + second - (first - second) ** 2) / (n + 2)))
    return [max(-1.0, first - second - margin), min(1.0, first - second + margin)]


def cochran_q(values: FloatArray, effect: str = "condition") -> Result:
    """Cochran's (1950) Q of answers 0 or 1 (n, k), exact where that takes no longer than about a second.

    Q is Friedman's χ² of such answers, and its exact p Friedman's: every order of a participant's answers is as
    likely. Effect size: η²_Q = Q/(n(k − 1)) (Serlin, Carr and Marascuilo 1982), with Kendall's W's interval, which it
    is. Pairs of conditions are followed up by `mcnemar`.
    """
    n, k = values.shape
    blank = Result(effect, "Q", "Cochran's Q, chi-squared approximation", "eta squared Q", n, df1=float(k - 1))
    if status := too_few(n) or _not_binary(values):
        return replace(blank, status=status)
    ranked = friedman(values)
    if ranked.statistic is None:
        return replace(blank, status=ranked.status)
    statistic, chi2_p = with_statsmodels.cochran_q(values)
    exact = "exact" in ranked.method
    explained = ("no_interval",) if "no_interval" in ranked.details else ()
    return replace(
        blank,
        method="Cochran's Q, exact over all orders of each participant's answers" if exact else blank.method,
        statistic=statistic,
        p=ranked.p if exact else chi2_p,
        effect_size=statistic / (n * (k - 1)),
        ci_low=ranked.ci_low,
        ci_high=ranked.ci_high,
        details={
            "chi2_p": chi2_p,
            "n_changed": int(np.sum(np.ptp(values, axis=1) > 0)),
            "proportions": [float(share) for share in values.mean(axis=0)],
            **{name: ranked.details[name] for name in explained},
        },
    )


def _not_binary(*arrays: FloatArray) -> str | None:
    return None if all(np.isin(array, (0.0, 1.0)).all() for array in arrays) else NOT_BINARY
