"""results.json: every number the report shows, in lists of objects with the tables' columns."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline import tables
from pipeline.differences import OF_A_REPLAY, OF_A_STUDY
from pipeline.errors import PipelineError
from pipeline.study import Study

SCHEMA_VERSION = 1
LISTS = (
    "descriptives",
    "comparisons",
    "comparisons_all_data",
    "accuracy",
    "replay_agreement",
    "quality",
    "exclusions",
    "sensor_noise",
    "phones",
    "shown_at_selection",
    "accuracy_means",
    "printed",
    "design_check",
    "simulated_reductions",
)


def write(path: Path, name: str, study: Study, found: Mapping[str, pd.DataFrame], people: Mapping[str, Any]) -> None:
    """The file; `details` of a comparison as an object, what does not apply as null."""
    content: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "study": {
            "name": name,
            "title": study.title,
            "data_origin": study.data_origin,
            "conditions": list(study.conditions),
            "alpha": study.alpha,
            "participants": dict(people),
        },
    }
    for table in LISTS:
        content[table] = tables.records(table, found[table]) if table in found else []
    for row in (*content["comparisons"], *content["comparisons_all_data"]):
        row["details"] = None if row["details"] is None else json.loads(row["details"])
    _dump(content, path)


def write_replay(path: Path, studies: Sequence[Mapping[str, Any]], found: Mapping[str, pd.DataFrame]) -> None:
    """The file of a replay: what is known of its studies, and its tables."""
    content: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "studies": [dict(study) for study in studies]}
    _dump(content | {name: tables.records(name, table) for name, table in found.items()}, path)


def write_exploration(
    path: Path,
    settings: Mapping[str, Any],
    found: Mapping[str, pd.DataFrame],
    pays: Sequence[Mapping[str, Any]],
) -> None:
    """The file of an exploration: what was asked of which study, its tables, and what pays for each measure."""
    content: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "explored": dict(settings), "what_pays": list(pays)}
    _dump(content | {name: tables.records(name, table) for name, table in found.items()}, path)


def _dump(content: Mapping[str, Any], path: Path) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8")


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
