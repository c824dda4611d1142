"""From the study's entries under `comparisons` to the rows of that table: which test, of which values, and families."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np
import pandas as pd

from pipeline.analysis import complete_cases, families, model_rows
from pipeline.analysis.complete_cases import CompleteCases, Request
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics import OK, diagnostics, pairs
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.art import art_anova
from pipeline.statistics.bayes import bayes_t
from pipeline.statistics.crossover import crossover
from pipeline.statistics.equivalence import tost
from pipeline.statistics.mixed import mixed_model
from pipeline.statistics.paired import t_paired
from pipeline.statistics.pairs import Pair
from pipeline.statistics.rank import friedman, wilcoxon
from pipeline.statistics.result import Result
from pipeline.study.comparison import Comparison
from pipeline.study.measures import has_total, measure, measure_order
from pipeline.study.settings import Study
from pipeline.tables.table import Row

Answer = tuple[list[Row], list[Row]]
"""Rows of `comparisons`, and the exclusions that came of incomplete participants."""


def compared(study: Study, measures: pd.DataFrame, observations: pd.DataFrame) -> Answer:
    """Every row of `comparisons`, and every exclusion that came of them, each once."""
    rows: list[Row] = []
    exclusions: list[Row] = []
    if study.comparisons and len(study.conditions) < 2:
        raise PipelineError("study.yaml: comparisons need at least two conditions; `conditions` lists only one")
    by_entry: list[tuple[Comparison, list[Row]]] = []
    for requests in all_requests(study, measures, observations):
        of_entry: list[Row] = []
        for request in requests:
            answer, incomplete = RUN[request.entry.test](request)
            of_entry += answer
            exclusions += incomplete
        by_entry.append((requests[0].entry, of_entry))
        rows += of_entry
    families.adjust(by_entry)
    for row in rows:
        row["details"] = json.dumps(row["details"]) if row["details"] else None
    unique = {tuple(sorted(row.items())): row for row in exclusions}
    return rows, list(unique.values())


def all_requests(study: Study, measures: pd.DataFrame, observations: pd.DataFrame) -> Iterator[list[Request]]:
    """What each entry asks, one request per measure."""
    known = sorted(set(measures["measure"]), key=measure_order)
    for entry in study.comparisons:
        named = list(dict.fromkeys(name for wanted in entry.measures for name in _matching(wanted, known)))
        yield [Request(study, entry, name, measures, observations) for name in named]


def _matching(wanted: str, known: Sequence[str]) -> list[str]:
    """The measures an entry names; `*` stands for scales, never for a total."""
    if "*" in wanted:
        pattern = ".*".join(re.escape(piece) for piece in wanted.split("*"))
        found = [name for name in known if re.fullmatch(pattern, name) and not name.endswith("/total")]
    else:
        found = [name for name in known if name == wanted]
    if not found and wanted.endswith("/total"):
        found = _only_score(wanted.removesuffix("total"), known)
    if not found:
        hint = did_you_mean(wanted, known)
        raise PipelineError(f'study.yaml: comparisons: there is no measure "{wanted}" in the data{hint}')
    return found


def _only_score(prefix: str, known: Sequence[str]) -> list[str]:
    """What is meant by the total of an instrument that has a single score; PipelineError for one without a rule."""
    mine = [name for name in known if name.startswith(prefix)]
    if len(mine) == 1:
        return mine
    if mine and not has_total(prefix.removesuffix("/")):
        questionnaire = prefix.removesuffix("/")
        raise PipelineError(
            f'study.yaml: comparisons: "{questionnaire}" has no total, for nothing says how it is scored; state'
            f" scoring: {{{questionnaire}: {{rule: sum, range: [lowest, highest answer]}}}}, or compare"
            f" {questionnaire}/*"
        )
    return []


def _anova(request: Request) -> Answer:
    """A row an effect, and the pairs that follow up those of more than two levels."""
    cases = complete_cases.by_factors_of(request)
    rows = [_row(request, result) for result in rm_anova(cases.values, request.entry.within)]
    if cases.values.shape[1:] == (2,):
        (pair,) = pairs.of_conditions(cases.values, cases.levels[0])
        rows = [_diagnosed({**rows[0], **_change(request, pair)}, pair, cases)]
    if request.entry.follow_up != "none":
        for pair in pairs.follow_ups(cases.values, request.entry.within, cases.levels):
            row = _pair_row(request, t_paired(pair.first, pair.second, pair.effect), pair, cases)
            rows.append({**row, "adjust": request.entry.follow_up})
    return rows, cases.left_out


def _art(request: Request) -> Answer:
    cases = complete_cases.by_factors_of(request)
    return [_row(request, result) for result in art_anova(cases.values, request.entry.within)], cases.left_out


def _friedman(request: Request) -> Answer:
    cases = complete_cases.by_condition(request)
    row = _row(request, friedman(cases.values))
    of_conditions = pairs.of_conditions(cases.values, cases.levels[0])
    return [{**row, **_change(request, of_conditions[0])} if len(of_conditions) == 1 else row], cases.left_out


def _pairwise(test: Callable[[Request, FloatArray, FloatArray], Result]) -> Callable[[Request], Answer]:
    """What gives a row a pair of conditions."""

    def answer(request: Request) -> Answer:
        cases = complete_cases.by_condition(request)
        of_conditions = pairs.of_conditions(cases.values, cases.levels[0])
        rows = [_pair_row(request, test(request, pair.first, pair.second), pair, cases) for pair in of_conditions]
        return rows, cases.left_out

    return answer


def _mixed(request: Request) -> Answer:
    """A row a term, and the pairs of levels of those that have more than two."""
    model = model_rows.of_model(request)
    rows = [
        _row(request, result) for result in mixed_model(model.values, model.participants, model.columns, model.terms)
    ]
    if model_rows.CARRY_OVER in model.columns:
        rows = [{**row, "method": f"{row['method']}; without first periods, before which nothing came"} for row in rows]
    kept: list[Row] = []
    for _, of_term in groupby(rows, key=lambda row: row["effect"]):
        whole, *levels = of_term
        kept.append(whole)
        if request.entry.follow_up != "none":
            kept += [{**row, "adjust": request.entry.follow_up} for row in levels]
    return kept, model.left_out


def _crossover(request: Request) -> Answer:
    """The rows treatment, period and carry-over."""
    cases = model_rows.of_crossover(request)
    results = crossover(cases.values, cases.first_came_first, cases.conditions, cases.sequences)
    return [_row(request, result) for result in results], cases.left_out


RUN: Mapping[str, Callable[[Request], Answer]] = {
    "rm_anova": _anova,
    "art_anova": _art,
    "friedman": _friedman,
    "t_paired": _pairwise(lambda _, first, second: t_paired(first, second)),
    "wilcoxon": _pairwise(lambda request, first, second: wilcoxon(first, second, zeros=request.entry.zeros)),
    "tost": _pairwise(lambda request, first, second: tost(first, second, request.entry.bounds or (0.0, 0.0))),
    "bayes_t": _pairwise(lambda request, first, second: bayes_t(first, second, request.entry.prior_scale)),
    "mixed_model": _mixed,
    "crossover": _crossover,
}
"""What computes each test of study.yaml."""


def _row(request: Request, result: Result) -> Row:
    """A result as a row."""
    return {
        "measure": request.measure,
        "test": request.entry.test,
        "effect": result.effect,
        "contrast": result.contrast,
        "n": result.n,
        "statistic_name": result.statistic_name,
        "statistic": result.statistic,
        "df1": result.df1,
        "df2": result.df2,
        "p": result.p,
        "adjust": request.entry.adjust,
        "method": result.method,
        "effect_size_name": result.effect_size_name,
        "effect_size": result.effect_size,
        "ci_low": result.ci_low,
        "ci_high": result.ci_high,
        "status": result.status,
        "details": dict(result.details),
    }


def _change(request: Request, pair: Pair) -> Row:
    """The mean difference of a pair, if anybody is in it, and the reduction.

    A share of the first mean says something only where zero means none: never on a scale known to be of another kind,
    and not where a mean is zero or negative, which contradicts such a zero.
    """
    if not len(pair.first):
        return {}
    first, second = float(np.mean(pair.first)), float(np.mean(pair.second))
    has_zero = measure(request.measure).scale in ("ratio", "unknown") and first > 0 and second > 0
    return {"mean_difference": first - second, "reduction": 1 - second / first if has_zero else None}


def _pair_row(request: Request, result: Result, pair: Pair, cases: CompleteCases) -> Row:
    """The row of a test of two conditions."""
    return _diagnosed({**_row(request, result), **_change(request, pair), "contrast": pair.contrast}, pair, cases)


def _diagnosed(row: Row, pair: Pair, cases: CompleteCases) -> Row:
    """The row with what is to be said of the differences that it rests on."""
    if row["status"] != OK:
        return row
    diagnosis = diagnostics.differences(pair.first, pair.second, cases.participants)
    return {**row, "details": {**row["details"], **diagnosis}}
