"""The rows that the mixed model and the crossover take: values with their period, sequence and preceding condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pipeline.analysis import complete_cases
from pipeline.analysis.complete_cases import Request
from pipeline.analysis.factors import BETWEEN_FACTORS, missing_cells, parsed
from pipeline.errors import PipelineError
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.mixed import Column, Covariate, Factor
from pipeline.statistics.result import IntArray
from pipeline.tables.table import Row

CARRY_OVER = "carry_over"
TARGET = "target"
_WHERE = (
    'give a column "period" in the measures, a column "sequence" that lists the conditions in the participants table,'
    ' or the fact "order" in the logs'
)


@dataclass(frozen=True)
class ModelRows:
    """Values (N,) of a mixed model, the participant of each, the model's columns and terms, and who was left out.

    `crossed` has, by the name of the entry's `random`, which of its levels each value is of (N,).
    """

    values: FloatArray
    participants: list[str]
    columns: dict[str, Column]
    terms: list[str]
    crossed: dict[str, IntArray]
    left_out: list[Row]


def of_model(request: Request) -> ModelRows:
    """Each participant's mean in each combination of the levels that the entry names and that they have; not listwise.

    `period` is a slope, `factor(period)` a factor; `carry_over` is the condition of the preceding period, so the
    first period, which has none, does not count.
    """
    terms = list(request.entry.terms)
    names = list(dict.fromkeys(name for term in terms for name in term.split(":")))
    own_columns = ("condition", "period", "sequence", CARRY_OVER)
    observations, factors = complete_cases.rows_and_factors(request, _observations(request))
    random = [] if request.entry.random is None else [request.entry.random]
    further = [*(name for name in names if name not in own_columns), *random]
    rows = complete_cases.with_factors(request, observations, further)
    left_out: list[Row] = complete_cases.rare_levels(request, factors)
    if request.entry.missing == "listwise":
        outside = {name: levels for name, levels in factors.crossed.items() if name not in further}
        rows, partial = _without_partial_conditions(request, rows, outside)
        left_out += partial
    for name in ("period", "sequence"):
        if name in names or (name == "period" and CARRY_OVER in names):
            rows, unknown = _with_known(request, rows, name)
            left_out += unknown
    if CARRY_OVER in names:
        rows, unknown = _with_carry_over(request, rows)
        left_out += unknown
    cell = ["participant", *names, *random]
    means = _means(_means(rows, [*cell, "factors"]), cell)
    columns = {name: _column(request, name, means[name]) for name in names}
    crossed = {name: _crossed(request, name, means[name]) for name in random}
    values = means["value"].to_numpy(np.float64)
    return ModelRows(values, list(means["participant"]), columns, terms, crossed, left_out)


def _observations(request: Request) -> pd.DataFrame:
    """The values the model takes: of trials by target, where the entry names the targets and no column does."""
    own = request.observations[request.observations["measure"] == request.measure]
    if request.entry.random != TARGET or any(TARGET in factors for factors in parsed(own["factors"])):
        return request.observations
    by_target = request.target_observations
    return by_target if request.measure in set(by_target["measure"]) else request.observations


def _crossed(request: Request, name: str, values: pd.Series) -> IntArray:
    """The level of a random factor that each row has; PipelineError for a factor with one level."""
    codes, levels = pd.factorize(values, sort=True)
    if len(levels) == 1:
        raise PipelineError(
            f'study.yaml: comparisons: random: "{name}" of "{request.measure}" has one level; leave random out'
        )
    return np.asarray(codes, dtype=np.int64)


def _without_partial_conditions(
    request: Request, rows: pd.DataFrame, crossed: Mapping[str, Sequence[str]]
) -> tuple[pd.DataFrame, list[Row]]:
    """Without a participant's rows of a condition in which a cell of a factor outside the model is missing.

    The model takes people who lack a whole condition; a mean over half of a condition's cells would confound the two.
    """
    lacking = missing_cells(rows, request.study.conditions, crossed) if crossed else {}
    met = set(zip(rows["participant"], rows["condition"], strict=True))
    partial: dict[tuple[str, str], list[str]] = {}
    for person, cells in lacking.items():
        for cell in cells:
            condition = cell.split(BETWEEN_FACTORS)[0]
            if (person, condition) in met:
                partial.setdefault((person, condition), []).append(cell)
    exclusions = [
        complete_cases.left_out(request, person, f"no value in {', '.join(cells)}, so not counted in {condition}")
        for (person, condition), cells in partial.items()
    ]
    kept = [place not in partial for place in zip(rows["participant"], rows["condition"], strict=True)]
    return rows[kept], exclusions


def _means(rows: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """The mean of each combination of keys, weighted by `n`, as one row with n = 1."""
    weighted = rows.assign(value=rows["value"] * rows["n"])
    sums = weighted.groupby(list(dict.fromkeys(keys)), dropna=False, sort=True)[["value", "n"]].sum().reset_index()
    return pd.DataFrame(sums.assign(value=sums["value"] / sums["n"], n=1))


def _column(request: Request, name: str, values: pd.Series) -> Column:
    """A term's value in each row; PipelineError for a factor with one level."""
    if name == "period" and request.entry.period_is_slope:
        return Covariate(values.to_numpy(np.float64))
    levels = complete_cases.levels_of(request.study, "condition" if name == CARRY_OVER else name, values)
    levels = [level for level in levels if level in set(values) or name == "condition"]
    if len(levels) < 2:
        raise PipelineError(
            f'study.yaml: comparisons: "{name}" of "{request.measure}" has one level in the rows of the model; take it'
            " out of fixed"
        )
    codes = np.array([levels.index(value) for value in values], dtype=np.int64)
    return Factor(tuple(str(level) for level in levels), codes)


def _with_carry_over(request: Request, rows: pd.DataFrame) -> tuple[pd.DataFrame, list[Row]]:
    """Rows with the condition of their participant's preceding period, without first periods."""
    met = request.observations.dropna(subset="period")
    before = {
        (participant, int(period) + 1): condition
        for participant, period, condition in zip(met["participant"], met["period"], met["condition"], strict=True)
    }
    places = [(who, int(period)) for who, period in zip(rows["participant"], rows["period"], strict=True)]
    rows = rows.copy()
    rows[CARRY_OVER] = [before.get(place) for place in places]
    return _with_known(request, rows[[period > 1 for _, period in places]], CARRY_OVER)


def _with_known(request: Request, rows: pd.DataFrame, name: str) -> tuple[pd.DataFrame, list[Row]]:
    """The rows that have a period or sequence, and the exclusions for those that have none."""
    lacking = rows[rows[name].isna()]
    if len(lacking) == len(rows):
        raise PipelineError(
            f'study.yaml: comparisons: {request.entry.test} of "{request.measure}" needs the'
            f" {name.replace('_', '-')}, but no data state it; {_WHERE}"
        )
    unknown = [
        complete_cases.left_out(
            request, str(participant), f"no {name} is known for {', '.join(dict.fromkeys(rows_of['condition']))}"
        )
        for participant, rows_of in lacking.groupby("participant", sort=True)
    ]
    return rows.drop(index=lacking.index), unknown


@dataclass(frozen=True)
class CrossoverRows:
    """Values (n, 2) of participants in two conditions, and who met the first one first."""

    values: FloatArray
    participants: list[str]
    conditions: tuple[str, str]
    first_came_first: list[bool]
    sequences: tuple[str, str] | None
    left_out: list[Row]


def of_crossover(request: Request) -> CrossoverRows:
    """Participants with a value and a period of their own in each of the two conditions."""
    complete = complete_cases.by_condition(request)
    rows = request.observations[request.observations["measure"] == request.measure]
    rows = rows[rows["participant"].isin(complete.participants)]
    kept, left_out = _with_known(request, rows, "period") if len(rows) else (rows, [])
    first, second = request.study.conditions
    when: dict[str, dict[str, set[int]]] = {}
    for who, condition, period in zip(kept["participant"], kept["condition"], kept["period"], strict=True):
        when.setdefault(who, {}).setdefault(condition, set()).add(int(period))
    keep: list[int] = []
    first_came_first: list[bool] = []
    for index, participant in enumerate(complete.participants):
        periods = when.get(participant, {})
        if len(periods) < 2:
            continue  # listed among those whose period is not known
        if len(periods[first]) == len(periods[second]) == 1 and periods[first] != periods[second]:
            keep.append(index)
            first_came_first.append(min(periods[first]) < min(periods[second]))
        else:
            left_out.append(
                complete_cases.left_out(request, participant, "the two conditions do not have a period each")
            )
    people = [complete.participants[index] for index in keep]
    labels = dict(zip(rows["participant"], rows["sequence"], strict=True))
    sequences = _labels([labels.get(person) for person in people], first_came_first)
    return CrossoverRows(
        complete.values[keep], people, (first, second), first_came_first, sequences, [*complete.left_out, *left_out]
    )


def _labels(labels: list[Any], early: list[bool]) -> tuple[str, str] | None:
    """The study's own names of the two sequences, if it has one for each."""
    of_early = {label for label, first in zip(labels, early, strict=True) if first}
    of_late = {label for label, first in zip(labels, early, strict=True) if not first}
    if len(of_early) != 1 or len(of_late) != 1 or of_early == of_late:
        return None
    (early_label,), (late_label,) = of_early, of_late
    return None if pd.isna(early_label) or pd.isna(late_label) else (str(early_label), str(late_label))
