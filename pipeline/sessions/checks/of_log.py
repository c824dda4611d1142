"""A log's readings in the form that the checks take."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.sessions.by_parts import in_memory
from pipeline.sessions.checks.recorded import Events, Frames, Imu, Positions, Recorded, Times
from pipeline.sessions.checks.turns import turned
from pipeline.sessions.logs.log import BoolArray, Log, Readings
from pipeline.sessions.usable import finite, usable, within_a_day
from pipeline.sessions.wanted import of_events, of_stream
from pipeline.statistics.arrays import FloatArray
from pipeline.study.settings import Study
from pipeline.study.simulation import Task
from pipeline.study.streams import AccelerationStream, DisplayStream, PositionStream, ReferenceStream, Stream
from pipeline.tables.columns import S_PER_NS

_MM_PER_M = 1000.0
_RING_STEP_MM = 5.0
AnyArray = np.ndarray[Any, Any]
Placed = PositionStream | ReferenceStream | DisplayStream


def of_log(log: Log, study: Study) -> Recorded:
    """The streams that study.yaml names and the log has."""
    keys = {name: of_stream(stream).key for name, stream in study.streams.items()}
    there = {name: log.topics[key] for name, key in keys.items() if key in log.topics}
    read = [readings for readings in there.values() if readings.read]
    origin_ns = min((int(readings.arrival_ns.min()) for readings in read), default=0)
    positions, imus = [], []
    for name, readings in there.items():
        stream = study.streams[name]
        if not readings.read:
            continue
        if isinstance(stream, AccelerationStream):
            imus.append(imu(name, readings, origin_ns, stream))
        elif isinstance(stream, PositionStream | ReferenceStream | DisplayStream):
            positions.append(of_positions(name, readings, origin_ns, stream))
    happened = log.topics.get(of_events(study.events).key) if study.events is not None else None
    task = study.task
    return Recorded(
        tuple(positions),
        tuple(imus),
        None if happened is None or not happened.read else events(happened, origin_ns),
        task_targets_mm(task),
        max((task.target_diameter_mm, *(ring.target_diameter_mm for ring in task.rings))) if task is not None else 0.0,
        study.display.px_per_mm if study.display is not None else None,
        tuple("xyz".index(axis) for axis in study.axes),
    )


def task_targets_mm(task: Task | None) -> FloatArray | None:
    """Where the task has targets (k, 2): each, or every 5 mm of its rings, which begin anywhere; None without one."""
    if task is None:
        return None
    if task.targets_mm:
        return np.array(task.targets_mm, dtype=np.float64)
    circles = []
    for ring in task.rings:
        angle = np.linspace(0.0, 2 * np.pi, max(36, round(np.pi * ring.diameter_mm / _RING_STEP_MM)))
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        circles.append(np.array(ring.centre_mm) + ring.diameter_mm / 2 * circle)
    return np.concatenate(circles)


def times(readings: Readings, origin_ns: int, stream: Stream | None = None, left_out: int = 0) -> Times:
    """When readings were stamped and arrived, and how late the stamps are according to study.yaml."""
    late = stream is not None and (stream.stamped_on_arrival or stream.kind in ("reference", "display"))
    late_s = stream.latency_s if stream is not None and late else 0.0
    return Times(readings.stamp_ns, readings.arrival_ns, origin_ns, late_s, left_out)


def of_positions(
    name: str,
    readings: Readings,
    origin_ns: int,
    stream: Placed | None = None,
) -> Positions:
    """A stream of positions, those that are not finite left out."""
    whole = _sound(readings, 3)
    kept = usable(readings, whole)
    value_mm = kept.values * _MM_PER_M
    if isinstance(stream, ReferenceStream):
        value_mm = turned(_unit(stream.rotation_xyzw), value_mm) + np.array(stream.translation_mm)
    return Positions(
        name,
        "position" if stream is None else stream.kind,
        times(kept, origin_ns, stream, readings.read - kept.read),
        value_mm,
        stream.noise_sd_mm if isinstance(stream, PositionStream) else None,
        _frames(readings, whole),
    )


def imu(name: str, readings: Readings, origin_ns: int, stream: AccelerationStream | None = None) -> Imu:
    """A stream of accelerations, those that are not finite left out."""
    whole = _sound(readings, 6)
    kept, claims = usable(readings, whole), readings.claims
    count = kept.read

    def of(column: AnyArray, otherwise: float | bool) -> AnyArray:
        if not len(column):
            return np.full(count, otherwise)
        return column if count == readings.read else column[whole]

    return Imu(
        name,
        times(kept, origin_ns, stream, readings.read - kept.read),
        _in_body(kept.values[:, :3], stream),
        kept.values[:, 3:6],
        kept.values[:, 6:10],
        of(claims.orientation_length, np.nan),
        of(claims.force_disclaimed, False),
        of(claims.gyroscope_disclaimed, False),
        None if stream is None else stream.gravity_mm_s2,
        None if stream is None else stream.noise_sd_mm_s2,
        stream is not None and stream.calibrate_s > 0,
        _frames(readings, whole),
    )


def _in_body(force_m_s2: FloatArray, stream: AccelerationStream | None) -> FloatArray:
    """The specific force (n, 3) in the frame of the body, as far as study.yaml states the mounting."""
    force_m_s2 = in_memory(force_m_s2)
    return force_m_s2 if stream is None else turned(_unit(stream.mounting_xyzw), force_m_s2)


def _unit(quaternion_xyzw: tuple[float, float, float, float]) -> FloatArray:
    """A rotation of study.yaml as a unit quaternion (1, 4); there it may have any length."""
    found: FloatArray = np.array([quaternion_xyzw]) / np.linalg.norm(quaternion_xyzw)
    return found


def _sound(readings: Readings, figures: int) -> BoolArray:
    """Which readings (n,) are usable: their first `figures` values are finite, and their times within a day of most."""
    found = finite(readings.values, figures)
    for one in (readings.stamp_ns, readings.arrival_ns):
        found &= within_a_day(one)
    return found


def _frames(readings: Readings, whole: BoolArray) -> Frames:
    claims = readings.claims
    if not len(claims.frame):
        return Frames()
    return Frames(claims.frames, claims.frame if whole.all() else claims.frame[whole])


def events(readings: Readings, origin_ns: int) -> Events:
    """Events by arrival."""
    order = np.argsort(readings.arrival_ns, kind="stable")
    listed = [readings.events[at] for at in order]

    def column(name: str) -> FloatArray:
        values = [one.get(name) for one in listed]
        return np.array([value * _MM_PER_M if isinstance(value, float) else np.nan for value in values])

    return Events(
        (readings.arrival_ns[order] - origin_ns).astype(np.float64) * S_PER_NS,
        np.array([one["type"] == "selection" for one in listed], bool),
        np.column_stack([column(f"target_{axis}") for axis in "xyz"]),
        np.column_stack([column(axis) for axis in "xyz"]),
    )
