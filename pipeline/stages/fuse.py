"""What every estimator would have shown, at the arrival of each acceleration."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline import recording, tables
from pipeline.recording import Recording
from pipeline.stage import Outcome, Work
from pipeline.study import Study


def run(work: Work) -> Outcome:
    """One session's tracks: a row an estimator and instant, from its first estimate on."""
    study = work.study
    loaded = recording.load(study, work.entry("ingest"))
    parts = []
    for name in study.estimators if len(loaded.times) else ():
        parts.append(tracked(study, name, loaded, work.session.id))
    tables.write("tracks", pd.concat(parts) if parts else tables.frame("tracks", []), work.out)
    return Outcome()


def tracked(study: Study, name: str, loaded: Recording, session: str) -> pd.DataFrame:
    """One estimator's rows of `tracks`."""
    track = recording.show(study, name, loaded, loaded.times)
    known = np.isfinite(track.mean).all(axis=1)
    columns = {"session": session, "estimator": name, "time_ns": loaded.to_ns(track.time[known])}
    for index, axis in enumerate(study.axes):
        columns[f"{axis}_mm"] = track.mean[known, index]
        columns[f"sd_{axis}_mm"] = track.sd[known, index]
    return tables.as_table("tracks", pd.DataFrame(columns))
