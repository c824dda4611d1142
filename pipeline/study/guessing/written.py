"""How a file with a table was written: encoding, separator, decimals, sheets, and in which row its header stands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import PipelineError
from pipeline.study.fields import identifier
from pipeline.study.guessing.headers import meaning
from pipeline.study.guessing.qualtrics import header_rows
from pipeline.study.guessing.text import decimal_of, encoding_of, separator_of
from pipeline.study.table_settings import TableFormat
from pipeline.study.table_text import WORKBOOKS, is_workbook, read_rows, sheets_of

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", *WORKBOOKS)
_TITLE_ROWS = 12

Form = dict[str, str | int]
"""What `format` in study.yaml says of a table."""


@dataclass(frozen=True)
class Written:
    """A table as it stands in its file: `form` is what `format` would say, `cells` the rows below the header."""

    path: Path
    form: Form
    header: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]

    name: str = ""
    """Its path in the study folder."""

    described: tuple[str, ...] = ()
    """What each column holds, in words, where a further row of the header says it."""

    @property
    def decimal(self) -> str:
        """The mark before the decimals."""
        return str(self.form.get("decimal", "."))

    def column(self, name: str) -> list[str]:
        """The cells of a column."""
        place = self.header.index(name)
        return [row[place] for row in self.cells]


@dataclass(frozen=True)
class NotUsed:
    """A file that is no table of a study, or not one that can be guessed, with the reason."""

    path: Path
    reason: str


def tables_in(path: Path, participant: Sequence[str] = ()) -> list[Written | NotUsed]:
    """The tables of a file, one for each sheet of a workbook. `participant` are further headers of participants."""
    try:
        found = [(form, _table(path, form, participant)) for form in _forms(path)]
    except PipelineError as error:
        return [NotUsed(path, str(error).removeprefix(f"{path}: "))]
    return [
        NotUsed(path, f'sheet "{form["sheet"]}": {one.reason}') if isinstance(one, NotUsed) and "sheet" in form else one
        for form, one in found
    ]


def _forms(path: Path) -> Iterator[Form]:
    """How the tables of a file are probably written."""
    if is_workbook(path):
        sheets = {name: rows for name, rows in sheets_of(path).items() if any(any(row) for row in rows)}
        for name, rows in sheets.items():
            comma: Form = {"decimal": ","} if decimal_of(cell for row in rows for cell in row) == "," else {}
            yield {**comma, **({"sheet": name} if len(sheets) > 1 else {})}
        return
    content = path.read_bytes()
    encoding = encoding_of(content)
    text = content.decode(encoding, errors="replace")
    separator = separator_of(text)
    form: Form = {} if separator == "," else {"separator": {"\t": "tab", " ": "space"}.get(separator, separator)}
    if separator != "," and decimal_of(cell for line in text.splitlines() for cell in line.split(separator)) == ",":
        form["decimal"] = ","
    if encoding != "utf-8":
        form["encoding"] = encoding
    yield form


def _table(path: Path, form: Form, participant: Sequence[str]) -> Written | NotUsed:
    """The table from its header on: the first row that names the participants, else the first one."""
    rows = read_rows(path, TableFormat.model_validate(form))
    if not rows:
        return NotUsed(path, "it is empty")
    titles = rows[:_TITLE_ROWS]
    start = next((at for at, (_, row) in enumerate(titles) if any(_names_people(c, participant) for c in row)), 0)
    header = [str(identifier(cell.strip())) for cell in rows[start][1]]
    while header and not header[-1]:
        header.pop()
    described = header_rows([row for _, row in rows[start:]])
    cells = tuple(tuple(str(identifier(cell.strip())) for cell in row) for _, row in rows[start + described :])
    if any(len(row) < len(header) or any(row[len(header) :]) for row in cells):
        return NotUsed(path, "its rows are not all as long as its header")
    if not all(header) or len(set(header)) < len(header):
        return NotUsed(path, "a column has no name, or two have the same one")
    if not cells:
        return NotUsed(path, "it has no rows below its header")
    row_of_header: Form = {"header_row": rows[start][0]} if start else {}
    if described > 1:
        row_of_header["header_rows"] = described
    words = tuple(cell.strip() for cell in rows[start + 1][1][: len(header)]) if described > 1 else ()
    whole = tuple(row[: len(header)] for row in cells)
    return Written(path, {**form, **row_of_header}, tuple(header), whole, described=words)


def _names_people(cell: str, participant: Sequence[str]) -> bool:
    return cell.strip() in participant or meaning(cell.strip()) == "participant"
