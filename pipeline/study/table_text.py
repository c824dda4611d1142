"""Reads a table of the study, a CSV file or a sheet of a workbook, as rows of text with the file's own row numbers."""

from __future__ import annotations

import csv
import io
import math
from datetime import date, datetime, time
from pathlib import Path

from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.table_settings import TableFormat

WORKBOOKS = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")

Numbered = list[tuple[int, list[str]]]
"""Rows that are not empty, each with its number in the file, from 1."""


def is_workbook(path: Path) -> bool:
    """Whether a file is read as a workbook, by its name."""
    return path.suffix.casefold() in WORKBOOKS


def read_rows(path: Path, form: TableFormat) -> Numbered:
    """The rows of a file from its header on. Raises PipelineError, naming the remedy, where it cannot be read."""
    rows = _workbook_rows(path, form) if is_workbook(path) else _csv_rows(path, form)
    first = form.header_row or 1
    kept = [(line, cells) for line, cells in rows if line >= first and any(cell.strip() for cell in cells)]
    return kept[:1] + kept[form.header_rows or 1 :]


# CSV ----------------------------------------------------------------------------------------------------------------


def _csv_rows(path: Path, form: TableFormat) -> Numbered:
    reader = csv.reader(
        io.StringIO(read_text(path, form.encoding), newline=""), delimiter=form.separator or ",", strict=True
    )
    try:
        return [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise PipelineError(f"{path}, row {reader.line_num}: cannot be read as CSV: {error}") from None


def read_text(path: Path, encoding: str | None) -> str:
    """A file's text, without a byte order mark. Raises PipelineError that names the encoding it probably has."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise PipelineError(f"{path}: cannot be read: {error.strerror or error}") from None
    named = encoding or "utf-8"
    try:
        text = content.decode("utf-8-sig" if named.replace("_", "-").lower() in ("utf-8", "utf8") else named)
    except UnicodeError as error:
        from pipeline.study.guessing.text import encoding_remedy

        raise PipelineError(f"{path}: {encoding_remedy(content, named, error)}") from None
    if "\0" in text:
        raise PipelineError(f"{path}: is not a table of text: it holds zero bytes")
    return text


# Workbooks ----------------------------------------------------------------------------------------------------------


def sheets_of(path: Path, decimal: str = ".") -> dict[str, list[list[str]]]:
    """The sheets of a workbook in their order, cells as text; row 1 is the first one of the sheet.

    Numbers get the decimal mark that study.yaml states, for a workbook may hold some of them as text. Raises
    PipelineError where the file is no workbook, or where the package that reads them is not installed.
    """
    try:
        from python_calamine import CalamineError, CalamineWorkbook
    except ImportError:
        raise PipelineError(
            f'{path}: reading workbooks needs a further package: pip install "steadyhand[xlsx]", or save it as CSV'
        ) from None
    try:
        with CalamineWorkbook.from_path(path) as book:
            sheets = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in book.sheet_names}
    except FileNotFoundError:
        raise PipelineError(f"{path}: there is no such file") from None
    except (CalamineError, OSError, ValueError) as error:
        raise PipelineError(
            f"{path}: is not a workbook that can be read ({error}); save it as .xlsx or as CSV in UTF-8"
        ) from None
    return {name: [[_text(cell, decimal) for cell in row] for row in rows] for name, rows in sheets.items()}


def _workbook_rows(path: Path, form: TableFormat) -> Numbered:
    sheets = sheets_of(path, form.decimal or ".")
    filled = [name for name, rows in sheets.items() if any(cell.strip() for row in rows for cell in row)]
    if form.sheet is not None and form.sheet not in sheets:
        raise PipelineError(f'{path}: format: there is no sheet "{form.sheet}"{did_you_mean(form.sheet, sheets)}')
    if form.sheet is None and len(filled) > 1:
        raise PipelineError(
            f"{path}: has {len(filled)} sheets with something in them ({', '.join(filled)}); say which one is meant:"
            f" write format: {{sheet: {filled[0]}}} in study.yaml, or format: {{trials: {{sheet: {filled[0]}}}}} for"
            " one table alone"
        )
    name = form.sheet or (filled[0] if filled else next(iter(sheets)))
    return list(enumerate(sheets[name], 1))


def _text(cell: object, decimal: str) -> str:
    """A cell as it would stand in a CSV file: 3 for the number 3.0, which is how workbooks hold every whole number."""
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, float):
        whole = cell == int(cell) and abs(cell) < 2**53 if math.isfinite(cell) else False
        return str(int(cell)) if whole else repr(cell).replace(".", decimal)
    if isinstance(cell, datetime | date | time):
        return cell.isoformat()
    return "" if cell is None else str(cell)
