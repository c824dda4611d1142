"""Columns of a table as figures and times.

Every column is parsed once, to whole numbers or floats where all its cells are such. Times are exact to the nanosecond:
stamps since 1970 have more digits than a float holds, so a column of such is read a second time, as text.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.logs.tables.text import split_line
from pipeline.statistics.arrays import FloatArray

_DIGITS = pa.decimal128(38, 9)
_NS_PER_S = 1_000_000_000
_EXACT_S = 4e6  # up to here a float tells nanoseconds apart, with one to spare
_BLOCK_BYTES = 2**24
_SAMPLE_LINES, _SAMPLE_BYTES = 5, 2**14


@dataclass(frozen=True)
class _Lines:
    """The lines below a header, and how their cells are written."""

    text: bytes | memoryview
    names: tuple[str, ...]
    separator: str
    decimal_comma: bool

    def parsed(self, names: Sequence[str] | None, texts: Sequence[str]) -> tuple[Any, int]:
        """Columns (None: all), some as text, and how many lines are left out for the number of their cells."""
        lost = 0

        def leave_out(_: Any) -> str:
            nonlocal lost
            lost += 1
            return "skip"

        table = csv.read_csv(
            pa.BufferReader(pa.py_buffer(self.text)),
            csv.ReadOptions(column_names=self.names, use_threads=False, block_size=_BLOCK_BYTES),
            csv.ParseOptions(delimiter=self.separator, invalid_row_handler=leave_out),
            csv.ConvertOptions(
                column_types=dict.fromkeys(texts, pa.string()),
                include_columns=names,
                strings_can_be_null=False,
                null_values=[""],
                true_values=[],
                false_values=[],
                timestamp_parsers=[],
                decimal_point="," if self.decimal_comma else ".",
            ),
        )
        return table, lost


@dataclass(frozen=True)
class Table:
    """Columns by their names, all of n rows, and how many lines were not of as many cells."""

    lines: _Lines
    parsed: Any  # pyarrow's
    lost: int = 0
    _texts: dict[str, Any] = field(default_factory=dict)

    @property
    def columns(self) -> Mapping[str, int]:
        """The place of each column."""
        return {name: place for place, name in enumerate(self.lines.names)}

    @property
    def rows(self) -> int:
        """How many lines could be read."""
        return int(self.parsed.num_rows)

    def numbers(self, name: str) -> FloatArray:
        """A column's figures (n,); NaN for a cell that is empty or holds none."""
        column = self.parsed[name]
        if not _is_number(column):
            column = self._plain(name)
            try:
                column = pc.cast(column, pa.float64())
            except pa.ArrowInvalid:
                column = pa.array([_number(cell) for cell in column.to_pylist()], pa.float64())
        return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)

    def times_ns(self, name: str, unit_s: float) -> IntArray:
        """A column's times in ns (n,), exact in all its digits. ValueError where a cell holds none."""
        per_unit = round(unit_s * _NS_PER_S)
        column = self.parsed[name]
        empty = column.null_count if _is_number(column) else self._plain(name).null_count
        if empty:
            raise ValueError(f'{empty} cells of "{name}" are empty, and a reading needs a time')
        if pa.types.is_integer(column.type):
            return column.to_numpy().astype(np.int64) * per_unit  # type: ignore[no-any-return]
        if not (_is_number(column) and _farthest(column) * unit_s < _EXACT_S):
            exact = self._exact_ns(name, per_unit)
            if exact is not None:
                return exact
        number = self.numbers(name)
        if not np.isfinite(number).all():
            raise ValueError(f'"{name}" holds cells that are no times')
        whole = np.floor(number)
        return whole.astype(np.int64) * per_unit + np.rint((number - whole) * per_unit).astype(np.int64)

    def texts(self, name: str) -> list[str]:
        """A column's cells as text."""
        return [str(cell).strip() for cell in self._text(name).to_pylist()]

    def _exact_ns(self, name: str, per_unit: int) -> IntArray | None:
        """Times by their decimal digits; None where a cell has more of them, or no plain number."""
        try:
            billionths = _low_words(pc.cast(self._plain(name), _DIGITS))
        except pa.ArrowInvalid:
            return None
        return billionths // (_NS_PER_S // per_unit) if per_unit < _NS_PER_S else billionths

    def _text(self, name: str) -> Any:
        if name not in self._texts:
            kept = self.parsed[name]
            self._texts[name] = kept if kept.type == pa.string() else self.lines.parsed([name], [name])[0][name]
        return self._texts[name]

    def _plain(self, name: str) -> Any:
        """A column's cells as text, numbers with a decimal point, none where they are empty."""
        column = pc.utf8_trim_whitespace(self._text(name))
        if self.lines.decimal_comma:
            column = pc.replace_substring(column, ",", ".")
        return pc.if_else(pc.equal(column, ""), None, column)


def _is_number(column: Any) -> bool:
    return bool(pa.types.is_integer(column.type) or pa.types.is_floating(column.type))


def _farthest(column: Any) -> float:
    return float(np.abs(column.to_numpy()).max(initial=0.0))


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


def table_of(lines: bytes | memoryview, names: Sequence[str], separator: str, stamp: str | None = None) -> Table:
    """The lines below a header as a table. Lines with more or fewer cells are left out and counted.

    Names that stand twice get a number, as `x`, `x.1`. `stamp` is a column of times since 1970 that are no whole
    numbers, which is read as text at once. SessionError where nothing can be read.
    """
    comma = separator != "," and _has_decimal_commas(lines, separator)
    written = _Lines(lines, tuple(numbered(names)), separator, comma)
    try:
        try:
            return Table(written, *written.parsed(None, () if stamp is None else (stamp,)))
        except pa.ArrowInvalid:  # a cell far below is of another type than the first ones
            return Table(written, *written.parsed(None, written.names))
    except (pa.ArrowInvalid, ValueError) as error:
        raise SessionError(f"its lines cannot be read as a table: {str(error).splitlines()[0]}") from None


def numbered(names: Sequence[str]) -> list[str]:
    """Names, those that stand more than once with a number."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        count = seen.get(name, 0)
        seen[name] = count + 1
        found.append(f"{name}.{count}" if count else name)
    return found


def _has_decimal_commas(lines: bytes | memoryview, separator: str) -> bool:
    first = bytes(lines[:_SAMPLE_BYTES]).split(b"\n")[:_SAMPLE_LINES]
    cells = [cell for line in first for cell in split_line(line.decode(errors="replace"), separator)]
    return any("," in cell and not math.isnan(_number(cell.replace(",", "."))) for cell in cells)
