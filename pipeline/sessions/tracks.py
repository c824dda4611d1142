"""The table `tracks` of one session as what each estimator would have shown; a long one stays in its file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.recording import Shown, Tracked
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study
from pipeline.tables import table as tables


@dataclass(frozen=True)
class Stored:
    """An estimator's track in the table `tracks` of an entry, read anew whenever it is asked for."""

    study: Study
    entry: Path
    estimator: str

    def parts(self) -> Iterator[Shown]:
        """A part of the table at a time."""
        for part in tables.read_parts("tracks", self.entry):
            if pc.any(pc.equal(part["estimator"], self.estimator)).as_py():
                yield _shown(self.study, part, self.estimator)


def tracks_of(study: Study, entry: Path) -> dict[str, Tracked]:
    """What each estimator would have shown, by its name; without those that never had an estimate."""
    if tables.rows("tracks", entry) > tables.ROWS_AT_ONCE:
        there = {name for part in tables.read_parts("tracks", entry) for name in _names(part)}
        return {name: Stored(study, entry, name) for name in study.estimators if name in there}
    table = tables.read_arrow("tracks", entry)
    there = set(_names(table))
    return {name: _shown(study, table, name) for name in study.estimators if name in there}


def newest_at(tracked: Tracked, times_ns: IntArray) -> list[FloatArray | None]:
    """The newest mean (d,) that is not after each of the times (k,); None before the first."""
    found: list[FloatArray | None] = [None] * len(times_ns)
    for part in tracked.parts():
        rows = np.searchsorted(part.time_ns, times_ns, side="right") - 1
        for index in np.flatnonzero(rows >= 0).tolist():
            found[index] = part.mean[rows[index]]
    return found


def _names(table: pa.Table) -> list[str]:
    names: list[str] = pc.unique(table["estimator"]).to_pylist()
    return names


def _shown(study: Study, table: pa.Table, estimator: str) -> Shown:
    rows = tables.matching(table, "estimator", estimator)
    mean, sd = (np.column_stack([rows[column.format(axis)] for axis in study.axes]) for column in ("{}_mm", "sd_{}_mm"))
    return Shown(rows["time_ns"], mean, sd)
