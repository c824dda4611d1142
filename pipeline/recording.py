"""A session's tables as fusion_core knows them: sensors, samples, the reference, and the instants to be shown at."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import ConfigDict, TypeAdapter, ValidationError

from fusion_core import ESTIMATORS, Estimator, FloatArray, Samples, Sensor
from fusion_core.alignment import rotate, tracker_acceleration
from pipeline import tables
from pipeline.errors import PipelineError, did_you_mean
from pipeline.study import AccelerationStream, PositionStream, ReferenceStream, Study


@dataclass(frozen=True)
class Recording:
    """One session. Times are seconds since `origin_ns`; `times` are the instants every estimator is asked for.

    `samples` holds the sensors, the analysed axes only; `reference` is in the tracker's frame and clock.
    """

    origin_ns: int
    samples: dict[str, Samples]
    times: FloatArray
    reference: Samples | None
    display: Samples | None

    def to_ns(self, time: FloatArray) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Seconds since the origin as the tables' nanoseconds."""
        return np.rint(time / tables.NANOSECONDS).astype(np.int64) + self.origin_ns


def load(study: Study, entry: Path) -> Recording:
    """A session's recording from its ingested tables."""
    positions, imu = tables.read("positions", entry), tables.read("imu", entry)
    stamps = pd.concat([positions["arrival_ns"], imu["arrival_ns"]])
    origin_ns = int(stamps.min()) if len(stamps) else 0
    axes = ["xyz".index(axis) for axis in study.axes]
    samples: dict[str, Samples] = {}
    reference = display = None
    for name, stream in study.streams.items():
        rows = imu if stream.kind == "acceleration" else positions
        rows = rows[rows["stream"] == name]
        if isinstance(stream, AccelerationStream):
            samples[name] = _accelerations(rows, stream, origin_ns, axes)
            continue
        value = rows[["x_mm", "y_mm", "z_mm"]].to_numpy(np.float64)
        if isinstance(stream, ReferenceStream) and len(value):
            value = rotate(np.array(stream.rotation_xyzw), value) + np.array(stream.translation_mm)
        late = stream.stamp == "arrival" or stream.kind != "position"
        read = _samples(rows, value[:, axes], origin_ns, stream.latency_s if late else 0.0)
        if isinstance(stream, PositionStream):
            samples[name] = read
        elif isinstance(stream, ReferenceStream):
            reference = read if len(read) else None
        else:
            display = read if len(read) else None
    return Recording(origin_ns, samples, _instants(study, imu, positions, origin_ns), reference, display)


def _samples(rows: pd.DataFrame, value: FloatArray, origin_ns: int, latency_s: float) -> Samples:
    time_ns, arrival_ns = rows["time_ns"].to_numpy(np.int64), rows["arrival_ns"].to_numpy(np.int64)
    return tables.samples(time_ns - round(latency_s / tables.NANOSECONDS), arrival_ns, value, origin_ns)


def _accelerations(rows: pd.DataFrame, stream: AccelerationStream, origin_ns: int, axes: list[int]) -> Samples:
    """In the tracker frame; those of unknown orientation are left out (the table `quality` counts them)."""
    known = rows[rows["qw"].notna()]
    force = known[["ax_mm_s2", "ay_mm_s2", "az_mm_s2"]].to_numpy(np.float64)
    turn = known[["qx", "qy", "qz", "qw"]].to_numpy(np.float64)
    value = tracker_acceleration(force, turn, np.array(stream.gravity_mm_s2))
    return _samples(known, value[:, axes], origin_ns, stream.latency_s if stream.stamp == "arrival" else 0.0)


def _instants(study: Study, imu: pd.DataFrame, positions: pd.DataFrame, origin_ns: int) -> FloatArray:
    """The arrivals of the accelerations; of the frames where there is no IMU."""
    accelerations, frames = study.stream_of_kind("acceleration"), study.stream_of_kind("position")
    rows = imu[imu["stream"] == accelerations] if accelerations else positions[positions["stream"] == frames]
    arrival = np.unique(rows["arrival_ns"].to_numpy(np.int64))
    times: FloatArray = (arrival - origin_ns) * tables.NANOSECONDS
    return times


def sensors(study: Study) -> dict[str, Sensor]:
    """The study's sensors by stream name, of the analysed axes."""
    return {
        name: Sensor(
            "position" if isinstance(stream, PositionStream) else "acceleration",
            stream.noise_sd_mm if isinstance(stream, PositionStream) else stream.noise_sd_mm_s2,
            stream.latency_s,
            len(study.axes),
        )
        for name, stream in study.sensor_streams.items()
    }


def build_estimator(study: Study, name: str) -> Estimator:
    """The study's estimator of that name; PipelineError that says which key or value is wrong."""
    settings = study.estimators[name]
    where = f"study.yaml: estimators.{name}"
    if settings.type not in ESTIMATORS:
        raise PipelineError(f'{where}: type "{settings.type}" is not known{did_you_mean(settings.type, ESTIMATORS)}')
    kind = ESTIMATORS[settings.type]
    types = {field.name: field.type for field in fields(kind) if field.name != "sensors"}
    used = {n: s for n, s in sensors(study).items() if settings.use is None or n in settings.use}
    parameters = {}
    for key, value in settings.parameters.items():
        if key not in types:
            raise PipelineError(f'{where}: unknown key "{key}"{did_you_mean(key, types)}')
        parameters[key] = _converted(kind, key, value, where)
    try:
        return kind(used, **parameters)
    except ValueError as error:
        raise PipelineError(f"{where}: {error}") from None


@cache
def _adapters(kind: type) -> dict[str, TypeAdapter[Any]]:
    """What turns a parameter of study.yaml into the type its dataclass states."""
    from typing import get_type_hints

    strict = ConfigDict(allow_inf_nan=False)
    hints = get_type_hints(kind)
    return {
        field.name: TypeAdapter(hints[field.name], config=strict) for field in fields(kind) if field.name != "sensors"
    }


def _converted(kind: type, key: str, value: Any, where: str) -> Any:
    if isinstance(value, bool):
        raise PipelineError(f'{where}: "{key}": should not be {str(value).lower()}')
    try:
        return _adapters(kind)[key].validate_python(value)
    except ValidationError as error:
        fault = error.errors()[0]["msg"]
        raise PipelineError(f'{where}: "{key}": {fault[0].lower()}{fault[1:]} (found {value!r})') from None


def seeded(*names: str) -> np.random.Generator:
    """Random numbers that depend on names alone, so that a result does not depend on order or on other sessions."""
    digest = hashlib.sha256("\x1f".join(names).encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:8], "big"))
