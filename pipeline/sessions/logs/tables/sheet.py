"""A table as a log's topic: which columns are a vector, which the stamp, and in which units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from pipeline.sessions.logs.log import IntArray
from pipeline.statistics.arrays import FloatArray
from pipeline.study.units import M_PER_INCH

Vector = tuple[str, ...]
"""The names of a vector's columns: x, y, z, or x, y, z, w of an orientation."""

LENGTHS: Mapping[str, float] = {
    "m": 1.0,
    "meters": 1.0,
    "metres": 1.0,
    "cm": 0.01,
    "centimeters": 0.01,
    "mm": 0.001,
    "millimeters": 0.001,
    "in": M_PER_INCH,
    "inches": M_PER_INCH,
}
"""Metres of a unit, as recorders write it."""

TIMES: Mapping[str, float] = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
"""Seconds of a unit."""


class Columns(Protocol):
    """What a sheet needs of a table, whatever the file: columns by their names, all of n rows."""

    @property
    def columns(self) -> Mapping[str, Any]:
        """The columns, of which only the names matter here."""
        ...

    @property
    def rows(self) -> int:
        """How many readings there are."""
        ...

    @property
    def lost(self) -> int:
        """How many more the file has, which cannot be read."""
        ...

    def numbers(self, name: str) -> FloatArray:
        """A column's figures (n,); NaN for none."""
        ...

    def times_ns(self, name: str, unit_s: float) -> IntArray:
        """A column's times in ns (n,). ValueError where there is none."""
        ...

    def texts(self, name: str) -> list[str]:
        """A column's cells as text."""
        ...


@dataclass(frozen=True)
class Sheet:
    """One body, or one sensor, of a table.

    `vectors` names the columns of "position", "acceleration", "angular_velocity", "orientation" and "velocity", as far
    as there are; `units` how much of SI a unit of each is, where the file says it. `stamp` is the column of times,
    `time_units_s` the unit of each such column, as far as the file says it; without one, lines are `period_s` apart.
    `zero_is_missing` is true of recorders that write zeros where they lost a body.
    """

    topic: str
    kind: str
    table: Columns
    stamp: str | None
    time_units_s: Mapping[str, float] = field(default_factory=dict)
    vectors: Mapping[str, Vector] = field(default_factory=dict)
    units: Mapping[str, float] = field(default_factory=dict)
    period_s: float | None = None
    zero_is_missing: bool = False
