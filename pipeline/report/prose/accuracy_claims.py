"""May an estimator be called the best? The first page and the console ask the same two questions of results.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.words.accuracy_reference import SMOOTHED


def without_reference(results: Mapping[str, Any]) -> bool:
    """Are estimates compared with smoothed readings, because nothing recorded where the hand was?"""
    return any(row["reference"] == SMOOTHED for row in results["accuracy"])


def sessions_in_doubt(results: Mapping[str, Any]) -> tuple[list[str], int]:
    """The sessions with accuracy that have a red check, in order; and how many have accuracy."""
    sessions = list(dict.fromkeys(row["session"] for row in results["accuracy"]))
    red = {row["session"] for row in results["checks"] if row["status"] == "red"}
    return [session for session in sessions if session in red], len(sessions)
