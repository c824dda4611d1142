"""results.json: every number the report shows, in lists of objects with the tables' columns."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.errors import PipelineError
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.tables.catalogue import IN_STUDY_RESULTS
from pipeline.tables.differences import OF_A_REPLAY, OF_A_STUDY

SCHEMA_VERSION = 1


def write(path: Path, name: str, study: Study, found: Mapping[str, pd.DataFrame], people: Mapping[str, Any]) -> None:
    """The file; `details` of a comparison as an object, what does not apply as null."""
    head = {
        "name": name,
        "title": study.title,
        "data_origin": study.data_origin,
        "conditions": list(study.conditions),
        "alpha": study.alpha,
        "participants": dict(people),
    }
    rows: dict[str, Iterable[Mapping[str, Any]]] = {
        table: tables.records(table, found[table]) if table in found else () for table in IN_STUDY_RESULTS
    }
    for table in ("comparisons", "comparisons_all_data"):
        rows[table] = map(_with_details, rows[table])
    _dump(path, {"study": head}, rows)


def _with_details(row: Mapping[str, Any]) -> Mapping[str, Any]:
    return {**row, "details": None if row["details"] is None else json.loads(row["details"])}


def write_replay(path: Path, studies: Sequence[Mapping[str, Any]], found: Mapping[str, pd.DataFrame]) -> None:
    """The file of a replay: what is known of its studies, and its tables."""
    lists: dict[str, Iterable[Mapping[str, Any]]] = {"studies": studies}
    _dump(path, {}, lists | {name: tables.records(name, table) for name, table in found.items()})


def write_exploration(
    path: Path,
    settings: Mapping[str, Any],
    found: Mapping[str, pd.DataFrame],
    pays: Sequence[Mapping[str, Any]],
) -> None:
    """The file of an exploration: what was asked of which study, its tables, and what pays for each measure."""
    lists: dict[str, Iterable[Mapping[str, Any]]] = {"what_pays": pays}
    _dump(path, {"explored": settings}, lists | {name: tables.records(name, table) for name, table in found.items()})


def _dump(path: Path, head: Mapping[str, Any], lists: Mapping[str, Iterable[Mapping[str, Any]]]) -> None:
    """One object, written as it is made, for an archive's rows are many: each stands on a line of its own."""
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
    """The one object in a user's JSON file; PipelineError where there is none, or numbers that JSON does not have."""
    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text, parse_int=_number, parse_float=_number, parse_constant=_number)
    except (ValueError, OverflowError, RecursionError) as error:
        raise PipelineError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(content, dict):
        raise PipelineError(f"{path}: should hold one object")
    return content


def _number(text: str) -> int | float:
    value = int(text) if text.lstrip("-").isdigit() else float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no finite number")
    return value


def identity_of(content: Mapping[str, Any]) -> Mapping[str, tuple[str, ...]] | None:
    """What tells the rows of its tables apart: those of a study's results, or of a replay's; None for neither."""
    if "study" in content:
        return OF_A_STUDY if isinstance(content["study"], dict) else None
    return OF_A_REPLAY if isinstance(content.get("studies"), list) else None


def read_checked(path: Path) -> dict[str, Any]:
    """The content of a results.json that a user names.

    Raises PipelineError where it cannot be read, is none, or is of another schema_version.
    """
    content = read_object(path)
    version, identity = content.get("schema_version"), identity_of(content)
    if version is not None and version != SCHEMA_VERSION:
        raise PipelineError(
            f"{path}: has schema_version {version!r}, and this Steadyhand reads {SCHEMA_VERSION}; write the results"
            " again with: steadyhand compare STUDY"
        )
    if version is None or identity is None:
        lacking = "schema_version" if version is None else "study"
        raise PipelineError(f"{path}: is no results.json of Steadyhand: it has no {lacking}")
    _require_objects(path, "studies", content.get("studies", []), ("name",))
    if not isinstance(content.get("study", {}).get("participants", {}), dict):
        raise PipelineError(f"{path}: study: participants should be an object")
    for table, columns in identity.items():
        _require_objects(path, table, content.get(table, []), columns)
    return content


def _require_objects(path: Path, table: str, rows: Any, columns: Sequence[str]) -> None:
    """A list of objects that have these columns, as text or null, and details that are an object or null."""
    if not isinstance(rows, list):
        raise PipelineError(f"{path}: {table} should be a list")
    for number, row in enumerate(rows, 1):
        if not isinstance(row, dict) or not isinstance(row.get("details"), dict | None):
            raise PipelineError(f"{path}: {table}: row {number} is no row of Steadyhand's")
        for column in columns:
            if column not in row or not isinstance(row[column], str | None):
                raise PipelineError(f"{path}: {table}: row {number} should have {column}, a text or null")
