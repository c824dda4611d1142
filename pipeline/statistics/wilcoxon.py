"""The Wilcoxon signed-rank test, exact with ties and zeros.

Theory of operation
===================

Under the null hypothesis each difference is as likely to have the other sign. So the distribution of W₊, the sum of
the ranks of positive differences, is that of a sum in which each rank is in or out by a fair coin, whatever the ranks
are, tied or not: no table and no approximation is needed, only the number of ways to reach each sum.

    ranks 1, 2.5, 2.5     doubled 2, 5, 5      ways to reach 0, 2, 5, 7, 10, 12:  1 1 2 2 1 1

Midranks are halves, so doubled they are whole numbers, and the ways are a product of polynomials (1 + x^w),
multiplied out one rank after the other (`_convolved`): sums of positive terms, so that small probabilities are as
exact as large ones. Beyond some hundred ranks blocks are multiplied by Fourier transforms, whose error is absolute.
There the coins are tilted so that W is expected where the tail begins (Esscher 1932), and the tilt is taken out
again: the tail is computed where its probabilities are large.

Before anything is ranked, differences that only round-off parts are made equal, and those within it zero
(`result.rounded_differences`): 0.3 − 0.2 and 0.2 − 0.1 tie. scipy, pingouin and R do not do that, and each then
breaks ties one way or the other.

What must stay true. p is the share of sign patterns with a W as far from its mean or farther: the tests enumerate all
patterns for small n. The doubled ranks are whole numbers; anything else would need another lattice. Above
`EXACT_UP_TO` pairs the normal approximation is taken, and `method` says so.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from scipy import optimize, signal, special, stats

from pipeline.statistics import ALL_ZERO
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.rank_biserial import rank_biserial, rank_biserial_interval
from pipeline.statistics.result import (
    IntArray,
    Result,
    rounded_differences,
    too_few,
)

EXACT_UP_TO = 3000  # pairs: beyond, the Walsh averages alone would fill the memory
_BLOCK = 256
_SHARPEST = -50.0


def wilcoxon(
    first: FloatArray,
    second: FloatArray,
    effect: str = "condition",
    zeros: Literal["dropped", "pratt"] = "dropped",
) -> Result:
    """Signed-rank test of first − second, two-sided, by the exact distribution of W₊ over all signs of the midranks.

    Zeros are dropped (Wilcoxon) or ranked and then dropped (Pratt 1959). Effect size: matched-pairs rank-biserial
    correlation with an interval by the jackknife, which leaves out 0 where p is below .05 and nowhere else.
    """
    n = len(first)
    treatment = "zeros dropped" if zeros == "dropped" else "zeros by Pratt"
    how = "exact" if n <= EXACT_UP_TO else f"asymptotic (over {EXACT_UP_TO} pairs), tie-corrected"
    blank = Result(effect, "W+", f"{how}, midranks, {treatment}", "matched-pairs rank-biserial", n)
    differences = rounded_differences(first, second)
    status = too_few(n) or (None if np.any(differences) else ALL_ZERO)
    if status is not None:
        return replace(blank, status=status)
    sizes, nonzero = np.abs(differences), differences != 0
    ranks = stats.rankdata(sizes)
    if zeros == "dropped":
        ranks = np.where(nonzero, ranks - np.count_nonzero(~nonzero), 0.0)
    w_plus, w_minus = (float(ranks[side].sum()) for side in (differences > 0, differences < 0))
    p = signed_rank_p(ranks[nonzero], w_plus)
    low, high = rank_biserial_interval(differences, ranks, p)
    location, interval = hodges_lehmann(differences) if n <= EXACT_UP_TO else (None, None)
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
        p=p,
        effect_size=rank_biserial(differences, ranks),
        ci_low=low,
        ci_high=high,
        details=details,
    )


def signed_rank_p(ranks: FloatArray, w_plus: float) -> float:
    """Two-sided p of W₊ when every rank takes its sign by a fair coin: twice the smaller tail, at most 1.

    Exact up to `EXACT_UP_TO` ranks, beyond by the normal distribution with the ranks' own variance.
    """
    smaller = min(w_plus, float(ranks.sum()) - w_plus)
    if len(ranks) > EXACT_UP_TO:
        z = (smaller - ranks.sum() / 2) / np.sqrt(np.sum(ranks**2) / 4)
        return float(min(1.0, 2 * special.ndtr(z)))
    doubled = np.rint(2 * ranks).astype(np.int64)  # midranks are halves, so doubled ranks are whole
    unit = int(np.gcd.reduce(doubled))
    return float(min(1.0, 2 * _lower_tail(doubled // unit, round(2 * smaller) // unit)))


def _lower_tail(weights: IntArray, at: int) -> float:
    """P(W ≤ at) of a sum W of weights, each in or out by a fair coin.

    Many weights are convolved by Fourier transforms, whose error is absolute. Coins tilted so that W is expected at
    `at` (Esscher 1932) put the tail where the probabilities are large, and the tilt is taken out again.
    """
    tilt = 0.0 if len(weights) <= _BLOCK else _tilt(weights, at)
    scale = float(np.sum(np.logaddexp(0, tilt * weights) - np.log(2)))
    return float(np.sum(_distribution(weights, tilt)[: at + 1] * np.exp(scale - tilt * np.arange(at + 1))))


def _tilt(weights: IntArray, at: int) -> float:
    """The tilt under which W is expected at `at`, which is at most half the weights' sum."""

    def beyond(tilt: float) -> float:
        return float(np.sum(weights * special.expit(tilt * weights)) - at)

    return _SHARPEST if beyond(_SHARPEST) >= 0 else float(optimize.brentq(beyond, _SHARPEST, 0.0, xtol=1e-15))


def _distribution(weights: IntArray, tilt: float = 0.0) -> FloatArray:
    """P(W = 0), P(W = 1), … where a weight w is in with probability 1 / (1 + e^(−tilt·w))."""
    parts = [
        _convolved(block, special.expit(tilt * block))
        for block in np.split(weights, range(_BLOCK, len(weights), _BLOCK))
    ]
    while len(parts) > 1:
        pairs = [signal.fftconvolve(first, second) for first, second in zip(parts[::2], parts[1::2], strict=False)]
        parts = pairs + parts[2 * len(pairs) :]
    return parts[0]


def _convolved(weights: IntArray, chances: FloatArray) -> FloatArray:
    """The same for few weights, one after the other: sums of positive terms, so that small figures are right too."""
    probability = np.zeros(int(weights.sum()) + 1)
    probability[0], reached = 1.0, 0
    for weight, chance in zip(weights, chances, strict=True):
        before = probability[: reached + 1].copy()
        probability[: reached + 1] *= 1 - chance
        probability[weight : reached + weight + 1] += chance * before
        reached += int(weight)
    return probability


def hodges_lehmann(differences: FloatArray, level: float = 0.95) -> tuple[float, tuple[float, float] | None]:
    """Median of all Walsh averages, and its exact interval; None where n is too small for the level."""
    n = len(differences)
    row, column = np.triu_indices(n)
    walsh = np.sort((differences[row] + differences[column]) / 2)
    cumulative = np.cumsum(_distribution(np.arange(1, n + 1)))
    outside = int(np.searchsorted(cumulative, (1 - level) / 2 * (1 + 1e-12), side="right"))
    interval = (float(walsh[outside - 1]), float(walsh[-outside])) if outside > 0 else None
    return float(np.median(walsh)), interval
