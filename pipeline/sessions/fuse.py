"""What every estimator would have shown, at the arrival of each acceleration."""

from __future__ import annotations

import pyarrow as pa

from pipeline.engine.stage import Outcome, Work
from pipeline.sessions import recording
from pipeline.sessions.recording import Shown
from pipeline.study.settings import Study
from pipeline.tables import table as tables


def run(work: Work) -> Outcome:
    """One session's tracks: a row an estimator and instant, from its first estimate on."""
    study = work.study
    loaded = recording.load(study, work.entry("ingest"))
    parts = [tables.of_rows("tracks", [])]
    for name in study.estimators if len(loaded.times) else ():
        parts.append(_table(study, work.session.id, name, recording.tracked(study, name, loaded)))
    tables.write("tracks", pa.concat_tables(parts).combine_chunks(), work.out)
    return Outcome()


def _table(study: Study, session: str, name: str, shown: Shown) -> pa.Table:
    """One estimator's rows of `tracks`."""
    columns = {"session": session, "estimator": name, "time_ns": shown.time_ns}
    for index, axis in enumerate(study.axes):
        columns[f"{axis}_mm"] = shown.mean[:, index]
        columns[f"sd_{axis}_mm"] = shown.sd[:, index]
    return tables.of_columns("tracks", len(shown.time_ns), columns)
