"""One session with one variant of an estimator: its accuracy, and what it would have shown at the selections."""

from __future__ import annotations

from pathlib import Path

from fusion_core import Samples
from pipeline.engine.stage import Outcome, Work
from pipeline.sessions import recording
from pipeline.sessions.assess import accuracy_row, trial_rows
from pipeline.sessions.recording import Recording
from pipeline.study.settings import Study
from pipeline.tables import table as tables

_Loaded = tuple[Recording, tuple[str, Samples] | None]
_last: dict[tuple[Path, str], _Loaded] = {}


def run(work: Work) -> Outcome:
    """The session's accuracy and trials of the study's one estimator, as `fuse` and `assess` would give them."""
    study, ingested = work.study, work.entry("ingest")
    (name,) = study.estimators
    loaded, reference = _recording(study, ingested)
    shown = recording.tracked(study, name, loaded)
    row = accuracy_row(work, loaded, reference, name, shown)
    tables.write("accuracy", tables.of_rows("accuracy", [row] if row else []), work.out)
    trials = trial_rows(work, tables.read_arrow("events", ingested).to_pylist(), {name: shown})
    rows = [trial for trial in trials if trial["estimator"] == name]
    tables.write("trials", tables.of_rows("trials", rows), work.out)
    return Outcome()


def _recording(study: Study, ingested: Path) -> _Loaded:
    """A session's recording and reference; the last session's are kept, as its other variants usually come next."""
    key = ingested, study.model_dump_json(include={"streams", "axes"})
    if key not in _last:
        loaded = recording.load(study, ingested)
        _last.clear()
        _last[key] = loaded, recording.reference(study, loaded)
    return _last[key]
