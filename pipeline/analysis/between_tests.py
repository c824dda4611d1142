"""The tests of study.yaml between groups of participants, and of mixed designs: from groups to rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.analysis import groups
from pipeline.analysis.comparison_rows import Answer, group_pair_row, row_of
from pipeline.analysis.complete_cases import Request
from pipeline.statistics import mixed_anova, pairs
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import Result


def pairs_of_groups(test: Callable[[FloatArray, FloatArray, str], Result]) -> Callable[[Request], Answer]:
    """A test of every pair of groups: one row per pair."""

    def answer(request: Request) -> Answer:
        cases = groups.by_group(request)
        rows = [
            group_pair_row(request, test(pair.first, pair.second, cases.factor), pair)
            for pair in pairs.of_groups(cases.groups, cases.names, cases.factor)
        ]
        if not rows:
            rows = [row_of(request, test(np.array([]), np.array([]), cases.factor))]
        return rows, cases.left_out

    return answer


def all_groups(
    test: Callable[[Sequence[FloatArray], str], Result],
    follow_up: Callable[[Sequence[FloatArray], Sequence[str], str], list[Result]],
    adjusts_itself: bool,
) -> Callable[[Request], Answer]:
    """A test of all groups: one row, followed by the pairs where there are three groups or more."""

    def answer(request: Request) -> Answer:
        cases = groups.by_group(request)
        rows = [row_of(request, test(cases.groups, cases.factor))]
        if len(cases.names) > 2 and request.entry.follow_up != "none":
            compared_pairs = pairs.of_groups(cases.groups, cases.names, cases.factor)
            results = follow_up(cases.groups, cases.names, cases.factor)
            adjust = "none" if adjusts_itself else request.entry.follow_up
            for pair, result in zip(compared_pairs, results, strict=True):
                rows.append({**group_pair_row(request, result, pair), "adjust": adjust})
        return rows, cases.left_out

    return answer


def mixed_design(request: Request) -> Answer:
    """Rows of the groups, the factors within and their interactions, and the pairs that follow them up."""
    cases = groups.mixed(request)
    within = request.entry.within
    rows = [
        row_of(request, result) for result in mixed_anova.mixed_anova(cases.values, cases.codes, cases.factor, within)
    ]
    if request.entry.follow_up != "none" and len(cases.values):
        between = (cases.factor, cases.names)
        for follow_up in mixed_anova.follow_ups(cases.values, cases.codes, between, within, cases.levels):
            row = group_pair_row(request, follow_up.result, follow_up.pair)
            rows.append({**row, "adjust": request.entry.follow_up})
    return rows, cases.left_out
