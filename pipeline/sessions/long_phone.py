"""A long session's phone, read from its table some rows at a time: of hours it would take gigabytes at once.

Only where nothing needs all of its readings together: the log has every orientation, the mounting is that of the
phone's own axes, a reference was recorded, and the estimators that use the phone can go on from a state.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc

from fusion_core import Samples, Sensor
from fusion_core.estimator import resuming
from fusion_core.phone.calibration import Body
from pipeline.errors import PipelineError
from pipeline.sessions.estimators import build_estimator, of_space, sensor, sensors_used
from pipeline.sessions.growing import Growing
from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.phone import CARRIED, IN_LOG, Phone, aligned, logged_readings
from pipeline.study.memory import free_bytes, shortage
from pipeline.study.settings import Study
from pipeline.study.streams import AccelerationStream
from pipeline.tables import table as tables

AnyArray = np.ndarray[Any, Any]

_LOGGED_BYTES, _WHOLE_BYTES = 80, 390  # of a message: its figures, and what fusing makes of them
_ORIENTATION = ("qx", "qy", "qz", "qw")


@dataclass(frozen=True)
class LongPhone:
    """The phone of a session's entry, to be turned into samples in space piece by piece."""

    entry: Path
    name: str
    stream: AccelerationStream
    sensor: Sensor
    count: int

    def phone(self) -> Phone:
        """Where the orientations came from, without the readings."""
        gravity = np.array(self.stream.gravity_mm_s2)
        nothing = Body(np.zeros(0), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)), gravity)
        return Phone(nothing, {IN_LOG: self.count, CARRIED: 0}, 0)

    def arrivals_ns(self) -> IntArray:
        """When every reading arrived, in order (n,)."""
        found = Growing(np.int64)
        for part in tables.read_parts("imu", self.entry, ("arrival_ns",)):
            found.add(part["arrival_ns"].to_numpy())
        return found.whole()

    def pieces(self, origin_ns: int) -> Iterator[Samples]:
        """The accelerations of all axes in order of arrival; those that arrived at once are never parted."""
        waiting: dict[str, AnyArray] = {}
        for part in tables.read_parts("imu", self.entry):
            rows = tables.of_stream(part, self.name)
            joined = {key: np.concatenate([waiting[key], rows[key]]) if waiting else rows[key] for key in rows}
            arrival_ns = joined["arrival_ns"]
            ready = int(np.searchsorted(arrival_ns, arrival_ns[-1]))
            waiting = {key: column[ready:] for key, column in joined.items()}
            if ready:
                yield self._samples({key: column[:ready] for key, column in joined.items()}, origin_ns)
        yield self._samples(waiting, origin_ns)

    def _samples(self, rows: Mapping[str, AnyArray], origin_ns: int) -> Samples:
        return aligned(
            *logged_readings(rows, self.stream, self.sensor, origin_ns), self.stream, None
        ).body.acceleration()


def long_phone(study: Study, entry: Path) -> LongPhone | None:
    """The session's phone if it is long and can be read in pieces; None if there is none such.

    Raises PipelineError where a long one has to be in memory whole, and takes more than there is.
    """
    count = tables.rows("imu", entry)
    if count <= tables.ROWS_AT_ONCE:
        return None
    found = _in_pieces(study, entry, count)
    if found is None:
        _require_memory(entry, count)
    return found


def _in_pieces(study: Study, entry: Path, count: int) -> LongPhone | None:
    phones = {name: one for name, one in study.sensor_streams.items() if isinstance(one, AccelerationStream)}
    if len(phones) != 1 or not _has_reference(study, entry):
        return None
    ((name, stream),) = phones.items()
    moved = stream.mounting_xyzw != (0.0, 0.0, 0.0, 1.0) or stream.lever_arm_mm != (0.0, 0.0, 0.0)
    if moved or stream.calibrate_s or not all(_goes_on(study, each, name) for each in study.estimators):
        return None
    orientations = tables.read_parts("imu", entry, _ORIENTATION)
    known = all(np.isfinite(part[column].to_numpy()).all() for part in orientations for column in _ORIENTATION)
    return LongPhone(entry, name, stream, of_space(sensor(study, stream)), count) if known else None


def _require_memory(entry: Path, count: int) -> None:
    lacking = shortage(_LOGGED_BYTES * count, _WHOLE_BYTES / _LOGGED_BYTES, free_bytes(), "what its phone measured")
    if lacking is not None:
        session = next(tables.read_parts("imu", entry, ("session",)))["session"][0].as_py()
        raise PipelineError(f"session {session}: {lacking}")


def _has_reference(study: Study, entry: Path) -> bool:
    """Without one it is made of all readings smoothed, or where the hand is still is judged by the phone."""
    name = study.stream_of_kind("reference")
    parts = tables.read_parts("positions", entry, ("stream",))
    return name is not None and any(pc.any(pc.equal(part["stream"], name)).as_py() for part in parts)


def _goes_on(study: Study, estimator: str, phone: str) -> bool:
    """Whether an estimator needs none of the phone, or a piece at a time."""
    return phone not in sensors_used(study, estimator) or resuming(build_estimator(study, estimator)) is not None
