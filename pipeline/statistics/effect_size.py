"""Effect sizes and their intervals by inverting noncentral distributions (Cumming and Finch 2001; Steiger 2004)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import optimize, special, stats

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(800)
_LARGEST = 1e5  # of a noncentrality: beyond it the distributions are not computed


def cohen_dz(differences: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Mean difference over the SD of the differences."""
    return float(np.mean(differences) / np.std(differences, ddof=1))


def dz_interval(dz: float, n: int, level: float = 0.95) -> tuple[float | None, float | None]:
    """Interval of d_z from the noncentral t distribution."""
    t, tail = dz * np.sqrt(n), (1 - level) / 2
    width = 10 + abs(t)

    def bound(target: float) -> float | None:
        found = _solve(lambda shift: noncentral_t_cdf(t, n - 1, shift) - target, t - width, t + width)
        return None if found is None else float(found / np.sqrt(n))

    return bound(1 - tail), bound(tail)


def noncentral_t_cdf(t: float, df: int, noncentrality: float) -> float:
    """P(T ≤ t) as E[Φ(t·s − δ)] over s = √(χ²/df), by Gauss and Legendre.

    SciPy's own gives NaN for negative t far from zero; in the middle the two agree to 1e-10.
    """
    low, high = np.sqrt(stats.chi2.ppf(1e-18, df)), np.sqrt(stats.chi2.isf(1e-18, df))
    at = (_NODES + 1) / 2 * (high - low) + low
    density = _WEIGHTS * (high - low) / 2 * stats.chi.pdf(at, df)
    return float(np.sum(density * special.ndtr(t * at / np.sqrt(df) - noncentrality)))


def hedges_correction(df: int) -> float | None:
    """The exact small-sample factor J (Hedges 1981); None for one degree of freedom, where it is zero."""
    if df < 2:
        return None
    return float(np.exp(special.gammaln(df / 2) - special.gammaln((df - 1) / 2)) / np.sqrt(df / 2))


def partial_eta_squared_interval(
    statistic: float, df1: float, df2: float, level: float = 0.95
) -> tuple[float | None, float | None]:
    """Interval of partial η² from the noncentral F distribution."""
    tail = (1 - level) / 2

    def below(noncentrality: float) -> float:
        if noncentrality == 0:
            return float(stats.f.cdf(statistic, df1, df2))
        return float(stats.ncf.cdf(statistic, df1, df2, noncentrality))

    bounds: list[float | None] = []
    for target in (1 - tail, tail):
        if below(0.0) < target:
            bounds.append(0.0)
            continue
        upper = max(10.0, 4 * statistic * df1)
        while below(upper) > target and upper < _LARGEST:
            upper *= 2
        found = _solve(lambda value, target=target: below(value) - target, 0.0, upper)  # type: ignore[misc]
        bounds.append(None if found is None else found / (found + df2))
    return bounds[0], bounds[1]


def _solve(function: Callable[[float], float], low: float, high: float) -> float | None:
    if not np.isfinite(function(low)) or not np.isfinite(function(high)) or function(low) * function(high) > 0:
        return None
    return float(optimize.brentq(function, low, high, xtol=1e-10, rtol=1e-12))
