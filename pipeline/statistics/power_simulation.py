"""The power of a planned comparison by simulation: studies drawn as they are expected, each tested as a study is.

The tests here take many studies at once and decide as `t_paired`, `wilcoxon` and `rm_anova` do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import numpy.typing as npt
from scipy import linalg, special, stats

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.power import Design
from pipeline.statistics.search import smallest
from pipeline.statistics.wilcoxon import signed_rank_p

BoolArray = npt.NDArray[np.bool_]

VALUES_AT_ONCE = 2_000_000  # in memory


@dataclass(frozen=True)
class Share:
    """In how many of the simulated studies p was below alpha."""

    significant: int
    studies: int

    @property
    def power(self) -> float:
        """As a share."""
        return self.significant / self.studies

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Of the power, exact (Clopper and Pearson 1934)."""
        k, n, tail = self.significant, self.studies, (1 - level) / 2
        low = special.betaincinv(k, n - k + 1, tail) if k > 0 else 0.0
        high = special.betaincinv(k + 1, n - k, 1 - tail) if k < n else 1.0
        return float(low), float(high)


@dataclass(frozen=True)
class Simulated:
    """Shares by the test's own p, and by the p corrected for sphericity where there is one."""

    own: Share
    corrected: Share | None


def simulate(design: Design, n: int, studies: int, seed: int, values_at_once: int = VALUES_AT_ONCE) -> Simulated:
    """Draw `studies` studies of n participants; the same for the same seed and n, whatever else is drawn.

    At most `values_at_once` values are in memory, or those of one study.
    """
    own = corrected = 0
    for values in _drawn(design, n, studies, values_at_once, np.random.default_rng([seed, n])):
        if design.test == "rm_anova":
            p, p_gg = rm_anova_p(values)
            own += int(np.sum(p < design.alpha))
            corrected += int(np.sum(p_gg < design.alpha))
        else:
            own += int(np.sum(_significant(design, values[..., 0] - values[..., 1])))
    has_correction = design.test == "rm_anova" and design.conditions > 2
    return Simulated(Share(own, studies), Share(corrected, studies) if has_correction else None)


def crossings(share_of: Callable[[float], Share], power: float, largest: float) -> tuple[float, float, float] | None:
    """The smallest effect whose share reaches this power, with the bounds of the simulation's error.

    None where the largest does not reach it. `share_of` draws the same for every effect, so that power rises with the
    effect but for single studies. Each of the three is looked for by halves, down to 1e-3 of itself.
    """
    share_of = cache(share_of)

    def crossing(reached: Callable[[Share], float]) -> float | None:
        low, high = 0.0, largest
        if reached(share_of(high)) < power:
            return None
        while high - low > 1e-3 * high:
            middle = (low + high) / 2
            if reached(share_of(middle)) >= power:
                high = middle
            else:
                low = middle
        return high

    effect = crossing(lambda share: share.power)
    if effect is None:
        return None
    low, high = crossing(lambda share: share.interval()[1]), crossing(lambda share: share.interval()[0])
    return effect, low or 0.0, largest if high is None else high


def _drawn(
    design: Design, n: int, studies: int, values_at_once: int, random: np.random.Generator
) -> Iterator[FloatArray]:
    """Values (studies, n, k), a part of the studies at a time."""
    k, r = design.conditions, design.correlation
    factor = linalg.cholesky((1 - r) * np.eye(k) + r, lower=True)
    at_once = max(1, values_at_once // (n * k))
    for start in range(0, studies, at_once):
        count = min(at_once, studies - start)
        yield random.standard_normal((count, n, k)) @ factor.T + design.means


def _significant(design: Design, differences: FloatArray) -> BoolArray:
    if design.test == "wilcoxon":
        return wilcoxon_significant(differences, design.alpha)
    return t_paired_p(differences) < design.alpha


def t_paired_p(differences: FloatArray) -> FloatArray:
    """Two-sided p values (studies,) of the paired t test, of differences (studies, n)."""
    n = differences.shape[1]
    statistic = differences.mean(axis=1) / (differences.std(axis=1, ddof=1) / np.sqrt(n))
    result: FloatArray = 2 * stats.t.sf(np.abs(statistic), n - 1)
    return result


def wilcoxon_significant(differences: FloatArray, alpha: float) -> BoolArray:
    """Whether the signed-rank test's exact p is below alpha (studies,), of differences (studies, n) without ties."""
    n = differences.shape[1]
    order = np.argsort(np.abs(differences), axis=1)
    positive = np.take_along_axis(differences > 0, order, axis=1)
    w_plus = positive @ np.arange(1, n + 1)
    result: BoolArray = np.minimum(w_plus, n * (n + 1) // 2 - w_plus) <= critical_w(n, alpha)
    return result


@lru_cache(maxsize=512)
def critical_w(n: int, alpha: float) -> int:
    """The largest smaller rank sum with an exact p below alpha where no ranks tie; −1 where there is none."""
    ranks = np.arange(1.0, n + 1)
    centre, spread = n * (n + 1) / 4, np.sqrt(n * (n + 1) * (2 * n + 1) / 24)
    guess = int(max(0, centre - spread * stats.norm.isf(alpha / 2)))
    above = smallest(lambda w: signed_rank_p(ranks, float(w)) >= alpha, 0, int(centre), guess)
    return int(centre) if above is None else above - 1


def rm_anova_p(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """p values (studies,) of one within-factor, own and corrected by Greenhouse-Geisser, of values (studies, n, k)."""
    _, n, k = values.shape
    scores = values @ linalg.helmert(k).T
    means = scores.mean(axis=1)
    residuals = scores - means[:, None]
    covariance = np.swapaxes(residuals, 1, 2) @ residuals
    error = np.trace(covariance, axis1=1, axis2=2)
    df1 = k - 1
    df2 = df1 * (n - 1)
    statistic = (n * np.sum(means**2, axis=1) / df1) / (error / df2)
    epsilon = error**2 / (df1 * np.sum(covariance**2, axis=(1, 2)))
    return stats.f.sf(statistic, df1, df2), stats.f.sf(statistic, epsilon * df1, epsilon * df2)
