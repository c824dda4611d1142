"""A printed interval of a mean against mean, SD and n."""

from __future__ import annotations

from math import sqrt

from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.study.printed import Cell
from pipeline.study.rounded import Interval, Rounded

_ROUND_OFF = 1e-9


Printed = tuple[Rounded, Rounded]


def interval_finding(what: str, interval: Printed, cell: Cell, n: int | None, population: bool, by_t: bool) -> Finding:
    """Is it the t interval of the mean? Another kind is a remark, unless the file says that all are t intervals."""
    low, high = interval
    printed = f"{cell.ci_level.text} % CI [{low.text}, {high.text}]"
    statement = Statement("interval", what, printed)
    if low.interval.low > high.interval.high:
        return statement.judge(False, "the lower bound first", "the lower bound is above the upper one")
    level = float(cell.ci_level.value) / 100
    if cell.mean is None or cell.sd is None or n is None or n < 2 or not 0 < level < 1:
        return statement.unchecked("mean, SD and n are needed")
    from scipy import stats

    error = sqrt(n / (n - 1)) if population else 1.0
    sd = cell.sd.interval.at_least(0)
    spread = (float(sd.low) * error / sqrt(n), float(sd.high) * error / sqrt(n))
    t, z = float(stats.t.ppf((1 + level) / 2, n - 1)), float(stats.norm.ppf((1 + level) / 2))
    by_student = _bounds(cell.mean.interval, spread, t)
    follows = f"[{low.span(*by_student[0])}, {high.span(*by_student[1])}]"
    if _fits(interval, by_student):
        return statement.judge(True, follows, "the t interval of the mean")
    kind = "by the normal distribution" if _fits(interval, _bounds(cell.mean.interval, spread, z)) else ""
    explanation = f"an interval {kind}, not by t" if kind else "not the t interval of mean, SD and n"
    if by_t:
        return statement.judge(False, follows, explanation)
    return statement.remark(follows, explanation if kind else f"{explanation}; is it of another kind?")


Ends = tuple[tuple[float, float], tuple[float, float]]
"""The range of the lower bound, and that of the upper bound."""


def _bounds(mean: Interval, spread: tuple[float, float], times: float) -> Ends:
    low, high = float(mean.low), float(mean.high)
    return (low - times * spread[1], high - times * spread[0]), (low + times * spread[0], high + times * spread[1])


def _fits(printed: Printed, ends: Ends) -> bool:
    return all(
        float(figure.interval.low) <= high + _room(high) and low - _room(low) <= float(figure.interval.high)
        for figure, (low, high) in zip(printed, ends, strict=True)
    )


def _room(value: float) -> float:
    return _ROUND_OFF * max(abs(value), 1e-300)
