"""What every estimator would have shown, at the arrival of each acceleration."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline import recording, tables
from pipeline.stage import Outcome, Work


def run(work: Work) -> Outcome:
    """One session's tracks: a row an estimator and instant, from its first estimate on."""
    study = work.study
    loaded = recording.load(study, work.entry("ingest"))
    parts = []
    for name in study.estimators if len(loaded.times) else ():
        track = recording.show(study, name, loaded, loaded.times)
        known = np.isfinite(track.mean).all(axis=1)
        columns = {
            "session": work.session.id,
            "estimator": name,
            "time_ns": loaded.to_ns(track.time[known]),
        }
        for index, axis in enumerate(study.axes):
            columns[f"{axis}_mm"] = track.mean[known, index]
            columns[f"sd_{axis}_mm"] = track.sd[known, index]
        parts.append(tables.as_table("tracks", pd.DataFrame(columns)))
    tables.write("tracks", pd.concat(parts) if parts else tables.frame("tracks", []), work.out)
    return Outcome()
