"""A study's tables as CSV or Parquet, with a dictionary of their columns."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.engine.result import Result
from pipeline.stages import COMPARE
from pipeline.tables import table as tables
from pipeline.tables.catalogue import TABLES
from pipeline.tables.columns import COUNT, FLOAT, TEXT, Table

DICTIONARY = "dictionary.csv"
_KINDS = {TEXT: "text", FLOAT: "number", COUNT: "whole number"}
_STAGES = {stage.name for stage in COMPARE}


def as_csv(result: Result, folder: Path) -> int:
    """Write every table that has rows as CSV, and the dictionary; how many files that are."""
    return _write(result, folder, "csv", lambda name, table: tables.write_csv(name, table.to_pandas(), folder))


def as_parquet(result: Result, folder: Path) -> int:
    """Write every table that has rows as Parquet, and the dictionary; how many files that are."""
    return _write(result, folder, "parquet", lambda name, table: pq.write_table(table, folder / f"{name}.parquet"))


def of_study(result: Result) -> Iterator[tuple[Table, pa.Table]]:
    """Every table of the study that has rows: of all sessions together, in the order of the catalogue."""
    for name, table in TABLES.items():
        if table.stage in _STAGES:
            rows = tables.read_arrow(name, [entry.folder for entry in result.entries[table.stage].values()])
            if rows.num_rows:
                yield table, rows


def _write(result: Result, folder: Path, suffix: str, write: Callable[[str, pa.Table], None]) -> int:
    written = []
    for table, rows in of_study(result):
        write(table.name, rows)
        written.append((table, rows.num_rows))
    for stale in {path.stem for path in folder.glob(f"*.{suffix}")} & TABLES.keys() - {one.name for one, _ in written}:
        (folder / f"{stale}.{suffix}").unlink()
    with (folder / DICTIONARY).open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(["table", "rows", "column", "type", "meaning"])
        for table, count in written:
            lines.writerow([table.name, count, "", "", table.about])
            for column in table.columns:
                lines.writerow([table.name, "", column.name, _KINDS[column.kind], column.about])
    return len(written) + 1
