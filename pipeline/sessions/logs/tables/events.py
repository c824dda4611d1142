"""Events in a table: a column `type`, and those of an event's other fields that there are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.sessions.logs.mcap.events import EVENT_TYPES
from pipeline.sessions.logs.tables.sheet import Columns

_PLACES = ("target_x", "target_y", "target_z", "x", "y", "z")


def events_of(table: Columns) -> tuple[Mapping[str, object], ...]:
    """One event a line, places in metres. ValueError for a table that holds something else."""
    if "type" not in table.columns:
        raise ValueError("it has no column `type`, which events need")
    types = table.texts("type")
    strange = next((one for one in types if one not in EVENT_TYPES), None)
    if strange is not None:
        raise ValueError(f'"{strange[:40]}" is no type of an event; these are {", ".join(EVENT_TYPES)}')
    figures = {name: table.numbers(name) for name in ("trial", *_PLACES) if name in table.columns}
    found = []
    for index, kind in enumerate(types):
        event: dict[str, object] = {"type": kind, "trial": None}
        for name, column in figures.items():
            if np.isfinite(column[index]):
                event[name] = int(column[index]) if name == "trial" else float(column[index])
        found.append(event)
    return tuple(found)
