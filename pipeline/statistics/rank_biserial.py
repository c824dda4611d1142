"""The matched-pairs rank-biserial correlation (Kerby 2014) and its interval.

Theory of operation. r = (W₊ − W₋)/T, T the sum of all ranks, has no simple standard error: ranks depend on each other,
and the variance that W₊ has under the null is wrong elsewhere. So the interval is made of three parts.

1. The jackknife (Arvesen 1969): r without each participant in turn gives the standard error, Fisher's z keeps the
   bounds within ±1, and Student's t with n − 1 degrees of freedom allows for few participants.
2. Where all m differences have one sign the jackknife finds no spread. There the bound is that of the share of positive
   differences, 2·0.025^(1/m) − 1 (Clopper and Pearson 1934), which is above 0 just where the exact p is below .05. And
   no r below 1 bounds itself more closely than that: it would be more certain for having a difference against it.
3. The exact test knows better than the jackknife whether r may be 0. Where p is not below .05 an interval that leaves
   out 0 is carried to 0, and where it is, one that holds 0 ends a step of r, 1/T, beside it.

Of 12 participants at least 95 % of such intervals held r in simulations (`make bench`), of normal, skewed, heavy-tailed
and rated differences alike; without the third part 3 to 20 % of them contradicted p.
"""

from __future__ import annotations

import numpy as np

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.tails import t_quantile


def rank_biserial(differences: FloatArray, ranks: FloatArray) -> float:
    """(W₊ − W₋)/T of differences (n,) and the ranks of their sizes (n,), those of dropped zeros 0."""
    total = float(ranks.sum())
    return float(np.sum(np.sign(differences) * ranks)) / total if total else 0.0


def rank_biserial_interval(
    differences: FloatArray, ranks: FloatArray, p: float, level: float = 0.95
) -> tuple[float, float]:
    """Of r; `p` is the exact two-sided one that it must not contradict. Arguments as for `rank_biserial`."""
    n, m, total = len(differences), int(np.count_nonzero(differences)), float(ranks.sum())
    r = rank_biserial(differences, ranks)
    of_one_sign = 2 * ((1 - level) / 2) ** (1 / m) - 1
    low, high = -1.0, 1.0
    if abs(r) < 1:
        margin = t_quantile((1 + level) / 2, n - 1) * _error(differences, ranks) / (1 - r**2)
        low, high = (float(np.tanh(np.arctanh(r) + sign * margin)) for sign in (-1, 1))
    low, high = (of_one_sign, 1.0) if r == 1 else (low, max(high, -of_one_sign))
    low, high = (-1.0, -of_one_sign) if r == -1 else (min(low, of_one_sign), high)
    if p >= 1 - level:
        return min(low, 0.0), max(high, 0.0)
    return (max(low, 1 / total), high) if r > 0 else (low, min(high, -1 / total))


def _error(differences: FloatArray, ranks: FloatArray) -> float:
    """The standard error of r by the jackknife over participants.

    Without a participant, all larger differences lose a rank and all equal ones half a rank. So every r without one is
    had from counts of signs: 1, −1 or 0 each, summed over the larger and over the equal sizes.
    """
    n, ranked = len(differences), ranks > 0
    sign, size = np.sign(differences), np.abs(differences)
    order = np.argsort(size, kind="stable")
    sums = np.concatenate([[0.0], np.cumsum(sign[order])])
    below, up_to = (np.searchsorted(size[order], size, side) for side in ("left", "right"))
    larger, equal = sums[-1] - sums[up_to], sums[up_to] - sums[below] - sign
    whole, count = np.sum(sign * ranks), np.count_nonzero(ranked)
    total = ranks.sum() - count * ranked  # 1 + … + m without one is 1 + … + (m − 1)
    without = np.where(ranked, whole - sign * ranks - larger - equal / 2, whole)
    r_without = np.divide(without, total, out=np.zeros(n), where=total > 0)
    pseudo = n * whole / ranks.sum() - (n - 1) * r_without
    return float(np.std(pseudo, ddof=1)) / float(np.sqrt(n))
