"""Reads a study's own tables (participants, trials, questionnaires, measures) and checks them row by row.

Where a table cannot be used, the message names the file, the column, what was found, and what to write into study.yaml.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.guessing.remedies import misnamed_column, number_remedy
from pipeline.study.large_tables import numbers as numbers_of
from pipeline.study.table_file import TableFile, read_table
from pipeline.study.wide_tables import lengthened, value_columns

MISSING = ("", "NA", "N/A")
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


def _required_text(file: TableFile, table: pd.DataFrame, columns: Iterable[str]) -> None:
    for column in columns:
        for line in table.index[table[column] == ""]:
            raise PipelineError(f'{file.path}, row {line}: "{column}" is empty')


def _number(text: str, decimal: str) -> float:
    """A number as people write it: no underscores, and not so large or small that squares or sums overflow."""
    if decimal == ",":
        if "." in text:
            raise ValueError
        text = text.replace(",", ".")
    value = float(text.replace("−", "-"))
    if "_" in text:
        raise ValueError
    if _TINY > abs(value) > 0 or (np.isfinite(value) and abs(value) > _HUGE):
        raise ValueError(f" between {_TINY:g} and {_HUGE:g}")
    return value


def _numbers(
    file: TableFile, table: pd.DataFrame, column: str, *, factor: float = 1.0, finite: bool = False
) -> pd.Series:
    """A column as numbers, times `factor`; NaN for a missing cell or code. Raises PipelineError for other text.

    With `finite`, for infinity too: a measure may be infinite and is listed then, a place or a time cannot be.
    """
    if isinstance(table[column].dtype, pd.StringDtype) and file.decimal == ".":
        words = [*MISSING, *(code for code in file.missing if isinstance(code, str))]
        read = numbers_of(table[column], words)
        if read is not None:  # else one of them is at fault, or is written in another way
            coded = np.isin(read, [code for code in file.missing if not isinstance(code, str)])
            return pd.Series(np.where(coded, np.nan, read * factor), index=table.index)
    values, faults, texts = [], [], []
    for line, text in table[column].items():
        try:
            is_missing = text in MISSING or text in file.missing
            value = np.nan if is_missing else _number(text, file.decimal)
            if finite and np.isinf(value):
                raise ValueError(" that is finite")
            values.append(np.nan if value in file.missing else value * factor)
        except ValueError as error:
            span = str(error) if str(error).startswith((" between", " that is")) else ""
            faults.append(f'row {line}: "{column}" should be a number{span}, found "{text}"')
            texts.append(text)
    if faults:
        more = f"; and {len(faults) - _SHOWN_FAULTS} more" if len(faults) > _SHOWN_FAULTS else ""
        raise PipelineError(f"{file.path}, {'; '.join(faults[:_SHOWN_FAULTS])}{more}{number_remedy(file, texts)}")
    return pd.Series(values, index=table.index, dtype=np.float64)


def _whole_numbers(file: TableFile, table: pd.DataFrame, column: str) -> pd.Series:
    values = _numbers(file, table, column)
    whole = np.isfinite(values) & (values.abs() < 2**53) & (values == values.round())
    for line, given in table[column][~whole].items():
        raise PipelineError(f'{file.path}, row {line}: "{column}" should be a whole number, found "{given}"')
    return values.astype(np.int64)


def _periods(file: TableFile, table: pd.DataFrame) -> pd.Series:
    """The column period: whole numbers from 1, NA where the cell is empty."""
    values = _numbers(file, table, "period")
    for line, value, given in zip(table.index, values, table["period"], strict=True):
        if not (np.isnan(value) or (1 <= value < 2**31 and value == round(value))):
            raise PipelineError(
                f'{file.path}, row {line}: "period" should be 1 for what came first, 2 for what came next, and so on,'
                f' found "{given}"'
            )
    return values.astype("Int64")


def _check_conditions(file: TableFile, table: pd.DataFrame) -> None:
    for line, condition in table["condition"][~table["condition"].isin(file.conditions)].items():
        hint = did_you_mean(condition, file.conditions)
        raise PipelineError(f'{file.path}, row {line}: condition "{condition}" is not in study.yaml{hint}')


def _check_unique(file: TableFile, table: pd.DataFrame, columns: Sequence[str]) -> None:
    repeated = table[table.duplicated(list(columns), keep=False)]
    if len(repeated):
        what = ", ".join(f"{column} {repeated.iloc[0][column]}" for column in columns)
        same = repeated[(repeated[list(columns)] == repeated.iloc[0][list(columns)]).all(axis=1)]
        rows = ", ".join(str(line) for line in same.index[:_SHOWN_FAULTS])
        raise PipelineError(f"{file.path}: rows {rows} are duplicates ({what}); keep one of them")


def _own_columns(file: TableFile, table: pd.DataFrame, ours: Sequence[str]) -> list[str]:
    """The study's own columns, which are kept. Raises PipelineError for one that is likely one of ours misspelt."""
    own = [str(name) for name in table if name not in ours]
    for name in own:
        meant = misnamed_column(name, [column for column in ours if column not in table])
        if meant is not None:
            raise PipelineError(
                f'{file.path}: the column "{name}" is not known; did you mean "{meant}"? If so, write columns:'
                f" {{{file.table}: {{{name}: {meant}}}}} in study.yaml; if not, give it another name there"
            )
    return own


def read_participants(file: TableFile) -> pd.DataFrame:
    """One row per participant, everything as text; the column participant is unique.

    Raises PipelineError, naming the file and the row, where the table is not as docs/tables.md says; so do the others.
    """
    table, _ = read_table(file, PARTICIPANT_REQUIRED)
    _required_text(file, table, ["participant"])
    _check_unique(file, table, ["participant"])
    return table


def read_trials(file: TableFile) -> pd.DataFrame:
    """One row per trial: ids, trial (whole number), coordinates in mm and times in s (NaN where missing).

    Columns of the study's own are kept as text.
    """
    table, factors = read_table(file, TRIAL_REQUIRED, (*TRIAL_REQUIRED[2:], *TRIAL_OPTIONAL[1:]))
    _own_columns(file, table, (*TRIAL_REQUIRED, *TRIAL_OPTIONAL))
    given = [str(name) for name in table]
    for column in TRIAL_OPTIONAL:
        if column not in table:
            table[column] = "" if column == "session" else np.nan
    _required_text(file, table, ["participant", "condition"])
    _check_conditions(file, table)
    table["trial"] = _whole_numbers(file, table, "trial")
    _check_unique(file, table, ["participant", "condition", "session", "trial"])
    for column in (name for name in (*TRIAL_REQUIRED[3:], *TRIAL_OPTIONAL[1:]) if name in given):
        table[column] = _numbers(file, table, column, factor=factors.get(column, 1.0), finite=True)
    widths = table["target_width_mm"]
    for line, width in widths[widths <= 0].items():
        raise PipelineError(f'{file.path}, row {line}: "target_width_mm" should be above 0, found {width:g}')
    return table


def own_columns_of_trials(table: pd.DataFrame) -> list[str]:
    """The columns of a table of trials that are the study's own."""
    return [str(name) for name in table if name not in (*TRIAL_REQUIRED, *TRIAL_OPTIONAL)]


def read_questionnaires(file: TableFile) -> pd.DataFrame:
    """One row per rating, NaN where missing."""
    table = _with_values(file, RATING_REQUIRED)
    _own_columns(file, table, (*RATING_REQUIRED, "session"))
    _required_text(file, table, RATING_REQUIRED[:4])
    _check_conditions(file, table)
    keys = [*RATING_REQUIRED[:4], *(["session"] if "session" in table else [])]
    _check_unique(file, table, keys)
    return table


def read_measures(file: TableFile) -> tuple[pd.DataFrame, list[str]]:
    """One row per value, NaN where missing, and the names of further within-factors, each a column of text.

    The column period, if there is one, holds whole numbers.
    """
    table = _with_values(file, MEASURE_REQUIRED)
    factors = [str(name) for name in table if name not in MEASURE_REQUIRED and name not in MEASURE_RESERVED]
    _required_text(file, table, MEASURE_REQUIRED[:3])
    _check_conditions(file, table)
    if "period" in table:
        table["period"] = _periods(file, table)
    keys = [*MEASURE_REQUIRED[:3], *factors, *(name for name in ("trial", "period") if name in table)]
    _check_unique(file, table, keys)
    return table, factors


def _with_values(file: TableFile, required: Sequence[str]) -> pd.DataFrame:
    """A table with a value a row in the last of its required columns, as it is or made of a wide one."""
    value = required[-1]
    if not file.wide:
        table, _ = read_table(file, required, (value,))
        table[value] = _numbers(file, table, value)
        return table
    table, _ = read_table(file, required[:1])
    columns = value_columns(file, [str(name) for name in table])
    for column in columns:
        table[column] = _numbers(file, table, column)
    return lengthened(file, table, columns, value, required)


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


def read_repeats(file: TableFile) -> pd.DataFrame:
    """A row a repeated study, condition and measure: its mean over participants, NaN where missing."""
    table, _ = read_table(file, REPEAT_REQUIRED)
    _required_text(file, table, ("condition", "measure"))
    _check_conditions(file, table)
    table["repeat"] = _whole_numbers(file, table, "repeat")
    _check_unique(file, table, REPEAT_REQUIRED[:3])
    table["value"] = _numbers(file, table, "value")
    return table
