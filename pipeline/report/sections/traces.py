"""What the page of traces shows of each session."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.report.document import traces
from pipeline.report.document.traces import Kind, Series, Traces
from pipeline.report.sections.material import ORIGINS, Material
from pipeline.sessions import recording
from pipeline.study.session import Session
from pipeline.tables import table as tables
from pipeline.tables.columns import S_PER_NS

PAGE = "traces.html"
_KINDS: dict[str, Kind] = {"position": "tracker", "display": "display", "reference": "reference"}


def write(material: Material, path: Path) -> None:
    """The page, where there are sessions."""
    if material.sessions:
        traces.render(
            material.study.title, ORIGINS[material.study.data_origin], _all(material), len(material.sessions), path
        )


def _all(material: Material) -> Iterator[Traces]:
    """Session by session, for there may be thousands."""
    ingested_of, fused_of = (material.entries[stage] for stage in ("ingest", "fuse"))
    for session, ingested, fused in zip(material.sessions, ingested_of, fused_of, strict=True):
        yield _of_session(material, session, ingested, fused)


def _of_session(material: Material, session: Session, ingested: Path, fused: Path) -> Traces:
    study = material.study
    origin_ns, streams = recording.positions(study, ingested)
    series: list[Series] = []
    for name, samples in streams.items():
        kind = _KINDS[study.streams[name].kind]
        time_s = samples.arrival if kind == "tracker" else samples.time
        order = np.argsort(time_s, kind="stable")
        if len(order):
            series.append(Series(name, kind, recording.shown_axes(study, name), time_s[order], samples.value[order]))
    columns = [f"{axis}_mm" for axis in study.axes]
    for estimator, rows in tables.read("tracks", fused).groupby("estimator", sort=False):
        time_s = (rows["time_ns"].to_numpy(np.int64) - origin_ns) * S_PER_NS
        series.append(Series(str(estimator), "estimator", study.axes, time_s, rows[columns].to_numpy(np.float64)))
    return Traces(session.id, session.participant, session.condition, tuple(series))
