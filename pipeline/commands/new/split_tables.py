"""Tables of which each participant has a file: files with the same columns, whose names differ in a placeholder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

from pipeline.study.guessing.file_names import NamePattern, guess_pattern
from pipeline.study.guessing.headers import meaning
from pipeline.study.guessing.written import Written
from pipeline.study.session import PLACEHOLDER


def joined(tables: Sequence[Written], conditions: Sequence[str]) -> list[Written]:
    """The tables, those with the same columns as one, under the pattern of their names where these are built alike."""

    def columns(table: Written) -> tuple[str, ...]:
        return (table.path.suffix, str(sorted(table.form.items())), *table.header)

    found: list[Written] = []
    for _, alike in groupby(sorted(tables, key=columns), key=columns):
        group = list(alike)
        suffix = group[0].path.suffix
        names = guess_pattern([one.name for one in group], conditions, suffix, every_part=False)
        found += group if len(group) == 1 or names is None else [_as_one(group, names)]
    order = {table.path: place for place, table in enumerate(tables)}
    return sorted(found, key=lambda table: order[table.path])


def _as_one(group: Sequence[Written], names: NamePattern) -> Written:
    """One table of them all, with a column for what their names say and they do not."""
    roles = dict.fromkeys(PLACEHOLDER.findall(names.pattern))
    own = {meaning(name) for name in group[0].header}
    said = {"participant": names.participants, "condition": names.every_condition, "session": names.sessions}
    added = [role for role in roles if role not in own]
    cells = [(*row, *(said[role][place] for role in added)) for place, table in enumerate(group) for row in table.cells]
    return replace(group[0], header=(*group[0].header, *added), cells=tuple(cells), name=names.pattern)
