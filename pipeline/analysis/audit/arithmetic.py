"""Printed reductions, totals, percentages, counts and lags against the figures they are computed from."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import reduce
from math import ceil, floor
from operator import add

from pipeline.analysis.audit.cells import printed_cell
from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.study.printed import Measure, Parts, Peak, Publication, Reduction, Share, Total
from pipeline.study.rounded import Interval, Rounded

_FIGURES = {"mean": "mean", "median": "median", "sd": "SD", "rmse": "RMSE", "participants": "mean"}
_ONE = Interval(Fraction(1), Fraction(1))


def reduction_findings(measure: Measure) -> Iterator[Finding]:
    """Each printed reduction against the two figures it compares."""
    return (_reduction(measure, reduction) for reduction in measure.reductions)


def _reduction(measure: Measure, reduction: Reduction) -> Finding:
    figure = _FIGURES[reduction.of]
    what = f"{measure.name}, {reduction.before} to {reduction.to}"
    statement = Statement("reduction", what, f"{figure} reduced by {_percent(reduction.percent)}")
    if reduction.of == "participants":
        return statement.unchecked("the mean of the participants' own reductions cannot be computed from printed means")
    before, after = (getattr(measure.cells[name], reduction.of) for name in (reduction.before, reduction.to))
    if before is None or after is None:
        return statement.unchecked(f"the {figure} of both conditions is needed")
    if before.interval.low <= 0 <= before.interval.high:
        return statement.unchecked(f"the first {figure}, {before.text}, may be zero")
    possible = _reduced(before, after)
    fits = possible.meets(reduction.percent.interval)
    explanation = f"1 − {after.text}/{before.text}"
    if not fits and not after.interval.low <= 0 <= after.interval.high:
        relative_to_second = (before.interval / after.interval - _ONE) * 100
        explanation += (
            f"; relative to the second, {reduction.percent.span(relative_to_second.low, relative_to_second.high)} %"
        )
    return statement.judge(fits, f"{reduction.percent.span(possible.low, possible.high)} %", explanation)


def _reduced(before: Rounded, after: Rounded) -> Interval:
    """The reduction in percent of the first figure."""
    return (_ONE - after.interval / before.interval) * 100


def _percent(figure: Rounded) -> str:
    return f"{figure.text.rstrip(' %')} %"


def total_finding(publication: Publication, total: Total) -> Finding:
    """A total against the means it is computed from, each narrowed to what the scale's steps allow."""
    statement = Statement("total", total.label, total.printed.text)
    measures = publication.named(total.measures)
    cells = [printed_cell(publication, measure, total.condition) for measure in measures]
    parts: list[Interval] = []
    grains: set[Fraction | None] = set()
    for cell in cells:
        if cell.cell.mean is None:
            return statement.unchecked(f"{cell.what} has no mean")
        if cell.n is None and total.sum is not None:
            return statement.unchecked(f"{cell.what} has no n")
        times = cell.n if cell.n is not None and total.sum is not None else 1
        possible, grain = cell.cell.mean.interval, None
        if cell.steps is not None and cell.n is not None:
            totals = cell.steps.totals(possible, cell.n)
            if not totals:
                return statement.unchecked(f"{cell.what} has a mean that is not possible")
            possible = Interval(cell.steps.mean(totals[0], cell.n), cell.steps.mean(totals[-1], cell.n))
            grain = cell.steps.grain * Fraction(times, cell.n)
        parts.append(possible * times)
        grains.add(grain)
    grain = grains.pop() if len(grains) == 1 else None
    factor = Fraction(1, len(parts)) if total.average is not None else Fraction(1)
    possible_total = reduce(add, parts) * factor
    fits = _meets(possible_total, None if grain is None else grain * factor, total.printed.interval)
    follows = total.printed.span(possible_total.low, possible_total.high)
    verb = "average" if total.average is not None else "add up to"
    over = f" over {cells[0].n} participants" if total.sum is not None and len({cell.n for cell in cells}) == 1 else ""
    return statement.judge(fits, follows, f"the printed means of {len(parts)} measures {verb} {follows}{over}")


def _meets(possible: Interval, grain: Fraction | None, printed: Interval) -> bool:
    """Does the printed total stand for a possible one? Where all scales have one step, these lie `grain` apart."""
    if grain is None or not possible.meets(printed):
        return possible.meets(printed)
    low, high = max(possible.low, printed.low), min(possible.high, printed.high)
    return ceil((low - possible.low) / grain) <= floor((high - possible.low) / grain)


def share_finding(share: Share) -> Finding:
    """A percentage against the printed count, or against every count that is possible."""
    percent = share.percent.interval
    if share.count is not None:
        statement = Statement("percentage", share.label, f"{share.count} of {share.of}, {_percent(share.percent)}")
        exact = Fraction(100 * share.count, share.of)
        fits = share.count <= share.of and percent.low <= exact <= percent.high
        return statement.judge(fits, f"{share.percent.like(exact)} %", f"{share.count} of {share.of}")
    statement = Statement("percentage", share.label, f"{_percent(share.percent)} of {share.of}")
    counts = range(max(0, ceil(percent.low * share.of / 100)), min(share.of, floor(percent.high * share.of / 100)) + 1)
    if counts and percent.high - percent.low >= Fraction(100, share.of):
        return statement.unchecked(f"of {share.of} every percentage with these digits is possible")
    if counts:
        return statement.judge(True, f"{counts[0]} of {share.of}", "a whole number of them")
    below = min(max(floor(share.percent.value * share.of / 100), 0), share.of - 1)
    near = [share.percent.like(Fraction(100 * count, share.of)) for count in (below, below + 1)]
    return statement.judge(False, f"{near[0]} or {near[1]} %", f"{below} or {below + 1} of {share.of}")


def count_finding(parts: Parts) -> Finding:
    """Counts are exact."""
    printed = f"{' + '.join(map(str, parts.parts))} = {parts.total}"
    total = sum(parts.parts)
    return Statement("count", parts.label, printed).judge(total == parts.total, str(total), "the sum of the parts")


def peak_finding(peak: Peak) -> Finding:
    """The lag of a cross-correlation's peak: its distance from the middle, in samples."""
    samples = peak.at - (peak.of + 1) // 2
    rate = peak.rate_hz.interval
    ends = (Fraction(samples) / rate.low, Fraction(samples) / rate.high)
    possible = Interval(min(ends), max(ends))
    statement = Statement("lag", peak.label, f"{peak.lag_s.text} s for the peak at {peak.at} of {peak.of}")
    explanation = f"{samples} samples from the middle at {peak.rate_hz.text} Hz"
    follows = f"{peak.lag_s.like(Fraction(samples) / peak.rate_hz.value)} s"
    return statement.judge(possible.meets(peak.lag_s.interval), follows, explanation)
