"""Whether an estimator may be called the best; the first page and the console decide it in the same way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.words.accuracy_reference import SMOOTHED


def without_reference(results: Mapping[str, Any]) -> bool:
    """Whether estimates are compared with smoothed readings, because nothing recorded where the hand was."""
    return any(row["reference"] == SMOOTHED for row in results["accuracy"])


def sessions_in_doubt(results: Mapping[str, Any]) -> tuple[list[str], int]:
    """The sessions with accuracy that have a red check, in order, and how many sessions have accuracy."""
    sessions = list(dict.fromkeys(row["session"] for row in results["accuracy"]))
    red = {row["session"] for row in results["checks"] if row["status"] == "red"}
    return [session for session in sessions if session in red], len(sessions)
