"""The units of a table of trials: as its headers state them, or as its values suggest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

from pipeline.study.guessing.codes import number_of
from pipeline.study.guessing.headers import UNITS, split_unit
from pipeline.study.guessing.kind import TableGuess

_METRES_MAX = 3.0  # targets that are all nearer than this are hardly given in millimetres
_TRIAL_MAX_S = 200.0  # the median of longer ones is likely in milliseconds


@dataclass(frozen=True)
class Unit:
    """A unit, and whether a header states it."""

    unit: str
    stated: bool


def in_units(table: TableGuess) -> tuple[Unit, Unit]:
    """The units of positions and of times in a table of trials."""
    places = [name for name in table.header if name.rpartition("_")[0] in UNITS and name.split("_")[1:2] != ["width"]]
    places = [name for name in places if name.startswith(("target", "selected"))]
    return _length(table, places), _time(table)


def _length(table: TableGuess, places: Sequence[str]) -> Unit:
    given = [table.written.header[table.header.index(name)] for name in places]
    if all(split_unit(name)[1] is not None or name in places for name in given):
        return Unit(places[0].rpartition("_")[2], True)
    numbers = [abs(value) for name in places for value in _numbers(table, name)]
    return Unit("m" if numbers and max(numbers) < _METRES_MAX else "mm", False)


def _time(table: TableGuess) -> Unit:
    if not {"start_s", "selection_s"} <= set(table.header):
        return Unit("s", True)
    pairs = zip(table.column("start_s"), table.column("selection_s"), strict=True)
    decimal = table.written.decimal
    lasted = [
        end - start
        for first, last in pairs
        if (start := number_of(first, decimal)) is not None and (end := number_of(last, decimal)) is not None
    ]
    return Unit("ms" if lasted and median(lasted) > _TRIAL_MAX_S else "s", False)


def _numbers(table: TableGuess, name: str) -> list[float]:
    cells = (number_of(cell, table.written.decimal) for cell in table.column(name))
    return [value for value in cells if value is not None]


def with_units(table: TableGuess, length: str, time: str) -> TableGuess:
    """A table of trials whose positions and times, now in mm and s by their names, are in these units."""
    units = {"mm": length, "s": time}

    def renamed(name: str) -> str:
        base, _, unit = name.rpartition("_")
        return f"{base}_{units.get(unit, unit)}" if base in UNITS else name

    header = tuple(renamed(name) for name in table.header)
    pairs = zip(table.written.header, header, strict=True)
    return replace(table, header=header, columns={given: name for given, name in pairs if given != name})
