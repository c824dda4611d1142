"""Printed Wilcoxon signed-rank tests: can n pairs have this W and this p?"""

from __future__ import annotations

from math import ceil, floor

from pipeline.analysis.audit import signed_rank
from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.phrases import label, written_p
from pipeline.study.printed import Measure, PrintedTest, Publication
from pipeline.study.rounded import Interval, Rounded

_METHODS = {None: "exact p or normal approximation", "exact": "exact p", "normal": "normal approximation"}


def wilcoxon_finding(publication: Publication, measure: Measure, test: PrintedTest) -> Finding | None:
    """W and p against n; None for another test, and where neither is printed."""
    if test.test != "wilcoxon":
        return None
    printed = [f"W = {test.W.text}"] if test.W is not None else []
    printed += [written_p(test.p)] if test.p is not None else []
    if not printed:
        return None
    statement, n = Statement("Wilcoxon", label(measure, test), ", ".join(printed)), publication.n_of(measure, test)
    if n is None:
        return statement.unchecked("n is not given")
    if test.W is not None and not _is_rank_sum(test.W.interval, n):
        return statement.judge(
            False, f"0 to {n * (n + 1) // 2} in steps of 0.5", f"{n} pairs cannot have this rank sum"
        )
    if test.p is None:
        return statement.judge(True, f"0 to {n * (n + 1) // 2} in steps of 0.5", f"a rank sum that {n} pairs can have")
    return _p_finding(statement, n, test, test.p)


def _is_rank_sum(printed: Interval, n: int) -> bool:
    """Midranks are halves, and so are their sums."""
    return max(ceil(printed.low * 2), 0) <= min(floor(printed.high * 2), n * (n + 1))


def _p_finding(statement: Statement, n: int, test: PrintedTest, p: Rounded) -> Finding:
    """By the exact distribution first; by the normal approximation or one-sided as a remark, where nothing is said."""
    sides = [int(test.sides)] if test.sides else [2, 1]
    all_patterns = n <= signed_rank.MOST_FOR_ALL_PATTERNS
    for count in sides:
        side = "" if count == sides[0] else "a one-sided "
        if test.method != "normal" and _exact_possible(n, test.W, p.interval, count):
            return _possible(statement, f"{side or 'an '}exact p of {n} pairs", remarkable=bool(side))
        if test.method != "exact" and _normal_possible(n, test.W, p.interval, count):
            unsaid = test.method is None and all_patterns
            explanation = f"{side or 'a '}normal approximation for {n} pairs{', and no exact p' if unsaid else ''}"
            return _possible(statement, explanation, remarkable=unsaid or bool(side))
    method, smallest = _METHODS[test.method], signed_rank.smallest_p(n, min(sides), test.method)
    if float(p.interval.high) < smallest:
        return statement.judge(False, f"{smallest:.2g} or more", f"no {method} of {n} pairs is this small")
    if n > (signed_rank.MOST_FOR_NORMAL if test.method == "normal" else signed_rank.MOST_FOR_ALL_PATTERNS):
        return statement.unchecked(f"{n} pairs have too many patterns of zeros and ties to try them all")
    return statement.judge(False, "another p", f"no {method} of {n} pairs has this value, whatever the zeros and ties")


def _possible(statement: Statement, explanation: str, remarkable: bool) -> Finding:
    text = f"{explanation}, for some zeros and ties"
    return statement.remark("possible", text) if remarkable else statement.judge(True, "possible", text)


def _exact_possible(n: int, rank_sum: Rounded | None, p: Interval, sides: int) -> bool:
    if n > signed_rank.MOST_FOR_ALL_PATTERNS:
        return rank_sum is None and n <= signed_rank.MOST_FOR_UNTIED and signed_rank.untied_p_possible(n, p, sides)
    if rank_sum is None:
        return signed_rank.exact_p_possible(n, p, sides)
    return signed_rank.exact_p_with_sum(n, rank_sum.interval, p, sides)


def _normal_possible(n: int, rank_sum: Rounded | None, p: Interval, sides: int) -> bool:
    if n > signed_rank.MOST_FOR_NORMAL:
        return False
    fits = None if rank_sum is None else lambda doubled, total: signed_rank.sum_fits(rank_sum.interval, doubled, total)
    return signed_rank.normal_p_possible(n, p, sides, fits)
