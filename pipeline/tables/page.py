"""docs/tables.md, written from the tables' records: `make docs`, which is `python -m pipeline.tables.page`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from pipeline.tables.catalogue import TABLES
from pipeline.tables.columns import COUNT, FLOAT, TEXT, Table
from pipeline.tables.command_tables import EXPLORE_TABLES, REPLAY_TABLES
from pipeline.tables.session_tables import SESSION_TABLES
from pipeline.words.phrases import listing

PAGE = Path(__file__).parents[2] / "docs" / "tables.md"

_HEAD = """\
# Tables

Every table that Steadyhand computes, and what each column says. This page is generated from the records in
`pipeline/tables`: change those, then run `make docs`.

Columns never vary with data or options; what does not apply is missing (null in `results.json`, an empty cell in CSV).
A column's name ends in its unit: `_mm`, `_s`, `_ns` for nanoseconds since 1970. Positions are in the tracker's frame.
`pipeline.load` gives the tables of a study as DataFrames ([notebook.md](notebook.md)). CSV files stand in the folder
`tables` of its report.
"""
_KINDS = {TEXT: "text", FLOAT: "number", COUNT: "whole number"}


def page() -> str:
    """The whole page."""
    parts = [_HEAD]
    for title, tables in _groups().items():
        parts.append(f"## {title}\n")
        parts += ["\n".join(_lines(table)) + "\n" for table in tables]
    return "\n".join(parts)


def _groups() -> Mapping[str, Sequence[Table]]:
    of_study = [table for table in TABLES.values() if table.stages and table not in SESSION_TABLES]
    return {
        "Of each session": SESSION_TABLES,
        "Of a study": of_study,
        "Of `steadyhand replay`": REPLAY_TABLES,
        "Of `steadyhand explore`": EXPLORE_TABLES,
        "Never stored": [table for table in TABLES.values() if not (table.stages or table.commands)],
    }


def _lines(table: Table) -> Iterator[str]:
    yield f"### {table.name}\n"
    yield " ".join([table.about, *_whereabouts(table)]) + "\n"
    yield "| column | type | what it says |"
    yield "|---|---|---|"
    for column in table.columns:
        yield f"| `{column.name}` | {_KINDS[column.kind]} | {column.about} |"


def _whereabouts(table: Table) -> Iterator[str]:
    """Which stages and commands write the table, and which files of a report hold it."""
    if table.stages:
        if len(table.stages) == 1:
            yield f"Written by the stage {table.stage}."
        else:
            yield f"Written by the stages {listing(list(table.stages))}; the last has it whole."
        if table.commands:
            yield f"Also written by {listing([f'`steadyhand {command}`' for command in table.commands])}."
    files = ["`results.json`"] * table.in_results + [f"`{table.name}.csv`"] * table.as_csv
    if files:
        yield f"In {listing(files)}."
    if table.checked:
        yield "`steadyhand check` watches its numbers."


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
