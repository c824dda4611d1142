"""Reads a study's own CSV tables (participants, trials, questionnaires, measures) and checks them row by row."""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.fields import identifier

MISSING = ("", "NA", "N/A")
Codes = Sequence[float | str]
"""What study.yaml lists under `missing`: numbers or words that stand for a value that is not there."""
_SHOWN_FAULTS = 5
_HUGE, _TINY = 1e100, 1e-100

PARTICIPANT_REQUIRED = ("participant",)
TRIAL_REQUIRED = (
    "participant",
    "condition",
    "trial",
    "target_x_mm",
    "target_y_mm",
    "selected_x_mm",
    "selected_y_mm",
)
TRIAL_OPTIONAL = ("session", "target_z_mm", "selected_z_mm", "start_s", "selection_s", "target_width_mm")
RATING_REQUIRED = ("participant", "condition", "questionnaire", "scale", "rating")
MEASURE_REQUIRED = ("participant", "condition", "measure", "value")
REPEAT_REQUIRED = ("repeat", "condition", "measure", "value")
MEASURE_RESERVED = ("trial", "period", "sequence", "unit")


def _read(path: Path, required: Sequence[str], optional: Sequence[str] | None) -> pd.DataFrame:
    """A CSV file as text, ids in NFC; columns that are not listed are allowed only if `optional` is None."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            numbered = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise PipelineError(f"{path}: cannot be read as CSV in UTF-8: {error}") from None
    if not numbered:
        raise PipelineError(f"{path}: is empty; its first line must name the columns {', '.join(required)}")
    header = _header(path, numbered[0][1], required, optional)
    if len(numbered) == 1:
        raise PipelineError(f"{path}: holds no rows below its header")
    for line, row in numbered[1:]:
        if len(row) != len(header):
            raise PipelineError(f"{path}, row {line}: has {len(row)} cells, the first line {len(header)}")
    cells = [[cell.strip() for cell in row] for _, row in numbered[1:]]
    table = pd.DataFrame(cells, columns=header, dtype=object)
    for name in header:
        table[name] = table[name].map(identifier)
    table.index = pd.Index([line for line, _ in numbered[1:]])  # the file's own line numbers
    return table


def _header(path: Path, first: Sequence[str], required: Sequence[str], optional: Sequence[str] | None) -> list[str]:
    """The names of the columns, checked."""
    header = [str(identifier(name.strip())) for name in first]
    for name in header:
        if header.count(name) > 1:
            raise PipelineError(f'{path}: the column "{name}" is listed twice')
        if not name:
            raise PipelineError(f"{path}: a column has no name")
    for name in required:
        if name not in header:
            raise PipelineError(f'{path}: the column "{name}" is missing; found: {", ".join(header)}')
    if optional is not None:
        for name in header:
            if name not in required and name not in optional:
                hint = did_you_mean(name, [*required, *optional])
                raise PipelineError(f'{path}: the column "{name}" is not known{hint}')
    return header


def _required_text(path: Path, table: pd.DataFrame, columns: Iterable[str]) -> None:
    for column in columns:
        for line in table.index[table[column] == ""]:
            raise PipelineError(f'{path}, row {line}: "{column}" is empty')


def _number(text: str) -> float:
    """A number as people write it: no underscores, and not so large or small that squares or sums overflow."""
    value = float(text)
    if "_" in text:
        raise ValueError
    if _TINY > abs(value) > 0 or (np.isfinite(value) and abs(value) > _HUGE):
        raise ValueError(f" between {_TINY:g} and {_HUGE:g}")
    return value


def _numbers(path: Path, table: pd.DataFrame, column: str, codes: Codes = (), *, finite: bool = False) -> pd.Series:
    """A column as numbers, NaN for a missing cell or code. Raises PipelineError, naming the rows, for other text.

    With `finite`, for infinity too: a measure may be infinite and is listed then, a place or a time cannot be.
    """
    values, faults = [], []
    for line, text in table[column].items():
        try:
            value = np.nan if text in MISSING or text in codes else _number(text)
            if finite and np.isinf(value):
                raise ValueError(" that is finite")
            values.append(np.nan if value in codes else value)
        except ValueError as error:
            span = str(error) if str(error).startswith((" between", " that is")) else ""
            faults.append(f'row {line}: "{column}" should be a number{span}, found "{text}"')
    if faults:
        more = f"; and {len(faults) - _SHOWN_FAULTS} more" if len(faults) > _SHOWN_FAULTS else ""
        hint = " (a decimal comma? use a point)" if any('"' in f and "," in f.split("found")[1] for f in faults) else ""
        hint = hint or " (if that stands for a missing value, list it under `missing:` in study.yaml)"
        raise PipelineError(f"{path}, {'; '.join(faults[:_SHOWN_FAULTS])}{more}{hint}")
    return pd.Series(values, index=table.index, dtype=np.float64)


def _whole_numbers(path: Path, table: pd.DataFrame, column: str) -> pd.Series:
    values = _numbers(path, table, column)
    for line, value in values.items():
        if not (np.isfinite(value) and abs(value) < 2**53 and value == round(value)):
            found = str(table.at[line, column])
            raise PipelineError(f'{path}, row {line}: "{column}" should be a whole number, found "{found}"')
    return values.astype(np.int64)


def _periods(path: Path, table: pd.DataFrame) -> pd.Series:
    """The column period: whole numbers from 1, NA where the cell is empty."""
    values = _numbers(path, table, "period")
    for line, value in values.dropna().items():
        if not (1 <= value < 2**31 and value == round(value)):
            found = str(table.at[line, "period"])
            raise PipelineError(
                f'{path}, row {line}: "period" should be 1 for what came first, 2 for what came next, and so on, found'
                f' "{found}"'
            )
    return values.astype("Int64")


def _check_conditions(path: Path, table: pd.DataFrame, conditions: Sequence[str]) -> None:
    for line, condition in table["condition"].items():
        if condition not in conditions:
            hint = did_you_mean(condition, conditions)
            raise PipelineError(f'{path}, row {line}: condition "{condition}" is not in study.yaml{hint}')


def _check_unique(path: Path, table: pd.DataFrame, columns: Sequence[str]) -> None:
    repeated = table[table.duplicated(list(columns), keep=False)]
    if len(repeated):
        what = ", ".join(f"{column} {repeated.iloc[0][column]}" for column in columns)
        same = repeated[(repeated[list(columns)] == repeated.iloc[0][list(columns)]).all(axis=1)]
        rows = ", ".join(str(line) for line in same.index[:_SHOWN_FAULTS])
        raise PipelineError(f"{path}: rows {rows} are duplicates ({what}); keep one of them")


def read_participants(path: Path) -> pd.DataFrame:
    """One row per participant, everything as text; the column participant is unique.

    Raises PipelineError, naming the file and the row, where the table is not as docs/tables.md says; so do the others.
    """
    table = _read(path, PARTICIPANT_REQUIRED, None)
    _required_text(path, table, ["participant"])
    _check_unique(path, table, ["participant"])
    return table


def read_trials(path: Path, conditions: Sequence[str], codes: Codes = ()) -> pd.DataFrame:
    """One row per trial: ids, trial (whole number), coordinates in mm and times in s (NaN where missing)."""
    table = _read(path, TRIAL_REQUIRED, TRIAL_OPTIONAL)
    for column in TRIAL_OPTIONAL:
        if column not in table:
            table[column] = ""
    _required_text(path, table, ["participant", "condition"])
    _check_conditions(path, table, conditions)
    table["trial"] = _whole_numbers(path, table, "trial")
    _check_unique(path, table, ["participant", "condition", "session", "trial"])
    for column in (*TRIAL_REQUIRED[3:], *TRIAL_OPTIONAL[1:]):
        table[column] = _numbers(path, table, column, codes, finite=True)
    for line, width in table["target_width_mm"].items():
        if width <= 0:
            raise PipelineError(f'{path}, row {line}: "target_width_mm" should be above 0, found {width:g}')
    return table


def read_questionnaires(path: Path, conditions: Sequence[str], codes: Codes = ()) -> pd.DataFrame:
    """One row per rating, NaN where missing."""
    table = _read(path, RATING_REQUIRED, ("session",))
    _required_text(path, table, RATING_REQUIRED[:4])
    _check_conditions(path, table, conditions)
    table["rating"] = _numbers(path, table, "rating", codes)
    keys = [*RATING_REQUIRED[:4], *(["session"] if "session" in table else [])]
    _check_unique(path, table, keys)
    return table


def read_measures(path: Path, conditions: Sequence[str], codes: Codes = ()) -> tuple[pd.DataFrame, list[str]]:
    """One row per value, NaN where missing, and the names of further within-factors, each a column of text.

    The column period, if there is one, holds whole numbers.
    """
    table = _read(path, MEASURE_REQUIRED, None)
    factors = [str(name) for name in table if name not in MEASURE_REQUIRED and name not in MEASURE_RESERVED]
    _required_text(path, table, MEASURE_REQUIRED[:3])
    _check_conditions(path, table, conditions)
    table["value"] = _numbers(path, table, "value", codes)
    if "period" in table:
        table["period"] = _periods(path, table)
    keys = [*MEASURE_REQUIRED[:3], *factors, *(name for name in ("trial", "period") if name in table)]
    _check_unique(path, table, keys)
    return table, factors


def participant_facts(listed: pd.DataFrame, analysed: Collection[str]) -> dict[str, Any]:
    """How many were analysed, how many are listed, and the sex and age of those who are both, for the report.

    What the file does not say is left out.
    """
    facts: dict[str, Any] = {"n": len(analysed), "listed": len(listed)}
    table = listed[listed["participant"].isin(list(analysed))]
    columns = {str(name).lower(): str(name) for name in table}
    for name in ("sex", "gender"):
        if name in columns:
            facts["sex"] = {str(k): int(v) for k, v in table[columns[name]].value_counts().items() if k}
            break
    for name in ("age", "age_years"):
        if name in columns:
            ages = pd.to_numeric(table[columns[name]], errors="coerce").replace([np.inf, -np.inf], np.nan).dropna()
            if len(ages):
                facts["age"] = {
                    "mean": float(ages.mean()),
                    "min": float(ages.min()),
                    "max": float(ages.max()),
                }
            break
    return facts


def read_repeats(path: Path, conditions: Sequence[str]) -> pd.DataFrame:
    """A row a repeated study, condition and measure: its mean over participants, NaN where missing."""
    table = _read(path, REPEAT_REQUIRED, ())
    _required_text(path, table, ("condition", "measure"))
    _check_conditions(path, table, conditions)
    table["repeat"] = _whole_numbers(path, table, "repeat")
    _check_unique(path, table, REPEAT_REQUIRED[:3])
    table["value"] = _numbers(path, table, "value")
    return table
