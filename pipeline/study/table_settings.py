"""How a study's own tables are written: `format`, `columns`, `wide`, `practice` and `factors` in study.yaml."""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_serializer, model_validator

from pipeline.study.fields import Frozen, Id, known, unique
from pipeline.study.session import PLACEHOLDER

TableName = Literal["participants", "trials", "questionnaires", "measures"]

_SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " "}


class TableFormat(Frozen):
    """How one table is written. What is not stated is as in a plain CSV file: commas, points, UTF-8, header first.

    Of `header_rows`, the first names the columns and the others only describe them, as in exports of Qualtrics.
    """

    separator: str | None = None
    decimal: Literal[".", ","] | None = None
    encoding: str | None = None
    sheet: Id | None = None
    header_row: Annotated[int, Field(ge=1, le=1000)] | None = None
    header_rows: Annotated[int, Field(ge=1, le=10)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _separator_by_name(cls, given: Any) -> Any:
        """`separator: tab` is easier to write than "\\t"."""
        if isinstance(given, dict) and given.get("separator") in _SEPARATORS:
            return {**given, "separator": _SEPARATORS[given["separator"]]}
        return given

    @model_validator(mode="after")
    def _can_be_read(self) -> TableFormat:
        if self.separator is not None and len(self.separator) != 1:
            raise ValueError(f'separator should be one character, such as ";", or tab; found "{self.separator}"')
        if self.separator is not None and self.separator == self.decimal:
            raise ValueError(f'separator and decimal are both "{self.separator}"; they must differ')
        if self.encoding is not None:
            try:
                codecs.lookup(self.encoding)
            except LookupError:
                raise ValueError(f'encoding "{self.encoding}" is not known; utf-8 or cp1252 is likely meant') from None
        return self

    def over(self, usual: TableFormat) -> TableFormat:
        """This format, with what it does not state taken from `usual`."""
        stated = {name: getattr(self, name) for name in TableFormat.model_fields}
        return TableFormat(**{k: getattr(usual, k) if value is None else value for k, value in stated.items()})


class Formats(TableFormat):
    """The format of all tables, and of single ones that differ from it."""

    participants: TableFormat = TableFormat()
    trials: TableFormat = TableFormat()
    questionnaires: TableFormat = TableFormat()
    measures: TableFormat = TableFormat()

    def of(self, table: str) -> TableFormat:
        """The format of a table, such as `trials`."""
        own = getattr(self, table, TableFormat())
        return own.over(TableFormat(**{name: getattr(self, name) for name in TableFormat.model_fields}))


_Headers = Mapping[Id, Id]
"""A table's own headers, each with the column that it means."""


def _one_header_each(headers: _Headers) -> _Headers:
    unique("columns", tuple(headers.values()))
    return headers


Headers = Annotated[_Headers, AfterValidator(_one_header_each)]


class Columns(Frozen):
    """The tables' own headers: `{trials: {Teilnehmer: participant}}`."""

    participants: Headers = Field(default={})
    trials: Headers = Field(default={})
    questionnaires: Headers = Field(default={})
    measures: Headers = Field(default={})


def _is_a_wide_entry(entry: Mapping[str, str | tuple[str, ...]]) -> Mapping[str, str | tuple[str, ...]]:
    """Check that exactly one key says which columns hold values."""
    pattern = entry.get(PATTERN)
    lists = [key for key, value in entry.items() if not isinstance(value, str)]
    if isinstance(pattern, str):
        if not PLACEHOLDER.findall(pattern):
            raise ValueError(f'columns: "{pattern}" has no placeholder, such as {{condition}}_{{measure}}')
        unique("columns: placeholder", tuple(PLACEHOLDER.findall(pattern)))
    if len(lists) + isinstance(pattern, str) != 1 or PATTERN in lists:
        raise ValueError(
            "needs one list of the columns that hold values, such as measure: [time_s, errors], or a pattern of their"
            ' names, such as columns: "{condition}_{measure}"'
        )
    return entry


PATTERN = "columns"
"""The key of a wide table's entry that holds a pattern of headers instead of a list of them."""

WideEntry = Annotated[
    Mapping[Id, Id | Annotated[tuple[Id, ...], Field(min_length=1)]],
    AfterValidator(_is_a_wide_entry),
]


def _one_alone(value: object) -> object:
    return [value] if isinstance(value, dict) else value


class Wide(Frozen):
    """Tables that have several values in a row: which columns hold them, and what their headers say.

    `measure: [time_s, errors]` says that these columns are a measure each; `condition: [kinect, fusion]` with
    `measure: time_s` that they hold one measure under each condition.
    """

    questionnaires: Annotated[tuple[WideEntry, ...], BeforeValidator(_one_alone)] = ()
    measures: Annotated[tuple[WideEntry, ...], BeforeValidator(_one_alone)] = ()


class Practice(Frozen):
    """Trials that people did to practise: the first ones of each session, or those that a column marks."""

    trials: Annotated[int, Field(ge=1, le=100_000)] | None = None
    column: Id | None = None
    marks: tuple[Id, ...] = ()

    @model_validator(mode="after")
    def _one_way(self) -> Practice:
        if (self.trials is None) == (self.column is None):
            raise ValueError("needs either trials, how many come first, or column, which column marks them")
        if self.marks and self.column is None:
            raise ValueError("marks are the values of column that mark a practice trial, and there is no column")
        return self


class Factor(Frozen):
    """A column that tells cells or groups apart; `levels` in their order, by the alphabet or their size if not stated.

    Written `between`, `within`, a list of levels, or `{between: [novice, expert]}`.
    """

    kind: Literal["between", "within"]
    levels: tuple[Id, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _from_short_form(cls, given: Any) -> Any:
        if isinstance(given, str):
            known("factors", given, ("between", "within"))
            return {"kind": given}
        if isinstance(given, list | tuple):
            return {"kind": "within", "levels": given}
        if isinstance(given, dict) and "kind" not in given:
            if len(given) != 1:
                raise ValueError("should be between, within, or levels in their order: {between: [novice, expert]}")
            ((kind, levels),) = given.items()
            known("factors", str(kind), ("between", "within"))
            return {"kind": kind, "levels": levels}
        return given

    @model_validator(mode="after")
    def _levels_differ(self) -> Factor:
        unique("levels", self.levels)
        return self

    @model_serializer
    def _short_form(self) -> object:
        return {self.kind: list(self.levels)} if self.levels else self.kind


def headers_of_pattern(pattern: str, conditions: tuple[str, ...], questionnaires: tuple[str, ...]) -> re.Pattern[str]:
    """The expression for headers of a wide table, such as `{condition}_{measure}`.

    A condition is one of study.yaml, a trial or period a number; a questionnaire that is known is found whole though
    its name has the separator in it, as `nasa_tlx_mental`.
    """
    anything = "[^_]+?" if pattern.count("_") else ".+?"
    pieces = PLACEHOLDER.split(pattern)
    names = [piece for index, piece in enumerate(pieces) if index % 2]
    free = {
        "condition": "|".join(re.escape(name) for name in sorted(conditions, key=len, reverse=True)),
        "trial": r"\d+",
        "period": r"\d+",
        "questionnaire": "|".join([*(re.escape(name) for name in questionnaires), anything]),
        "measure": ".+",
        "scale": ".+",
    }
    return re.compile(
        "".join(
            f"(?P<{piece}>{free.get(piece, anything)})" if piece in names and index % 2 else re.escape(piece)
            for index, piece in enumerate(pieces)
        )
    )
