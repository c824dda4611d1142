"""Which selection belongs to which trial of a session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Row = Mapping[str, Any]


def selections_by_trial(events: Sequence[Row]) -> tuple[list[Row], list[tuple[Row, int]]]:
    """A session's trial_starts in order, and its selections, each with the place of its start among them, -1 for none.

    A selection belongs to the newest start before it, unless both name their trial and the names differ.
    """
    in_order = sorted(events, key=lambda event: event["time_ns"])  # stable
    starts = [event for event in in_order if event["type"] == "trial_start"]
    selections = [event for event in in_order if event["type"] == "selection"]
    times = [event["time_ns"] for event in starts]
    found = []
    for selection in selections:
        place = int(np.searchsorted(times, selection["time_ns"], side="right")) - 1
        if place >= 0:
            named, own = starts[place]["trial"], selection["trial"]
            if named is not None and own is not None and named != own:
                place = -1
        found.append((selection, place))
    return starts, found
