"""Which selection belongs to which trial of a session, and how people moved from one to the next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.sessions import movements
from pipeline.statistics.arrays import FloatArray
from pipeline.tables.columns import S_PER_NS
from pipeline.tables.table import Row

_EVENT_COLUMNS = ["trial", "start_s", "selection_s", "left_s"]
_OF_A_MOVEMENT = (
    *("start_s", "selection_s", "left_s"),
    *(f"{what}_{axis}_mm" for what in ("target", "selected", "left") for axis in "xyz"),
)


def selections_by_trial(events: Sequence[Row]) -> tuple[list[Row], list[tuple[Row, int]]]:
    """A session's trial_starts in order, and its selections, each with the index of its trial_start, -1 for none.

    A selection belongs to the newest start before it. If both name their trial and the names differ, it belongs to the
    start before that if the newest start has the same time as the selection, and otherwise to none.
    """
    in_order = sorted(events, key=lambda event: event["time_ns"])  # stable
    starts = [event for event in in_order if event["type"] == "trial_start"]
    selections = [event for event in in_order if event["type"] == "selection"]
    times = [event["time_ns"] for event in starts]
    with_start = []
    for selection in selections:
        place, own = int(np.searchsorted(times, selection["time_ns"], side="right")) - 1, selection["trial"]
        while place >= 0 and own is not None and starts[place]["trial"] not in (None, own):
            place = place - 1 if times[place] == selection["time_ns"] else -1
        with_start.append((selection, place))
    return starts, with_start


def trial_table(events: Sequence[Row], origin_ns: int) -> pd.DataFrame:
    """One row per trial: its number, start, target, and time and place of its first and last selection (`left_`).

    Coordinates are in mm, times in s since `origin_ns`; NaN where something is missing.
    """
    starts, selections = selections_by_trial(events)
    by_trial: dict[int, list[Row]] = {}
    for selection, place in selections:
        by_trial.setdefault(place, []).append(selection)
    rows = []
    for index, start in enumerate(starts):
        own = by_trial.get(index, [])
        first, last = (own[0], own[-1]) if own else ({}, {})
        row = {"trial": index + 1 if start["trial"] is None else start["trial"]}
        for name, event in (("start_s", start), ("selection_s", first), ("left_s", last)):
            row[name] = (event["time_ns"] - origin_ns) * S_PER_NS if event else np.nan
        for axis in "xyz":
            target = first.get(f"target_{axis}_mm")
            row[f"target_{axis}_mm"] = start[f"target_{axis}_mm"] if target is None else target
            row[f"selected_{axis}_mm"], row[f"left_{axis}_mm"] = first.get(f"{axis}_mm"), last.get(f"{axis}_mm")
        rows.append(row)
    places = [f"{what}_{axis}_mm" for what in ("target", "selected", "left") for axis in "xyz"]
    table = pd.DataFrame(rows, columns=[*_EVENT_COLUMNS, *places])
    return table.astype({"trial": "Int64", **dict.fromkeys([*_EVENT_COLUMNS[1:], *places], "float64")})


def with_movements(trials: pd.DataFrame) -> pd.DataFrame:
    """Trials of one session, in order, from `trial_table`, with duration_s and the columns of a movement added."""
    return trials.assign(**moved({name: trials[name].to_numpy(np.float64) for name in _OF_A_MOVEMENT}))


def moved(trials: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """duration_s and the columns of a movement (n,), of columns (n,) of the n trials of one session, in order."""
    duration_s = trials["selection_s"] - trials["start_s"]
    pause_s = trials["start_s"] - movements.previous(trials["left_s"])
    target, selected, left = (
        np.column_stack([trials[f"{what}_{axis}_mm"] for axis in "xyz"]) for what in ("target", "selected", "left")
    )
    return {
        "duration_s": np.where(duration_s >= 0, duration_s, np.nan),
        **vars(movements.aimed(target, selected, left, pause_s)),
    }


def coordinates(trials: pd.DataFrame, what: str, axes: str = "xyz") -> FloatArray:
    """Places (n, d) in mm from `trial_table`: of `what` = "target", "selected" or "left"."""
    places: FloatArray = trials[[f"{what}_{axis}_mm" for axis in axes]].to_numpy(np.float64)
    return places
