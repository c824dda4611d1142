"""Groups of participants: who is in which, and their values, for tests between people and mixed designs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.analysis import complete_cases
from pipeline.analysis.complete_cases import Request, left_out, levels_of, rows_and_factors
from pipeline.analysis.factors import folded, parsed
from pipeline.errors import PipelineError, did_you_mean
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import IntArray
from pipeline.study.settings import Study
from pipeline.tables.table import Row
from pipeline.words.phrases import listing

CONDITION = "condition"


@dataclass(frozen=True)
class GroupCases:
    """Values of each group's participants (nᵢ, …), the groups' names, who they are, and the exclusions."""

    factor: str
    names: list[str]
    groups: list[FloatArray]
    members: list[list[str]]
    left_out: list[Row]


@dataclass(frozen=True)
class MixedCases:
    """Values of n complete participants (n, k₁, …), the levels of each factor within, and the group of each (n,)."""

    factor: str
    names: list[str]
    codes: IntArray
    values: FloatArray
    participants: list[str]
    levels: list[list[str]]
    left_out: list[Row]


def one_condition_each(study: Study, seen: Iterable[tuple[object, object]]) -> bool:
    """Does each participant meet one condition: as study.yaml says, or because nobody met two of them?

    `seen` are pairs of participant and condition. A second condition that nobody has met yet makes no such design.
    """
    if CONDITION in study.factors:
        return True
    met = Counter(person for person, _ in set(seen))
    conditions = Counter(condition for _, condition in set(seen))
    return len(conditions) > 1 and min(conditions.values()) > 1 and max(met.values()) == 1


def by_group(request: Request) -> GroupCases:
    """Each participant's mean over everything else, by group; where conditions are the groups, over theirs alone."""
    factor = between_factor(request)
    rows, factors = rows_and_factors(request, request.measures)
    members = group_of_each(request, factor, rows)
    if factor == CONDITION:
        means = rows.groupby("participant")["value"].mean()
        exclusions = complete_cases.rare_levels(request, factors)
    else:
        cases = complete_cases.by_condition(request)
        means = pd.Series(cases.values.mean(axis=1), index=cases.participants)
        exclusions = list(cases.left_out)
    known = {person: float(value) for person, value in means.items() if person in members}
    exclusions += _without_group(request, factor, [str(person) for person in means.index if person not in members])
    names = group_names(request, factor, members, known)
    people = [[person for person in known if members[person] == name] for name in names]
    groups = [np.array([known[person] for person in of_group]) for of_group in people]
    return GroupCases(factor, names, groups, people, exclusions)


def mixed(request: Request) -> MixedCases:
    """Complete participants by the factors of `within`, and the group of each."""
    factor = between_factor(request)
    if factor == CONDITION:
        raise PipelineError(
            f'study.yaml: comparisons: mixed_anova of "{request.measure}" needs conditions that everybody meets, and'
            " factors says that each participant meets one condition; use test: anova_welch, between: condition"
        )
    rows, _ = rows_and_factors(request, request.measures)
    members = group_of_each(request, factor, rows)
    cases = complete_cases.by_factors_of(request)
    kept = [person in members for person in cases.participants]
    people = [person for person in cases.participants if person in members]
    names = group_names(request, factor, members, people)
    codes = np.array([names.index(members[person]) for person in people], dtype=np.int64)
    missing = [person for person in cases.participants if person not in members]
    exclusions = [*cases.left_out, *_without_group(request, factor, missing)]
    return MixedCases(factor, names, codes, cases.values[kept], people, cases.levels, exclusions)


def between_factor(request: Request) -> str:
    """The factor whose levels are the groups: the entry's `between`, or the study's only one."""
    of_entry, declared = request.entry.between, request.study.between_factors
    if of_entry is not None:
        return of_entry
    if len(declared) == 1:
        return declared[0]
    which = f"names several: {', '.join(declared)}" if declared else "names none"
    raise PipelineError(
        f'study.yaml: comparisons: {request.entry.test} of "{request.measure}" needs to know the groups, and factors'
        f" {which}; write between: and the factor, a column of participants.csv"
    )


def group_of_each(request: Request, factor: str, rows: pd.DataFrame) -> dict[str, str]:
    """The level of each participant, from participants.csv, the measures' own column, or the one condition they met."""
    if factor == CONDITION:
        return _one_level_each(request, factor, zip(rows["participant"], rows["condition"], strict=True))
    if factor in request.people:
        members = {str(person): str(level) for person, level in request.people[factor].items() if level}
        _refuse_look_alikes(factor, members)
        return members
    facts = parsed(rows["factors"])
    pairs = [(person, fact[factor]) for person, fact in zip(rows["participant"], facts, strict=True) if factor in fact]
    if not pairs:
        known = [*request.people, *dict.fromkeys(name for fact in facts for name in fact), CONDITION]
        raise PipelineError(
            f'study.yaml: comparisons: neither participants.csv nor the measures have a column "{factor}"'
            f"{did_you_mean(factor, known)}"
        )
    members = _one_level_each(request, factor, pairs)
    _refuse_look_alikes(factor, members)
    return members


def _one_level_each(request: Request, factor: str, pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    members: dict[str, str] = {}
    for person, level in pairs:
        if members.setdefault(str(person), str(level)) != level:
            raise PipelineError(
                f'study.yaml: comparisons: {request.entry.test} of "{request.measure}" compares groups of people, and'
                f' {person} has both {factor} "{members[str(person)]}" and "{level}"; use a test within participants,'
                " such as t_paired or rm_anova"
            )
    return members


def _refuse_look_alikes(factor: str, members: Mapping[str, str]) -> None:
    """Raise PipelineError for two groups whose names differ in case, spaces or invisible characters only."""
    by_name: dict[str, str] = {}
    counts = Counter(members.values())
    for name in sorted(counts, key=lambda level: (-counts[level], level)):
        usual = by_name.setdefault(folded(name), name)
        if usual != name:
            people = sorted(person for person, level in members.items() if level == name)
            raise PipelineError(
                f'study.yaml: comparisons: the groups "{usual}" and "{name}" of {factor} differ only in case, spaces or'
                f' invisible characters; write "{usual}" for {listing(people)}, or give the groups names of their own'
            )


def group_names(request: Request, factor: str, members: Mapping[str, str], people: Iterable[str]) -> list[str]:
    """The groups that have somebody, in the study's order or by the alphabet."""
    occupied = {members[person] for person in people}
    return [
        name for name in levels_of(request.study, factor, pd.Series(sorted(set(members.values())))) if name in occupied
    ]


def _without_group(request: Request, factor: str, people: list[str]) -> list[Row]:
    return [left_out(request, person, f"no {factor} is known") for person in people]
