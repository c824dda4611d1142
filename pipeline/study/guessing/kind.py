"""Which of a study's tables a file probably is, and what its columns mean."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pipeline.study.guessing.codes import missing_words
from pipeline.study.guessing.headers import EVERY, meaning, plain, split_unit
from pipeline.study.guessing.qualtrics import is_own, person_of
from pipeline.study.guessing.shapes import (
    Entry,
    crossed_headers,
    numbered_entry,
    numeric_columns,
    questionnaire_of,
    tlx_names,
)
from pipeline.study.guessing.written import NotUsed, Written

_PLACES = {"target_x", "target_y", "selected_x", "selected_y"}
_OF_TRIALS = (*_PLACES, "target_z", "selected_z", "start", "selection", "target_width")
_IDS = ("participant", "condition", "session", "trial", "period", "sequence", "practice")
_OF_PEOPLE = ("age", "sex")
_ANY_ID = ("id", "code", "nr", "no")


@dataclass(frozen=True)
class TableGuess:
    """A table with its kind, which is its key in study.yaml.

    `columns` and `wide` are what these keys of study.yaml would say, `header` has our names for the columns that have
    one. `values` are the columns that hold values in a table that has several in a row, `missing` the words that stand
    for a missing value, `further` the columns of the study's own.
    """

    written: Written
    kind: str
    columns: Mapping[str, str]
    header: tuple[str, ...]
    conditions: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    wide: tuple[Entry, ...] = ()
    missing: tuple[str, ...] = ()
    further: tuple[str, ...] = ()

    def column(self, name: str) -> list[str]:
        """The cells of a column, by our name for it."""
        return self.written.column(self.written.header[self.header.index(name)])


def guess_kind(written: Written, conditions: Sequence[str], given: Mapping[str, str]) -> TableGuess | NotUsed:
    """What a table probably is. `conditions` are those known already, `given` headers whose meaning the user stated."""
    ours = _ours(written.header, given)
    if "participant" not in ours:
        found = ", ".join(written.header)
        return NotUsed(written.path, f"no column is known to name the participants; it has {found}")
    bases = {column.rpartition("_")[0]: column for column in ours}
    if "condition" in ours:
        if bases.keys() >= _PLACES and "trial" in ours:
            own = [bases[name] for name in _OF_TRIALS if name in bases]
            return _long(written, "trials", ours, ("participant", "condition", "trial", "session", *own))
        for kind, long in (
            ("questionnaires", ("questionnaire", "scale", "rating")),
            ("measures", ("measure", "value")),
        ):
            if ours.keys() >= set(long):
                return _long(
                    written,
                    kind,
                    ours,
                    (*_IDS, *long) if kind == "measures" else ("participant", "condition", "session", *long),
                )
    return _with_values(written, ours, conditions)


def _ours(header: Sequence[str], given: Mapping[str, str]) -> dict[str, str]:
    """Our columns, each with the header that means it: as the user stated, by the exact name, or the first likely."""
    ours = {column: name for name, column in given.items() if name in header}
    for name in header:
        if name in EVERY and name not in ours.values():
            ours.setdefault(name, name)
    for name in header:
        column = meaning(name)
        if column is not None and name not in ours.values():
            ours.setdefault(column, name)
    for name in header:  # what is called so may be anything's id, so a better name goes first
        if plain(name) in _ANY_ID and name not in ours.values():
            ours.setdefault("participant", name)
    person = person_of(header)
    if person is not None:
        ours.setdefault("participant", person)
    return ours


def _long(written: Written, kind: str, ours: Mapping[str, str], wanted: Sequence[str]) -> TableGuess:
    """A table with a value a row, or of trials, with our names for the columns that are wanted."""
    columns = {ours[name]: name for name in wanted if name in ours}
    header = tuple(columns.get(name, name) for name in written.header)
    numbers = [
        name
        for name in ("rating", "value", *(n for n in wanted if n.rpartition("_")[0] in _OF_TRIALS))
        if name in header
    ]
    further = tuple(name for name in header if name not in columns.values())
    renamed = {given: name for given, name in columns.items() if given != name}
    table = TableGuess(written, kind, renamed, header, further=further)
    if "condition" in header:
        table = replace(table, conditions=tuple(dict.fromkeys(cell for cell in table.column("condition") if cell)))
    return _with_missing(table, numbers)


def _with_missing(table: TableGuess, numbers: Sequence[str]) -> TableGuess:
    """The table with the words that stand for a missing value in its columns of numbers."""
    words = missing_words([table.column(name) for name in numbers], table.written.decimal, ("", "NA", "N/A", "NaN"))
    return replace(table, missing=tuple(dict.fromkeys(words)))


def _with_values(written: Written, ours: Mapping[str, str], conditions: Sequence[str]) -> TableGuess | NotUsed:
    """A table of people, or one with several values in a row: of a questionnaire, of measures, or of conditions."""
    table = _long(written, "measures", ours, _IDS)
    numbers = numeric_columns(table.header, [list(row) for row in written.cells], written.decimal)
    free = [name for name in numbers if name in table.further and meaning(name) not in _OF_PEOPLE and not is_own(name)]
    if "condition" not in ours:
        return _without_conditions(table, free, conditions, ours)
    in_other_words = {name: scale for name, scale in _scales_of_tlx(table, free).items() if name != scale}
    table, free = _with_names(table, in_other_words), [in_other_words.get(name, name) for name in free]
    items = questionnaire_of(free)
    if items is not None and 2 * len(items[1]) >= len(free):
        return _wide(table, "questionnaires", items[1], {"questionnaire": items[0], "scale": items[1]})
    if not free:
        return NotUsed(written.path, "no column holds numbers to compare")
    numbered = numbered_entry(free, [written.column(written.header[table.header.index(name)]) for name in free])
    if numbered is not None:
        return _wide(table, numbered.kind, free, numbered.entry)
    renamed = {name: _with_unit(name) for name in free}
    values = list(renamed.values())
    return _wide(_with_names(table, renamed), "measures", values, {"measure": values})


def _scales_of_tlx(table: TableGuess, free: Sequence[str]) -> Mapping[str, str]:
    """The columns of a NASA-TLX by their headers, or by what a further row of the header says of them."""
    words = {table.written.described[table.header.index(name)]: name for name in free if table.written.described}
    return tlx_names(free) or {words[text]: scale for text, scale in tlx_names(list(words)).items()}


def _with_names(table: TableGuess, renamed: Mapping[str, str]) -> TableGuess:
    """The table with other names for some of its own columns."""
    return replace(
        table,
        columns={**table.columns, **{given: name for given, name in renamed.items() if given != name}},
        header=tuple(renamed.get(name, name) for name in table.header),
        further=tuple(renamed.get(name, name) for name in table.further),
    )


def _without_conditions(
    table: TableGuess, values: Sequence[str], conditions: Sequence[str], ours: Mapping[str, str]
) -> TableGuess | NotUsed:
    """A row a participant: what is known of them, or a column for each condition."""
    people = table.column("participant")
    if len(conditions) > 1 and set(conditions) <= set(values):
        listed = [name for name in values if name in conditions]
        found = _wide(table, "measures", listed, {"condition": listed, "measure": "value"})
        return replace(found, conditions=tuple(conditions))
    crossed = crossed_headers(values, conditions)
    if crossed is not None:
        found = _wide(table, "measures", crossed.headers, crossed.entry)
        return replace(found, conditions=crossed.conditions)
    if len(set(people)) < len(people):
        return NotUsed(table.written.path, "no column names the conditions, and participants have several rows each")
    return _long(table.written, "participants", ours, ("participant", "sequence"))


def _wide(table: TableGuess, kind: str, values: Sequence[str], entry: Entry) -> TableGuess:
    further = tuple(name for name in table.further if name not in values)
    found = replace(table, kind=kind, values=tuple(values), wide=(entry,), further=further)
    return _with_missing(found, values)


def _with_unit(header: str) -> str:
    """A measure's name with its unit at its end, by which Steadyhand knows it: `Zeit (ms)` as `Zeit_ms`."""
    base, unit = split_unit(header)
    return f"{re.sub(r'[^0-9A-Za-zÀ-ÿ]+', '_', base).strip('_')}_{unit}" if unit else header
