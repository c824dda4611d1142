"""Compares two results.json value by value: which values moved, which rows were added, and which are gone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.tables.catalogue import IN_STUDY_RESULTS, TABLES, in_results_of
from pipeline.tables.table import Row
from pipeline.words.numbers import NO_VALUE

Figures = Mapping[str, Any]

_STUDY, _STUDIES = "study", "studies"

OF_A_STUDY: Mapping[str, tuple[str, ...]] = {
    name: tuple(column for column in TABLES[name].key if column != _STUDY) for name in IN_STUDY_RESULTS
}
"""The tables of a study's results.json, and the columns that tell the rows of each apart.

The name of the study's folder tells no rows apart there, and is not compared: results of two folders may be.
"""
OF_A_REPLAY: Mapping[str, tuple[str, ...]] = {name: TABLES[name].key for name in in_results_of("replay")}
"""The same for the results.json of a replay, where a row belongs to one of several studies."""

_NEAR_ZERO = 1e-12  # a difference that is truly zero may leave this much rounding error
_FACTS: Mapping[str, tuple[str, ...]] = {_STUDY: (), _STUDIES: ("name",)}


class _Absent:
    """Stands for a value that one of the two results does not have."""


ABSENT = _Absent()


@dataclass(frozen=True)
class Change:
    """A value that changed, was added or is gone: its name, and its values before and now, `ABSENT` if none."""

    name: str
    before: Any
    now: Any

    @property
    def is_numeric(self) -> bool:
        """Whether it is or was a number."""
        return is_number(self.before) or is_number(self.now)

    @property
    def difference(self) -> float | None:
        """Now − before, where both are numbers."""
        return float(self.now - self.before) if is_number(self.before) and is_number(self.now) else None

    @property
    def relative(self) -> float | None:
        """The difference over the size of the value before, where that is not 0."""
        by = self.difference
        return by / abs(self.before) if by is not None and self.before else None

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Before, now, difference and relative difference, for a table."""
        by, relative = self.difference, self.relative
        return (
            cell(self.before),
            cell(self.now),
            NO_VALUE if by is None else f"{by:+.4g}",
            NO_VALUE if relative is None else f"{100 * relative:+.3g} %",
        )


@dataclass(frozen=True)
class Identified:
    """A row, identified by its table and the values of the table's key."""

    table: str
    key: Mapping[str, str | None]

    @property
    def name(self) -> str:
        """`completion_time_s | t_paired | condition | a - b`."""
        return " | ".join(str(value) for value in self.key.values() if value is not None)


@dataclass(frozen=True)
class Moved:
    """A row that both results have, and its values that changed."""

    row: Identified
    changes: Sequence[Change]


@dataclass
class Differences:
    """What differs between two sets of results; `compared` counts the values that both have."""

    compared: int = 0
    moved: list[Moved] = field(default_factory=list)
    removed: list[Identified] = field(default_factory=list)
    added: list[Identified] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.moved or self.removed or self.added)


def is_number(value: object) -> bool:
    """Whether it is a number. True and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def cell(value: object) -> str:
    """A value as text in a table of differences."""
    if value is ABSENT:
        return "absent"
    if value is None:
        return "undefined"
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def figures(row: Row) -> Iterator[tuple[str, Any]]:
    """A row's values by column, with those of `details` by their own names."""
    for column, value in row.items():
        if column == "details":
            yield from detailed(value)
        else:
            yield column, value


def detailed(details: Figures | None) -> Iterator[tuple[str, Any]]:
    """The details of a comparison by name; each part of a list has its index in the name."""
    for name, detail in (details or {}).items():
        parts = detail if isinstance(detail, list) else [detail]
        for index, part in enumerate(parts):
            yield f"{name}{f' {index}' if len(parts) > 1 else ''}", part


def changes(before: Figures, now: Figures, relative: float) -> list[Change]:
    """The values that were added, are gone, or differ by more than `relative` times the larger of the two.

    Numbers that differ by less than 1e-12 count as equal, unless `relative` is 0.
    """
    absolute = _NEAR_ZERO if relative else 0.0
    changed = []
    for name in dict.fromkeys([*before, *now]):
        old, new = before.get(name, ABSENT), now.get(name, ABSENT)
        if is_number(old) and is_number(new):
            same = math.isclose(old, new, rel_tol=relative, abs_tol=absolute)
        else:
            same = old == new and type(old) is type(new)
        if not same:
            changed.append(Change(name, old, new))
    return changed


def between(
    before: Mapping[str, Any], now: Mapping[str, Any], identity: Mapping[str, Sequence[str]], relative: float
) -> Differences:
    """Compare the tables that `identity` names, and what is known about the participants or the studies.

    `before` and `now` are contents of results.json.
    """
    differences = Differences()
    for table, columns in [*_FACTS.items(), *identity.items()]:
        olds, news = (_by_key(_rows(content, table), columns) for content in (before, now))
        for key in dict.fromkeys([*olds, *news]):
            row = Identified(table, dict(zip(columns, key, strict=True)))
            pairs, removed, added = _paired(olds.get(key, []), news.get(key, []))
            for old, new in pairs:
                _compare(differences, row, _others(old, columns), _others(new, columns), relative)
            differences.removed += [row] * removed
            differences.added += [row] * added
    return differences


def _rows(content: Mapping[str, Any], table: str) -> Sequence[Row]:
    """A table's rows. The participants of a study and the studies of a replay are compared like tables, too."""
    if table == _STUDY:
        people = content[_STUDY].get("participants", {}) if _STUDY in content else {}
        return [{f"participants {name}": value for name, value in people.items()}]
    if table == _STUDIES:
        return [{"name": study["name"], "sessions": study.get("sessions")} for study in content.get(_STUDIES, [])]
    rows: Sequence[Row] = content.get(table, [])
    return rows


def _compare(differences: Differences, row: Identified, before: Row, now: Row, relative: float) -> None:
    old, new = dict(figures(before)), dict(figures(now))
    differences.compared += len(old.keys() & new.keys())
    moved = changes(old, new, relative)
    if moved:
        differences.moved.append(Moved(row, moved))


def _by_key(rows: Sequence[Row], columns: Sequence[str]) -> dict[tuple[str | None, ...], list[Row]]:
    by_key: dict[tuple[str | None, ...], list[Row]] = {}
    for row in rows:
        by_key.setdefault(tuple(row[column] for column in columns), []).append(row)
    return by_key


def _others(row: Row, columns: Sequence[str]) -> Row:
    """The values to compare: not the key, nor the name of the study's folder, which two copies need not share."""
    return {column: value for column, value in row.items() if column not in (*columns, _STUDY)}


def _paired(before: Sequence[Row], now: Sequence[Row]) -> tuple[list[tuple[Row, Row]], int, int]:
    """Pair the rows that share a key: equal ones first, then the others in order; and count those left over.

    Several rows share a key where study.yaml asks for one test with different options.
    """
    olds, news = list(before), list(now)
    pairs = []
    if len(olds) + len(news) > 2:
        for row in before:
            if row in news:
                pairs.append((row, row))
                olds.remove(row)
                news.remove(row)
    rest = list(zip(olds, news, strict=False))
    return pairs + rest, len(olds) - len(rest), len(news) - len(rest)
