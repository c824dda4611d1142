"""The power of a planned comparison in closed form, and what is assumed of the study it is planned for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.effect_size import noncentral_t_cdf

TESTS = ("t_paired", "wilcoxon", "rm_anova")


@dataclass(frozen=True)
class Design:
    """A study of k conditions as it is expected: normal values of SD 1, correlated alike between any two conditions.

    `difference` is the largest between two conditions, in SDs of a condition; the others lie in the middle between
    these two, which makes f the smallest it can be (Cohen 1988, section 8.2.1, pattern 1). Equal correlations are a
    case of sphericity.
    """

    test: str
    difference: float
    correlation: float = 0.5
    conditions: int = 2
    alpha: float = 0.05

    @property
    def dz(self) -> float:
        """The difference over the SD of a participant's differences."""
        return float(self.difference / np.sqrt(2 * (1 - self.correlation)))

    @property
    def f(self) -> float:
        """SD of the conditions' means over the SD of a condition (Cohen 1988, section 8.2)."""
        return float(self.difference / np.sqrt(2 * self.conditions))

    @property
    def means(self) -> FloatArray:
        """Means of the conditions (k,), in SDs of a condition."""
        means = np.zeros(self.conditions)
        means[0], means[-1] = self.difference / 2, -self.difference / 2
        return means


def difference_of_dz(dz: float, correlation: float) -> float:
    """The difference in SDs of a condition that makes this d_z."""
    return float(dz * np.sqrt(2 * (1 - correlation)))


def difference_of_f(f: float, conditions: int) -> float:
    """The largest difference in SDs of a condition that makes this f, the other conditions in the middle."""
    return float(f * np.sqrt(2 * conditions))


def closed_form(design: Design, n: int) -> float | None:
    """Power with n participants; None for a test that has no closed form."""
    if design.test == "t_paired":
        return paired_t_power(design.dz, n, design.alpha)
    if design.test == "rm_anova":
        return rm_anova_power(design.f, n, design.conditions, design.correlation, design.alpha)
    return None


def paired_t_power(dz: float, n: int, alpha: float = 0.05) -> float:
    """Power of the two-sided paired t test: both tails of noncentral t with δ = d_z·√n (Cohen 1988, section 2.3)."""
    critical, noncentrality = float(stats.t.isf(alpha / 2, n - 1)), dz * np.sqrt(n)
    above = 1 - noncentral_t_cdf(critical, n - 1, noncentrality)
    return above + noncentral_t_cdf(-critical, n - 1, noncentrality)


def rm_anova_power(f: float, n: int, conditions: int, correlation: float, alpha: float = 0.05) -> float:
    """Power of the uncorrected F test of one within-factor under sphericity: noncentral F with λ = n·k·f²/(1 − r).

    As G*Power computes it from Cohen's f (Faul, Erdfelder, Lang and Buchner 2007, table 3).
    """
    df1 = conditions - 1
    df2 = df1 * (n - 1)
    noncentrality = n * conditions * f**2 / (1 - correlation)
    return float(stats.ncf.sf(stats.f.isf(alpha, df1, df2), df1, df2, noncentrality))
