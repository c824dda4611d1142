"""What the participants' means say of each group and condition, before any test of groups."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pipeline.analysis.complete_cases import Request, rows_and_factors
from pipeline.analysis.descriptives import described_values
from pipeline.analysis.groups import CONDITION, between_factor, group_names, group_of_each
from pipeline.analysis.person_means import person_means
from pipeline.study.statistical_tests import TESTS
from pipeline.tables.table import Row


def by_group(requests: Iterable[Request]) -> list[Row]:
    """n, mean, SD, median and interval of each measure that is tested between groups: a row per group and condition.

    Where conditions are the groups the table `descriptives` has the same, so there are no rows.
    """
    rows: list[Row] = []
    done: set[tuple[str, str]] = set()
    for request in requests:
        if TESTS[request.entry.test].design not in ("between", "mixed"):
            continue
        factor = between_factor(request)
        if factor == CONDITION or (request.measure, factor) in done:
            continue
        done.add((request.measure, factor))
        rows += _of_measure(request, factor)
    return rows


def group_members(requests: Iterable[Request]) -> list[Row]:
    """Who is in which group of each measure that is tested between groups, in the groups' order; as `by_group`."""
    rows: dict[tuple[str, str, str], Row] = {}
    for request in requests:
        if TESTS[request.entry.test].design not in ("between", "mixed") or between_factor(request) == CONDITION:
            continue
        factor = between_factor(request)
        measured, _ = rows_and_factors(request, request.measures)
        members = group_of_each(request, factor, measured)
        people = [str(person) for person in dict.fromkeys(measured["participant"]) if str(person) in members]
        for name in group_names(request, factor, members, people):
            for person in (one for one in people if members[one] == name):
                row = {"measure": request.measure, "factor": factor, "participant": person, "group": name}
                rows[request.measure, factor, person] = row
    return list(rows.values())


def _of_measure(request: Request, factor: str) -> list[Row]:
    measured, _ = rows_and_factors(request, request.measures)
    members = group_of_each(request, factor, measured)
    means = person_means(request.study, request.measures, request.measure)
    means = means[[str(person) in members for person in means.index]]
    group = np.array([members[str(person)] for person in means.index])
    described = described_values(request.measure, means, request.observations)
    rows: list[Row] = []
    for name in group_names(request, factor, members, (str(person) for person in means.index)):
        of_group = means[group == name]
        cell = {"measure": request.measure, "factor": factor, "group": name, "group_n": len(of_group)}
        for condition in request.study.conditions:
            values = of_group[condition].dropna().to_numpy(np.float64)
            if len(values):
                rows.append({**cell, "condition": condition, **described(values)})
    return rows
