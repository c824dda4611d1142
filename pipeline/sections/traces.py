"""What the page of traces shows of each session."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline import recording, tables
from pipeline.document import traces
from pipeline.document.traces import Series, Traces
from pipeline.sections.material import ORIGINS, Material
from pipeline.study import Session

PAGE = "traces.html"


def write(material: Material, path: Path) -> None:
    """The page, where there are sessions."""
    if material.sessions:
        traces.render(
            material.study.title, ORIGINS[material.study.data_origin], _all(material), len(material.sessions), path
        )


def _all(material: Material) -> Iterator[Traces]:
    """Session by session, for there may be thousands."""
    for session, ingested, fused in zip(material.sessions, material.ingested, material.fused, strict=True):
        yield _of_session(material, session, ingested, fused)


def _of_session(material: Material, session: Session, ingested: Path, fused: Path) -> Traces:
    study = material.study
    origin_ns, streams = recording.positions(study, ingested)
    found: list[Series] = []
    for name, samples in streams.items():
        kind = study.streams[name].kind
        time = samples.arrival if kind == "position" else samples.time
        order = np.argsort(time, kind="stable")
        if len(time):
            shown = "tracker" if kind == "position" else "display" if kind == "display" else "reference"
            axes = recording.shown_axes(study, name)
            found.append(Series(name, shown, axes, time[order], samples.value[order]))
    columns = [f"{axis}_mm" for axis in study.axes]
    for name, rows in tables.read("tracks", fused).groupby("estimator", sort=False):
        time = (rows["time_ns"].to_numpy(np.int64) - origin_ns) * tables.NANOSECONDS
        found.append(Series(str(name), "estimator", study.axes, time, rows[columns].to_numpy(np.float64)))
    return Traces(session.id, session.participant, session.condition, tuple(found))
