"""What every estimator would have shown, at the arrival of each acceleration."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pyarrow as pa

from pipeline.engine.stage import Outcome, Work
from pipeline.sessions import recording
from pipeline.sessions.recording import Recording
from pipeline.study.settings import Study
from pipeline.tables import table as tables


def run(work: Work) -> Outcome:
    """One session's tracks: a row an estimator and instant, from its first estimate on."""
    study = work.study
    loaded = recording.load(study, work.entry("ingest"), may_be_long=True)
    names = study.estimators if len(loaded.times) else ()
    tables.write_parts("tracks", (part for name in names for part in _parts(study, work, name, loaded)), work.out)
    rows = len(loaded.times)
    del loaded
    tables.give_back(rows)
    return Outcome()


def _parts(study: Study, work: Work, name: str, loaded: Recording) -> Iterator[pa.Table]:
    """One estimator's rows of `tracks`, some at a time."""
    for shown in recording.tracked_in_parts(study, name, loaded):
        for begin in range(0, len(shown.time_ns), tables.ROWS_AT_ONCE):
            part = slice(begin, begin + tables.ROWS_AT_ONCE)
            columns: dict[str, Any] = {"session": work.session.id, "estimator": name, "time_ns": shown.time_ns[part]}
            for index, axis in enumerate(study.axes):
                columns[f"{axis}_mm"] = shown.mean[part, index]
                columns[f"sd_{axis}_mm"] = shown.sd[part, index]
            yield tables.of_columns("tracks", len(columns["time_ns"]), columns)
