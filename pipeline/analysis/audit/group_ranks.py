"""Printed Mann-Whitney and Kruskal-Wallis tests: what groups of these sizes can have, whatever values tie.

With ties the ranks' variance is smaller and a p may lie on either side of that without; so a p that does not follow
from U without ties is only a remark. Only what no values can have is called impossible: with r the correlation of ranks
and groups, z² is (N − 1)·r², and H is N − 1 times the share of the ranks' variation that groups explain.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, comb, floor, sqrt

import numpy as np

from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.p_values import Bounds, meets
from pipeline.analysis.audit.phrases import label, written, written_p
from pipeline.statistics.arrays import FloatArray
from pipeline.study.printed import Measure, PrintedTest
from pipeline.study.rounded import Interval, Rounded

_ROUND_OFF = 1e-9
_MOST_FOR_EXACT = 60  # participants


def group_rank_findings(measure: Measure, test: PrintedTest) -> Iterator[Finding]:
    """U, z, H and p against the groups' sizes."""
    if test.test not in ("mann_whitney", "kruskal"):
        return
    names = test.conditions or tuple(measure.cells)
    ns = [n for n in (measure.cells[name].n for name in names) if n is not None]
    if len(ns) < max(len(names), 2):
        yield Statement("ranks of groups", label(measure, test), _printed(test)).unchecked("n of every group is needed")
    elif test.test == "kruskal":
        yield from _kruskal(measure, test, sum(ns))
    elif len(ns) == 2:
        yield from _mann_whitney(measure, test, ns[0], ns[1])


def _printed(test: PrintedTest) -> str:
    parts = [f"U = {test.U.text}"] if test.U is not None else []
    parts += [written(*test.statistic, test)] if test.statistic is not None else []
    return ", ".join(parts + ([written_p(test.p)] if test.p is not None else []))


def _kruskal(measure: Measure, test: PrintedTest, number: int) -> Iterator[Finding]:
    figure = test.H or test.chi2
    if figure is not None:
        statement = Statement("ranks of groups", label(measure, test), _printed(test))
        fits = figure.interval.low <= number - 1
        yield statement.judge(fits, f"{number - 1} or less", f"H of {number} participants cannot be larger")


def _mann_whitney(measure: Measure, test: PrintedTest, n: int, m: int) -> Iterator[Finding]:
    statement = Statement("ranks of groups", label(measure, test), _printed(test))
    number = n + m
    if test.U is not None and not _is_u(test.U.interval, n * m):
        yield statement.judge(False, f"0 to {n * m} in steps of 0.5", f"groups of {n} and {m} cannot have this U")
        return
    if test.z is not None:
        largest, least = sqrt(number - 1), 0.0
        if test.U is not None:
            least = max(0.0, _distance(test.U.interval, n * m)[0] - 0.5) / _sd(n, m)
        size = test.z.interval.size()
        fits = float(size.low) <= largest * (1 + _ROUND_OFF) and float(size.high) >= least * (1 - _ROUND_OFF)
        yield statement.judge(fits, test.z.span(least, largest), "z without its sign, for some ties")
    if test.p is not None:
        yield _p_finding(statement, test, test.p, n, m)
    elif test.U is not None and test.z is None:
        yield statement.judge(True, f"0 to {n * m} in steps of 0.5", f"a U that groups of {n} and {m} can have")


def _is_u(printed: Interval, most: int) -> bool:
    return max(ceil(printed.low * 2), 0) <= min(floor(printed.high * 2), 2 * most)


def _sd(n: int, m: int) -> float:
    """Of U where no values tie; ties make it smaller."""
    return sqrt(n * m * (n + m + 1) / 12)


def _distance(u: Interval, most: int) -> Bounds:
    """Bounds of |U − its mean|, the same for either group's U."""
    size = (Interval(u.low * 2 - most, u.high * 2 - most)).size()
    return float(size.low) / 2, min(float(size.high), most) / 2


def _p_finding(statement: Statement, test: PrintedTest, p: Rounded, n: int, m: int) -> Finding:
    from scipy import stats

    fewest_sides = 1 if test.sides == "1" or test.sides is None else 2
    least = min(1 / comb(n + m, n), fewest_sides * float(stats.norm.sf(sqrt(n + m - 1)))) * (1 - _ROUND_OFF)
    if float(p.interval.high) < least:
        return statement.judge(False, f"{least:.2g} or more", f"groups of {n} and {m} cannot have a p this small")
    if test.U is None:
        return statement.judge(True, "possible", f"a p that groups of {n} and {m} can have, for some ties")
    sides = [2, 1] if test.sides is None else [int(test.sides)]
    for count in sides:
        bounds = _without_ties(test.U.interval, n, m, test.method)
        side = (bounds[0] * count / 2, bounds[1] * count / 2)
        if meets(side, p.interval) or (count == 1 and meets((1 - side[1], 1 - side[0]), p.interval)):
            if count == sides[0]:
                return statement.judge(True, _span(side), "p follows from U, where few values tie")
            return statement.remark(
                _span(side), f"only if it is one-sided; else p is {_span(bounds)} where few values tie"
            )
    return statement.remark(
        _span(_without_ties(test.U.interval, n, m, test.method)), "p does not follow from U unless many values tie"
    )


def _span(bounds: Bounds) -> str:
    return " to ".join(dict.fromkeys(f"{bound:.2g}" for bound in bounds))


def _without_ties(u: Interval, n: int, m: int, method: str | None) -> Bounds:
    """Two-sided p of the normal approximation, with and without its correction for continuity, and the exact one."""
    from scipy import stats

    near, far = _distance(u, n * m)
    p_values: list[float] = []
    if method != "exact":
        for apart in (near, far):
            z = (np.array([apart, max(apart - 0.5, 0.0)])) / _sd(n, m)
            p_values += [float(p) for p in 2 * stats.norm.sf(z)]
    if method != "normal" and n + m <= _MOST_FOR_EXACT:
        p_values += [_exact(n * m / 2 - apart, n, m) for apart in (near, far)]
    return (min(p_values) * (1 - _ROUND_OFF), min(1.0, max(p_values) * (1 + _ROUND_OFF))) if p_values else (0.0, 1.0)


def _exact(u: float, n: int, m: int) -> float:
    """Twice P(U ≤ u) without ties, at most 1."""
    ways = _ways(min(n, m), max(n, m))
    return float(min(1.0, 2 * ways[: floor(u + _ROUND_OFF) + 1].sum() / ways.sum()))


def _ways(n: int, m: int) -> FloatArray:
    """How many orders of n and m values have U = 0, 1, …, n·m: the coefficients of a Gaussian binomial."""
    ways = np.zeros(n * m + 1)
    ways[0] = 1
    for step in range(m + 1, m + n + 1):
        ways[step:] -= ways[:-step].copy()
    for step in range(1, n + 1):
        for at in range(step, len(ways)):
            ways[at] += ways[at - step]
    return ways
