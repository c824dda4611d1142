"""The arrays behind each row of `comparisons`, for another program to compute the same from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from pipeline.analysis import complete_cases, families, groups, model_rows, within_tests
from pipeline.analysis.comparisons import Answered
from pipeline.analysis.complete_cases import Request
from pipeline.analysis.ratios import on_logarithms
from pipeline.statistics import mixed_anova, pairs
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.mixed import Column
from pipeline.statistics.pairs import Pair
from pipeline.statistics.result import IntArray
from pipeline.study.comparison import Comparison
from pipeline.study.statistical_tests import TUKEY
from pipeline.tables.table import Row


@dataclass(frozen=True)
class Paired:
    """Two values of each participant, (n,) each."""

    first: FloatArray
    second: FloatArray


@dataclass(frozen=True)
class Within:
    """Values of complete participants (n, k₁, k₂, …), and the places of the factors that the row's effect is of.

    Of a mixed design also the group of each participant (n,), and whether the effect includes it.
    """

    values: FloatArray
    effect: tuple[int, ...]
    codes: IntArray | None = None
    with_group: bool = False


@dataclass(frozen=True)
class Groups:
    """Values of each group (nᵢ,), and the places of the two that the row compares, if it compares two of several."""

    groups: Sequence[FloatArray]
    pair: tuple[int, int] = (0, 1)


@dataclass(frozen=True)
class Model:
    """The rows of a mixed model: values (N,), the participant of each, its columns and terms, and further intercepts.

    `term` is the row's own, and `levels` are the two levels of it that the row compares, if it compares two.
    """

    values: FloatArray
    participants: Sequence[str]
    columns: Mapping[str, Column]
    terms: Sequence[str]
    random: Mapping[str, IntArray]
    term: str
    levels: tuple[int, int] | None = None


@dataclass(frozen=True)
class Family:
    """The p values of a family as the table has them, how they are adjusted, and which of them is the row's."""

    p_values: Sequence[float]
    method: str
    place: int


Data = Paired | Within | Groups | Model | Family

P_ADJUSTED = "p_adjusted"
"""The procedure of a `Family`."""


@dataclass(frozen=True)
class Problem:
    """A row of `comparisons`, which procedure computed it, the arrays it was computed from, and the entry's options.

    The procedure is the test, or what follows it up: pairs after an analysis of variance are paired t tests.
    """

    row: Row
    procedure: str
    data: Data
    entry: Comparison


def problems_of(answered: Answered) -> Iterator[Problem]:
    """One for each row of a request that another program might compute; none for ART and crossover analyses."""
    entry = answered.request.entry
    build = _DATA.get(entry.test)
    if build is None:
        return
    known = build(answered.request)
    for row in answered.rows:
        found = known.get((row["effect"], row["contrast"]))
        if found is not None:
            yield Problem(row, *found, entry)


def all_problems(answered: Sequence[Answered]) -> list[Problem]:
    """What there is to compute anew of a study: each row that can be, then each p that is adjusted."""
    return [*(problem for one in answered for problem in problems_of(one)), *families_of(answered)]


def families_of(answered: Sequence[Answered]) -> Iterator[Problem]:
    """One for each row whose p is adjusted: the p values of its family, as they stand in the table."""
    by_row = {id(row): one.request.entry for one in answered for row in one.rows}
    of_entries = [list(of_entry) for _, of_entry in groupby(answered, key=lambda one: id(one.request.entry))]
    by_entry = [(of_entry[0].request.entry, [row for one in of_entry for row in one.rows]) for of_entry in of_entries]
    for family in families.grouped(by_entry).values():
        rows = [row for row in family if row["p"] is not None]
        p_values = [float(row["p"]) for row in rows]
        for place, row in enumerate(rows):
            if row["p_adjusted"] is not None:
                yield Problem(row, P_ADJUSTED, Family(p_values, row["adjust"], place), by_row[id(row)])


_Known = dict[tuple[str, str | None], tuple[str, Data]]
"""The procedure and the data of each effect and contrast."""


def _paired(found: Sequence[Pair]) -> _Known:
    return {(pair.effect, pair.contrast): ("t_paired", Paired(pair.first, pair.second)) for pair in found}


def _tested(request: Request, values: FloatArray) -> FloatArray:
    """The values, or their logarithms where the entry asks for these; where one has none, the row has a status."""
    return np.log(values) if on_logarithms(request) and np.all(values > 0) else values


def _rm_anova(request: Request) -> _Known:
    cases, within = complete_cases.by_factors_of(request), request.entry.within
    values = _tested(request, cases.values)
    known = _paired(pairs.follow_ups(values, within, cases.levels))
    for effect, name in _effects(values.shape[1:], within):
        known[name, None] = ("rm_anova", Within(values, effect))
    if values.shape[1:] == (2,):  # the row of two conditions names their contrast
        (pair,) = pairs.of_conditions(values, cases.levels[0])
        known["condition", pair.contrast] = ("rm_anova", Within(values, (0,)))
    return known


def _effects(levels: Sequence[int], within: Sequence[str]) -> Iterator[tuple[tuple[int, ...], str]]:
    from pipeline.statistics.anova import effect_name, effects_of

    for effect in effects_of(levels):
        yield effect, effect_name(within, effect)


def _friedman(request: Request) -> _Known:
    cases = complete_cases.by_condition(request)
    return {("condition", None): ("friedman", Within(cases.values, (0,)))}


def _of_conditions(request: Request) -> _Known:
    cases = complete_cases.by_condition(request)
    known = _paired(pairs.of_conditions(_tested(request, cases.values), cases.levels[0]))
    return {place: (request.entry.test, data) for place, (_, data) in known.items()}


def _of_groups(request: Request) -> _Known:
    cases = groups.by_group(request)
    positive = all(np.all(group > 0) for group in cases.groups)
    values = [_tested(request, group) if positive else group for group in cases.groups]
    return {
        (pair.effect, pair.contrast): (request.entry.test, Groups([pair.first, pair.second]))
        for pair in pairs.of_groups(values, cases.names, cases.factor)
    }


def _all_groups(request: Request) -> _Known:
    cases = groups.by_group(request)
    known: _Known = {(cases.factor, None): (request.entry.test, Groups(cases.groups))}
    after_welch = "tukey_kramer" if request.entry.follow_up == TUKEY else "games_howell"
    places = [(i, j) for i in range(len(cases.names)) for j in range(i + 1, len(cases.names))]
    for pair, place in zip(pairs.of_groups(cases.groups, cases.names, cases.factor), places, strict=True):
        known[pair.effect, pair.contrast] = (
            (after_welch, Groups(cases.groups, place))
            if request.entry.test == "anova_welch"
            else ("mann_whitney", Groups([pair.first, pair.second]))
        )
    return known


def _mixed_anova(request: Request) -> _Known:
    cases, within = groups.mixed(request), request.entry.within
    values = _tested(request, cases.values)
    known: _Known = {(cases.factor, None): ("mixed_anova", Within(values, (), cases.codes, True))}
    for effect, name in _effects(values.shape[1:], within):
        known[name, None] = ("mixed_anova", Within(values, effect, cases.codes))
        known[f"{cases.factor}:{name}", None] = ("mixed_anova", Within(values, effect, cases.codes, True))
    if not len(values):
        return known
    between = (cases.factor, cases.names)
    for follow_up in mixed_anova.follow_ups(values, cases.codes, between, within, cases.levels):
        pair = follow_up.pair
        if not pair.paired:
            known[pair.effect, pair.contrast] = ("t_welch", Groups([pair.first, pair.second]))
        elif pair.effect.startswith(f"{cases.factor}:"):  # within one group; over all of them no program has one call
            known[pair.effect, pair.contrast] = ("t_paired", Paired(pair.first, pair.second))
    return known


def _mixed_model(request: Request) -> _Known:
    from pipeline.statistics.mixed import Factor

    model = model_rows.of_model(request)
    random = within_tests.random_intercepts(model)
    known: _Known = {}
    for term in model.terms:
        data = Model(_tested(request, model.values), model.participants, model.columns, model.terms, random, term)
        known[term, None] = ("mixed_model", data)
        column = model.columns.get(term)
        if isinstance(column, Factor):
            for i in range(len(column.levels)):
                for j in range(i + 1, len(column.levels)):
                    contrast = f"{column.levels[i]} - {column.levels[j]}"
                    known[term, contrast] = ("mixed_model", replace(data, levels=(i, j)))
    return known


_DATA: Mapping[str, Callable[[Request], _Known]] = {
    "rm_anova": _rm_anova,
    "friedman": _friedman,
    "t_paired": _of_conditions,
    "wilcoxon": _of_conditions,
    "tost": _of_conditions,
    "bayes_t": _of_conditions,
    "t_welch": _of_groups,
    "mann_whitney": _of_groups,
    "anova_welch": _all_groups,
    "kruskal": _all_groups,
    "mixed_anova": _mixed_anova,
    "mixed_model": _mixed_model,
}
