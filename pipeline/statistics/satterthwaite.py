"""Tests of the coefficients of a linear mixed model, with Satterthwaite's (1946) degrees of freedom.

As lmerTest computes them (Kuznetsova et al. 2017): the variance of an estimate is itself estimated, and its degrees of
freedom are those of the χ² with the same mean and variance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.statistics.arrays import FloatArray

_SAME = 1e-8  # degrees of freedom closer than this, relatively, are one number


@dataclass(frozen=True)
class Fit:
    """Estimates of p coefficients and of the variances: the residual's and, by name, the random intercepts'.

    `derivatives` (m, p, p) say how the coefficients' covariance changes with the residual's variance and with each
    other one above zero, `uncertainty` (m, m) is the covariance of those estimates.
    """

    coefficients: FloatArray
    covariance: FloatArray
    derivatives: FloatArray
    uncertainty: FloatArray
    variance_residual: float
    variances: Mapping[str, float]
    log_likelihood: float

    @property
    def zero(self) -> list[str]:
        """The random intercepts whose variance is estimated as zero; any makes the fit singular."""
        return [name for name, variance in self.variances.items() if variance == 0]


def degrees_of_freedom(fitted: Fit, hypothesis: FloatArray) -> float:
    """Degrees of freedom of one linear combination (p,) of the coefficients: 2v² / Var(v̂)."""
    variance = hypothesis @ fitted.covariance @ hypothesis
    slope = np.array([hypothesis @ matrix @ hypothesis for matrix in fitted.derivatives])
    return float(2 * variance**2 / (slope @ fitted.uncertainty @ slope))


def f_test(fitted: Fit, hypotheses: FloatArray) -> tuple[float, float, float]:
    """F and its two degrees of freedom for q linear combinations (q, p), by Fai and Cornelius (1996)."""
    variances, directions = np.linalg.eigh(hypotheses @ fitted.covariance @ hypotheses.T)
    combined, q = directions.T @ hypotheses, len(hypotheses)
    statistic = float(np.sum((combined @ fitted.coefficients) ** 2 / variances) / q)
    single = np.array([degrees_of_freedom(fitted, row) for row in combined])
    if np.ptp(single) < _SAME * single.mean():
        return statistic, float(q), float(single.mean())
    if np.any(single <= 2):
        return statistic, float(q), 2.0
    expected = float(np.sum(single / (single - 2)))
    return statistic, float(q), 2 * expected / (expected - q)
