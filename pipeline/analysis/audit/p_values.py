"""The p value that a printed statistic and its degrees of freedom leave open (statcheck: Nuijten et al. 2016)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from pipeline.statistics.arrays import FloatArray
from pipeline.study.printed import Symbol
from pipeline.study.rounded import Interval

Bounds = tuple[float, float]


_PATH = 33  # points between the bounds of a degree of freedom that is itself rounded
_SMALLEST_DF = 1e-3
_ROUND_OFF = 1e-9  # relative: of the distributions' own arithmetic


def p_two_sided(symbol: Symbol, statistic: float, df: Sequence[float | FloatArray]) -> FloatArray:
    """p of both tails for t, z and Pearson's r (df = n − 2), of the upper tail for F, χ² and H; one for each df."""
    from scipy import special  # the functions behind `stats`, which takes ten times as long to look at its arguments

    p: Any
    if symbol == "F":
        p = special.fdtrc(df[0], df[1], max(statistic, 0.0))
    elif symbol in ("chi2", "H"):
        p = special.chdtrc(df[0], max(statistic, 0.0))
    elif symbol == "z":
        p = 2 * special.ndtr(-abs(statistic))
    elif symbol == "r":
        with np.errstate(divide="ignore"):
            size = np.divide(min(abs(statistic), 1.0), np.sqrt(1 - min(abs(statistic), 1.0) ** 2))
        p = 2 * special.stdtr(df[0], -size * np.sqrt(df[0]))
    else:
        p = 2 * special.stdtr(df[0], -abs(statistic))
    return np.asarray(p, dtype=np.float64)


def p_bounds(symbol: Symbol, statistic: Interval, df: Sequence[Interval]) -> Bounds:
    """The smallest and the largest p for a statistic and degrees of freedom within intervals."""
    return _p_bounds(symbol, statistic, tuple(df))


@lru_cache(maxsize=1024)  # of one printed test several checks ask
def _p_bounds(symbol: Symbol, statistic: Interval, df: tuple[Interval, ...]) -> Bounds:
    grid = np.meshgrid(*(_points(part) for part in df), indexing="ij")
    return _bounds(symbol, statistic, grid)


def p_bounds_corrected(statistic: Interval, df: Sequence[Interval], epsilon: Interval) -> Bounds:
    """The same for F with both degrees of freedom times one ε, as corrections for sphericity have it."""
    return _p_bounds_corrected(statistic, tuple(df), epsilon)


@lru_cache(maxsize=1024)
def _p_bounds_corrected(statistic: Interval, df: tuple[Interval, ...], epsilon: Interval) -> Bounds:
    first, second, factor = np.meshgrid(*(_points(part) for part in (*df, epsilon)), indexing="ij")
    return _bounds("F", statistic, [first * factor, second * factor])


def _points(interval: Interval) -> FloatArray:
    low, high = max(float(interval.low), _SMALLEST_DF), max(float(interval.high), _SMALLEST_DF)
    return np.array([low]) if low == high else np.linspace(low, high, _PATH)


def _bounds(symbol: Symbol, statistic: Interval, df: Sequence[FloatArray]) -> Bounds:
    """p falls with the statistic's size, but need not be monotonic in the degrees of freedom of F.

    So these are walked through, and the bounds widened by the walk's largest step: what lies between two points is
    no further off than that.
    """
    size = statistic.at_least(0) if symbol in ("F", "chi2", "H") else statistic.size()
    smallest, largest = (p_two_sided(symbol, float(end), df) for end in (size.high, size.low))
    steps = [np.abs(np.diff(p, axis=axis)) for p in (smallest, largest) for axis in range(p.ndim)]
    room = max((float(step.max()) for step in steps if step.size), default=0.0)
    low, high = float(smallest.min()) - room, float(largest.max()) + room
    return max(0.0, low * (1 - _ROUND_OFF)), min(1.0, high * (1 + _ROUND_OFF))


def meets(bounds: Bounds, printed: Interval) -> bool:
    """Do a printed p and the recomputed bounds overlap?"""
    return bounds[0] <= float(printed.high) and float(printed.low) <= bounds[1]
