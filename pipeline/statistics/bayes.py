"""The Bayes factor of a paired difference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import special

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.effect_size import dz_interval
from pipeline.statistics.paired import differences_of
from pipeline.statistics.result import Result

PRIOR_SCALE = 0.707
_STEP = 0.01  # of ln g; the integrand is smooth and dies out on both sides, so sums converge faster than any power


def bayes_t(
    first: FloatArray, second: FloatArray, prior_scale: float = PRIOR_SCALE, effect: str = "condition"
) -> Result:
    """BF₁₀ of first − second under the JZS prior: d_z is Cauchy with the given scale (Rouder et al. 2009, eq. 1)."""
    method = f"JZS Bayes factor of the paired difference, Cauchy prior of scale {prior_scale:g} on d_z"
    blank = Result(effect, "BF10", method, "Cohen's d_z", len(first))
    found = differences_of(first, second)
    if isinstance(found, str):
        return replace(blank, status=found)
    log_bf10 = log_bayes_factor(found.mean / found.error, found.n, prior_scale)
    bf10 = float(np.exp(log_bf10)) if log_bf10 < np.log(np.finfo(np.float64).max) else None
    low, high = dz_interval(found.dz, found.n)
    return replace(
        blank,
        statistic=bf10,
        effect_size=found.dz,
        ci_low=low,
        ci_high=high,
        details={"bf10": bf10, "log_bf10": log_bf10, "prior_scale": prior_scale},
    )


def log_bayes_factor(t: float, n: int, prior_scale: float) -> float:
    """ln BF₁₀ of a one-sample t of n values: the integral over g by the trapezoidal rule in ln g."""
    df = n - 1
    log_g = np.arange(-7.0, 45.0 + 2 * np.log1p(abs(t)), _STEP)
    spread = np.log1p(n * prior_scale**2 * np.exp(log_g))
    log_likelihood = -spread / 2 - (df + 1) / 2 * np.log1p(t**2 / df * np.exp(-spread))
    log_prior = -(np.log(2 * np.pi) + 3 * log_g + np.exp(-log_g)) / 2
    log_integral = special.logsumexp(log_likelihood + log_prior + log_g) + np.log(_STEP)
    return float(log_integral + (df + 1) / 2 * np.log1p(t**2 / df))
