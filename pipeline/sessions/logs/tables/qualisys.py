"""Qualisys Track Manager's TSV of markers (3D) or bodies (6D): lines of facts, then figures in millimetres.

    FREQUENCY       100
    MARKER_NAMES    hand    head           or BODY_NAMES
    Frame   Time    hand X  hand Y  …      in files that were exported with these columns

What was not seen is empty or all zeros. A body has X, Y, Z, three angles, a residual, and nine figures of its rotation.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import SessionError
from pipeline.sessions.logs.tables.sheet import Sheet
from pipeline.sessions.logs.tables.table import table_of
from pipeline.sessions.logs.tables.text import Text, split_line

_MARK = "NO_OF_FRAMES"
_NAMES = ("MARKER_NAMES", "BODY_NAMES")
_WIDTHS = {"MARKER_NAMES": 3, "BODY_NAMES": 16}
_MM_M = 0.001


def recognised(text: Text) -> bool:
    """Whether the first line is that of Qualisys."""
    return text.head[0].startswith(_MARK)


def sheets(path: Path, text: Text) -> list[Sheet]:
    """Every marker or body. SessionError where the file names none, or does not say its rate."""
    lines = [split_line(line, "\t") for line in text.head]
    facts = {row[0]: row[1:] for row in lines if row and row[0].isupper()}
    key = next((name for name in _NAMES if name in facts), None)
    if key is None:
        raise SessionError("it names no MARKER_NAMES or BODY_NAMES; export it with its header")
    bodies = [name for name in facts[key] if name]
    at = next(index for index, row in enumerate(lines) if row and _is_figure(row[0]))
    width = len(lines[at]) - (1 if not lines[at][-1] else 0)
    leading = width - len(bodies) * _WIDTHS[key]
    if leading not in (0, 2):
        raise SessionError(f"its lines have {width} figures, which do not fit its {len(bodies)} names")
    columns = [
        *("Frame", "Time")[:leading],
        *(f"{body}|{place}" for body in bodies for place in range(_WIDTHS[key])),
        *([""] if len(lines[at]) > width else []),
    ]
    table = table_of(text.below(at), columns, "\t")
    stamp = "Time" if leading else None
    period_s = None if leading else _period_s(facts)
    return [
        Sheet(
            body,
            "Qualisys",
            table,
            stamp,
            {"Time": 1.0},
            {"position": (f"{body}|0", f"{body}|1", f"{body}|2")},
            {"position": _MM_M},
            period_s,
            zero_is_missing=True,
        )
        for body in bodies
    ]


def _period_s(facts: dict[str, list[str]]) -> float:
    try:
        return 1.0 / float(facts["FREQUENCY"][0])
    except (LookupError, ValueError, ZeroDivisionError):
        raise SessionError("it has neither a column Time nor a FREQUENCY") from None


def _is_figure(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
