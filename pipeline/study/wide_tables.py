"""Tables with several values in a row, made into ones with a value a row, as `wide` in study.yaml says."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.measures import QUESTIONNAIRES
from pipeline.study.table_file import TableFile
from pipeline.study.table_settings import PATTERN, WideEntry, headers_of_pattern

_OF_PEOPLE = ("participant", "session")  # never a value's column, whatever a pattern says


def value_columns(file: TableFile, headers: Sequence[str]) -> dict[str, dict[str, str]]:
    """The columns that hold values, each with what its header and its entry say of them: `{"measure": "time_s"}`.

    Raises PipelineError for a column that is not there, a pattern that fits none, and a column named by two entries.
    """
    held: dict[str, dict[str, str]] = {}
    for entry in file.wide:
        same = {key: value for key, value in entry.items() if isinstance(value, str) and key != PATTERN}
        for header, own in _of_entry(file, entry, headers):
            if header in held:
                raise PipelineError(f'study.yaml: wide.{file.table}: two entries name the column "{header}"; keep one')
            held[header] = {**same, **own}
    return held


def _of_entry(file: TableFile, entry: WideEntry, headers: Sequence[str]) -> Iterator[tuple[str, dict[str, str]]]:
    """The columns of one entry, and what each one's header says."""
    pattern = entry.get(PATTERN)
    if isinstance(pattern, str):
        fits = headers_of_pattern(pattern, file.conditions, tuple(QUESTIONNAIRES))
        matches = [(header, fits.fullmatch(header)) for header in headers if header not in _OF_PEOPLE]
        found = [(header, match.groupdict()) for header, match in matches if match]
        if not found:
            raise PipelineError(
                f'study.yaml: wide.{file.table}: no column of {file.path.name} fits "{pattern}"; found:'
                f" {', '.join(headers)}"
            )
        yield from found
        return
    ((key, listed),) = ((key, value) for key, value in entry.items() if not isinstance(value, str))
    for header in listed:
        if header not in headers:
            raise PipelineError(
                f'study.yaml: wide.{file.table}.{key}: there is no column "{header}" in {file.path.name}'
                f"{did_you_mean(header, headers)}"
            )
        yield header, {key: _number_of(header) if key in ("trial", "period") else header}


def _number_of(header: str) -> str:
    """The number in a header such as `Trial 3`; the header itself where it has none, which is refused later."""
    digits = re.findall(r"\d+", header)
    return digits[-1] if digits else header


def lengthened(
    file: TableFile, table: pd.DataFrame, columns: Mapping[str, Mapping[str, str]], value: str, required: Sequence[str]
) -> pd.DataFrame:
    """The table with a row for each of its values, which stand in the column `value`.

    Columns that hold no values stay with each row. Raises PipelineError where something required is said nowhere.
    """
    kept = table.drop(columns=list(columns))
    parts = []
    for header, facts in columns.items():
        twice = [name for name in facts if name in kept]
        if twice:
            raise PipelineError(
                f'study.yaml: wide.{file.table}: says the {twice[0]} of "{header}", and {file.path.name} has a column'
                f' "{twice[0]}" too; keep one of them'
            )
        parts.append(kept.assign(**facts, **{value: table[header]}))
    order = np.argsort(np.tile(np.arange(len(table)), len(parts)), kind="stable")  # row by row of the file
    long: pd.DataFrame = pd.concat(parts).iloc[order]
    for name in required:
        if name != value and name not in long:
            named = {"measure": "measure: time_s", "questionnaire": "questionnaire: nasa_tlx"}.get(name, f"{name}: …")
            raise PipelineError(
                f"study.yaml: wide.{file.table}: nothing says which {name} the values are of; add it to the entry, such"
                f" as {named}"
            )
    return long
