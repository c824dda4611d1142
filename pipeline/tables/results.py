"""Writes and reads results.json: all numbers of the report, as lists of objects with the tables' columns."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa

from pipeline.errors import PipelineError
from pipeline.study.settings import Study
from pipeline.study.yaml_text import require_whole_characters
from pipeline.tables import table as tables
from pipeline.tables.catalogue import IN_STUDY_RESULTS
from pipeline.tables.differences import OF_A_REPLAY, OF_A_STUDY

SCHEMA_VERSION = 1


def write(path: Path, name: str, study: Study, frames: Mapping[str, pa.Table], people: Mapping[str, Any]) -> None:
    """Write a study's file; `details` of a comparison become an object, and what does not apply is null."""
    head = {
        "name": name,
        "title": study.title,
        "data_origin": study.data_origin,
        "conditions": list(study.conditions),
        "question": [list(pair) for pair in study.asked_pairs],
        "alpha": study.alpha,
        "participants": dict(people),
    }
    rows: dict[str, Iterable[Mapping[str, Any]]] = {
        table: tables.records(table, frames[table]) if table in frames else () for table in IN_STUDY_RESULTS
    }
    for table in ("comparisons", "comparisons_all_data"):
        rows[table] = map(_with_details, rows[table])
    _dump(path, {"study": head}, rows)


def _with_details(row: Mapping[str, Any]) -> Mapping[str, Any]:
    return {**row, "details": None if row["details"] is None else json.loads(row["details"])}


def write_replay(path: Path, studies: Sequence[Mapping[str, Any]], frames: Mapping[str, pd.DataFrame]) -> None:
    """Write a replay's file: its studies, and its tables."""
    lists: dict[str, Iterable[Mapping[str, Any]]] = {"studies": studies}
    _dump(path, {}, lists | {name: tables.records(name, table) for name, table in frames.items()})


def write_exploration(
    path: Path,
    settings: Mapping[str, Any],
    frames: Mapping[str, pd.DataFrame],
    pays: Sequence[Mapping[str, Any]],
) -> None:
    """Write an exploration's file: its settings, its tables, and what pays for each measure."""
    lists: dict[str, Iterable[Mapping[str, Any]]] = {"what_pays": pays}
    _dump(path, {"explored": settings}, lists | {name: tables.records(name, table) for name, table in frames.items()})


def _dump(path: Path, head: Mapping[str, Any], lists: Mapping[str, Iterable[Mapping[str, Any]]]) -> None:
    """Write one object, each row on its own line; row by row, so that large results never fill the memory."""
    as_json = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
    with path.open("w", encoding="utf-8") as file:
        file.write(f'{{\n "schema_version": {SCHEMA_VERSION}')
        for key, value in head.items():
            file.write(f",\n {as_json(key)}: {as_json(dict(value))}")
        for name, rows in lists.items():
            file.write(f",\n {as_json(name)}: [")
            for place, row in enumerate(rows):
                file.write(f"{',' if place else ''}\n  {as_json(dict(row))}")
            file.write("\n ]")
        file.write("\n}\n")


def read(path: Path) -> dict[str, Any]:
    """The file's content."""
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def read_object(path: Path) -> dict[str, Any]:
    """The object in a user's JSON file.

    Raises PipelineError for a file without one, and for NaN and infinity, which are not JSON.
    """
    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text, parse_int=_number, parse_float=_number, parse_constant=_number)
    except (ValueError, OverflowError, RecursionError) as error:
        raise PipelineError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(content, dict):
        raise PipelineError(f"{path}: should hold one JSON object")
    if "\\u" in text:  # only an escape can be half a character: the file itself is UTF-8
        require_whole_characters(path, json.dumps(content, ensure_ascii=False))
    return content


def _number(text: str) -> int | float:
    value = int(text) if text.lstrip("-").isdigit() else float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is not a finite number")
    return value


def identity_of(content: Mapping[str, Any]) -> Mapping[str, tuple[str, ...]] | None:
    """The key of each table in the results of a study or of a replay; None for any other file."""
    if "study" in content:
        return OF_A_STUDY if isinstance(content["study"], dict) else None
    return OF_A_REPLAY if isinstance(content.get("studies"), list) else None


def read_checked(path: Path) -> dict[str, Any]:
    """The content of a results.json that a user names.

    Raises PipelineError for a file that cannot be read, is no results.json, or has another schema_version.
    """
    content = read_object(path)
    version, identity = content.get("schema_version"), identity_of(content)
    if version is not None and version != SCHEMA_VERSION:
        raise PipelineError(
            f"{path}: has schema_version {version!r}, but this Steadyhand reads {SCHEMA_VERSION}; write the results"
            " again with: steadyhand compare STUDY"
        )
    if version is None or identity is None:
        missing = "schema_version" if version is None else "study"
        raise PipelineError(f"{path}: is not a results.json of Steadyhand: it has no {missing}")
    _require_objects(path, "studies", content.get("studies", []), ("name",))
    if not isinstance(content.get("study", {}).get("participants", {}), dict):
        raise PipelineError(f"{path}: study: participants should be an object")
    for table, columns in identity.items():
        _require_objects(path, table, content.get(table, []), columns)
    return content


def _require_objects(path: Path, table: str, rows: Any, columns: Sequence[str]) -> None:
    """Raise PipelineError unless `rows` is a list of objects with these columns, and with details if any."""
    if not isinstance(rows, list):
        raise PipelineError(f"{path}: {table} should be a list")
    for number, row in enumerate(rows, 1):
        if not isinstance(row, dict) or not isinstance(row.get("details"), dict | None):
            raise PipelineError(f"{path}: {table}: row {number} is not a row that Steadyhand wrote")
        for column in columns:
            if column not in row or not isinstance(row[column], str | None):
                raise PipelineError(f'{path}: {table}: row {number} needs "{column}", text or null')
