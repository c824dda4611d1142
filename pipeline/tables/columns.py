"""The record of a table, its columns, and the columns that several tables share.

The records stand in `session_tables`, `recording_tables`, `study_tables` and `command_tables`; `catalogue` has all of
them by name.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import pyarrow as pa

S_PER_NS = 1e-9
"""Times in tables are whole nanoseconds; seconds are for people and for fusion_core."""
NS_PER_S = 1e9

TEXT, FLOAT, COUNT = pa.string(), pa.float64(), pa.int64()
"""The three types a column can have."""


class Column(NamedTuple):
    """A column: its name, which ends in the unit, its type, and what it holds, with the unit if the name has none."""

    name: str
    kind: pa.DataType
    about: str


@dataclass(frozen=True)
class Table:
    """A table. Everything that lists tables derives from these records.

    `about` says what a row stands for. `stages` of a study write the table, in this order, and the last of them has it
    completely; `commands` such as replay may write it too. `key` are the text columns that tell the rows
    of results.json apart. `in_results`: its rows stand in results.json. `as_csv`: it is written as CSV beside the
    report. `checked`: `steadyhand check` expects its numbers to stay the same.
    """

    name: str
    about: str
    columns: tuple[Column, ...]
    stages: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    key: tuple[str, ...] = ()
    in_results: bool = False
    as_csv: bool = False
    checked: bool = False

    @cached_property
    def schema(self) -> pa.Schema:
        """The columns as an Arrow schema."""
        return pa.schema([(column.name, column.kind) for column in self.columns])

    @cached_property
    def names(self) -> list[str]:
        """The columns' names in order."""
        return [column.name for column in self.columns]

    @property
    def stage(self) -> str:
        """The stage that has the complete table; empty for a table that no stage of a study writes."""
        return self.stages[-1] if self.stages else ""


def text(name: str, about: str) -> Column:
    """A column of text."""
    return Column(name, TEXT, about)


def number(name: str, about: str) -> Column:
    """A column of numbers."""
    return Column(name, FLOAT, about)


def count(name: str, about: str) -> Column:
    """A column of whole numbers."""
    return Column(name, COUNT, about)


def each(name: str, about: str, axes: Iterable[str] = "xyz") -> tuple[Column, ...]:
    """A column of numbers for each axis; the axis replaces {} in the name and in the description."""
    return tuple(number(name.format(axis), about.format(axis)) for axis in axes)


# Columns that several tables share --------------------------------------------------------------------------------

SESSION = text("session", "id of the session: its log's file name without the suffix")
PARTICIPANT = text("participant", "id of the participant")
CONDITION = text("condition", "the condition, as study.yaml names it")
WHO = (PARTICIPANT, CONDITION, SESSION)
TRIAL = count("trial", "number of the trial within its session")
STUDY = text("study", "name of the study's folder")
STREAM = text("stream", "the sensor stream, as study.yaml names it")
ESTIMATOR = text("estimator", "the estimator, as study.yaml names it")
VARIANT = text("variant", "an estimator with other settings, as in fusion[window=3]; null for the study's own settings")
MEASURE = text("measure", "name of the dependent variable; a rating is named as in nasa_tlx/effort")
FACTORS = text("factors", "levels of further factors as a JSON object; null where there are none")
STAMPED = count("time_ns", "the stamp as it stands in the log, since 1970")
ARRIVAL = count("arrival_ns", "when the message was logged, since 1970")
POSITION = each("{}_mm", "position along {} in the tracker's frame")
TARGET = each("target_{}_mm", "the target's {}; null on an axis that the target does not have")
CI_LOW = number("ci_low", "lower end of its 95 % interval")
CI_HIGH = number("ci_high", "upper end of its 95 % interval")
DF1 = number("df1", "first (numerator) degrees of freedom, uncorrected for sphericity")
DF2 = number("df2", "second (denominator) degrees of freedom, or the only ones")
P = number("p", "p value, before any correction or adjustment; null for a Bayes factor")
STATISTIC_NAME = text("statistic_name", "what the statistic is: t, F, chi2, W+, BF10")
STATISTIC = number("statistic", "its value, without a unit")
ERROR = number("position_error_mm", "distance from the target, over the axes that the target has")
SQUARED_ERROR = number("squared_error_mm2", "the same, squared")
