"""Every check that a file of printed figures allows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from pipeline.analysis.audit.arithmetic import (
    count_finding,
    peak_finding,
    reduction_findings,
    share_finding,
    total_finding,
)
from pipeline.analysis.audit.cells import cell_findings
from pipeline.analysis.audit.claims import claim_findings, family_findings
from pipeline.analysis.audit.degrees_of_freedom import degrees_of_freedom_findings
from pipeline.analysis.audit.effect_sizes import effect_size_findings
from pipeline.analysis.audit.finding import CONTRADICTION, Finding, Statement
from pipeline.analysis.audit.from_means import statistic_findings
from pipeline.analysis.audit.group_ranks import group_rank_findings
from pipeline.analysis.audit.mcnemar import mcnemar_finding
from pipeline.analysis.audit.phrases import label, written_p
from pipeline.analysis.audit.recomputed import p_finding
from pipeline.analysis.audit.wilcoxon import wilcoxon_finding
from pipeline.study.printed import Measure, PrintedTest, Publication


def audit(publication: Publication) -> list[Finding]:
    """Findings in the file's order: measures, then totals, percentages, counts, lags, claims and families.

    The explanation of a contradiction says so where it would be none if figures were cut off instead of rounded.
    """
    all_findings = list(_findings(publication))
    if publication.rounding == "cut_off" or not any(finding.verdict == CONTRADICTION for finding in all_findings):
        return all_findings
    rounded_or_cut_off = _findings(publication.as_read("either"))
    still = {(f.check, f.what, f.printed) for f in rounded_or_cut_off if f.verdict == CONTRADICTION}
    return [
        replace(f, explanation=f"{f.explanation}; no contradiction if figures are cut off, not rounded")
        if f.verdict == CONTRADICTION and (f.check, f.what, f.printed) not in still
        else f
        for f in all_findings
    ]


def _findings(publication: Publication) -> Iterator[Finding]:
    for measure in publication.measures:
        of_measure = [*_of_measure(publication, measure)]
        claimed = any(test.significant is not None for test in measure.tests)
        yield from of_measure
        if not of_measure and not claimed and not _is_in_a_total(publication, measure):
            yield Statement("any", measure.name, "").unchecked("no two of its figures depend on each other")
    yield from (total_finding(publication, total) for total in publication.totals)
    yield from map(share_finding, publication.shares)
    yield from map(count_finding, publication.counts)
    yield from map(peak_finding, publication.peaks)
    yield from claim_findings(publication)
    for family in publication.families:
        yield from family_findings(publication, family)


def _of_measure(publication: Publication, measure: Measure) -> Iterator[Finding]:
    yield from cell_findings(publication, measure)
    yield from reduction_findings(measure)
    for test in measure.tests:
        yield from _of_test(publication, measure, test)


def _is_in_a_total(publication: Publication, measure: Measure) -> bool:
    return any(measure in publication.named(total.measures) for total in publication.totals)


def _of_test(publication: Publication, measure: Measure, test: PrintedTest) -> Iterator[Finding]:
    yield from _out_of_range(measure, test)
    checked = p_finding(publication, measure, test)
    if checked is not None:
        yield checked
    yield from degrees_of_freedom_findings(publication, measure, test)
    yield from statistic_findings(publication, measure, test)
    yield from effect_size_findings(publication, measure, test)
    yield from group_rank_findings(measure, test)
    for finding in (wilcoxon_finding(publication, measure, test), mcnemar_finding(publication, measure, test)):
        if finding is not None:
            yield finding
    if test.p is not None and test.p_adjusted is not None:
        statement = Statement(
            "adjusted p", label(measure, test), f"{written_p(test.p)}, adjusted {test.p_adjusted.text}"
        )
        fits = test.p_adjusted.interval.high >= test.p.interval.low
        yield statement.judge(fits, f"{test.p.text} or more", "an adjustment never makes p smaller")


def _out_of_range(measure: Measure, test: PrintedTest) -> Iterator[Finding]:
    """Figures that no data can give, whatever the others are."""
    bounded = [
        ("p", test.p, 0, 1),
        ("adjusted p", test.p_adjusted, 0, 1),
        ("r", test.r, -1, 1),
        ("η²p", test.partial_eta_squared, 0, 1),
        ("effect r", test.effect_r, -1, 1),
    ]
    unbounded = [("F", test.F), ("χ²", test.chi2), ("H", test.H), ("W", test.W), ("U", test.U)]
    for name, figure, low, high in [*bounded, *((name, figure, 0, None) for name, figure in unbounded)]:
        if figure is None:
            continue
        statement = Statement("range", label(measure, test), f"{name} = {figure.text}")
        if figure.interval.high < low:
            yield statement.judge(False, f"{low} or more", f"{name} cannot be less than {low}")
        elif high is not None and figure.relation == "=" and figure.interval.low > high:
            yield statement.judge(False, f"{high} or less", f"{name} cannot be more than {high}")
    for part in test.df:
        if part.value <= 0:
            yield Statement("range", label(measure, test), f"df = {part.text}").judge(
                False, "more than 0", "degrees of freedom are counts"
            )
