"""The Bayes factor of a paired difference, two-sided and one-sided.

pingouin computes the two-sided one unless it is too large for a float, and no one-sided ones, so all of it is our own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from scipy import special, stats

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.effect_size import dz_interval
from pipeline.statistics.paired import differences_of
from pipeline.statistics.result import Result

PRIOR_SCALE = 0.707
Alternative = Literal["two-sided", "greater", "less"]
_STEP = 0.01  # of ln g; the integrand is smooth and dies out on both sides, so sums converge faster than any power
_NAMES = {"two-sided": "BF10", "greater": "BF+0", "less": "BF-0"}
_SIDES = {"two-sided": "", "greater": ", above zero only", "less": ", below zero only"}


def bayes_t(
    first: FloatArray,
    second: FloatArray,
    prior_scale: float = PRIOR_SCALE,
    effect: str = "condition",
    alternative: Alternative = "two-sided",
) -> Result:
    """BF₁₀ of first − second under the JZS prior: d_z is Cauchy with the given scale (Rouder et al. 2009, eq. 1).

    With `alternative` "greater" or "less" it is Cauchy above or below zero alone (Morey and Wagenmakers 2014); the
    details have all three.
    """
    prior = f"Cauchy prior of scale {prior_scale:g} on d_z{_SIDES[alternative]}"
    method = f"JZS Bayes factor of the paired difference, {prior}"
    blank = Result(effect, _NAMES[alternative], method, "Cohen's d_z", len(first))
    summary = differences_of(first, second)
    if isinstance(summary, str):
        return replace(blank, status=summary)
    t = summary.mean / summary.error
    log_bf10 = log_bayes_factor(t, summary.n, prior_scale)
    above, below = log_shares(t, summary.n, prior_scale)
    # One side has half of the prior; the factor is how much more of the posterior it has.
    logs = {"bf10": log_bf10, "bf_plus0": log_bf10 + np.log(2) + above, "bf_minus0": log_bf10 + np.log(2) + below}
    factors = {name: _factor(value) for name, value in logs.items()}
    chosen = {"two-sided": "bf10", "greater": "bf_plus0", "less": "bf_minus0"}[alternative]
    low, high = dz_interval(summary.dz, summary.n)
    return replace(
        blank,
        statistic=factors[chosen],
        effect_size=summary.dz,
        ci_low=low,
        ci_high=high,
        details={
            **factors,
            **{f"log_{name}": float(value) for name, value in logs.items()},
            "prior_scale": prior_scale,
        },
    )


def _factor(log: float) -> float | None:
    """The factor from its logarithm; None beyond the largest float, for which the details have the logarithm."""
    return float(np.exp(log)) if log < np.log(np.finfo(np.float64).max) else None


def log_bayes_factor(t: float, n: int, prior_scale: float) -> float:
    """ln BF₁₀ of a one-sample t of n values: the integral over g by the trapezoidal rule in ln g."""
    return float(special.logsumexp(_log_weights(t, n, prior_scale)[1]) + np.log(_STEP) + _log_null(t, n))


def log_shares(t: float, n: int, prior_scale: float) -> tuple[float, float]:
    """ln of the posterior's shares above and below zero.

    Given g the mean's posterior is Student's t with n degrees of freedom around κ times the observed mean, where
    κ = n·r²·g/(1 + n·r²·g) (Rouder et al. 2009, the model of eq. 1, integrated over the variance).
    """
    log_g, weights = _log_weights(t, n, prior_scale)
    kappa = special.expit(log_g + np.log(n * prior_scale**2))
    size = t / np.sqrt(n - 1)  # the mean over the root of the summed squares
    standardized = np.sqrt(kappa * n) * size / np.sqrt(1 + size**2 * (1 - kappa))
    total = special.logsumexp(weights)
    above, below = (special.logsumexp(weights + stats.t.logcdf(side * standardized, n)) - total for side in (1, -1))
    return float(above), float(below)


def _log_null(t: float, n: int) -> float:
    """Minus the log likelihood without an effect, as far as it has t in it."""
    return float(n / 2 * np.log1p(t**2 / (n - 1)))


def _log_weights(t: float, n: int, prior_scale: float) -> tuple[FloatArray, FloatArray]:
    """ln g, and the log of likelihood times prior there (in ln g)."""
    df = n - 1
    log_g = np.arange(-7.0, 45.0 + 2 * np.log1p(abs(t)), _STEP)
    spread = np.log1p(n * prior_scale**2 * np.exp(log_g))
    log_likelihood = -spread / 2 - (df + 1) / 2 * np.log1p(t**2 / df * np.exp(-spread))
    log_prior = -(np.log(2 * np.pi) + 3 * log_g + np.exp(-log_g)) / 2
    return log_g, log_likelihood + log_prior + log_g
