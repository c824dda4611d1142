"""From rows of measures to the arrays that tests take: who has a value in every cell, and who is left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.analysis.factors import Factors, factors_of, missing_cells, parsed, without_rare
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics.arrays import FloatArray
from pipeline.study.comparison import Comparison
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.tables.table import Row

People = Mapping[str, Mapping[str, str]]
"""participants.csv by column: the value of each participant."""


@dataclass(frozen=True)
class Values:
    """The tables that comparisons stand on.

    `observations` are the values of `measures` with their period and sequence, `target_observations` those of trials
    by target.
    """

    measures: pd.DataFrame
    observations: pd.DataFrame
    target_observations: pd.DataFrame
    people: People


def read_values(folder: Path, people: People) -> Values:
    """The values that the stage `measure` left in a folder."""
    names = ("measures", "observations", "target_observations")
    measures, observations, target_observations = (tables.read(name, folder) for name in names)
    return Values(measures, observations, target_observations, people)


@dataclass(frozen=True)
class Request(Values):
    """One entry under `comparisons`, for one measure, and the values of all."""

    study: Study
    entry: Comparison
    measure: str

    @cached_property
    def cases(self) -> CompleteCases:
        """`by_condition`, which both the test and the check of its assumptions ask for."""
        return _by_condition(self)


@dataclass(frozen=True)
class CompleteCases:
    """Values of n complete participants (n, k₁, k₂, …), the levels of each factor, and the exclusions."""

    values: FloatArray
    participants: list[str]
    levels: list[list[str]]
    left_out: list[Row]


def by_condition(request: Request) -> CompleteCases:
    """Each participant's mean over everything else (n, k), of those who have a value in every cell of it.

    With `missing: available` also of those who lack a cell of a further factor: their mean is over the cells they have.
    """
    return request.cases


def _by_condition(request: Request) -> CompleteCases:
    rows, factors = rows_and_factors(request, request.measures)
    wide = tables.participant_means(rows, request.measure, request.study.conditions)
    levels = [list(request.study.conditions)]
    complete, left_out = _complete(request, rows, factors, wide)
    return CompleteCases(complete.to_numpy(np.float64), list(complete.index), levels, left_out)


def by_factors_of(request: Request) -> CompleteCases:
    """By the entry's factors: the conditions alone, or with further ones."""
    return by_factor(request) if len(request.entry.within) > 1 else by_condition(request)


def by_factor(request: Request) -> CompleteCases:
    """Each participant's mean by the factors of `within`, in their order (n, k₁, k₂, …)."""
    within = request.entry.within
    table, factors = rows_and_factors(request, request.measures)
    rows = with_factors(request, table, within)
    levels = [levels_of(request.study, factor, rows[factor]) for factor in within]
    for factor, known in zip(within, levels, strict=True):
        if factor in factors.between:
            raise PipelineError(
                f'study.yaml: comparisons: "{factor}" of "{request.measure}" does not vary within participants: it'
                f" divides people into groups, so it cannot stand in within. Write factors: {{{factor}: between}} and"
                " test: mixed_anova"
            )
        if len(known) < 2:
            raise PipelineError(
                f'study.yaml: comparisons: factor "{factor}" of "{request.measure}" has one level: {known[0]}'
            )
    wide = rows.pivot_table(index="participant", columns=list(within), values="value", aggfunc="mean")
    wide = wide.reindex(columns=pd.MultiIndex.from_product(levels, names=list(within)))
    complete, left_out = _complete(request, table, factors, wide)
    values = complete.to_numpy(np.float64).reshape(len(complete), *(len(level) for level in levels))
    return CompleteCases(values, list(complete.index), levels, left_out)


def rows_and_factors(request: Request, table: pd.DataFrame) -> tuple[pd.DataFrame, Factors]:
    """The measure's rows of a table without those of levels that are likely misspelt, and what its factors are."""
    rows = table[table["measure"] == request.measure]
    factors = factors_of(rows)
    return without_rare(rows, factors), factors


def rare_levels(request: Request, factors: Factors) -> list[Row]:
    """The exclusions for values at levels that are likely misspelt."""
    return [left_out(request, person, level.reason) for level in factors.rare for person in level.participants]


def _complete(
    request: Request, rows: pd.DataFrame, factors: Factors, wide: pd.DataFrame
) -> tuple[pd.DataFrame, list[Row]]:
    """The rows of `wide` of complete participants, and the exclusions of the others (listwise)."""
    lacking = missing_cells(rows, request.study.conditions, factors.crossed)
    if request.entry.missing == "available":
        lacking = {person: cells for person, cells in lacking.items() if wide.loc[person].isna().any()}
    exclusions = rare_levels(request, factors)
    exclusions += [left_out(request, person, f"no value in {', '.join(cells)}") for person, cells in lacking.items()]
    return wide.drop(index=[person for person in lacking if person in wide.index]).dropna(), exclusions


def with_factors(request: Request, table: pd.DataFrame, factors: Sequence[str]) -> pd.DataFrame:
    """The measure's rows with a column for each factor; PipelineError for one that some row lacks."""
    rows = table[table["measure"] == request.measure].copy()
    facts = parsed(rows["factors"])
    for factor in factors:
        if factor != "condition":
            rows[factor] = [fact.get(factor) for fact in facts]
            if rows[factor].isna().any():
                known = sorted({key for fact in facts for key in fact} | {"condition"})
                hint = did_you_mean(factor, known)
                raise PipelineError(
                    f'study.yaml: comparisons: "{request.measure}" has no factor "{factor}"{hint}; a column of the'
                    f" trials or questionnaires is one if factors lists it: factors: {{{factor}: within}}"
                )
    return rows


def levels_of(study: Study, factor: str, values: pd.Series) -> list[str]:
    """A factor's levels: as study.yaml orders them, else numbers by size, others by the alphabet.

    Raises PipelineError for a level of the data that study.yaml does not list.
    """
    if factor == "condition":
        return list(study.conditions)
    levels = sorted(set(values))
    stated = study.factors[factor].levels if factor in study.factors else ()
    if stated:
        for level in levels:
            if level not in stated:
                hint = did_you_mean(level, stated)
                raise PipelineError(f'study.yaml: factors: {factor} has no level "{level}", and the data do{hint}')
        return [level for level in stated if level in levels]
    numbers = pd.to_numeric(pd.Series(levels), errors="coerce")
    return levels if numbers.isna().any() else [levels[index] for index in numbers.argsort(kind="stable")]


def left_out(request: Request, participant: str, reason: str) -> Row:
    """The row of `exclusions` for a participant whom a comparison cannot use."""
    return {
        "participant": participant,
        "measure": request.measure,
        "what": "left out of comparisons",
        "reason": f"{request.entry.test}: {reason}",
    }
