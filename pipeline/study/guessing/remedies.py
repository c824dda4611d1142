"""What to write into study.yaml so that a table can be read: the last part of the messages about it."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from pipeline.errors import PipelineError
from pipeline.study.guessing.headers import meaning, meanings
from pipeline.study.guessing.qualtrics import looks_like_header
from pipeline.study.guessing.shapes import wide_entry
from pipeline.study.guessing.text import decimal_of, separator_of
from pipeline.study.table_text import is_workbook, read_text
from pipeline.study.yaml_text import flow

if TYPE_CHECKING:
    from pipeline.study.table_file import TableFile

_ALIKE = 0.8  # of two words, of which one is likely a slip for the other
_HEADER_ROWS = 12


def header_remedy(
    file: TableFile, header: Sequence[str], required: Sequence[str], cells: Sequence[Sequence[str]]
) -> str:
    """What to write for a table whose header lacks a column: another separator, other names, or that it is wide."""
    if len(header) <= 2 and not is_workbook(file.path):
        separator = separator_of(read_text(file.path, file.form.encoding))
        if separator != (file.form.separator or ","):
            return _another_separator(file, separator)
    row = _header_row(file, required)
    if row is not None:
        return f"; row {row} looks like the header: write {_keys({'format': {file.table: {'header_row': row}}})}"
    columns = meanings(header, _wanted(required))
    keys: dict[str, object] = {"columns": {file.table: columns}} if columns else {}
    named = [columns.get(name, name) for name in header]
    wide = wide_entry(file.table, named, cells, file.conditions, file.decimal)
    if wide is not None:
        keys["wide"] = {file.table: wide}
        if any(name in named for name in ("w_mental", "weight_mental")):
            keys["scoring"] = {"nasa_tlx": {"rule": "weighted_tlx", "range": [0, 100]}}
    return f"; write {_keys(keys)}" if keys else ""


def _another_separator(file: TableFile, separator: str) -> str:
    lines = read_text(file.path, file.form.encoding).splitlines()
    decimal = decimal_of(cell for line in lines for cell in line.split(separator))
    form: dict[str, object] = {"separator": {"\t": "tab", " ": "space"}.get(separator, separator)}
    if decimal == ",":
        form["decimal"] = decimal
    columns = meanings([cell.strip() for cell in lines[0].split(separator)], _wanted(()))
    keys: dict[str, object] = {"format": form}
    if columns:
        keys["columns"] = {file.table: columns}
    return f"; its cells are separated by {flow(form['separator'])}: write {_keys(keys)}"


def _header_row(file: TableFile, required: Sequence[str]) -> int | None:
    """The row below the first one that has the required columns, by our names or others; None where there is none."""
    from pipeline.study.table_text import read_rows

    if file.form.header_row is not None:
        return None
    try:
        rows = read_rows(file.path, file.form)[1:_HEADER_ROWS]
    except PipelineError:
        return None
    for line, row in rows:
        names = {meaning(cell) or cell for cell in row}
        if required[0] in names and sum(name in names for name in required) > 1:
            return line
    return None


def _wanted(required: Sequence[str]) -> list[str]:
    from pipeline.study.guessing.headers import EVERY

    return [*required, *EVERY]


def number_remedy(file: TableFile, found: Iterable[str]) -> str:
    """What to write where a column has text in the place of numbers."""
    texts = list(found)
    if looks_like_header(texts):
        return f"; the file is an export of Qualtrics: write {_keys({'format': {file.table: {'header_rows': 3}}})}"
    if any("," in text for text in texts) and file.decimal == ".":
        return ' (a decimal comma? use a point), or write format: {decimal: ","} in study.yaml'
    if any("." in text for text in texts) and file.decimal == ",":
        return ' (study.yaml says format: {decimal: ","}, so a number has no point; take points between thousands out)'
    words = list(dict.fromkeys(text for text in texts if text))
    remark = " (if that stands for a missing value, list it under `missing:` in study.yaml)"
    return f"{remark}: missing: {flow(words[:1])}" if words else remark


def misnamed_column(name: str, columns: Sequence[str]) -> str | None:
    """The one of `columns`, which a table lacks, that a column of another name is likely meant to be."""
    meant = meaning(name)
    if meant in columns:
        return meant
    close = difflib.get_close_matches(name, columns, n=1, cutoff=_ALIKE)
    return close[0] if close else None


def _keys(keys: dict[str, object]) -> str:
    """Keys and values as they are to be written into study.yaml."""
    written = " and ".join(f"{key}: {flow(value)}" for key, value in keys.items())
    return f"{written} in study.yaml"
