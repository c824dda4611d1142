"""Effect sizes and their intervals by inverting noncentral distributions (Cumming and Finch 2001; Steiger 2004)."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import isfinite

import numpy as np
from scipy import optimize, special, stats

from pipeline.statistics.arrays import FloatArray

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(400)
_STEP = np.array([-9.0, 9.0])  # where Φ is neither 0 nor 1
_SMOOTH_FROM = 3  # degrees of freedom
_WIDEST = 1e6  # times the estimate: no bound is searched for beyond it
_SMALLEST, _ROUND_OFF = 1e-300, 2**-53  # probabilities this near to 0 and 1 have a normal score that is finite
_LARGEST = 1e5  # noncentrality for which SciPy's noncentral F is used: beyond it gives NaN


def cohen_dz(differences: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Mean difference over the SD of the differences."""
    return float(np.mean(differences) / np.std(differences, ddof=1))


def dz_interval(dz: float, n: int, level: float = 0.95) -> tuple[float | None, float | None]:
    """Interval of d_z from the noncentral t distribution."""
    return standardized_interval(float(dz * np.sqrt(n)), n - 1, float(n**-0.5), level)


@lru_cache(maxsize=1024)  # several tests of the same values share it, also those without the exclusions
def standardized_interval(t: float, df: float, error: float, level: float = 0.95) -> tuple[float | None, float | None]:
    """Interval of a standardized difference, which is t times `error`: from the noncentralities that fit t."""
    tail = (1 - level) / 2

    def bound(target: float) -> float | None:
        width, wanted = 10 + abs(t), _normal_score(target)
        # Of one degree of freedom t may be a small part of its noncentrality: the bracket grows until it holds it.
        while width < _WIDEST * (10 + abs(t)):
            noncentrality = _solve(
                lambda shift: _normal_score(noncentral_t_cdf(t, df, shift)) - wanted, t - width, t + width
            )
            if noncentrality is not None:
                return noncentrality * error
            width *= 4
        return None

    return bound(1 - tail), bound(tail)


def _normal_score(probability: float) -> float:
    """Of a noncentrality it is nearly a straight line, on which a root is found in half the steps."""
    return float(special.ndtri(min(max(probability, _SMALLEST), 1 - _ROUND_OFF)))


def noncentral_t_cdf(t: float, df: float, noncentrality: float) -> float:
    """P(T ≤ t) as E[Φ(t·s − δ)] over s = √(χ²/df), by Gauss and Legendre.

    SciPy's own gives NaN for negative t far from zero; in the middle the two agree to 1e-10. For a large t, Φ is a
    step as narrow as 1/t: its surroundings are integrated apart.
    """
    edges = _reach(df)
    if t != 0:
        edges = np.unique(np.clip([*edges, *((noncentrality + _STEP) / t)], *edges))
    # Below three degrees of freedom s^(df − 1) is not smooth at 0, where of its fourth root u it is: s = u⁴.
    power = 4 if df < _SMOOTH_FROM else 1
    edges = edges ** (1 / power)
    root = (_NODES + 1) / 2 * np.diff(edges)[:, None] + edges[:-1, None]
    at, widths = root**power, power * root ** (power - 1) * np.diff(edges)[:, None] / 2
    # Of s: 2 (df/2)^(df/2) / Γ(df/2) · s^(df − 1) · exp(−df s² / 2)
    log_density = np.log(2) + df / 2 * np.log(df / 2) - special.gammaln(df / 2)
    density = np.exp(log_density + (df - 1) * np.log(at) - df * at**2 / 2) * _WEIGHTS * widths
    return float(np.sum(density * special.ndtr(t * at - noncentrality)))


@lru_cache(maxsize=1024)
def _reach(df: float) -> FloatArray:
    """Between which numbers √(χ²/df) lies, but for 1e-18 on either side."""
    bounds: FloatArray = np.sqrt(np.array([stats.chi2.ppf(1e-18, df), stats.chi2.isf(1e-18, df)]) / df)
    return bounds


def hedges_correction(df: float) -> float | None:
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
            return float(special.fdtr(df1, df2, statistic))
        if noncentrality > _LARGEST:  # there a noncentral χ is normal around √(λ + df1 − 1), to five digits
            return noncentral_t_cdf(np.sqrt(statistic * df1), df2, np.sqrt(noncentrality + df1 - 1))
        return float(special.ncfdtr(df1, df2, noncentrality, statistic))  # what `stats.ncf` asks, far sooner

    bounds: list[float | None] = []
    for target in (1 - tail, tail):
        if below(0.0) < target:
            bounds.append(0.0)
            continue
        upper = max(10.0, 4 * statistic * df1)
        while below(upper) > target and upper < _WIDEST * statistic * df1:
            upper *= 2
        bound = _solve(lambda value, target=target: below(value) - target, 0.0, upper)  # type: ignore[misc]
        bounds.append(None if bound is None else bound / (bound + df2))
    return bounds[0], bounds[1]


def _solve(function: Callable[[float], float], low: float, high: float) -> float | None:
    ends = {low: function(low), high: function(high)}
    if not all(map(isfinite, ends.values())) or ends[low] * ends[high] > 0:
        return None

    def known(at: float) -> float:
        """SciPy begins with the ends, of which each takes as long as a step."""
        return ends[at] if at in ends else function(at)

    return float(optimize.brentq(known, low, high, xtol=1e-10, rtol=1e-12))
