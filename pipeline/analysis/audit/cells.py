"""One condition's printed mean, SD, median and RMSE against each other, n and the scale."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, sqrt

from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.granularity import Steps, possible_sample
from pipeline.analysis.audit.intervals import interval_finding
from pipeline.study.printed import Cell, Measure, Publication, Scale
from pipeline.study.rounded import Rounded


@dataclass(frozen=True)
class PrintedCell:
    """A cell, and what its measure and the file say of it. `n` is None where it is not known for certain."""

    what: str
    cell: Cell
    n: int | None
    scale: Scale
    population: bool  # is the SD's divisor n, not n − 1?

    @property
    def steps(self) -> Steps | None:
        """The scale's steps, if it has any."""
        scale = self.scale
        if scale.step is None:
            return None
        grain = scale.step.value / scale.items
        origin = next((end.value for end in (scale.min, scale.max) if end is not None), Fraction(0))
        least, most = (None if end is None else int((end.value - origin) / grain) for end in (scale.min, scale.max))
        return Steps(grain, origin, least, most)


def printed_cell(publication: Publication, measure: Measure, condition: str) -> PrintedCell:
    """A cell by its condition. Groups must each say their own n: the file's may be that of all together."""
    cell = measure.cells[condition]
    n = cell.n if measure.between else cell.n or measure.n or publication.n
    what = f"{measure.name}, {condition}"
    return PrintedCell(what, cell, n, measure.scale or Scale(), publication.sd == "population")


def cell_findings(publication: Publication, measure: Measure) -> Iterator[Finding]:
    """Every check that a measure's cells allow."""
    for condition in measure.cells:
        cell = printed_cell(publication, measure, condition)
        yield from _out_of_range(cell)
        if cell.steps is not None:
            yield from _granularity(cell, cell.steps)
        elif measure.scale is not None:
            yield from _spread(cell)
        if cell.cell.rmse is not None and cell.cell.mean is not None:
            yield _rmse(cell, cell.cell.rmse, cell.cell.mean)
        if cell.cell.ci is not None:
            yield interval_finding(
                cell.what, cell.cell.ci, cell.cell, cell.n, cell.population, by_t=publication.intervals == "t"
            )


def _out_of_range(cell: PrintedCell) -> Iterator[Finding]:
    """Figures that no data can give, whatever the others are."""
    low, high = cell.scale.min, cell.scale.max
    for name, figure in (("SD", cell.cell.sd), ("RMSE", cell.cell.rmse)):
        if figure is not None and figure.interval.high < 0:
            yield Statement("range", cell.what, f"{name} = {figure.text}").judge(
                False, "0 or more", "it cannot be negative"
            )
    for name, figure in (("M", cell.cell.mean), ("median", cell.cell.median)):
        if figure is None:
            continue
        statement = Statement("range", cell.what, f"{name} = {figure.text}")
        if low is not None and figure.interval.high < low.value:
            yield statement.judge(False, f"{low.text} or more", "the scale begins there")
        if high is not None and figure.interval.low > high.value:
            yield statement.judge(False, f"{high.text} or less", "the scale ends there")


def _granularity(cell: PrintedCell, steps: Steps) -> Iterator[Finding]:
    """GRIM for the mean, GRIMMER for mean and SD, and a median on the scale's steps."""
    mean, sd, median, n = cell.cell.mean, cell.cell.sd, cell.cell.median, cell.n
    if n is None:
        named = {"M": mean, "SD": sd, "median": median}
        printed = ", ".join(f"{name} = {figure.text}" for name, figure in named.items() if figure is not None)
        if printed:
            yield Statement("GRIM", cell.what, printed).unchecked("what is possible depends on n, which is not given")
        return
    if mean is not None and sd is not None and n > 1 and steps.totals(mean.interval, n):
        yield _grimmer(cell, steps, mean, sd, n)
    elif mean is not None:
        yield _grim(cell, steps, mean, n)
    if median is not None:
        yield _median(cell, steps, median, n)


def _scores(cell: PrintedCell, n: int) -> str:
    step = "whole-number" if cell.scale.step is None or cell.scale.step.value == 1 else f"{cell.scale.step.text}-step"
    items = f", each the mean of {cell.scale.items} items" if cell.scale.items > 1 else ""
    return f"{n} {step} scores{items}"


def _grim(cell: PrintedCell, steps: Steps, mean: Rounded, n: int) -> Finding:
    statement, interval = Statement("GRIM", cell.what, f"M = {mean.text}"), mean.interval
    totals = steps.totals(interval, n)
    if not totals:
        below, above = (mean.like(value) for value in steps.nearest_means(mean.value, n))
        return statement.judge(False, f"{below} or {above}", f"no {_scores(cell, n)} have this mean")
    if interval.high - interval.low >= steps.grain / n:
        return statement.unchecked(f"at n = {n} every mean with these digits is possible")
    return statement.judge(True, mean.like(steps.mean(totals[0], n)), f"{_scores(cell, n)} can have this mean")


def _grimmer(cell: PrintedCell, steps: Steps, mean: Rounded, sd: Rounded, n: int) -> Finding:
    statement = Statement("GRIMMER", cell.what, f"M = {mean.text}, SD = {sd.text}")
    divisor, other_divisor = (n, n - 1) if cell.population else (n - 1, n)
    sample = possible_sample(steps, mean.interval, sd.interval, n, divisor)
    if sample is not None:
        follows = f"M = {mean.like(sample[0])}, SD = {sd.like(sqrt(sample[1]))}"
        return statement.judge(True, follows, f"{_scores(cell, n)} can have both")
    explanation = f"no {_scores(cell, n)} have both"
    if possible_sample(steps, mean.interval, sd.interval, n, other_divisor) is not None:
        explanation += f"; they could if the SD were divided by {'n − 1' if cell.population else 'n'}"
    return statement.judge(False, "another mean or SD", explanation)


def _median(cell: PrintedCell, steps: Steps, median: Rounded, n: int) -> Finding:
    """A score where n is odd, the mean of two where it is even."""
    grain = steps.grain if n % 2 else steps.grain / 2
    low, high = ((end - steps.origin) / grain for end in (median.interval.low, median.interval.high))
    statement = Statement("median", cell.what, f"median = {median.text}")
    return statement.judge(ceil(low) <= floor(high), f"steps of {float(grain):g}", f"the median of {_scores(cell, n)}")


def _spread(cell: PrintedCell) -> Iterator[Finding]:
    """On a scale without steps: an SD no larger than the mean and the scale's ends allow."""
    mean, sd, low, high = cell.cell.mean, cell.cell.sd, cell.scale.min, cell.scale.max
    if mean is None or sd is None or low is None or (high is None and cell.n is None) or cell.n == 1:
        return
    n = cell.n or 2  # the fewer, the larger a sample's SD may be
    room = (mean.interval.high - low.value, n - 1)  # all but one at the lower end
    squares = max(room[0], Fraction(0)) ** 2 * n * room[1]
    if high is not None:  # all at the ends (Bhatia and Davis 2000)
        middle = min(max((low.value + high.value) / 2, mean.interval.low), mean.interval.high)
        at_ends = max((middle - low.value) * (high.value - middle) * n, Fraction(0))
        squares = at_ends if cell.n is None else min(squares, at_ends)
    largest = squares / (n if cell.population else n - 1)
    ends = f"from {low.text} to {high.text}" if high is not None else f"of {low.text} and more"
    yield Statement("range", cell.what, f"M = {mean.text}, SD = {sd.text}").judge(
        sd.interval.at_least(0).low ** 2 <= largest,
        f"SD of {sd.like(sqrt(largest))} or less",
        f"values {ends} with this mean cannot spread further",
    )


def _rmse(cell: PrintedCell, rmse: Rounded, mean: Rounded) -> Finding:
    """The root of the mean of the squares; compared as squares, which are exact."""
    squares = mean.interval.at_least(0)
    return Statement("RMSE", cell.what, f"RMSE = {rmse.text}").judge(
        rmse.interval.squared().meets(mean.interval),
        rmse.span(sqrt(squares.low), sqrt(squares.high)),
        f"the root of the mean, {mean.text}",
    )
