"""Printed p values against the statistics they follow from (statcheck: Nuijten et al. 2016)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from pipeline.analysis.audit.degrees_of_freedom import WITHIN, degrees_of_freedom, rounded_after_correction
from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.p_values import Bounds, meets, p_bounds, p_bounds_corrected
from pipeline.analysis.audit.phrases import label, written, written_p
from pipeline.study.printed import Measure, PrintedTest, Publication, Symbol
from pipeline.study.rounded import Interval, Rounded

Reading = tuple[str, Bounds]
"""How a printed p may be meant ("" for the usual meaning), and its bounds if so."""

_WITH_OTHER_P = ("friedman", "wilcoxon", "mann_whitney", "kruskal", "mcnemar")
"""Tests whose statistic is often printed beside an exact p."""

_BY_COUNTING = ("wilcoxon", "mann_whitney", "mcnemar")


def p_left_open(test: PrintedTest, n: int | None) -> Bounds | None:
    """Bounds of p by every reading of the statistic that fits the printed p; None where none does."""
    if test.test in _WITH_OTHER_P and test.method != "normal":
        return None
    fitting = [bounds for _, bounds in _readings(test, n) if test.p is None or meets(bounds, test.p.interval)]
    return (min(low for low, _ in fitting), max(high for _, high in fitting)) if fitting else None


def p_finding(publication: Publication, measure: Measure, test: PrintedTest) -> Finding | None:
    """p against the statistic; None where neither is printed, or only a p that another check compares with n."""
    if test.statistic is None:
        if test.p is None or test.test in _BY_COUNTING:
            return None
        statement = Statement("recomputed p", label(measure, test), written_p(test.p))
        return statement.unchecked("no statistic is printed from which p follows")
    printed = written(*test.statistic, test)
    if test.p is None:
        return Statement("recomputed p", label(measure, test), printed).unchecked("no p is given")
    statement = Statement("recomputed p", label(measure, test), f"{printed}, {written_p(test.p)}")
    readings = list(_readings(test, publication.n_of(measure, test)))
    if not readings:
        return statement.unchecked("its degrees of freedom are not given")
    return _by_readings(publication, statement, test, test.p, readings)


def _by_readings(
    publication: Publication, statement: Statement, test: PrintedTest, p: Rounded, readings: Sequence[Reading]
) -> Finding:
    """Agreement by the usual reading; a remark where only another reading fits; else a contradiction."""
    plain = readings[0][1]
    for reading, bounds in readings:
        if meets(bounds, p.interval):
            if not reading:
                return statement.judge(True, _span(p, bounds), "p follows from the statistic")
            return statement.remark(_span(p, bounds), f"only if {reading}; else p is {_span(p, plain)}")
    if test.test in _WITH_OTHER_P and test.method != "normal":
        return statement.remark(_span(p, plain), "p does not follow from the statistic; it may be an exact p")
    across = _across(publication, test, p.interval, plain)
    return statement.judge(False, _span(p, plain), f"p does not follow from the statistic{across}")


def _readings(test: PrintedTest, n: int | None) -> Iterator[Reading]:
    """p from the statistic, by the usual readings first."""
    df = degrees_of_freedom(test, n)
    if test.statistic is None or df is None:
        return
    symbol, statistic = test.statistic[0], test.statistic[1].interval
    low, high = p_bounds(symbol, statistic, df)
    half, rest = (low / 2, high / 2), (1 - high / 2, 1 - low / 2)
    if test.sides == "1":
        yield "", half
        yield "", rest
    else:
        yield "", (low, high)
    if test.epsilon is not None and symbol == "F":
        yield "", p_bounds_corrected(statistic, df, test.epsilon.interval.at_least(0))
    if test.sides is None and (symbol in ("t", "z", "r") or (symbol == "F" and df[0].high == 1)):
        yield "it is one-sided", half
        yield "it is one-sided, against the direction found", rest
    yield from _other_freedom(test, n, symbol, statistic, df)


def _other_freedom(
    test: PrintedTest, n: int | None, symbol: Symbol, statistic: Interval, df: list[Interval]
) -> Iterator[Reading]:
    """Readings in which the degrees of freedom are not those printed."""
    rounded = rounded_after_correction(test, n)
    if rounded is not None:
        yield "its degrees of freedom are rounded after a correction", p_bounds("F", statistic, rounded)
    if symbol == "F" and test.test in (*WITHIN, "mixed_anova", None) and df[0].low > 1 and test.epsilon is None:
        bounds = p_bounds_corrected(statistic, df, Interval(1 / df[0].high, Fraction(1)))
        yield "it is corrected for sphericity, and its degrees of freedom are not", bounds
    if not test.df and test.n is None and df and df[0].high > 1:
        yield "fewer participants were tested", p_bounds(symbol, statistic, [Interval(Fraction(1), df[0].high)])


def _across(publication: Publication, test: PrintedTest, printed: Interval, bounds: Bounds) -> str:
    """A clause for where the recomputed p is on the other side of the level, else ""."""
    alpha = float((test.alpha or publication.alpha).value)
    across = printed.high < alpha < bounds[0] or bounds[1] < alpha < printed.low
    return f", and the recomputed p is on the other side of {alpha:g}" if across else ""


def _span(p: Rounded, bounds: Bounds) -> str:
    """With the digits of the printed p; with two where these would all be zeros."""
    if p.relation == "=" and p.like(bounds[1]).strip("0."):
        return p.span(*bounds)
    return " to ".join(dict.fromkeys(f"{bound:.2g}" for bound in bounds))
