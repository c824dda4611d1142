"""From rows of measures to the arrays that tests take: who has a value in every cell, and who is left out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics.arrays import FloatArray
from pipeline.study.comparison import Comparison
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.tables.table import Row


@dataclass(frozen=True)
class Request:
    """What one entry asks of one measure. `observations` are the same values with their period and sequence."""

    study: Study
    entry: Comparison
    measure: str
    measures: pd.DataFrame
    observations: pd.DataFrame


@dataclass(frozen=True)
class CompleteCases:
    """Values of n complete participants (n, k₁, k₂, …), the levels of each factor, and the exclusions."""

    values: FloatArray
    participants: list[str]
    levels: list[list[str]]
    left_out: list[Row]


def by_condition(request: Request) -> CompleteCases:
    """Each participant's mean over everything else (n, k)."""
    wide = tables.participant_means(request.measures, request.measure, request.study.conditions)
    complete = wide.dropna()
    return CompleteCases(
        complete.to_numpy(np.float64),
        list(complete.index),
        [list(request.study.conditions)],
        _incomplete(request, wide),
    )


def by_factors_of(request: Request) -> CompleteCases:
    """By the entry's factors: the conditions alone, or with further ones."""
    return by_factor(request) if len(request.entry.within) > 1 else by_condition(request)


def by_factor(request: Request) -> CompleteCases:
    """Each participant's mean by the factors of `within`, in their order (n, k₁, k₂, …)."""
    rows = with_factors(request, request.measures, request.entry.within)
    levels = [levels_of(request.study, factor, rows[factor]) for factor in request.entry.within]
    for factor, found in zip(request.entry.within, levels, strict=True):
        if len(found) < 2:
            raise PipelineError(
                f'study.yaml: comparisons: factor "{factor}" of "{request.measure}" has one level: {found[0]}'
            )
    wide = rows.pivot_table(index="participant", columns=list(request.entry.within), values="value", aggfunc="mean")
    wide = wide.reindex(columns=pd.MultiIndex.from_product(levels, names=list(request.entry.within)))
    complete = wide.dropna()
    values = complete.to_numpy(np.float64).reshape(len(complete), *(len(level) for level in levels))
    return CompleteCases(values, list(complete.index), levels, _incomplete(request, wide))


def with_factors(request: Request, table: pd.DataFrame, factors: Sequence[str]) -> pd.DataFrame:
    """The measure's rows with a column for each factor; PipelineError for one that some row lacks."""
    rows = table[table["measure"] == request.measure].copy()
    told = [json.loads(text) if isinstance(text, str) else {} for text in rows["factors"]]
    for factor in factors:
        if factor != "condition":
            rows[factor] = [facts.get(factor) for facts in told]
            if rows[factor].isna().any():
                known = sorted({key for facts in told for key in facts} | {"condition"})
                hint = did_you_mean(factor, known)
                raise PipelineError(f'study.yaml: comparisons: "{request.measure}" has no factor "{factor}"{hint}')
    return rows


def levels_of(study: Study, factor: str, values: pd.Series) -> list[str]:
    """A factor's levels: conditions in the study's order, numbers by size, others by the alphabet."""
    if factor == "condition":
        return list(study.conditions)
    found = sorted(set(values))
    numbers = pd.to_numeric(pd.Series(found), errors="coerce")
    return found if numbers.isna().any() else [found[index] for index in numbers.argsort(kind="stable")]


def left_out(request: Request, participant: str, reason: str) -> Row:
    """The row of `exclusions` for a participant whom a comparison cannot use."""
    return {
        "participant": participant,
        "measure": request.measure,
        "what": "left out of comparisons",
        "reason": f"{request.entry.test}: {reason}",
    }


def _incomplete(request: Request, wide: pd.DataFrame) -> list[Row]:
    """Who is left out of a comparison because a cell is missing (listwise)."""
    found: list[Row] = []
    for participant in wide.index[wide.isna().any(axis=1)]:
        absent = [
            column if isinstance(column, str) else " × ".join(column)
            for column in wide.columns[wide.loc[participant].isna()]
        ]
        found.append(left_out(request, participant, f"no value in {', '.join(absent)}"))
    return found
