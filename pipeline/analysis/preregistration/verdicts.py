"""The rows of the table `preregistration`: their verdicts, and how settings read as text."""

from __future__ import annotations

from typing import Any

from pipeline.tables.table import Row

AS_PLANNED, DEVIATION, EXPLORATORY, ALTERED = "as planned", "deviation", "exploratory", "altered"
NOT_PLANNED = "not planned"
DEVIATIONS = (ALTERED, DEVIATION, EXPLORATORY)
"""The verdicts that a reader has to know of."""


def point(what: str, planned: str, done: str, verdict: str | None = None, measure: str | None = None) -> Row:
    """A row; without a verdict of its own, it is as planned if both say the same."""
    by_text = AS_PLANNED if planned == done else DEVIATION
    return {"what": what, "measure": measure, "planned": planned, "done": done, "verdict": verdict or by_text}


def as_text(value: Any) -> str:
    if hasattr(value, "model_dump"):
        parts = value.model_dump(mode="json", exclude_defaults=True)
        if not isinstance(parts, dict):  # a factor that is between or within, without its levels
            return str(parts)
        return ", ".join(f"{key}: {as_text(part)}" for key, part in parts.items())
    return ", ".join(map(as_text, value)) if isinstance(value, list | tuple) else str(value)
