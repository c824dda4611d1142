"""The tests of study.yaml within participants: from complete cases to rows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

import numpy as np

from pipeline.analysis import complete_cases, model_rows
from pipeline.analysis.comparison_rows import Answer, change_of, diagnosed, pair_row, row_of
from pipeline.analysis.complete_cases import CompleteCases, Request
from pipeline.analysis.estimates import with_direction, with_estimates
from pipeline.analysis.ratios import on_logarithms, results_of_logarithms, with_ratio, with_ratio_of
from pipeline.statistics import FURTHER_TERMS, OK, estimation, pairs
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.art import art_anova, art_contrasts
from pipeline.statistics.crossover import crossover
from pipeline.statistics.friedman import friedman
from pipeline.statistics.logarithms import ratio_follow_ups, rm_anova_of_logarithms, t_paired_ratio
from pipeline.statistics.mixed import Factor, cells_of, mixed_model
from pipeline.statistics.paired import t_paired
from pipeline.statistics.result import IntArray, Result
from pipeline.statistics.shape import cell_shape
from pipeline.tables.table import Row

_ROWS_A_CELL = 1.5
"""Mean rows per participant and condition from which variance between these cells differs from that within them."""


def anova(request: Request) -> Answer:
    """One row per effect, and the pairs that follow up those of more than two levels."""
    cases = complete_cases.by_factors_of(request)
    test = rm_anova_of_logarithms if on_logarithms(request) else rm_anova
    rows = [row_of(request, result) for result in test(cases.values, request.entry.within)]
    if cases.values.shape[1:] == (2,):
        (pair,) = pairs.of_conditions(cases.values, cases.levels[0])
        rows = [_with_ratio_of_two(request, {**rows[0], **change_of(request, pair)}, pair, cases)]
        rows = [_with_difference_interval(request, diagnosed(request, rows[0], pair, cases), pair)]
    if request.entry.follow_up != "none":
        for follow_up in _follow_ups(request, cases):
            row = pair_row(request, follow_up.result, follow_up.pair, cases)
            rows.append({**row, "adjust": request.entry.follow_up})
    return rows, cases.left_out


def _with_ratio_of_two(request: Request, row: Row, pair: pairs.Pair, cases: CompleteCases) -> Row:
    """The row of an analysis of two conditions with the ratio of their geometric means, if it is of logarithms."""
    if not on_logarithms(request) or row["status"] != OK:
        return row
    paired = t_paired_ratio(pair.first, pair.second)
    return with_ratio_of(row, paired.details["log_ratio_ci"], cases.levels[0][0])


def _with_difference_interval(request: Request, row: Row, pair: pairs.Pair) -> Row:
    """The row of an analysis of two conditions with the interval of their mean difference, that of the paired t."""
    if on_logarithms(request) or row["status"] != OK:
        return row
    bounds = t_paired(pair.first, pair.second).details["ci_difference"]
    return {**row, "details": {**row["details"], "ci_difference": bounds}}


def _follow_ups(request: Request, cases: CompleteCases) -> list[pairs.FollowUp]:
    if on_logarithms(request):
        return ratio_follow_ups(cases.values, request.entry.within, cases.levels)
    return [
        pairs.FollowUp(pair, t_paired(pair.first, pair.second, pair.effect))
        for pair in pairs.follow_ups(cases.values, request.entry.within, cases.levels)
    ]


def paired_t(request: Request, first: FloatArray, second: FloatArray) -> Result:
    """The paired t test of values or of their logarithms."""
    return (t_paired_ratio if on_logarithms(request) else t_paired)(first, second)


def art(request: Request) -> Answer:
    """One row per effect, with the shape of the cells; the pairs by ART-C, where follow_up is stated."""
    cases = complete_cases.by_factors_of(request)
    shape = cell_shape(cases.values)
    rows = [row_of(request, result) for result in art_anova(cases.values, request.entry.within)]
    rows = [{**row, "details": {**row["details"], **shape}} for row in rows]
    if "follow_up" in request.entry.model_fields_set and request.entry.follow_up != "none":
        for contrast in art_contrasts(cases.values, request.entry.within, cases.levels):
            row = pair_row(request, contrast.result, contrast.pair, cases)
            rows.append({**row, "adjust": request.entry.follow_up})
    return rows, cases.left_out


def friedman_test(request: Request) -> Answer:
    """One row; of two conditions with their mean difference."""
    cases = complete_cases.by_condition(request)
    row = row_of(request, friedman(cases.values))
    of_conditions = pairs.of_conditions(cases.values, cases.levels[0])
    return [{**row, **change_of(request, of_conditions[0])} if len(of_conditions) == 1 else row], cases.left_out


def pairwise(test: Callable[[Request, FloatArray, FloatArray], Result]) -> Callable[[Request], Answer]:
    """A test of every pair of conditions: one row per pair."""

    def answer(request: Request) -> Answer:
        cases = complete_cases.by_condition(request)
        of_conditions = pairs.of_conditions(cases.values, cases.levels[0])
        rows = [pair_row(request, test(request, pair.first, pair.second), pair, cases) for pair in of_conditions]
        rows = [
            with_direction(request, with_estimates(request, row, pair, estimation), pair)
            for row, pair in zip(rows, of_conditions, strict=True)
        ]
        return rows, cases.left_out

    return answer


def mixed_models(request: Request) -> Answer:
    """One row per term, and the pairs of levels of those that have more than two."""
    model = model_rows.of_model(request)
    random = random_intercepts(model)

    def fitted(values: FloatArray) -> list[Result]:
        return mixed_model(values, model.participants, model.columns, model.terms, random)

    results = results_of_logarithms(fitted, model.values) if on_logarithms(request) else fitted(model.values)
    rows = [with_ratio(row_of(request, result)) for result in results]
    further = [name for name in request.entry.fixed if name != "condition"]
    if further:
        rows = [{**row, "details": {**row["details"], FURTHER_TERMS: further}} for row in rows]
    if model_rows.CARRY_OVER in model.columns:
        rows = [
            {**row, "method": f"{row['method']}; without first periods, which have no preceding condition"}
            for row in rows
        ]
    kept: list[Row] = []
    for _, of_term in groupby(rows, key=lambda row: row["effect"]):
        whole, *levels = of_term
        kept.append(whole)
        if request.entry.follow_up != "none":
            kept += [{**row, "adjust": request.entry.follow_up} for row in levels]
    return kept, model.left_out


def random_intercepts(model: model_rows.ModelRows) -> dict[str, IntArray]:
    """The random intercepts that a model needs beside those of participants.

    Where participants have several rows in a condition, each of their conditions has one: without it the rows count as
    if each had met the condition anew, and small differences look certain.
    """
    condition = model.columns.get("condition")
    if not isinstance(condition, Factor):
        return model.crossed
    cells = cells_of(model.participants, condition)
    repeated = len(cells) >= _ROWS_A_CELL * len(np.unique(cells))
    return {**({"participant:condition": cells} if repeated else {}), **model.crossed}


def crossover_design(request: Request) -> Answer:
    """The rows treatment, period and carry-over."""
    cases = model_rows.of_crossover(request)
    results = crossover(cases.values, cases.first_came_first, cases.conditions, cases.sequences)
    return [row_of(request, result) for result in results], cases.left_out
