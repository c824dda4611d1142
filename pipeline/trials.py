"""Which selection belongs to which trial of a session, and how people moved from one to the next."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline import movements, tables
from pipeline.movements import FloatArray


def selections_by_trial(events: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A session's trial_starts in order, and its selections with the column `start`: the row of theirs, -1 for none.

    A selection belongs to the newest start before it, unless both name their trial and the names differ: then to the
    one before that, if the newest start is of the very moment of the selection, or else to none.
    """
    starts = events[events["type"] == "trial_start"].sort_values("time_ns", kind="stable").reset_index(drop=True)
    selections = events[events["type"] == "selection"].sort_values("time_ns", kind="stable").reset_index(drop=True)
    times, selected = starts["time_ns"].to_numpy(np.int64), selections["time_ns"].to_numpy(np.int64)
    row = np.searchsorted(times, selected, side="right") - 1
    named = starts["trial"].array
    for index, own in enumerate(selections["trial"].array):
        while row[index] >= 0 and not (pd.isna(own) or pd.isna(named[row[index]])) and named[row[index]] != own:
            at_once = times[row[index]] == selected[index]
            row[index] = row[index] - 1 if at_once else -1
    return starts, selections.assign(start=row)


def told(events: pd.DataFrame, origin_ns: int) -> pd.DataFrame:
    """A row a trial: trial, start_s, its first selection's time and place, its last one's (`left_`), and its target.

    Coordinates are in mm, times in s since `origin_ns`; NaN for what there is not.
    """
    starts, selections = selections_by_trial(events)
    own = selections[selections["start"] >= 0]
    first, last = (
        own.drop_duplicates("start", keep=keep).set_index("start").reindex(starts.index) for keep in ("first", "last")
    )
    found = {"trial": starts["trial"].fillna(pd.Series(starts.index + 1, dtype="Int64"))}
    for name, rows in (("start_s", starts), ("selection_s", first), ("left_s", last)):
        since = (rows["time_ns"] - origin_ns) * tables.NANOSECONDS
        found[name] = pd.Series(since.to_numpy(np.float64, na_value=np.nan), index=starts.index)
    for axis in "xyz":
        found[f"target_{axis}_mm"] = first[f"target_{axis}_mm"].fillna(starts[f"target_{axis}_mm"])
        found[f"selected_{axis}_mm"] = first[f"{axis}_mm"]
        found[f"left_{axis}_mm"] = last[f"{axis}_mm"]
    return pd.DataFrame(found)


def with_movements(trials: pd.DataFrame) -> pd.DataFrame:
    """Trials of one session in their order, as `told` gives them, with duration_s and the columns of a movement."""
    duration_s = (trials["selection_s"] - trials["start_s"]).to_numpy(np.float64)
    pause_s = trials["start_s"].to_numpy(np.float64) - movements.previous(trials["left_s"].to_numpy(np.float64))
    target, selected, left = (coordinates(trials, what) for what in ("target", "selected", "left"))
    return trials.assign(
        duration_s=np.where(duration_s >= 0, duration_s, np.nan),
        **vars(movements.aimed(target, selected, left, pause_s)),
    )


def coordinates(trials: pd.DataFrame, what: str, axes: str = "xyz") -> FloatArray:
    """Places (n, d) in mm of trials as `told` gives them: of a target, of what was selected or where it was left."""
    found: FloatArray = trials[[f"{what}_{axis}_mm" for axis in axes]].to_numpy(np.float64)
    return found
