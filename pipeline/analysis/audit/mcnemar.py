"""Printed McNemar tests against the numbers of those who changed, and against n."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.phrases import label, written, written_p
from pipeline.study.printed import Measure, PrintedTest, Publication
from pipeline.study.rounded import Interval

_ROUND_OFF = 1e-9


def mcnemar_finding(publication: Publication, measure: Measure, test: PrintedTest) -> Finding | None:
    """χ² and p against both numbers, or χ² against n; None for another test, and where nothing can be compared."""
    if test.test != "mcnemar":
        return None
    n, parts = publication.n_of(measure, test), [written(*test.statistic, test)] if test.statistic is not None else []
    parts += [written_p(test.p)] if test.p is not None else []
    if test.discordant is not None:
        parts.insert(0, f"{test.discordant[0]} and {test.discordant[1]} changed")
    statement = Statement("McNemar", label(measure, test), ", ".join(parts))
    if test.discordant is not None:
        return _by_numbers(statement, test, test.discordant, n)
    if test.chi2 is None or n is None:
        return statement.unchecked("how many changed each way, or χ² and n, are needed") if parts else None
    return statement.judge(test.chi2.interval.low <= n, f"{n} or less", "χ² cannot exceed the number of participants")


def _by_numbers(statement: Statement, test: PrintedTest, numbers: tuple[int, int], n: int | None) -> Finding:
    """Both numbers against n, then χ² and p against them."""
    b, c = numbers
    if n is not None and b + c > n:
        return statement.judge(False, f"{n} or fewer", f"{b + c} changed, of {n}")
    if b + c == 0:
        return statement.judge(test.chi2 is None and test.p is None, "no test", "nobody changed")
    squares = sorted({max(abs(b - c) - by, 0.0) ** 2 / (b + c) for by in (0.0, 0.5, 1.0)}, reverse=True)
    if test.chi2 is not None and not _any(squares, test.chi2.interval):
        follows = " or ".join(dict.fromkeys(test.chi2.like(value) for value in squares))
        return statement.judge(False, follows, "χ² of these numbers, with and without a correction for continuity")
    if test.p is None:
        return statement.judge(True, "possible", "χ² of these numbers")
    return _p_finding(statement, test, test.p.interval, _p_values(b, c, squares))


def _p_values(b: int, c: int, squares: Sequence[float]) -> list[float]:
    """Two-sided: exact, mid-p, and of χ² with or without a correction for continuity."""
    from scipy import stats

    exact = float(stats.binomtest(b, b + c).pvalue)
    return [exact, exact - float(stats.binom.pmf(b, b + c, 0.5)), *(float(stats.chi2.sf(x, 1)) for x in squares)]


def _p_finding(statement: Statement, test: PrintedTest, printed: Interval, two_sided: Sequence[float]) -> Finding:
    one_sided = [side for p in two_sided for side in (p / 2, 1 - p / 2)]
    follows = " to ".join(dict.fromkeys(f"{p:.2g}" for p in (min(two_sided), max(two_sided))))
    if _any(one_sided if test.sides == "1" else two_sided, printed):
        return statement.judge(True, follows, "p of these numbers, exact or by χ²")
    if test.sides is None and _any(one_sided, printed):
        return statement.remark(follows, "only if it is one-sided")
    return statement.judge(False, follows, "p of these numbers, exact, mid-p or by χ²")


def _any(values: Sequence[float], printed: Interval) -> bool:
    """Is one of the values within the printed ones?"""
    low, high = float(printed.low), float(printed.high)
    return any(low <= value * (1 + _ROUND_OFF) and value * (1 - _ROUND_OFF) <= high for value in values)
