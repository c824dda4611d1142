"""results.json: every number the report shows, in lists of objects with the tables' columns."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline import tables
from pipeline.study import Study

SCHEMA_VERSION = 1
LISTS = (
    "descriptives",
    "comparisons",
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
    for row in content["comparisons"]:
        row["details"] = None if row["details"] is None else json.loads(row["details"])
    _dump(content, path)


def write_replay(path: Path, studies: Sequence[Mapping[str, Any]], found: Mapping[str, pd.DataFrame]) -> None:
    """The file of a replay: what is known of its studies, and its tables."""
    content: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "studies": [dict(study) for study in studies]}
    _dump(content | {name: tables.records(name, table) for name, table in found.items()}, path)


def _dump(content: Mapping[str, Any], path: Path) -> None:
    path.write_text(json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8")


def read(path: Path) -> dict[str, Any]:
    """The file's content."""
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content
