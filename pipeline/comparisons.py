"""From the study's entries under `comparisons` to the rows of that table: which test, of which values, and families."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import pandas as pd

from pipeline import cells
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.paired import t_paired
from pipeline.statistics.rank import friedman, wilcoxon
from pipeline.statistics.result import FloatArray, Result
from pipeline.study import Comparison, Study
from pipeline.wording import measure_order

Row = dict[str, Any]
PAIRWISE = ("t_paired", "wilcoxon")


@dataclass(frozen=True)
class Asked:
    """What one entry asks of one measure."""

    study: Study
    entry: Comparison
    measure: str
    measures: pd.DataFrame


Answer = tuple[list[Row], list[Row]]
"""Rows of `comparisons`, and the exclusions that came of incomplete participants."""


def compared(study: Study, measures: pd.DataFrame) -> Answer:
    """Every row of `comparisons`, and every exclusion that came of them, each once."""
    rows: list[Row] = []
    left_out: list[Row] = []
    if study.comparisons and len(study.conditions) < 2:
        raise PipelineError("study.yaml: comparisons: need two conditions or more, and conditions lists one")
    for entry in study.comparisons:
        family: list[list[Row]] = []
        for measure in _matching(entry, sorted(set(measures["measure"]), key=measure_order)):
            found, incomplete = _TESTS[entry.test](Asked(study, entry, measure, measures))
            family.append(found)
            left_out += incomplete
        if entry.test in PAIRWISE and len(study.conditions) > 2:
            for pairs in family:
                _adjust(entry, pairs)
        else:
            _adjust(entry, [row for measured in family for row in measured])
        rows += [row for measured in family for row in measured]
    unique = {tuple(sorted(row.items())): row for row in left_out}
    return rows, list(unique.values())


def _matching(entry: Comparison, known: Sequence[str]) -> list[str]:
    """The measures an entry names; `*` stands for scales, never for a total."""
    if "*" in entry.measure:
        pattern = ".*".join(re.escape(piece) for piece in entry.measure.split("*"))
        found = [name for name in known if re.fullmatch(pattern, name) and not name.endswith("/total")]
    else:
        found = [name for name in known if name == entry.measure]
    if not found:
        raise PipelineError(
            f'study.yaml: comparisons: there is no measure "{entry.measure}" in the'
            f" data{did_you_mean(entry.measure, known)}"
        )
    return found


def _anova(asked: Asked) -> Answer:
    """A row an effect."""
    if len(asked.entry.within) == 1:
        return _whole(asked, lambda values: rm_anova(values, ["condition"])[0])
    values, left_out = cells.by_factor(asked.study, asked.entry, asked.measure, asked.measures)
    return [_row(asked, result) for result in rm_anova(values, asked.entry.within)], left_out


def _friedman(asked: Asked) -> Answer:
    return _whole(asked, friedman)


def _whole(asked: Asked, test: Callable[[FloatArray], Result]) -> Answer:
    """One row over all conditions."""
    values, left_out = cells.by_condition(asked.study, asked.entry, asked.measure, asked.measures)
    return [_row(asked, test(values), values if values.shape[1] == 2 else None)], left_out


def _wilcoxon(asked: Asked) -> Answer:
    return _pairs(asked, lambda first, second: wilcoxon(first, second, zeros=asked.entry.zeros))


def _t_paired(asked: Asked) -> Answer:
    return _pairs(asked, t_paired)


def _pairs(asked: Asked, test: Callable[[FloatArray, FloatArray], Result]) -> Answer:
    """A row a pair of conditions."""
    values, left_out = cells.by_condition(asked.study, asked.entry, asked.measure, asked.measures)
    rows = [
        _row(asked, test(values[:, i], values[:, j]), values[:, [i, j]], (first, second))
        for (i, first), (j, second) in combinations(enumerate(asked.study.conditions), 2)
    ]
    return rows, left_out


_TESTS: Mapping[str, Callable[[Asked], Answer]] = {
    "rm_anova": _anova,
    "t_paired": _t_paired,
    "wilcoxon": _wilcoxon,
    "friedman": _friedman,
}
"""Every test by its name in study.yaml."""


def _row(
    asked: Asked,
    result: Result,
    values: FloatArray | None = None,
    pair: tuple[str, str] | None = None,
) -> Row:
    """A result as a row; `values` of two conditions give the mean difference and the reduction."""
    row: Row = {
        "measure": asked.measure,
        "test": asked.entry.test,
        "effect": result.effect,
        "contrast": None if pair is None else f"{pair[0]} - {pair[1]}",
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
        "details": json.dumps(result.details) if result.details else None,
    }
    if values is not None and len(values):
        first, second = (float(mean) for mean in values.mean(axis=0))
        row["mean_difference"] = first - second
        row["reduction"] = 1 - second / first if first != 0 else None
    return row


def _adjust(entry: Comparison, rows: list[Row]) -> None:
    for row, value in zip(rows, adjusted([row["p"] for row in rows], entry.adjust), strict=True):
        row["p_adjusted"] = value
