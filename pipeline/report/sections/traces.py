"""What the page of traces shows of each session."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from pipeline.report.document import traces
from pipeline.report.document.traces import Event, Kind, Scene, Series, Traces
from pipeline.report.figures.plane import XY, Plane
from pipeline.report.sections import paths
from pipeline.report.sections.material import ORIGINS, Material
from pipeline.sessions import recording, trials
from pipeline.tables import table as tables
from pipeline.tables.columns import S_PER_NS
from pipeline.tables.table import Row

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
    for place, (ingested, fused) in enumerate(zip(ingested_of, fused_of, strict=True)):
        yield _of_session(material, place, ingested, fused)


def _of_session(material: Material, place: int, ingested: Path, fused: Path) -> Traces:
    study, session = material.study, material.sessions[place]
    origin_ns, streams = recording.positions(study, ingested)
    series: list[Series] = []
    for name, samples in streams.items():
        kind = _KINDS[study.streams[name].kind]
        time_s = samples.arrival if kind == "tracker" else samples.time
        order = np.argsort(time_s, kind="stable")
        if len(order):
            axes, after = recording.shown_axes(study, name), len(study.estimators)
            series.append(Series(name, kind, axes, time_s[order], samples.value[order], after))
    columns = [f"{axis}_mm" for axis in study.axes]
    of_estimator = dict(list(tables.read_thinned("tracks", fused).groupby("estimator", sort=False)))
    for at, estimator in enumerate(study.estimators):  # the order and the colours of the figures
        rows = of_estimator.get(estimator)
        if rows is None:
            continue
        time_s = (rows["time_ns"].to_numpy(np.int64) - origin_ns) * S_PER_NS
        values = rows[columns].to_numpy(np.float64)
        series.append(Series(estimator, "estimator", study.axes, time_s, values, at))
    scene = _scene(material, place, ingested, origin_ns)
    return Traces(session.id, session.participant, session.condition, tuple(series), scene)


def _scene(material: Material, place: int, ingested: Path, origin_ns: int) -> Scene | None:
    """What a session is played on; None where nothing moves in a plane."""
    axes, task = material.study.axes, material.study.task
    if len(axes) < 2:
        return None
    plane = (axes[0], axes[1])
    displayed_by = material.study.shown.get(material.sessions[place].condition or "")
    compared = _compared(material, displayed_by)
    events = events_of(ingested, origin_ns, plane)
    scene = Scene(plane, paths.displayed(material, place), displayed_by, compared, events)
    if task is None or plane != XY:  # the task is stated in x and y
        return scene
    return replace(
        scene,
        path_mm=task.path_mm,
        targets_mm=task.targets_mm,
        target_diameter_mm=task.target_diameter_mm,
        window_mm=task.window_mm,
    )


def _compared(material: Material, displayed_by: str | None) -> str | None:
    """The best estimator, or where the session showed just that, the first other one."""
    best = paths.best_estimator(material) if material.study.estimators else None
    if best != displayed_by:
        return best
    return next((name for name in material.study.estimators if name not in (displayed_by, "raw")), None)


def events_of(ingested: Path, origin_ns: int, plane: Plane) -> tuple[Event, ...]:
    """The trials' starts and the selections in the order of time; a selection without a target has its trial's."""
    rows: list[Row] = tables.read_arrow("events", ingested).to_pylist()
    starts, selections = trials.selections_by_trial(rows)
    events = [_event("trial_start", start, start, origin_ns, plane) for start in starts]
    for selection, place in selections:
        aimed = selection if place < 0 or _place(selection, "target_", plane) else starts[place]
        events.append(_event("selection", selection, aimed, origin_ns, plane))
    return tuple(sorted(events, key=lambda event: event.time_s))  # stable: a start comes before its selection


def _event(kind: Literal["trial_start", "selection"], row: Row, aimed: Row, origin_ns: int, plane: Plane) -> Event:
    return Event(kind, (row["time_ns"] - origin_ns) * S_PER_NS, _place(aimed, "target_", plane), _place(row, "", plane))


def _place(row: Row, prefix: str, plane: Plane) -> tuple[float, float] | None:
    """Where something is in the plane, in mm; None if that is not known on both axes."""
    x, y = (row[f"{prefix}{axis}_mm"] for axis in plane)
    return None if x is None or y is None else (float(x), float(y))
