"""Printed effect sizes against the statistics they follow from: partial η², Cohen's d and d_z, r = z/√N."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from math import inf, sqrt

from pipeline.analysis.audit.cells import printed_cell
from pipeline.analysis.audit.degrees_of_freedom import degrees_of_freedom, exactly, rounded_after_correction
from pipeline.analysis.audit.finding import Finding, Statement
from pipeline.analysis.audit.p_values import Bounds
from pipeline.analysis.audit.phrases import label, written_effect
from pipeline.statistics.effect_size import hedges_correction
from pipeline.study.printed import Measure, PrintedTest, Publication
from pipeline.study.rounded import Interval, Rounded

Reading = tuple[str, Bounds]
"""How a printed figure may be meant ("" for the usual meaning), and the bounds of its size if so."""

_ROUND_OFF = 1e-9
_PAIRED = ("t_paired", "rm_anova")


def effect_size_findings(publication: Publication, measure: Measure, test: PrintedTest) -> Iterator[Finding]:
    """Every effect size that is printed with a test."""
    n = publication.n_of(measure, test)
    if test.partial_eta_squared is not None:
        yield _by_readings(measure, test, "η²p", test.partial_eta_squared, list(_partial(test, n)), _NEEDS_F)
    if test.d_z is not None:
        yield _by_readings(measure, test, "d_z", test.d_z, list(_of_pairs(test, n)), _NEEDS_T)
    if test.d is not None:
        yield _cohen(publication, measure, test, test.d, n)
    if test.effect_r is not None:
        yield _from_z(publication, measure, test, test.effect_r, n)


_NEEDS_F = "F (or t) and its degrees of freedom are needed"
_NEEDS_T = "needs test: t_paired, or rm_anova with two conditions, its statistic and n"


def _by_readings(
    measure: Measure, test: PrintedTest, name: str, printed: Rounded, readings: Sequence[Reading], needed: str
) -> Finding:
    """Agreement by the usual reading; a remark where only another reading fits; else a contradiction."""
    statement = Statement("effect size", label(measure, test), written_effect(test, printed, name))
    if not readings:
        return statement.unchecked(needed)
    size = printed.interval.size()
    for reading, bounds in readings:
        if _meets(size, bounds):
            if not reading:
                return statement.judge(True, _span(printed, bounds), f"{name} follows from the statistic")
            plain = _span(printed, readings[0][1])
            return statement.remark(_span(printed, bounds), f"only if {reading}; else {name} is {plain}")
    return statement.judge(False, _span(printed, readings[0][1]), f"{name} does not follow from the statistic")


def _meets(size: Interval, bounds: Bounds) -> bool:
    return float(size.low) <= bounds[1] * (1 + _ROUND_OFF) and bounds[0] * (1 - _ROUND_OFF) <= float(size.high)


def _span(printed: Rounded, bounds: Bounds) -> str:
    return printed.span(*bounds) if bounds[1] < inf else f"{printed.like(bounds[0])} or more"


def _partial(test: PrintedTest, n: int | None) -> Iterator[Reading]:
    """η²p = F·df₁/(F·df₁ + df₂), whatever the correction for sphericity: it takes both by one factor."""
    df = degrees_of_freedom(test, n)
    if test.statistic is None or test.statistic[0] not in ("t", "F") or not df:
        return
    symbol, statistic = test.statistic[0], test.statistic[1].interval
    f = statistic.squared() if symbol == "t" else statistic.at_least(0)
    for reading, parts in (("", df), ("its degrees of freedom are rounded after a correction", None)):
        used = rounded_after_correction(test, n) if parts is None else parts
        if used is None:
            continue
        first, second = (exactly(1), used[0]) if symbol == "t" else (used[0], used[1])
        if first.low > 0 and second.low > 0:
            yield reading, (_share(f.low * first.low / second.high), _share(f.high * first.high / second.low))


def _share(ratio: Fraction) -> float:
    return float(ratio / (1 + ratio))


def _t_of_pairs(test: PrintedTest, n: int | None) -> tuple[Bounds, int] | None:
    """Bounds of |t| of two paired conditions, and the number of pairs; None for other tests and where n is unknown."""
    df = degrees_of_freedom(test, n)
    if test.statistic is None or test.test not in _PAIRED or not df or df[-1].low != df[-1].high or df[-1].low < 1:
        return None
    symbol, statistic = test.statistic[0], test.statistic[1].interval
    if symbol == "t":
        size = statistic.size()
        return (float(size.low), float(size.high)), int(df[-1].low) + 1
    if symbol != "F" or df[0] != exactly(1) or test.effect not in (None, "condition"):
        return None
    f = statistic.at_least(0)
    return (sqrt(f.low), sqrt(f.high)), int(df[-1].low) + 1


def _of_pairs(test: PrintedTest, n: int | None) -> Iterator[Reading]:
    """d_z = t/√n."""
    t_and_pairs = _t_of_pairs(test, n)
    if t_and_pairs is None:
        return
    (low, high), pairs = t_and_pairs
    dz = (low / sqrt(pairs), high / sqrt(pairs))
    yield "", dz
    if (correction := hedges_correction(pairs - 1)) is not None:
        yield "it is Hedges' g", (correction * dz[0], correction * dz[1])


def _cohen(publication: Publication, measure: Measure, test: PrintedTest, printed: Rounded, n: int | None) -> Finding:
    """d of groups follows from t and their n. d of pairs may be divided by several SDs, so it can only agree."""
    if test.test in ("t_independent", "welch"):
        return _of_groups(publication, measure, test, printed)
    statement = Statement("effect size", label(measure, test), written_effect(test, printed, "d"))
    for _, bounds in (*_of_pairs(test, n), *_over_sds(publication, measure, test)):
        if _meets(printed.interval.size(), bounds):
            return statement.judge(True, _span(printed, bounds), "d_z, or the difference divided by a printed SD")
    return statement.unchecked(
        "d of paired conditions may be divided by one of several SDs; if it is t/√n, call it d_z"
    )


def _of_groups(publication: Publication, measure: Measure, test: PrintedTest, printed: Rounded) -> Finding:
    """d = t·√(1/n₁ + 1/n₂) over the pooled SD; so of Welch's t where the groups are of one size."""
    names = test.conditions or tuple(measure.cells)
    ns = [n for n in (measure.cells[name].n for name in names) if n is not None]
    readings: list[Reading] = []
    if test.t is not None and len(names) == len(ns) == 2 and (test.test == "t_independent" or ns[0] == ns[1]):
        size = test.t.interval.size()
        by_n = sqrt(1 / ns[0] + 1 / ns[1])
        d = (float(size.low) * by_n, float(size.high) * by_n)
        readings.append(("", d))
        if (correction := hedges_correction(sum(ns) - 2)) is not None:
            readings.append(("it is Hedges' g", (correction * d[0], correction * d[1])))
            by_df = 2 / sqrt(sum(ns) - 2)
            readings.append(("it is 2t/√df", (float(size.low) * by_df, float(size.high) * by_df)))
        readings += _over_sds(publication, measure, test)
    return _by_readings(
        measure, test, "d", printed, readings, "t and n of both groups are needed (for Welch's t, equal n)"
    )


def _over_sds(publication: Publication, measure: Measure, test: PrintedTest) -> list[Reading]:
    """The difference of two printed means over one of their SDs, the mean SD, and the root of the mean variance."""
    names = test.conditions or tuple(measure.cells)
    cells = [printed_cell(publication, measure, name).cell for name in names]
    means = [cell.mean.interval for cell in cells if cell.mean is not None]
    sds = [cell.sd.interval.at_least(0) for cell in cells if cell.sd is not None]
    if len(cells) != 2 or len(means) != 2 or len(sds) != 2:
        return []
    difference = (means[0] - means[1]).size()
    lows, highs = [float(sd.low) for sd in sds], [float(sd.high) for sd in sds]
    ways = {
        "it is divided by the first SD": (lows[0], highs[0]),
        "it is divided by the second SD": (lows[1], highs[1]),
        "it is divided by the mean of the SDs": (sum(lows) / 2, sum(highs) / 2),
        "it is divided by the root of the mean variance": (_root_mean(lows), _root_mean(highs)),
    }
    return [
        (way, (float(difference.low) / high if high else inf, float(difference.high) / low if low else inf))
        for way, (low, high) in ways.items()
    ]


def _root_mean(sds: Sequence[float]) -> float:
    return sqrt(sum(sd**2 for sd in sds) / len(sds))


def _from_z(publication: Publication, measure: Measure, test: PrintedTest, printed: Rounded, n: int | None) -> Finding:
    """r = z/√N, N being participants; of pairs some take the observations, or only pairs that differ."""
    needed = "z of test: wilcoxon or mann_whitney, and n (of both groups), are needed"
    readings: list[Reading] = []
    if test.z is not None and test.test in ("wilcoxon", "mann_whitney"):
        size = test.z.interval.size()
        number = n if test.test == "wilcoxon" else _together(publication, measure, test)
        if number is not None:
            readings.append(("", _over_root(size, number, number)))
            if test.test == "wilcoxon":
                readings.append(
                    ("N counts observations, two per participant", _over_root(size, 2 * number, 2 * number))
                )
                readings.append(("N counts only pairs that differ", _over_root(size, 1, number)))
    return _by_readings(measure, test, "r", printed, readings, needed)


def _over_root(size: Interval, fewest: int, most: int) -> Bounds:
    return float(size.low) / sqrt(most), float(size.high) / sqrt(fewest)


def _together(publication: Publication, measure: Measure, test: PrintedTest) -> int | None:
    """Participants of the groups compared."""
    if test.n is not None:
        return test.n
    names = test.conditions or tuple(measure.cells)
    ns = [measure.cells[name].n for name in names]
    known = [n for n in ns if n is not None]
    return sum(known) if len(known) == len(ns) == 2 else None
