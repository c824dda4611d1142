"""The power of tests of groups by simulation: for the rank tests, which have no closed form, and beside the others'.

The tests here take many studies at once and decide as `t_welch`, `anova_welch`, `mann_whitney` and `kruskal_wallis` do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import stats

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.mann_whitney import rank_sum_p
from pipeline.statistics.power_designs import SeveralGroups
from pipeline.statistics.power_simulation import BoolArray, Share, crossings
from pipeline.statistics.search import smallest

TESTS = ("t_welch", "mann_whitney", "anova_welch", "kruskal")
_AT_ONCE = 2_000_000  # values in memory


@dataclass(frozen=True)
class Groups:
    """Normal values in groups, tested by one of `TESTS`; the effect and the means are those of `SeveralGroups`.

    Of two groups the effect f is half the difference over the root of the mean variance: `effect_of` takes that d.
    """

    test: str
    sds: tuple[float, ...] = (1.0, 1.0)
    size_ratios: tuple[float, ...] = (1.0, 1.0)
    alpha: float = 0.05

    @property
    def method(self) -> str:
        """How power is computed, in words."""
        return f"simulation of normal values, {self.test}"

    def sizes(self, n: int) -> tuple[int, ...]:
        """Of the groups, the first of n."""
        return tuple(max(2, round(ratio / self.size_ratios[0] * n)) for ratio in self.size_ratios)


def effect_of(d: float) -> float:
    """The f of two groups that differ by d."""
    return d / 2


def simulate_groups(design: Groups, effect: float, n: int, studies: int, seed: int) -> Share:
    """In how many of `studies` studies p is below alpha; the same seed and n draw the same, whatever the effect."""
    significant = 0
    for values in _drawn(design, effect, n, studies, np.random.default_rng([seed, n])):
        significant += int(np.sum(_significant(design, values)))
    return Share(significant, studies)


def detectable_by_simulation(
    design: Groups, n: int, power: float, studies: int, seed: int, largest: float = 10.0
) -> tuple[float, float, float] | None:
    """The smallest effect f that n find with this power, with the bounds of the simulation's error.

    None up to the largest.
    """
    return crossings(lambda effect: simulate_groups(design, effect, n, studies, seed), power, largest)


def _drawn(
    design: Groups, effect: float, n: int, studies: int, random: np.random.Generator
) -> Iterator[list[FloatArray]]:
    """Each group's values (studies, nᵢ), as many studies at a time as memory takes."""
    sds = np.asarray(design.sds, dtype=np.float64)
    sds = sds / np.sqrt(np.mean(sds**2))
    means, sizes = SeveralGroups(len(sds)).means(effect), design.sizes(n)
    at_once = max(1, _AT_ONCE // sum(sizes))
    for start in range(0, studies, at_once):
        drawn = random.standard_normal((min(at_once, studies - start), sum(sizes)))
        parts = np.split(drawn, np.cumsum(sizes)[:-1], axis=1)
        yield [part * sd + mean for part, sd, mean in zip(parts, sds, means, strict=True)]


def _significant(design: Groups, groups: list[FloatArray]) -> BoolArray:
    if design.test == "mann_whitney":
        return mann_whitney_significant(groups[0], groups[1], design.alpha)
    p = {"t_welch": anova_welch_p, "anova_welch": anova_welch_p, "kruskal": kruskal_p}[design.test](groups)
    result: BoolArray = p < design.alpha
    return result


def anova_welch_p(groups: list[FloatArray]) -> FloatArray:
    """p values (studies,) of Welch's test of groups (studies, nᵢ); of two groups it is Welch's t test."""
    k = len(groups)
    sizes = np.array([group.shape[1] for group in groups])[:, None]
    means = np.stack([group.mean(axis=1) for group in groups])
    weights = sizes / np.stack([group.var(axis=1, ddof=1) for group in groups])
    shares = weights / weights.sum(axis=0)
    lack = np.sum((1 - shares) ** 2 / (sizes - 1), axis=0)
    between = np.sum(weights * (means - np.sum(shares * means, axis=0)) ** 2, axis=0) / (k - 1)
    statistic = between / (1 + 2 * (k - 2) / (k**2 - 1) * lack)
    result: FloatArray = stats.f.sf(statistic, k - 1, (k**2 - 1) / (3 * lack))
    return result


def kruskal_p(groups: list[FloatArray]) -> FloatArray:
    """p values (studies,) of the Kruskal-Wallis test of groups (studies, nᵢ) without ties."""
    sizes = [group.shape[1] for group in groups]
    number = sum(sizes)
    ranks = np.argsort(np.argsort(np.concatenate(groups, axis=1), axis=1), axis=1) + 1.0
    sums = [part.sum(axis=1) for part in np.split(ranks, np.cumsum(sizes)[:-1], axis=1)]
    squares = np.sum([total**2 / size for total, size in zip(sums, sizes, strict=True)], axis=0)
    result: FloatArray = stats.chi2.sf(12 / (number * (number + 1)) * squares - 3 * (number + 1), len(groups) - 1)
    return result


def mann_whitney_significant(first: FloatArray, second: FloatArray, alpha: float) -> BoolArray:
    """Whether the exact two-sided p is below alpha (studies,), of groups (studies, nᵢ) without ties."""
    n, m = first.shape[1], second.shape[1]
    ranks = np.argsort(np.argsort(np.concatenate([first, second], axis=1), axis=1), axis=1)[:, :n] + 1
    u = ranks.sum(axis=1) - n * (n + 1) // 2
    result: BoolArray = np.minimum(u, n * m - u) <= critical_u(*sorted((n, m)), alpha)
    return result


@lru_cache(maxsize=512)
def critical_u(n: int, m: int, alpha: float) -> int:
    """The largest smaller U with an exact p below alpha where no ranks tie, n ≤ m; −1 where there is none."""

    def p(u: int) -> float:
        """Of the lowest ranks for the first group, its last ones moved up until U is u."""
        ranks, left = np.arange(n), u
        for at in reversed(range(n)):
            moved = min(left, m)
            ranks[at] += moved
            left -= moved
        rest = np.setdiff1d(np.arange(n + m), ranks)
        return rank_sum_p(np.concatenate([ranks, rest]) + 1.0, n)[0]

    above = smallest(lambda u: p(u) >= alpha, 0, n * m // 2, 0)
    return n * m // 2 if above is None else above - 1
