"""One session with one variant of an estimator: its accuracy, and what it would have shown at the selections."""

from __future__ import annotations

from pipeline import recording, tables
from pipeline.stage import Outcome, Work
from pipeline.stages.assess import accuracy_row, trial_rows
from pipeline.stages.fuse import tracked


def run(work: Work) -> Outcome:
    """The session's accuracy and trials of the study's one estimator, as `fuse` and `assess` would give them."""
    study, ingested = work.study, work.entry("ingest")
    (name,) = study.estimators
    loaded = recording.load(study, ingested)
    track = tracked(study, name, loaded, work.session.id) if len(loaded.times) else tables.frame("tracks", [])
    row = accuracy_row(work, loaded, recording.reference(study, loaded), name, track)
    tables.write("accuracy", tables.frame("accuracy", [row] if row else []), work.out)
    trials = trial_rows(work, tables.read("events", ingested), {name: track})
    rows = [trial for trial in trials if trial["estimator"] == name]
    tables.write("trials", tables.frame("trials", rows), work.out)
    return Outcome()
