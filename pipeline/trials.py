"""Which selection belongs to which trial of a session."""

from __future__ import annotations

import numpy as np
import pandas as pd


def selections_by_trial(events: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A session's trial_starts in order, and its selections with the column `start`: the row of theirs, -1 for none.

    A selection belongs to the newest start before it, unless both name their trial and the names differ.
    """
    starts = events[events["type"] == "trial_start"].sort_values("time_ns", kind="stable").reset_index(drop=True)
    selections = events[events["type"] == "selection"].sort_values("time_ns", kind="stable").reset_index(drop=True)
    times = starts["time_ns"].to_numpy(np.int64)
    row = np.searchsorted(times, selections["time_ns"].to_numpy(np.int64), side="right") - 1
    for index, start in enumerate(row):
        if start >= 0:
            named, own = starts["trial"].iloc[start], selections["trial"].iloc[index]
            if not (pd.isna(named) or pd.isna(own)) and named != own:
                row[index] = -1
    return starts, selections.assign(start=row)
