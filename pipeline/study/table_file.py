"""One of the study's own tables: where it is and how it is written, and its rows with our names for their columns."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pandas as pd

from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.fields import identifier
from pipeline.study.guessing.headers import UNITS
from pipeline.study.large_tables import by_column
from pipeline.study.memory import free_bytes, shortage
from pipeline.study.pseudonyms import Pseudonyms
from pipeline.study.settings import Study
from pipeline.study.table_parts import Part, check_told_apart, named_identifiers, parts_of
from pipeline.study.table_settings import TableFormat, WideEntry
from pipeline.study.table_text import is_workbook, read_rows

Codes = Sequence[float | str]
"""What study.yaml lists under `missing`: numbers or words that stand for a value that is not there."""

MEMORY_PER_BYTE = 16.0
"""Bytes of memory that a report takes for each of a table, by docs/limits.md."""

_IN_OURS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "s": 1.0, "ms": 1e-3}


_PLAIN_CSV = TableFormat()


@dataclass(frozen=True)
class TableFile:
    """A table's path, and what study.yaml says of it.

    `table` is its key in study.yaml, such as "trials"; `headers` what its own headers mean, `missing` the codes for
    values that are not there, `px_per_mm` how long a pixel is (None where study.yaml does not say). `parts` are the
    files of a table that is split, of which `path` is the pattern. `pseudonyms` replace the ids in it; None leaves
    them.
    """

    path: Path
    table: str = "participants"
    conditions: tuple[str, ...] = ()
    missing: Codes = ()
    form: TableFormat = _PLAIN_CSV
    headers: Mapping[str, str] = field(default_factory=dict)
    wide: tuple[WideEntry, ...] = ()
    px_per_mm: float | None = None
    parts: tuple[Part, ...] = ()
    pseudonyms: Pseudonyms | None = None

    @property
    def decimal(self) -> str:
        """The mark before the decimals."""
        return self.form.decimal or "."


def table_file(study: Study, folder: Path, table: str, pseudonyms: Pseudonyms | None = None) -> TableFile | None:
    """A table that study.yaml names, such as `participants`; None where it names none."""
    name = getattr(study, table)
    if name is None:
        return None
    return TableFile(
        folder / name,
        table,
        study.conditions,
        study.missing,
        study.format.of(table),
        getattr(study.columns, table, {}),
        getattr(study.wide, table, ()),
        study.display.px_per_mm if study.display is not None else None,
        tuple(parts_of(folder, name)),
        pseudonyms,
    )


def read_table(
    file: TableFile, required: Sequence[str], numbers: Collection[str] = ()
) -> tuple[pd.DataFrame, dict[str, float]]:
    """The table as text, ids in NFC, by its file's row numbers; and by how much columns in other units are multiplied.

    The columns have our names: those that `columns` in study.yaml gives them, and `start_s` for `start_ms`. Those named
    in `numbers`, which the caller turns into numbers at once, may be Arrow's text. Raises PipelineError, naming what to
    write into study.yaml, where the file cannot be read or lacks a required column.
    """
    table, factors = _read_parts(file, required) if file.parts else _read_one(file, required, {}, numbers)
    if file.pseudonyms is not None:
        file.pseudonyms.in_table(table, file.path)
    return table, factors


def _read_parts(file: TableFile, required: Sequence[str]) -> tuple[pd.DataFrame, dict[str, float]]:
    """A split table: its files one below the other, whose rows are named after them."""
    shown = {} if file.pseudonyms is None else file.pseudonyms.files
    tables: list[pd.DataFrame] = []
    said: dict[str, list[tuple[str, frozenset[str]]]] = {}
    factors: dict[str, float] = {}
    for part in file.parts:
        named = named_identifiers(part)
        table, factors = _read_one(replace(file, path=part.path, parts=()), required, named)
        if tables and set(table) != set(tables[0]):
            other = ", ".join(sorted(map(str, set(table) ^ set(tables[0]))))
            raise PipelineError(
                f"{file.path}: {part.name} and {file.parts[0].name} have different columns ({other}); the files of one "
                "table need the same"
            )
        for key, value in named.items():
            said.setdefault(key, []).append((value, frozenset(table[key])))
        table.index = pd.Index([f"{line} of {shown.get(part.name, part.name)}" for line in table.index])
        tables.append(table)
    for key, each in said.items():
        check_told_apart(str(file.path), key, each)
    return pd.concat(tables), factors


def _read_one(
    file: TableFile, required: Sequence[str], named: Mapping[str, str], numbers: Collection[str] = ()
) -> tuple[pd.DataFrame, dict[str, float]]:
    """One file. What its name says is a column, unless it has that column itself."""
    path = file.path
    _require_memory(path)
    large = None if named or is_workbook(path) else by_column(path, file.form)
    if large is not None:
        _check_names(path, large.header)
        ours, factors = _ours(file, _renamed(file, large.header))
        if set(required) <= set(ours):  # else the message needs the rows
            return large.frame(ours, numbers), factors
        del large
    rows = read_rows(path, file.form)
    if not rows:
        raise PipelineError(f"{path}: is empty; its first line must name the columns {', '.join(required)}")
    rows = _without_empty_ends(rows)
    header = [str(identifier(name.strip())) for name in rows[0][1]]
    _check_names(path, header)
    ours, factors = _ours(file, _renamed(file, header))
    cells = [[cell.strip() for cell in row] for _, row in rows[1:]]
    _require(
        file, ours, [name for name in required if name not in named], [row for row in cells if len(row) == len(header)]
    )
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise PipelineError(f"{path}, row {line}: has {len(row)} cells, the first line {len(header)}")
    if not cells:
        raise PipelineError(f"{path}: holds no rows below its header")
    table = pd.DataFrame(cells, columns=ours, dtype=object)
    for name in ours:
        table[name] = table[name].map(identifier)
    for key, value in named.items():
        if key not in table:
            table[key] = value
    table.index = pd.Index([line for line, _ in rows[1:]])  # the file's own line numbers
    return table, factors


def _require_memory(path: Path) -> None:
    lacking = shortage(path.stat().st_size, MEMORY_PER_BYTE, free_bytes()) if path.is_file() else None
    if lacking is not None:
        raise PipelineError(f"{path}: {lacking}")


def _without_empty_ends(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """The rows without columns on their right that have neither a name nor a value, as spreadsheets leave them."""
    width = max(
        (place for _, row in rows for place, cell in enumerate(row, 1) if cell.strip()),
        default=0,
    )
    header = len(rows[0][1])
    return [(line, row[:width]) if len(row) == header else (line, row) for line, row in rows]


def _check_names(path: Path, header: Sequence[str]) -> None:
    for place, name in enumerate(header, 1):
        if not name:
            raise PipelineError(f"{path}: column {place} has no name")
        if header.count(name) > 1:
            raise PipelineError(f'{path}: the column "{name}" is listed twice')


def _renamed(file: TableFile, header: Sequence[str]) -> list[str]:
    """The headers, with our names for those that `columns` in study.yaml lists."""
    for given in file.headers:
        if given not in header:
            found = ", ".join(header)
            raise PipelineError(
                f'study.yaml: columns.{file.table}: there is no column "{given}" in {file.path.name}'
                f"{did_you_mean(given, header)}; found: {found}"
            )
    named = [file.headers.get(name, name) for name in header]
    for name in named:
        if named.count(name) > 1:
            raise PipelineError(
                f'study.yaml: columns.{file.table}: "{name}" is what a header of {file.path.name} is renamed to, and'
                " another column there is called so; rename that one too"
            )
    return named


def _ours(file: TableFile, header: Sequence[str]) -> tuple[list[str], dict[str, float]]:
    """The names with our units, and for those that came in others, by how much their numbers are multiplied."""
    if file.table != "trials":
        return list(header), {}
    named, factors = [], {}
    for name in header:
        base, _, unit = name.rpartition("_")
        if base not in UNITS or unit not in UNITS[base] or unit == UNITS[base][0]:
            named.append(name)
            continue
        ours = f"{base}_{UNITS[base][0]}"
        if ours in header:
            raise PipelineError(f'{file.path}: has both "{name}" and "{ours}"; keep one of them')
        if unit == "px" and file.px_per_mm is None:
            raise PipelineError(
                f'{file.path}: "{name}" is in pixels, and study.yaml does not say how many are a millimetre; write'
                " display: {px_per_mm: 10, unit: px} with your display's own number"
            )
        named.append(ours)
        factors[ours] = 1.0 / file.px_per_mm if unit == "px" and file.px_per_mm else _IN_OURS[unit]
    return named, factors


def _require(file: TableFile, header: Sequence[str], required: Sequence[str], cells: Sequence[Sequence[str]]) -> None:
    missing = [name for name in required if name not in header]
    if missing:
        from pipeline.study.guessing.remedies import header_remedy

        remedy = header_remedy(file, header, required, cells)
        raise PipelineError(f'{file.path}: the column "{missing[0]}" is missing; found: {", ".join(header)}{remedy}')
