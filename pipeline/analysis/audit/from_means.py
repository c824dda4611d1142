"""Printed t, and F of two conditions, against what the printed means and SDs allow."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, sqrt

from pipeline.analysis.audit.cells import PrintedCell, printed_cell
from pipeline.analysis.audit.degrees_of_freedom import degrees_of_freedom, exactly
from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.p_values import Bounds
from pipeline.analysis.audit.phrases import label, written
from pipeline.study.printed import BETWEEN, Measure, PrintedTest, Publication

_PAIRED = ("t_paired", "rm_anova")
_ROUND_OFF = 1e-9


def statistic_findings(publication: Publication, measure: Measure, test: PrintedTest) -> Iterator[Finding]:
    """The statistic of two conditions against their means and SDs, where all of these are printed."""
    names = test.conditions or tuple(measure.cells)
    if test.statistic is None or len(names) != 2 or test.test not in (*_PAIRED, *BETWEEN) or test.effect is not None:
        return
    symbol, statistic = test.statistic
    df = degrees_of_freedom(test, publication.n_of(measure, test))
    cells = [printed_cell(publication, measure, name) for name in names]
    if symbol not in ("t", "F") or any(cell.cell.mean is None or cell.cell.sd is None for cell in cells):
        return
    if symbol == "F" and (df is None or df[0] != exactly(1)):
        return
    statement = Statement("statistic from means", label(measure, test), written(symbol, statistic, test))
    ns = [cell.n for cell in cells if cell.n is not None]
    if len(ns) < 2 or min(ns) < 2 or df is None:
        yield statement.unchecked("n of each condition and the degrees of freedom are needed")
    elif test.test in _PAIRED and (ns[0] != ns[1] or not exactly(ns[0] - 1).meets(df[-1])):
        yield statement.unchecked("the test and the means are not of the same participants")
    else:
        paired = test.test in _PAIRED
        low, high = _paired_t(cells, ns[0]) if paired else _group_t(cells, ns, test.test == "welch")
        size, power = statistic.interval.size(), 2 if symbol == "F" else 1
        bounds = (low**power, high**power)
        fits = float(size.low) <= bounds[1] * (1 + _ROUND_OFF) and bounds[0] * (1 - _ROUND_OFF) <= float(size.high)
        follows = statistic.span(*bounds) if high < inf else f"{statistic.like(bounds[0])} or more"
        given = "whatever the correlation of the conditions" if paired else "given n"
        yield statement.judge(fits, follows, f"what the means and SDs allow, {given}")


def _difference(cells: list[PrintedCell]) -> Bounds:
    """|difference of the means|."""
    first, second = (cell.cell.mean.interval for cell in cells if cell.cell.mean is not None)
    size = (first - second).size()
    return float(size.low), float(size.high)


def _sds(cells: list[PrintedCell]) -> list[Bounds]:
    """Each condition's sample SD."""
    sds = []
    for cell in cells:
        if cell.cell.sd is not None and cell.n is not None:
            factor = sqrt(cell.n / (cell.n - 1)) if cell.population else 1.0
            sd = cell.cell.sd.interval.at_least(0)
            sds.append((float(sd.low) * factor, float(sd.high) * factor))
    return sds


def _ratio(above: float, below: float) -> float:
    if below > 0:
        return above / below
    return inf if above > 0 else 0.0


def _paired_t(cells: list[PrintedCell], n: int) -> Bounds:
    """|t|: the SD of the differences lies between |s₁ − s₂| and s₁ + s₂, as the conditions correlate."""
    (low, high), (first, second) = _difference(cells), _sds(cells)
    apart = max(0.0, first[0] - second[1], second[0] - first[1])
    largest = sqrt(n) * high / apart if apart > 0 else inf
    return sqrt(n) * _ratio(low, first[1] + second[1]), largest


def _group_t(cells: list[PrintedCell], ns: list[int], welch: bool) -> Bounds:
    """|t| by Student's pooled variance, or Welch's."""
    (low, high), sds = _difference(cells), _sds(cells)
    errors = []
    for end in (1, 0):
        variances = [sd[end] ** 2 for sd in sds]
        if welch:
            errors.append(sqrt(sum(variance / n for variance, n in zip(variances, ns, strict=True))))
        else:
            pooled = sum(variance * (n - 1) for variance, n in zip(variances, ns, strict=True)) / (sum(ns) - 2)
            errors.append(sqrt(pooled * sum(1 / n for n in ns)))
    return _ratio(low, errors[0]), _ratio(high, errors[1])
