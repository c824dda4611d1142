"""Power in closed form beyond one within-factor: groups, factorial and mixed designs, equivalence.

Each design is a frozen value of what is assumed of the study; `power(effect, n)` is of n participants in each group
(of a design without groups: in all), and `method` names how it was computed. `detectable` and `fewest` solve it for the
effect and for n.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from scipy import optimize, special, stats

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.effect_size import noncentral_t_cdf
from pipeline.statistics.power import paired_t_power
from pipeline.statistics.search import smallest

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(400)
_LARGEST_EFFECT = 100.0


class Planned(Protocol):
    """A design whose power is known."""

    @property
    def method(self) -> str:
        """How power is computed, in words."""

    def power(self, effect: float, n: int) -> float:
        """The power for an effect, with n participants in each group."""


def detectable(design: Planned, n: int, power: float, largest: float = _LARGEST_EFFECT) -> float | None:
    """The smallest effect that n participants find with this power (sensitivity); None up to the largest."""
    if design.power(largest, n) < power:
        return None
    if design.power(0.0, n) >= power:
        return 0.0
    return float(optimize.brentq(lambda effect: design.power(effect, n) - power, 0.0, largest, xtol=1e-10))


def fewest(design: Planned, effect: float, power: float, most: int, least: int = 2) -> int | None:
    """The fewest participants in each group for this power; None if `most` are not enough."""
    return smallest(lambda n: design.power(effect, n) >= power, least, most, least)


@dataclass(frozen=True)
class PairedT:
    """`t_paired`; the effect is d_z."""

    alpha: float = 0.05
    method: ClassVar[str] = "closed form, noncentral t"

    def power(self, effect: float, n: int) -> float:
        """Power with n participants."""
        return paired_t_power(effect, n, self.alpha)


@dataclass(frozen=True)
class TwoGroups:
    """`t_welch` of two groups; the effect is the difference over the root of the mean of both variances.

    `sd_ratio` is the second group's SD over the first's, `size_ratio` its size over the first's n.
    """

    alpha: float = 0.05
    sd_ratio: float = 1.0
    size_ratio: float = 1.0
    method: ClassVar[str] = "closed form, noncentral t with Satterthwaite's degrees of freedom of the stated SDs"

    def power(self, effect: float, n: int) -> float:
        """Power with n participants in the first group."""
        error, df = self.error(n)
        critical, noncentrality = float(stats.t.isf(self.alpha / 2, df)), effect / error
        above = 1 - noncentral_t_cdf(critical, df, noncentrality)
        return above + noncentral_t_cdf(-critical, df, noncentrality)

    def error(self, n: int) -> tuple[float, float]:
        """The difference's standard error, in roots of the mean variance, and its degrees of freedom."""
        sizes = np.array([n, max(2, round(self.size_ratio * n))])
        variances = np.array([1.0, self.sd_ratio**2])
        shares = variances / variances.mean() / sizes
        return float(np.sqrt(shares.sum())), float(shares.sum() ** 2 / np.sum(shares**2 / (sizes - 1)))


@dataclass(frozen=True)
class SeveralGroups:
    """`anova_welch` of k groups of one size; the effect is f, the SD of their means over the root mean variance.

    The first and the last mean lie apart and the others in the middle (Cohen 1988, section 8.2.1, pattern 1). `sds` are
    the groups' SDs in any unit; None: all alike.
    """

    groups: int
    alpha: float = 0.05
    sds: tuple[float, ...] | None = None
    method: ClassVar[str] = "closed form, noncentral F with Welch's degrees of freedom of the stated SDs (Levy 1978)"

    def power(self, effect: float, n: int) -> float:
        """Power with n participants in each group."""
        k = self.groups
        sds = np.asarray(self.sds if self.sds is not None else np.ones(k), dtype=np.float64)
        weights = n / (sds**2 / np.mean(sds**2))
        means = self.means(effect)
        noncentrality = float(np.sum(weights * (means - np.sum(weights * means) / weights.sum()) ** 2))
        df2 = (k**2 - 1) / (3 * float(np.sum((1 - weights / weights.sum()) ** 2)) / (n - 1))
        return float(stats.ncf.sf(stats.f.isf(self.alpha, k - 1, df2), k - 1, df2, noncentrality))

    def means(self, effect: float) -> FloatArray:
        """Means of the groups (k,), in roots of the mean variance."""
        means = np.zeros(self.groups)
        means[0], means[-1] = np.array([1, -1]) * effect * np.sqrt(self.groups / 2)
        return means


@dataclass(frozen=True)
class FactorialEffect:
    """One effect of a repeated-measures or mixed ANOVA; the effect is f: the SD of what it adds to the cell means over
    the SD within a cell.

    `levels` are the within-factors' numbers of levels, `effect` the places of those in the effect (empty: the group's
    main effect), `groups` how many groups of n there are, and `with_group` whether the group is in the effect. Any two
    of a participant's values correlate by `correlation`. `epsilon` below 1 is a lack of sphericity: power is then that
    of the test corrected by it. λ and degrees of freedom as in G*Power (Faul, Erdfelder, Lang and Buchner 2007).
    """

    levels: tuple[int, ...]
    effect: tuple[int, ...]
    groups: int = 1
    with_group: bool = False
    correlation: float = 0.5
    epsilon: float = 1.0
    alpha: float = 0.05

    @property
    def method(self) -> str:
        """How power is computed, in words."""
        return "closed form, noncentral F" + (f" corrected by ε = {self.epsilon:g}" if self.epsilon < 1 else "")

    def power(self, effect: float, n: int) -> float:
        """Power with n participants in each group."""
        cells, people = int(np.prod(self.levels)), n * self.groups
        contrasts = int(np.prod([self.levels[place] - 1 for place in self.effect]))
        epsilon = self.epsilon if self.effect else 1.0
        # What of a cell's variance is left in a contrast within people, and in their mean.
        share = (1 - self.correlation) if self.effect else 1 + (cells - 1) * self.correlation
        df1 = epsilon * contrasts * (self.groups - 1 if self.with_group else 1)
        df2 = epsilon * contrasts * (people - self.groups)
        noncentrality = epsilon * people * cells * effect**2 / share
        return float(stats.ncf.sf(stats.f.isf(self.alpha, df1, df2), df1, df2, noncentrality))


@dataclass(frozen=True)
class Equivalence:
    """`tost` of paired differences (without `groups`) or of two groups of n, bounds at ±`bound` SDs.

    The SD is that of the differences, or of a group; the effect is the true difference in the same unit, 0 where the
    conditions are the same.
    """

    bound: float
    alpha: float = 0.05
    groups: bool = False
    method: ClassVar[str] = "exact, both one-sided tests integrated over the SD's distribution"

    def power(self, effect: float, n: int) -> float:
        """Power with n participants, or with n in each group."""
        df = 2 * (n - 1) if self.groups else n - 1
        error = float(np.sqrt((2 if self.groups else 1) / n))
        return equivalence_power((-self.bound, self.bound), effect, error, df, self.alpha)


def equivalence_power(bounds: tuple[float, float], effect: float, error: float, df: float, alpha: float) -> float:
    """P(both one-sided t tests reject) of an estimate that is normal around `effect` with standard error `error`.

    Both reject where lower + t·s·error < estimate < upper − t·s·error, s = √(χ²/df): integrated over s up to where
    nothing lies between (Phillips 1990, by one integral instead of Owen's two).
    """
    critical = float(stats.t.isf(alpha, df))
    low, high = np.sqrt(np.array([stats.chi2.ppf(1e-18, df), stats.chi2.isf(1e-18, df)]) / df)
    end = min(high, (bounds[1] - bounds[0]) / (2 * critical * error))
    if end <= low:
        return 0.0
    at = (_NODES + 1) / 2 * (end - low) + low
    density = _WEIGHTS * (end - low) / 2 * stats.chi.pdf(at * np.sqrt(df), df) * np.sqrt(df)
    upper = special.ndtr((bounds[1] - effect) / error - critical * at)
    lower = special.ndtr((bounds[0] - effect) / error + critical * at)
    return float(np.clip(np.sum(density * (upper - lower)), 0.0, 1.0))


def detectable_bound(
    n: int, power: float, effect: float = 0.0, alpha: float = 0.05, groups: bool = False
) -> float | None:
    """The narrowest ±bound within which n participants show equivalence with this power."""

    def lacking(bound: float) -> float:
        return Equivalence(bound, alpha, groups).power(effect, n) - power

    if lacking(_LARGEST_EFFECT) < 0:
        return None
    return float(optimize.brentq(lacking, 1e-9, _LARGEST_EFFECT, xtol=1e-10))
