"""Do two sessions hold the same readings? A log that was copied under another name counts a person twice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.sessions.checks.finding import Finding, rows_of
from pipeline.study.session import Session
from pipeline.tables import table as tables
from pipeline.tables.table import Row
from pipeline.words.phrases import listing

COPIED = "copied logs"

_FACTS = ["stream", "messages_read", "rate_hz", "gap_max_s", "jitter_ms", "latency_s"]
_VALUES = ("x_mm", "y_mm", "z_mm")
_NAMED_MAX = 3


def copied_rows(sessions: Sequence[Session], folders: Sequence[Path]) -> list[Row]:
    """Rows of the table `checks`; `folders` are the sessions' entries of ingest."""
    if len(sessions) < 2:
        return []
    copies = list(_copies(sessions, folders))
    if not copies:
        return rows_of([Finding(COPIED, "green", "none", "none")])
    named = "; ".join(listing(group) for group in copies[:_NAMED_MAX]) + ("; …" if len(copies) > _NAMED_MAX else "")
    message = (
        f"the logs of {named} hold the same readings: one was saved or copied under another name, and counts twice; "
        "remove it, or replace it by the log that belongs there"
    )
    return rows_of([Finding(COPIED, "amber", f"{len(copies)}", "none", message)])


def _copies(sessions: Sequence[Session], folders: Sequence[Path]) -> Iterator[list[str]]:
    """The ids of sessions with the same readings, which are read only where counts and rates agree."""
    quality = tables.read("quality", folders)
    alike: dict[str, list[str]] = {}
    for session, facts in quality.groupby("session", sort=False):
        alike.setdefault(facts[_FACTS].to_json(orient="values", double_precision=15), []).append(str(session))
    place = {session.id: folder for session, folder in zip(sessions, folders, strict=True)}
    for group in alike.values():
        if len(group) > 1:
            yield from _same_values({session: place[session] for session in group})


def _same_values(folders: Mapping[str, Path]) -> Iterator[list[str]]:
    found: dict[bytes, list[str]] = {}
    for session, folder in folders.items():
        value = _values(folder)
        if len(value) and np.ptp(value) > 0:
            found.setdefault(value.tobytes(), []).append(session)
    yield from (group for group in found.values() if len(group) > 1)


def _values(folder: Path) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """All positions of a session (n, 3) in mm."""
    rows: pd.DataFrame = tables.read("positions", [folder])
    return rows[list(_VALUES)].to_numpy(np.float64)
