"""The task's events as BIDS has them."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from pipeline.tables import table as tables

EVENT_COLUMNS = {
    "onset": "When the event was logged, in seconds from the recording's onset (acq_time in scans.tsv).",
    "duration": "Events are instants.",
    "trial_type": "session_start, trial_start, selection or session_end.",
    "trial": "The number of the trial.",
    **{f"target_{axis}_mm": f"{axis} of the target's centre, in mm." for axis in "xyz"},
    **{f"{axis}_mm": f"{axis} of what was selected, in mm." for axis in "xyz"},
}
"""The columns of events.tsv and what they hold."""

OF_BIDS = ("onset", "duration")
"""Those that BIDS itself describes."""


def events_of(ingest: Path) -> pd.DataFrame:
    """One session's events in time, with `time_ns` for the onset."""
    rows = tables.read("events", ingest).sort_values("time_ns", kind="stable").rename(columns={"type": "trial_type"})
    return rows.drop(columns="session").reset_index(drop=True)
