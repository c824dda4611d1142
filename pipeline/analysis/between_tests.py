"""The tests of study.yaml between groups of participants, and of mixed designs: from groups to rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pipeline.analysis import groups
from pipeline.analysis.comparison_rows import Answer, group_pair_row, row_of
from pipeline.analysis.complete_cases import Request
from pipeline.analysis.estimates import with_estimates
from pipeline.analysis.ratios import follow_ups_of_logarithms, on_logarithms, results_of_logarithms
from pipeline.statistics import estimation_groups, mixed_anova, pairs
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.logarithms import t_welch_ratio
from pipeline.statistics.result import Result
from pipeline.statistics.welch import t_welch


def welch_t(request: Request, first: FloatArray, second: FloatArray, effect: str) -> Result:
    """Welch's t of values or of their logarithms."""
    return (t_welch_ratio if on_logarithms(request) else t_welch)(first, second, effect)


def pairs_of_groups(test: Callable[[Request, FloatArray, FloatArray, str], Result]) -> Callable[[Request], Answer]:
    """A test of every pair of groups: one row per pair."""

    def answer(request: Request) -> Answer:
        cases = groups.by_group(request)
        compared_pairs = pairs.of_groups(cases.groups, cases.names, cases.factor)
        rows = [
            group_pair_row(request, test(request, pair.first, pair.second, cases.factor), pair)
            for pair in compared_pairs
        ]
        rows = [
            with_estimates(request, row, pair, estimation_groups)
            for row, pair in zip(rows, compared_pairs, strict=True)
        ]
        if not rows:
            rows = [row_of(request, test(request, np.array([]), np.array([]), cases.factor))]
        return rows, cases.left_out

    return answer


PairsTest = Callable[[Sequence[FloatArray], Sequence[str], str], list[Result]]
"""A test of every two groups, by their names."""


def all_groups(
    test: Callable[[Sequence[FloatArray], str], Result],
    follow_up: PairsTest,
    adjusts_itself: bool,
    others: Mapping[str, PairsTest] | None = None,
) -> Callable[[Request], Answer]:
    """A test of all groups: one row, followed by the pairs where there are three groups or more.

    `others` are the tests of pairs that an entry may name under `follow_up` instead; they adjust themselves.
    """
    named = others or {}

    def answer(request: Request) -> Answer:
        cases = groups.by_group(request)
        rows = [row_of(request, test(cases.groups, cases.factor))]
        if len(cases.names) > 2 and request.entry.follow_up != "none":
            compared_pairs = pairs.of_groups(cases.groups, cases.names, cases.factor)
            own = request.entry.follow_up in named
            results = named.get(request.entry.follow_up, follow_up)(cases.groups, cases.names, cases.factor)
            adjust = "none" if adjusts_itself or own else request.entry.follow_up
            for pair, result in zip(compared_pairs, results, strict=True):
                rows.append({**group_pair_row(request, result, pair), "adjust": adjust})
        return rows, cases.left_out

    return answer


def mixed_design(request: Request) -> Answer:
    """Rows of the groups, the factors within and their interactions, and the pairs that follow them up."""
    cases = groups.mixed(request)
    within = request.entry.within

    def analysed(values: FloatArray) -> list[Result]:
        return mixed_anova.mixed_anova(values, cases.codes, cases.factor, within)

    def followed_up(values: FloatArray) -> list[pairs.FollowUp]:
        return mixed_anova.follow_ups(values, cases.codes, (cases.factor, cases.names), within, cases.levels)

    log = on_logarithms(request)
    results = results_of_logarithms(analysed, cases.values) if log else analysed(cases.values)
    rows = [row_of(request, result) for result in results]
    if request.entry.follow_up != "none" and len(cases.values):
        for follow_up in follow_ups_of_logarithms(followed_up, cases.values) if log else followed_up(cases.values):
            row = group_pair_row(request, follow_up.result, follow_up.pair)
            rows.append({**row, "adjust": request.entry.follow_up})
    return rows, cases.left_out
