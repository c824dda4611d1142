"""A table's text: its encoding and separator, and its columns as figures and times.

Every column is read as text and turned to numbers when it is used: stamps in nanoseconds since 1970 have more digits
than a float holds.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import IntArray, Limits
from pipeline.statistics.arrays import FloatArray

_SEPARATORS = ",;\t"
_DIGITS = pa.decimal128(38, 9)
_NS_PER_S = 1_000_000_000
_HEAD_LINES = 60


@dataclass(frozen=True)
class Text:
    """A file's text and its first lines."""

    whole: str
    head: tuple[str, ...]


def read_text(path: Path, limits: Limits) -> Text:
    """A file's text. SessionError for one that is empty, no text, a Git LFS pointer or larger than the limit."""
    size = path.stat().st_size
    if size > limits.unpacked_bytes:
        raise SessionError(
            f"refused: a table of {size // 2**20} MiB; if it is sound, write `log_limits: {{unpacked_mib: N}}` in "
            "study.yaml"
        )
    content = path.read_bytes()
    if content.startswith(b"version https://git-lfs.github.com/spec/"):
        raise SessionError("it is a Git LFS pointer, not the log itself; run: git lfs pull")
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        whole = content.decode(encoding)
    except UnicodeDecodeError:
        whole = content.decode("cp1252", errors="replace")
    if "\0" in whole:
        raise SessionError("it is no text")
    if not whole.strip():
        raise SessionError("the file is empty")
    return Text(whole, tuple(whole[: 2**16].splitlines()[:_HEAD_LINES]))


def separator_of(line: str) -> str:
    """The separator that a header has most of; a space where it has none."""
    most = max(_SEPARATORS, key=line.count)
    return most if most in line else " "


def split_line(line: str, separator: str) -> list[str]:
    """The cells of one line, without the quotes around them."""
    import csv as stock

    return [cell.strip() for cell in next(stock.reader([line], delimiter=separator), [])]


@dataclass(frozen=True)
class Table:
    """Columns of text by their names, all of n rows, and how many lines were not of as many cells."""

    columns: Mapping[str, Any]  # pyarrow's ChunkedArrays of text
    rows: int
    lost: int = 0
    decimal_comma: bool = False

    def numbers(self, name: str) -> FloatArray:
        """A column's figures (n,); NaN for a cell that is empty or holds none."""
        column = self._plain(name)
        try:
            found = pc.cast(column, pa.float64())
        except pa.ArrowInvalid:
            found = pa.chunked_array([pa.array([_number(cell) for cell in column.to_pylist()], pa.float64())])
        return np.asarray(found.to_numpy(zero_copy_only=False), dtype=np.float64)

    def times_ns(self, name: str, unit_s: float) -> IntArray:
        """A column's times in ns (n,), exact in all its digits. ValueError where a cell holds none."""
        column = self._plain(name)
        per_unit = round(unit_s * _NS_PER_S)
        if column.null_count:
            raise ValueError(f'{column.null_count} cells of "{name}" are empty, and a reading needs a time')
        try:
            whole_units: IntArray = pc.cast(column, pa.int64()).to_numpy()
            return whole_units * per_unit
        except pa.ArrowInvalid:
            pass
        try:
            billionths = _low_words(pc.cast(column, _DIGITS))
            return billionths // (_NS_PER_S // per_unit) if per_unit < _NS_PER_S else billionths
        except pa.ArrowInvalid:
            pass
        number = self.numbers(name)
        if not np.isfinite(number).all():
            raise ValueError(f'"{name}" holds cells that are no times')
        whole = np.floor(number)
        return whole.astype(np.int64) * per_unit + np.rint((number - whole) * per_unit).astype(np.int64)

    def texts(self, name: str) -> list[str]:
        """A column's cells as text."""
        return [str(cell).strip() for cell in self.columns[name].to_pylist()]

    def _plain(self, name: str) -> Any:
        column = pc.utf8_trim_whitespace(self.columns[name])
        if self.decimal_comma:
            column = pc.replace_substring(column, ",", ".")
        return pc.if_else(pc.equal(column, ""), None, column)


def _low_words(scaled: Any) -> IntArray:
    """Decimals of nine digits as whole billionths: the lower half of their 128 bits, which times do not exceed."""
    whole = scaled.combine_chunks()
    words = np.frombuffer(whole.buffers()[1], "<i8")
    return words[2 * whole.offset : 2 * (whole.offset + len(whole)) : 2].copy()


def _number(cell: str | None) -> float:
    try:
        return float(cell) if cell else float("nan")
    except ValueError:
        return float("nan")


def table_of(lines: str, names: Sequence[str], separator: str) -> Table:
    """The lines below a header as a table. Lines with more or fewer cells are left out and counted.

    Names that stand twice get a number, as `x`, `x.1`. SessionError where nothing can be read.
    """
    lost = 0

    def leave_out(_: Any) -> str:
        nonlocal lost
        lost += 1
        return "skip"

    unique = numbered(names)
    try:
        table = csv.read_csv(
            io.BytesIO(lines.encode()),
            csv.ReadOptions(column_names=unique, use_threads=False, block_size=2**24),
            csv.ParseOptions(delimiter=separator, invalid_row_handler=leave_out),
            csv.ConvertOptions(column_types=dict.fromkeys(unique, pa.string()), strings_can_be_null=False),
        )
    except (pa.ArrowInvalid, ValueError) as error:
        raise SessionError(f"its lines cannot be read as a table: {str(error).splitlines()[0]}") from None
    comma = separator != "," and _has_decimal_commas(table)
    return Table({name: table[name] for name in unique}, table.num_rows, lost, comma)


def numbered(names: Sequence[str]) -> list[str]:
    """Names, those that stand more than once with a number."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        count = seen.get(name, 0)
        seen[name] = count + 1
        found.append(f"{name}.{count}" if count else name)
    return found


def _has_decimal_commas(table: Any) -> bool:
    first = table.slice(0, 5).to_pylist()
    cells = [cell for row in first for cell in row.values() if cell]
    return any("," in cell and not math.isnan(_number(cell.replace(",", "."))) for cell in cells)
