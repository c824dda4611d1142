"""Tails and quantiles of t, F and χ² as `scipy.stats` has them, to the last bit.

It asks the same special functions, after checks of its arguments that take fifty times as long: a comparison of a small
study asks hundreds of times.
"""

from __future__ import annotations

from scipy import special


def t_above(t: float, df: float) -> float:
    """P(T > t)."""
    return float(special.stdtr(df, -t))


def t_quantile(probability: float, df: float) -> float:
    """What T stays below with this probability."""
    return float(special.stdtrit(df, probability))


def f_above(f: float, df1: float, df2: float) -> float:
    """P(F > f); round-off may leave an f below 0."""
    return float(special.fdtrc(df1, df2, max(f, 0.0)))


def chi2_above(chi2: float, df: float) -> float:
    """P(χ² > chi2); round-off may leave it below 0, as in Mauchly's test of values that are spherical."""
    return float(special.chdtrc(df, max(chi2, 0.0)))
