"""The tests of study.yaml within participants: from complete cases to rows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

import numpy as np

from pipeline.analysis import complete_cases, model_rows
from pipeline.analysis.comparison_rows import Answer, change_of, diagnosed, pair_row, row_of
from pipeline.analysis.complete_cases import Request
from pipeline.statistics import OK, estimation, pairs
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.art import art_anova, art_contrasts
from pipeline.statistics.crossover import crossover
from pipeline.statistics.mixed import Factor, cells_of, mixed_model
from pipeline.statistics.paired import t_paired
from pipeline.statistics.rank import friedman
from pipeline.statistics.result import IntArray, Result
from pipeline.statistics.shape import cell_shape
from pipeline.tables.table import Row

_ROWS_A_CELL = 1.5
"""Mean rows per participant and condition from which variance between these cells differs from that within them."""


def anova(request: Request) -> Answer:
    """One row per effect, and the pairs that follow up those of more than two levels."""
    cases = complete_cases.by_factors_of(request)
    rows = [row_of(request, result) for result in rm_anova(cases.values, request.entry.within)]
    if cases.values.shape[1:] == (2,):
        (pair,) = pairs.of_conditions(cases.values, cases.levels[0])
        rows = [diagnosed({**rows[0], **change_of(request, pair)}, pair, cases)]
    if request.entry.follow_up != "none":
        for pair in pairs.follow_ups(cases.values, request.entry.within, cases.levels):
            row = pair_row(request, t_paired(pair.first, pair.second, pair.effect), pair, cases)
            rows.append({**row, "adjust": request.entry.follow_up})
    return rows, cases.left_out


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
        if request.entry.bootstrap or request.entry.permutation:
            rows = [_with_estimates(request, row, pair) for row, pair in zip(rows, of_conditions, strict=True)]
        return rows, cases.left_out

    return answer


def _with_estimates(request: Request, row: Row, pair: pairs.Pair) -> Row:
    """The row with a bootstrap interval and a permutation p of its mean difference, as far as the entry asks for them.

    Both are of the differences alone, whatever the test: also where the ranks are tested, they are of the mean.
    """
    if row["status"] != OK:
        return row
    details = dict(row["details"])
    if request.entry.bootstrap:
        details |= estimation.bootstrap(pair.first, pair.second, request.entry.seed)
    if request.entry.permutation:
        details |= estimation.permutation(pair.first, pair.second, request.entry.seed)
    return {**row, "details": details}


def mixed_models(request: Request) -> Answer:
    """One row per term, and the pairs of levels of those that have more than two."""
    model = model_rows.of_model(request)
    results = mixed_model(model.values, model.participants, model.columns, model.terms, _random_intercepts(model))
    rows = [row_of(request, result) for result in results]
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


def _random_intercepts(model: model_rows.ModelRows) -> dict[str, IntArray]:
    """The random intercepts that a model needs beside those of participants.

    Where participants have several rows in a condition, each of their conditions has one: without it the rows count as
    if each had met the condition anew, and small differences look certain.
    """
    condition = model.columns.get("condition")
    if not isinstance(condition, Factor):
        return {}
    cells = cells_of(model.participants, condition)
    repeated = len(cells) >= _ROWS_A_CELL * len(np.unique(cells))
    return {"participant:condition": cells} if repeated else {}


def crossover_design(request: Request) -> Answer:
    """The rows treatment, period and carry-over."""
    cases = model_rows.of_crossover(request)
    results = crossover(cases.values, cases.first_came_first, cases.conditions, cases.sequences)
    return [row_of(request, result) for result in results], cases.left_out
