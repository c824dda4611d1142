"""Printed degrees of freedom: which values they stand for, and which follow from n and the design."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.phrases import label, written
from pipeline.study.printed import DEGREES_OF_FREEDOM, Measure, PrintedTest, Publication
from pipeline.study.rounded import Interval, Rounded

WITHIN = ("rm_anova", "art_anova")
_LESS_THAN_N = {"t_paired": 1, "correlation": 2}
_LAST_FRACTIONAL = ("welch", "mixed_model", None)


def exactly(value: int | Fraction) -> Interval:
    """A value that is not rounded."""
    return Interval(Fraction(value), Fraction(value))


def is_whole(figure: Rounded) -> bool:
    """Is it printed without decimals?"""
    return figure.unit == 1


def degrees_of_freedom(test: PrintedTest, n: int | None) -> list[Interval] | None:
    """The degrees of freedom; None where they are neither printed nor follow from n.

    Printed whole they are exact, but for the last where a test's need not be whole (Welch, Satterthwaite).
    """
    if test.statistic is not None and DEGREES_OF_FREEDOM[test.statistic[0]] == 0:
        return []
    if not test.df:
        less = _LESS_THAN_N.get(test.test or "")
        return None if less is None or n is None or n <= less else [exactly(n - less)]
    last = len(test.df) - 1
    return [
        exactly(part.value)
        if is_whole(part) and not (index == last and test.test in _LAST_FRACTIONAL)
        else part.interval
        for index, part in enumerate(test.df)
    ]


def rounded_after_correction(test: PrintedTest, n: int | None) -> list[Interval] | None:
    """Their intervals, had they been corrected for sphericity and then rounded; None where that is not possible."""
    tests = (*WITHIN, "mixed_anova", None)
    if test.test not in tests or test.F is None or len(test.df) != 2 or not all(map(is_whole, test.df)):
        return None
    first, second = test.df
    if first.value <= 1 if n is None or test.test == "mixed_anova" else second.value == first.value * (n - 1):
        return None
    return [part.interval.at_least(1) for part in test.df]


def degrees_of_freedom_findings(publication: Publication, measure: Measure, test: PrintedTest) -> Iterator[Finding]:
    """The degrees of freedom against those that follow from n and the design."""
    if not test.df or test.statistic is None:
        return
    statement = Statement("degrees of freedom", label(measure, test), written(*test.statistic, test))
    n = publication.n_of(measure, test)
    if test.test in WITHIN and test.F is not None:
        yield statement.unchecked("n is not given") if n is None else _within(statement, test, n)
    elif test.test == "mixed_anova" and test.F is not None:
        yield statement.unchecked("n is not given") if n is None else _mixed(statement, test, n)
    elif test.test in _LESS_THAN_N:
        less = _LESS_THAN_N[test.test]
        yield statement.unchecked("n is not given") if n is None else _against_n(statement, test, n - less)
    elif test.test in ("friedman", "kruskal") and len(measure.cells) > 1:
        yield _levels(statement, measure, test)
    elif test.test in ("t_independent", "anova"):
        yield _between(statement, measure, test)


def _against_n(statement: Statement, test: PrintedTest, expected: int) -> Finding:
    """More than follow from n contradict it; fewer suggest that someone was left out, unless the test states its n."""
    df = test.df[-1]
    if df.interval.high < expected and test.n is None:
        return statement.remark(str(expected), "fewer than follow from n: was someone left out?")
    return statement.judge(df.interval.low <= expected <= df.interval.high, str(expected), "as follows from n")


def _within(statement: Statement, test: PrintedTest, n: int) -> Finding:
    """The error's are n − 1 times the effect's, corrected for sphericity or not."""
    first, second = test.df
    expected = first.value * (n - 1)
    follows, explanation = f"{first.text}, {first.like(expected)}", f"the second are n − 1 = {n - 1} times the first"
    whole = is_whole(first) and is_whole(second)
    if whole and second.value == expected:
        return statement.judge(True, follows, explanation)
    if first.interval.low <= 0:
        return statement.judge(False, follows, "degrees of freedom are more than 0")
    ratio = second.interval / first.interval
    if ratio.low <= n - 1 <= ratio.high:
        if whole:
            return statement.remark(follows, f"{explanation}, only if both are rounded after a correction")
        return statement.judge(True, follows, explanation)
    if ratio.high < n - 1 and test.n is None:
        return statement.remark(follows, f"{explanation}; these are fewer: was someone left out?")
    return statement.judge(False, follows, explanation)


def _mixed(statement: Statement, test: PrintedTest, n: int) -> Finding:
    """With n participants in g groups a within-effect's error has n − g times the effect's, other effects' fewer.

    Corrections for sphericity keep that ratio. How many groups and between-factors there were is not said.
    """
    first, second = test.df
    follows, explanation = f"the second at most {n - 2} times the first", f"{n} participants in two groups or more"
    if first.interval.low <= 0:
        return statement.judge(False, follows, "degrees of freedom are more than 0")
    fits = second.interval.low / first.interval.high <= n - 2
    if fits and is_whole(first) and is_whole(second) and second.value > first.value * (n - 2):
        if first.value > 1:
            return statement.remark(follows, f"{explanation}, only if both are rounded after a correction")
        fits = False
    return statement.judge(fits, follows, explanation)


def _levels(statement: Statement, measure: Measure, test: PrintedTest) -> Finding:
    """The conditions less 1. Other conditions may not be in the file, unless the test lists its own."""
    levels = len(test.conditions or measure.cells)
    if test.df[0].value != levels - 1 and test.conditions is None:
        return statement.remark(str(levels - 1), f"{levels} conditions less 1; were there others?")
    return statement.judge(test.df[0].value == levels - 1, str(levels - 1), f"{levels} conditions less 1")


def _between(statement: Statement, measure: Measure, test: PrintedTest) -> Finding:
    """All participants less the groups."""
    groups = test.conditions or tuple(measure.cells)
    ns = [n for n in (measure.cells[name].n for name in groups) if n is not None]
    if test.n is None and len(ns) < len(groups):
        return statement.unchecked("n of every group is needed")
    if len(groups) < 2 or (test.F is None and len(groups) > 2):
        return statement.unchecked("which groups were compared is not given")
    if test.F is not None:
        of_groups = _levels(statement, measure, test)
        if of_groups.verdict != "agreement":
            return of_groups
    return _against_n(statement, test, (test.n or sum(ns)) - len(groups))
