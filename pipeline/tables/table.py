"""Tables as DataFrames, in Arrow, and in files, always with exactly the columns and types of their records."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pipeline.errors import DamagedTableError
from pipeline.tables.catalogue import TABLES
from pipeline.tables.columns import COUNT, FLOAT, TEXT

pa.set_memory_pool(pa.system_memory_pool())  # the default pool would keep the memory of thousands of small tables

_MANY = pd.StringDtype("pyarrow")
_PANDAS = {  # as a frame holds them
    TEXT: (pd.StringDtype("python"), _MANY),
    COUNT: (pd.Int64Dtype(),),
    FLOAT: (np.dtype("float64"),),
}
FEW_ROWS = 512
_SMALL = 512  # rows
_SMALL_BYTES = 2**24
ROWS_AT_ONCE = 2**18
"""Rows of a part of a large table: some tens of megabytes."""
LOOKED_AT = 2**19  # rows: a page or a figure shows far fewer
_PARTS = 256  # tables that are read before they are merged: each takes far more memory than its few rows
_LINES_AT_ONCE = 2**16
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet runs a cell that begins like this


Row = dict[str, Any]
"""A row of a table, by column."""


def frame(name: str, rows: Iterable[Row]) -> pd.DataFrame:
    """Rows as a table. Raises KeyError for a column that the table does not have, which is a programming error."""
    listed = list(rows)
    _known_columns(name, listed)
    if not listed:
        return _empty(name, _text(0)).copy(deep=False)
    # Each column by itself and of its own type: a frame of unlike values, converted, takes five times as long.
    columns = TABLES[name].columns
    return pd.DataFrame(
        {column.name: _listed([row.get(column.name) for row in listed], column.kind) for column in columns}
    )


def _listed(values: list[Any], kind: pa.DataType) -> Any:
    """Values of one column, None where there is none, as a frame holds them."""
    if kind == FLOAT:
        return np.array(values, dtype=np.float64)
    return pd.array(values, dtype=_text(len(values)) if kind == TEXT else pd.Int64Dtype())


@cache
def _empty(name: str, _: Any) -> pd.DataFrame:
    """A comparison has some twenty tables, most of them without rows; converting each column of these took longest.

    Its text is of the type given, which is that of all tables at the time.
    """
    return as_table(name, pd.DataFrame(columns=TABLES[name].names))


def of_rows(name: str, rows: Iterable[Row]) -> pa.Table:
    """As `frame`, but an Arrow table, which takes a tenth of the time for few rows.

    Values must have the columns' types; NaN becomes null.
    """
    listed = list(rows)
    columns = _known_columns(name, listed)
    schema = TABLES[name].schema
    arrays = [
        pa.array([row.get(column) for row in listed], kind, from_pandas=True)
        for column, kind in zip(columns, schema.types, strict=True)
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def _known_columns(name: str, rows: Sequence[Row]) -> list[str]:
    """The table's columns. Raises KeyError for a row that has any other."""
    columns = TABLES[name].names
    for row in rows:
        unknown = row.keys() - set(columns)
        if unknown:
            raise KeyError(f"table {name} has no column {', '.join(sorted(unknown))}")
    return columns


def of_columns(name: str, length: int, columns: Mapping[str, Any]) -> pa.Table:
    """An Arrow table of `length` rows from arrays (length,) and from single values, which hold for every row.

    A column that is not given is null, and so is NaN.
    """
    arrays = []
    for column in TABLES[name].columns:
        value = columns.get(column.name)
        if isinstance(value, np.ndarray):
            arrays.append(pa.array(value, column.kind, from_pandas=True))
        else:
            arrays.append(pa.repeat(pa.scalar(value, column.kind), length))
    return pa.Table.from_arrays(arrays, schema=TABLES[name].schema)


def as_table(name: str, data: pd.DataFrame) -> pd.DataFrame:
    """A frame with exactly the table's columns, in its order and types."""
    columns = TABLES[name].columns
    if data.columns.tolist() == TABLES[name].names and all(
        held in _PANDAS[column.kind] for held, column in zip(data.dtypes, columns, strict=True)
    ):
        return data.copy(deep=False)
    converted = {}
    for column in columns:
        known = column.name in data
        converted[column.name] = _typed(data[column.name], column.kind) if known else _missing(column.kind, data.index)
    return pd.DataFrame(converted, index=data.index)


def _missing(kind: pa.DataType, index: pd.Index) -> pd.Series:
    if kind == FLOAT:
        return pd.Series(np.nan, index=index, dtype="float64")
    return pd.Series(pd.NA, index=index, dtype=_text(len(index)) if kind == TEXT else "Int64")


def _typed(values: pd.Series, kind: pa.DataType) -> pd.Series:
    if values.dtype in _PANDAS[kind]:
        return values
    if kind == TEXT:
        return values.astype(_text(len(values)))
    if kind == FLOAT:
        return pd.to_numeric(values).astype("float64")
    return pd.to_numeric(values).astype("Int64")


def write(name: str, data: pd.DataFrame | pa.Table, folder: Path) -> None:
    """Write `<name>.parquet`. Small tables are not compressed: unpacking would take most of the time to read them."""
    if len(data) == 0:
        data = TABLES[name].schema.empty_table()
    elif isinstance(data, pd.DataFrame):
        data = as_arrow(name, data)
    with pa.OSFile(str(folder / f"{name}.parquet"), "wb") as file:
        if len(data):
            pq.write_table(data.replace_schema_metadata(None), file, **_as_file(name, len(data) <= _SMALL))
        else:
            file.write(_empty_file(name))


def as_arrow(name: str, data: pd.DataFrame) -> pa.Table:
    """A frame as an Arrow table with exactly the table's columns, in its order and types."""
    schema = TABLES[name].schema
    if len(data) == 0:
        return schema.empty_table()
    data = as_table(name, data)
    # Column by column: `Table.from_pandas` also makes metadata for pandas, which is not kept.
    columns = [pa.array(data[column.name], column.type, from_pandas=True) for column in schema]
    return pa.Table.from_arrays(columns, schema=schema)


@cache
def _empty_file(name: str) -> bytes:
    """The file of a table without rows."""
    with pa.BufferOutputStream() as file:
        pq.write_table(TABLES[name].schema.empty_table(), file, **_as_file(name, small=True))
        content: bytes = file.getvalue().to_pybytes()
    return content


def _has_none(name: str, path: Path) -> bool:
    """Whether a file is that of a table without rows, as most are; opening it takes most of the time to read it."""
    with suppress(OSError):  # which reading it as any other will meet again
        return path.stat().st_size == len(_empty_file(name)) and path.read_bytes() == _empty_file(name)
    return False


def write_parts(name: str, parts: Iterable[pa.Table], folder: Path) -> None:
    """Write a table that is given part by part: of a large one no more than some parts are in memory."""
    waiting, rows, coming = [TABLES[name].schema.empty_table()], 0, iter(parts)
    for part in coming:
        waiting.append(part)
        rows += len(part)
        if rows > ROWS_AT_ONCE:
            break
    else:
        write(name, pa.concat_tables(waiting).combine_chunks(), folder)
        return
    with (
        pa.OSFile(str(folder / f"{name}.parquet"), "wb") as file,
        pq.ParquetWriter(file, TABLES[name].schema, **_as_file(name, small=False)) as writer,
    ):
        writer.write_table(pa.concat_tables(waiting).combine_chunks(), row_group_size=ROWS_AT_ONCE)
        del waiting
        for part in coming:
            writer.write_table(part, row_group_size=ROWS_AT_ONCE)


def _as_file(name: str, small: bool) -> dict[str, Any]:
    """How a table is encoded in its file."""
    columns = TABLES[name].columns
    floats = [column.name for column in columns if column.kind == FLOAT]
    times = [column.name for column in columns if column.name.endswith("_ns")]
    encodings = dict.fromkeys(floats, "BYTE_STREAM_SPLIT") | dict.fromkeys(times, "DELTA_BINARY_PACKED")
    plain = [name for name in TABLES[name].names if name not in encodings]
    return {
        "compression": "none" if small else "zstd",
        "use_dictionary": False if small else plain,
        "column_encoding": None if small else encodings,
        "store_schema": False,
        "write_page_checksum": True,
    }


def write_csv(name: str, data: pd.DataFrame, folder: Path) -> None:
    """Write `<name>.csv`; text that a spreadsheet would run as a formula gets an apostrophe in front."""
    table = as_table(name, data)
    with (folder / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")  # half of the time of pandas, and the same bytes
        rows.writerow(table.columns)
        for begin in range(0, len(table), _LINES_AT_ONCE):
            part = table.iloc[begin : begin + _LINES_AT_ONCE]
            rows.writerows(zip(*(_cells(part[column]) for column in part), strict=True))


def _cells(column: pd.Series) -> list[Any]:
    """A column's values as Python's, None where there is none; a formula with an apostrophe in front."""
    cells: np.ndarray[Any, Any]
    if column.dtype == np.float64:
        cells = column.to_numpy()
        missing = np.isnan(cells)
        if missing.any():
            cells = cells.astype(object)
            cells[missing] = None
    else:
        cells = np.array(column, dtype=object)
        cells[column.isna().to_numpy()] = None
    listed: list[Any] = cells.tolist()
    risky = {cell for cell in set(listed) if isinstance(cell, str) and cell.startswith(_FORMULA)}
    return [f"'{cell}" if cell in risky else cell for cell in listed] if risky else listed


def read(name: str, folders: Path | Sequence[Path]) -> pd.DataFrame:
    """Read a table from one or many folders; a folder without it counts as empty."""
    table = read_arrow(name, folders)
    if len(table) == 0:
        return _empty(name, _text(0)).copy(deep=False)
    return _as_frame(table)


def _as_frame(table: pa.Table) -> pd.DataFrame:
    # Straight to the types of `as_table`: by way of Python objects it takes three times as long.
    types = {TEXT: _text(len(table)), COUNT: pd.Int64Dtype()}
    frame: pd.DataFrame = table.to_pandas(types_mapper=types.get)
    return frame


def _text(rows: int) -> Any:
    """Of few rows as pandas is set to: Python's while a stage runs, which takes less time. Of many Arrow's.

    Arrow's is a quarter as large.
    """
    return pd.StringDtype() if rows <= FEW_ROWS else _MANY


def read_arrow(name: str, folders: Path | Sequence[Path]) -> pa.Table:
    """As `read`, but an Arrow table. Both raise DamagedTableError for a file that is not what was written."""
    merged, parts = [], []
    for folder in [folders] if isinstance(folders, Path) else folders:
        with suppress(FileNotFoundError):
            path = folder / f"{name}.parquet"
            parts.append(TABLES[name].schema.empty_table() if _has_none(name, path) else _read_file(name, path))
        if len(parts) == _PARTS:
            merged.append(pa.concat_tables(parts).combine_chunks())
            parts = []
    return pa.concat_tables([*merged, *parts]) if merged or parts else TABLES[name].schema.empty_table()


def rows(name: str, folder: Path) -> int:
    """How many rows a table has; none where there is no such file."""
    with suppress(FileNotFoundError), _opened(name, folder / f"{name}.parquet") as file:
        return int(file.metadata.num_rows)
    return 0


def read_parts(name: str, folder: Path, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
    """As `read_arrow` of one folder, some rows after the other: of a large table they are never in memory together."""
    with suppress(FileNotFoundError), _opened(name, folder / f"{name}.parquet") as file:
        left = file.metadata.num_rows
        for group in range(file.num_row_groups):
            part = file.read_row_group(group, columns, use_threads=False)
            left -= len(part)
            yield part
        if left:
            raise DamagedTableError(folder / f"{name}.parquet")


def read_thinned(name: str, folder: Path) -> pd.DataFrame:
    """As `read` of one folder, for what is looked at: of a table of millions of rows every n-th, some 500 000."""
    every = -(-rows(name, folder) // LOOKED_AT)
    if every <= 1:
        return read(name, folder)
    kept, begin = [], 0
    for part in read_parts(name, folder):
        kept.append(part.take(np.arange(-begin % every, len(part), every)))
        begin += len(part)
    return _as_frame(pa.concat_tables(kept))


def _read_file(name: str, path: Path) -> pa.Table:
    with _opened(name, path) as file:
        table = file.read(use_threads=False)
        if len(table) != file.metadata.num_rows:
            raise DamagedTableError(path)
        return table


@contextmanager
def _opened(name: str, path: Path) -> Iterator[pq.ParquetFile]:
    """Raises DamagedTableError where a checksum, the columns or the number of rows differ from what was written.

    The pages have checksums. What stands beside them in the file has none, but where a bit of it changes, the file
    cannot be read, or the columns are others, or the two numbers of rows in it differ.
    """
    try:
        # Opening a file takes longer than reading a small table from memory.
        small = path.stat().st_size <= _SMALL_BYTES
        with pa.BufferReader(path.read_bytes()) if small else pa.OSFile(str(path)) as content:
            file = pq.ParquetFile(content, page_checksum_verification=True)
            if file.schema_arrow != TABLES[name].schema:
                raise DamagedTableError(path)
            yield file
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException):
        raise DamagedTableError(path) from None


def give_back(rows: int) -> None:
    """Let the system have the memory of what was freed, after work with so many rows.

    Else it stays with the process, as pieces between others, and a long session takes half as much again.
    """
    if rows > ROWS_AT_ONCE:
        pa.default_memory_pool().release_unused()


Columns = Mapping[str, np.ndarray[Any, Any]]
"""Columns of a table by name, (n,) each."""


def of_stream(table: pa.Table, stream: str) -> Columns:
    """The numbers in one stream's rows as arrays (n,), NaN where they are null; times are in ns.

    Each is made when it is asked for: together they take as much memory as the table does.
    """
    return matching(table, "stream", stream)


def matching(table: pa.Table, column: str, value: str) -> Columns:
    """As `of_stream`, of the rows that have this value in a column."""
    numbers = table.select([column.name for column in table.schema if column.type != TEXT])
    own = pc.equal(table[column], value)
    return _Numbers(numbers if pc.all(own).as_py() else numbers.filter(own))


class _Numbers(Mapping[str, "np.ndarray[Any, Any]"]):
    def __init__(self, table: pa.Table) -> None:
        self._table = table

    def __getitem__(self, name: str) -> np.ndarray[Any, Any]:
        column: np.ndarray[Any, Any] = self._table[name].to_numpy()
        return column

    def __iter__(self) -> Iterator[str]:
        return iter(self._table.column_names)

    def __len__(self) -> int:
        return len(self._table.column_names)


def records(name: str, data: pd.DataFrame | pa.Table) -> Iterator[dict[str, Any]]:
    """Rows as plain objects for JSON, None for what does not apply; `details` and `factors` stay text."""
    table = data if isinstance(data, pa.Table) else as_arrow(name, data)
    for part in table.to_batches(max_chunksize=_LINES_AT_ONCE):
        for row in part.to_pylist():
            yield {key: _plain(value) for key, value in row.items()}


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not isfinite(value) else value


def participant_means(measures: pd.DataFrame, measure: str, conditions: Sequence[str]) -> pd.DataFrame:
    """One row per participant and one column per condition, in the given order: means over all else, or NaN."""
    counts = (measures["measure"] == measure) & measures["value"].notna()
    # By the numbers of cells: to group by two texts and to pivot takes half as long again.
    people, names = pd.factorize(measures["participant"][counts], sort=True)
    places, met = pd.factorize(measures["condition"][counts], sort=True)
    means = measures["value"][counts].groupby(people * len(met) + places).mean()
    by_met = np.full((len(names), len(met)), np.nan)
    by_met.flat[means.index] = means
    columns = pd.Index(list(conditions), name="condition")
    wide = np.full((len(names), len(columns)), np.nan)
    for place, of_met in enumerate(met.get_indexer(columns)):
        if of_met >= 0:
            wide[:, place] = by_met[:, of_met]
    return pd.DataFrame(wide, index=names.rename("participant"), columns=columns, copy=False)
