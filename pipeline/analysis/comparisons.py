"""From the study's entries under `comparisons` to the rows of that table: which test, of which values, and families."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np
import pandas as pd

from pipeline.analysis import complete_cases as cells
from pipeline.analysis import model_rows
from pipeline.analysis.complete_cases import Asked, Cells
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics import OK, diagnostics, pairs
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.art import art_anova
from pipeline.statistics.bayes import bayes_t
from pipeline.statistics.crossover import crossover
from pipeline.statistics.equivalence import tost
from pipeline.statistics.mixed import mixed_model
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.paired import t_paired
from pipeline.statistics.pairs import Pair
from pipeline.statistics.rank import friedman, wilcoxon
from pipeline.statistics.result import Result
from pipeline.study.measures import measure_order
from pipeline.study.settings import Study
from pipeline.tables.table import Row

Answer = tuple[list[Row], list[Row]]
"""Rows of `comparisons`, and the exclusions that came of incomplete participants."""


def compared(study: Study, measures: pd.DataFrame, observations: pd.DataFrame) -> Answer:
    """Every row of `comparisons`, and every exclusion that came of them, each once."""
    rows: list[Row] = []
    left_out: list[Row] = []
    if study.comparisons and len(study.conditions) < 2:
        raise PipelineError("study.yaml: comparisons: need two conditions or more, and conditions lists one")
    for asked in everything_asked(study, measures, observations):
        found: list[Row] = []
        for one in asked:
            answer, incomplete = RUN[one.entry.test](one)
            found += answer
            left_out += incomplete
        _adjust(found)
        rows += found
    for row in rows:
        row["details"] = json.dumps(row["details"]) if row["details"] else None
    unique = {tuple(sorted(row.items())): row for row in left_out}
    return rows, list(unique.values())


def everything_asked(study: Study, measures: pd.DataFrame, observations: pd.DataFrame) -> Iterator[list[Asked]]:
    """What each entry asks, a measure each."""
    known = sorted(set(measures["measure"]), key=measure_order)
    for entry in study.comparisons:
        named = _matching(entry.measure, known)
        yield [Asked(study, entry, measure, measures, observations) for measure in named]


def _matching(wanted: str, known: Sequence[str]) -> list[str]:
    """The measures an entry names; `*` stands for scales, never for a total."""
    if "*" in wanted:
        pattern = ".*".join(re.escape(piece) for piece in wanted.split("*"))
        found = [name for name in known if re.fullmatch(pattern, name) and not name.endswith("/total")]
    else:
        found = [name for name in known if name == wanted]
    if not found:
        hint = did_you_mean(wanted, known)
        raise PipelineError(f'study.yaml: comparisons: there is no measure "{wanted}" in the data{hint}')
    return found


def _anova(asked: Asked) -> Answer:
    """A row an effect, and the pairs that follow up those of more than two levels."""
    found = cells.by_factor(asked) if len(asked.entry.within) > 1 else cells.by_condition(asked)
    rows = [_row(asked, result) for result in rm_anova(found.values, asked.entry.within)]
    if found.values.shape[1:] == (2,):
        (pair,) = pairs.of_conditions(found.values, found.levels[0])
        rows = [_diagnosed({**rows[0], **_change(pair)}, pair, found)]
    if asked.entry.follow_up != "none":
        for pair in pairs.follow_ups(found.values, asked.entry.within, found.levels):
            row = _pair_row(asked, t_paired(pair.first, pair.second, pair.effect), pair, found)
            rows.append({**row, "adjust": asked.entry.follow_up})
    return rows, found.left_out


def _art(asked: Asked) -> Answer:
    found = cells.by_factor(asked) if len(asked.entry.within) > 1 else cells.by_condition(asked)
    return [_row(asked, result) for result in art_anova(found.values, asked.entry.within)], found.left_out


def _friedman(asked: Asked) -> Answer:
    found = cells.by_condition(asked)
    row = _row(asked, friedman(found.values))
    compared = pairs.of_conditions(found.values, found.levels[0])
    return [{**row, **_change(compared[0])} if len(compared) == 1 else row], found.left_out


def _pairwise(test: Callable[[Asked, FloatArray, FloatArray], Result]) -> Callable[[Asked], Answer]:
    """A row a pair of conditions."""

    def answer(asked: Asked) -> Answer:
        found = cells.by_condition(asked)
        compared = pairs.of_conditions(found.values, found.levels[0])
        rows = [_pair_row(asked, test(asked, pair.first, pair.second), pair, found) for pair in compared]
        return rows, found.left_out

    return answer


def _mixed(asked: Asked) -> Answer:
    """A row a term, and the pairs of levels of those that have more than two."""
    found = model_rows.of_model(asked)
    rows = [_row(asked, result) for result in mixed_model(found.values, found.participants, found.columns, found.terms)]
    if model_rows.CARRY_OVER in found.columns:
        rows = [{**row, "method": f"{row['method']}; without first periods, before which nothing came"} for row in rows]
    kept: list[Row] = []
    for _, of_term in groupby(rows, key=lambda row: row["effect"]):
        whole, *levels = of_term
        kept.append(whole)
        if asked.entry.follow_up != "none":
            kept += [{**row, "adjust": asked.entry.follow_up} for row in levels]
    return kept, found.left_out


def _crossover(asked: Asked) -> Answer:
    """The rows treatment, period and carry-over."""
    found = model_rows.of_crossover(asked)
    results = crossover(found.values, found.first_came_first, found.conditions, found.sequences)
    return [_row(asked, result) for result in results], found.left_out


RUN: Mapping[str, Callable[[Asked], Answer]] = {
    "rm_anova": _anova,
    "art_anova": _art,
    "friedman": _friedman,
    "t_paired": _pairwise(lambda _, first, second: t_paired(first, second)),
    "wilcoxon": _pairwise(lambda asked, first, second: wilcoxon(first, second, zeros=asked.entry.zeros)),
    "tost": _pairwise(lambda asked, first, second: tost(first, second, asked.entry.bounds or (0.0, 0.0))),
    "bayes_t": _pairwise(lambda asked, first, second: bayes_t(first, second, asked.entry.prior_scale)),
    "mixed_model": _mixed,
    "crossover": _crossover,
}
"""What computes each test of study.yaml."""


def _row(asked: Asked, result: Result) -> Row:
    """A result as a row."""
    return {
        "measure": asked.measure,
        "test": asked.entry.test,
        "effect": result.effect,
        "contrast": result.contrast,
        "n": result.n,
        "statistic_name": result.statistic_name,
        "statistic": result.statistic,
        "df1": result.df1,
        "df2": result.df2,
        "p": result.p,
        "adjust": asked.entry.adjust,
        "method": result.method,
        "effect_size_name": result.effect_size_name,
        "effect_size": result.effect_size,
        "ci_low": result.ci_low,
        "ci_high": result.ci_high,
        "status": result.status,
        "details": dict(result.details),
    }


def _change(pair: Pair) -> Row:
    """The mean difference and the reduction of a pair, if anybody is in it."""
    if not len(pair.first):
        return {}
    first, second = float(np.mean(pair.first)), float(np.mean(pair.second))
    return {"mean_difference": first - second, "reduction": 1 - second / first if first != 0 else None}


def _pair_row(asked: Asked, result: Result, pair: Pair, found: Cells) -> Row:
    """The row of a test of two conditions."""
    return _diagnosed({**_row(asked, result), **_change(pair), "contrast": pair.contrast}, pair, found)


def _diagnosed(row: Row, pair: Pair, found: Cells) -> Row:
    """The row with what is to be said of the differences that it rests on."""
    if row["status"] != OK:
        return row
    told = diagnostics.differences(pair.first, pair.second, found.participants)
    return {**row, "details": {**row["details"], **told}}


def _adjust(rows: list[Row]) -> None:
    """Adjust over the measures of an entry, effect by effect; of several pairs of a measure over those pairs."""
    contrasts = Counter((row["measure"], row["effect"]) for row in rows if row["contrast"] is not None)
    families: dict[tuple[str, str | None], list[Row]] = {}
    for row in rows:
        one_of_several = row["contrast"] is not None and contrasts[row["measure"], row["effect"]] > 1
        families.setdefault((row["effect"], row["measure"] if one_of_several else None), []).append(row)
    for family in families.values():
        for row, value in zip(family, adjusted([row["p"] for row in family], family[0]["adjust"]), strict=True):
            row["p_adjusted"] = value
