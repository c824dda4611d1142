"""What the further columns of measures.csv are: factors crossed with people, groups of people, misspelt levels.

A column is taken as study.yaml and the data together allow, never by its name:

- *crossed*: people meet several of its levels, and every level is met by many. Each person is then
  expected to have a value in each of its cells.
- *between*: every person has one level, so it tells groups of people apart.
- neither: everybody meets different levels (a random choice of targets, a time stamp). Nobody lacks a value.

A level that one person, or at most a fifth of them, has beside levels that most have is likely misspelt.
"""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from pipeline.errors import did_you_mean

BETWEEN_FACTORS = " × "
_RARE_SHARE = 0.2
_COMMON_SHARE = 0.5
_FEW = 3  # participants: among fewer, one person's level is no exception


@dataclass(frozen=True)
class RareLevel:
    """A level that hardly anybody has, who has it, and which common level is likely meant."""

    factor: str
    level: str
    participants: tuple[str, ...]
    meant: str | None

    @property
    def reason(self) -> str:
        """Why its values are not used, and what to do."""
        likely = f'; likely "{self.meant}" is meant' if self.meant else ""
        who = ", ".join(self.participants)
        return f'only {who} has {self.factor} "{self.level}", which is not used{likely}; check its spelling'


@dataclass(frozen=True)
class Factors:
    """The further factors of one measure: levels of the crossed ones, names of those between people, rare levels."""

    crossed: Mapping[str, tuple[str, ...]]
    between: tuple[str, ...]
    rare: tuple[RareLevel, ...]


def parsed(factors: pd.Series) -> list[dict[str, str]]:
    """The column `factors` of the tables, JSON text, as mappings."""
    return [json.loads(text) if isinstance(text, str) else {} for text in factors]


def factors_of(rows: pd.DataFrame) -> Factors:
    """What the further columns of one measure's rows are; rows of the table `measures` or `observations`."""
    facts = parsed(rows["factors"])
    people = list(rows["participant"])
    names = list(dict.fromkeys(name for fact in facts for name in fact))
    crossed: dict[str, tuple[str, ...]] = {}
    between: list[str] = []
    rare: list[RareLevel] = []
    for name in names:
        people_with: dict[str, set[str]] = {}
        for person, fact in zip(people, facts, strict=True):
            if name in fact:
                people_with.setdefault(fact[name], set()).add(person)
        levels_met: dict[str, int] = {}
        for who in people_with.values():
            for person in who:
                levels_met[person] = levels_met.get(person, 0) + 1
        if len(people_with) < 2:
            continue  # the same for everybody, so it divides nothing
        if max(levels_met.values()) == 1:
            between.append(name)
            continue
        unusual = _rare_levels(name, people_with, len(levels_met))
        common = [level for level in people_with if level not in {rare_level.level for rare_level in unusual}]
        if any(len(people_with[level]) >= _COMMON_SHARE * len(levels_met) for level in common):
            crossed[name], rare = tuple(common), rare + unusual
    return Factors(crossed, tuple(between), tuple(rare))


def without_rare(rows: pd.DataFrame, factors: Factors) -> pd.DataFrame:
    """One measure's rows without those of levels that are likely misspelt."""
    if not factors.rare:
        return rows
    rare = {(level.factor, level.level) for level in factors.rare}
    return rows[[not (rare & set(fact.items())) for fact in parsed(rows["factors"])]]


def _rare_levels(name: str, people_with: Mapping[str, set[str]], people: int) -> list[RareLevel]:
    """Levels that hardly anybody has, where others are common."""
    common = [level for level, who in people_with.items() if len(who) > _COMMON_SHARE * people]
    if people < _FEW or not common:
        return []
    return [
        RareLevel(name, level, tuple(sorted(who)), _meant(level, common))
        for level, who in people_with.items()
        if level not in common and (len(who) == 1 or len(who) <= _RARE_SHARE * people)
    ]


def _meant(level: str, common: Sequence[str]) -> str | None:
    """The common level that a rare one looks like."""
    alike = next((name for name in common if folded(name) == folded(level)), None)
    if alike is not None:
        return alike
    hint = did_you_mean(level, common)
    return hint.partition('"')[2].partition('"')[0] if "did you mean" in hint else None


def folded(text: str) -> str:
    """A name without what people overlook: case, white space, invisible characters, leading zeros of numbers."""
    plain = unicodedata.normalize("NFKC", text).casefold()
    kept = "".join(mark for mark in plain if not mark.isspace() and unicodedata.category(mark) not in ("Cf", "Cc"))
    digits = "".join(mark if mark.isdigit() else " " for mark in kept)
    for number in sorted(set(digits.split()), key=len, reverse=True):
        kept = kept.replace(number, number.lstrip("0") or "0")
    return kept.replace("_", "").replace("-", "")


def missing_cells(
    rows: pd.DataFrame, conditions: Sequence[str], crossed: Mapping[str, Sequence[str]]
) -> dict[str, list[str]]:
    """The cells in which a person has no value, named for readers (`kinect × left`), for each person who lacks one.

    A cell is a condition and a level of each crossed factor; combinations that nobody has do not count.
    """
    facts = parsed(rows["factors"])
    names = list(crossed)
    have: dict[str, set[tuple[str, ...]]] = {}
    for person, condition, fact in zip(rows["participant"], rows["condition"], facts, strict=True):
        if condition in conditions and all(fact.get(name) in crossed[name] for name in names):
            have.setdefault(person, set()).add((condition, *(fact[name] for name in names)))
    order = {condition: at for at, condition in enumerate(conditions)}
    every = sorted(set().union(*have.values()) if have else set(), key=lambda cell: (order[cell[0]], cell[1:]))
    people = sorted(set(rows["participant"]))
    lacking = {
        person: [BETWEEN_FACTORS.join(cell) for cell in every if cell not in have.get(person, ())] for person in people
    }
    return {person: cells for person, cells in lacking.items() if cells}
