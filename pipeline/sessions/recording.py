"""A session's tables as inputs of fusion_core: samples, the reference, and the instants to be estimated at."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from fusion_core import Estimator, FusionKalman, Samples, Sensor, Track, smooth
from fusion_core.estimator import resuming
from fusion_core.phone.orientation import rotate
from pipeline.sessions import piecewise
from pipeline.sessions.estimators import build_estimator, of_space, sensor, sensors, sensors_used
from pipeline.sessions.lever_arm import Arm, arm_of, less
from pipeline.sessions.long_phone import LongPhone, long_phone
from pipeline.sessions.phone import Imu, Phone, aligned, logged_readings
from pipeline.statistics.arrays import FloatArray, run_of
from pipeline.study.settings import Study
from pipeline.study.streams import (
    AccelerationStream,
    DisplayStream,
    LinearStream,
    PositionStream,
    ReferenceStream,
    Stream,
    VelocityStream,
)
from pipeline.tables import table as tables
from pipeline.tables.columns import S_PER_NS
from pipeline.tables.table import Columns
from pipeline.words.accuracy_reference import SMOOTHED

SETTLED_S = 1.0
"""Estimates in this time after the first frame's arrival are neither scored nor shown in figures."""

_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Mounted:
    """Samples that take a phone's mounting into account, which is known from `from_s` on.

    Their positions are those of the accelerometer; `arm` goes from it back to the point that the tracker sees, along
    the analysed axes. None where the two are one.
    """

    from_s: float
    imu: str
    samples: dict[str, Samples]
    arm: Arm | None

    def back(self, time: FloatArray) -> FloatArray | float:
        """The arm (m, d) in mm at each instant, by what is known then."""
        return 0.0 if self.arm is None else self.arm.at(time, time)


@dataclass(frozen=True)
class Recording:
    """One session. Times are seconds since `origin_ns`; `times` are the instants of every estimator's track.

    `samples` holds the sensors, the analysed axes only; `reference` is in the tracker's frame and clock; `phones` says
    where orientations came from. The readings of a `long_phone` are in neither: they are read anew, in pieces.
    """

    origin_ns: int
    samples: dict[str, Samples]
    times: FloatArray
    reference: Samples | None
    display: Samples | None
    phones: dict[str, Phone] = field(default_factory=dict)
    mounted: Mounted | None = None
    long_phone: LongPhone | None = None

    def to_ns(self, time: FloatArray) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Seconds since the origin as the tables' nanoseconds."""
        return np.rint(time / S_PER_NS).astype(np.int64) + self.origin_ns

    def to_s(self, time_ns: np.ndarray[Any, np.dtype[np.int64]]) -> FloatArray:
        """The tables' nanoseconds as seconds since the origin."""
        return np.asarray(time_ns - self.origin_ns, dtype=np.float64) * S_PER_NS


@dataclass(frozen=True)
class Shown:
    """What an estimator would have shown, as in the table `tracks`: `time_ns` (n,), `mean` and `sd` (n, d) in mm."""

    time_ns: np.ndarray[Any, np.dtype[np.int64]]
    mean: FloatArray
    sd: FloatArray

    def parts(self) -> Iterator[Shown]:
        """All of it at once, as it is in memory; `tracks.Stored` has more parts."""
        yield self


class Tracked(Protocol):
    """What an estimator would have shown, some instants after the others."""

    def parts(self) -> Iterator[Shown]:
        """The parts in order of time."""


def load(study: Study, entry: Path, may_be_long: bool = False) -> Recording:
    """A session's recording from its ingested tables; `may_be_long` leaves a long phone in its table where it can."""
    long = long_phone(study, entry) if may_be_long else None
    positions, readings = (tables.read_arrow(name, entry) for name in ("positions", "readings"))
    imu = tables.of_rows("imu", []) if long is not None else tables.read_arrow("imu", entry)
    arrivals_ns = np.zeros(0, np.int64) if long is None else long.arrivals_ns()
    first = [pc.min(table["arrival_ns"]).as_py() for table in (imu, positions) if len(table)]
    origin_ns = min([*first, *arrivals_ns[:1].tolist()], default=0)
    whole: dict[str, Samples] = {}
    for name, stream in study.streams.items():
        if not isinstance(stream, AccelerationStream):
            table = readings if isinstance(stream, VelocityStream | LinearStream) else positions
            whole[name] = _vectors(tables.of_stream(table, name), stream, origin_ns)
    raw = _raw_phones(study, imu, origin_ns) if long is None else {}
    times = _instants(study, imu, positions, origin_ns) if long is None else _rising_s(arrivals_ns, origin_ns)
    rows = len(imu) + len(positions)
    del imu, positions, readings, arrivals_ns  # a phone's orientations take as much memory again
    tables.give_back(rows)
    phones = _phones(study, raw, whole) if long is None else {long.name: long.phone()}
    samples = {
        name: _of_axes(phones[name].body.acceleration() if name in phones else whole[name], study, name)
        for name in study.sensor_streams
        if long is None or name != long.name
    }
    return Recording(
        origin_ns,
        samples,
        times,
        _only_stream_of(study, ReferenceStream, whole),
        _only_stream_of(study, DisplayStream, whole),
        phones,
        _mounted(study, samples, whole, phones),
        long,
    )


def positions(study: Study, entry: Path) -> tuple[int, dict[str, Samples]]:
    """The origin in ns, and the streams of positions as `load` gives them, each with its analysed axes.

    Phones are not read and their mounting is not corrected for, so this is quick.
    """
    table, origin_ns = _positions(entry)
    found = {}
    for name, stream in study.streams.items():
        if isinstance(stream, PositionStream | ReferenceStream | DisplayStream):
            whole = _vectors(tables.of_stream(table, name), stream, origin_ns)
            index = [_AXES.index(axis) for axis in shown_axes(study, name)]
            found[name] = Samples(whole.time, whole.arrival, whole.value[:, index])
    return origin_ns, found


def in_space(study: Study, entry: Path, *names: str) -> tuple[Samples, ...]:
    """Streams of positions with all three axes, in the tracker's frame and clock as study.yaml states them."""
    table, origin_ns = _positions(entry)
    return tuple(_vectors(tables.of_stream(table, name), study.streams[name], origin_ns) for name in names)


def _positions(entry: Path) -> tuple[pa.Table, int]:
    """The table `positions`, and the origin in ns."""
    table = tables.read_arrow("positions", entry)
    return table, pc.min(table["arrival_ns"]).as_py() if len(table) else 0


def shown_axes(study: Study, name: str) -> tuple[str, ...]:
    """Those of the analysed axes that a stream of positions has."""
    return tuple(study.axes_of(name)) if name in study.sensor_streams else tuple(study.axes)


def _vectors(rows: Columns, stream: Stream, origin_ns: int) -> Samples:
    """All three axes of a stream of vectors, in the tracker's frame and clock."""
    columns = ("x_mm", "y_mm", "z_mm") if "x_mm" in rows else _AXES
    value = np.column_stack([rows[column] for column in columns])
    if isinstance(stream, ReferenceStream) and len(value):
        value = rotate(np.array(stream.rotation_xyzw), value) + np.array(stream.translation_mm)
    late = stream.stamped_on_arrival or stream.kind in ("reference", "display")
    return samples(*_times(rows, stream.latency_s if late else 0.0), value, origin_ns)


def _times(rows: Columns, latency_s: float) -> tuple[Any, Any]:
    return rows["time_ns"] - round(latency_s / S_PER_NS), rows["arrival_ns"]


def _raw_phones(study: Study, imu: pa.Table, origin_ns: int) -> dict[str, tuple[Imu, FloatArray]]:
    """Every stream of accelerations with the orientations in the log (n, 4), in the phone's own frame."""
    found = {}
    for name, stream in study.sensor_streams.items():
        if isinstance(stream, AccelerationStream):
            rows, in_space = tables.of_stream(imu, name), of_space(sensor(study, stream))
            found[name] = logged_readings(rows, stream, in_space, origin_ns)
    return found


def _phones(study: Study, raw: dict[str, tuple[Imu, FloatArray]], whole: dict[str, Samples]) -> dict[str, Phone]:
    """The phone of every stream of accelerations, with all three axes."""
    tracker = None
    if study.tracker is not None:
        tracker = whole[study.tracker], of_space(sensor(study, study.sensor_streams[study.tracker]))
    found = {}
    for name, stream in study.sensor_streams.items():
        if isinstance(stream, AccelerationStream):
            found[name] = aligned(*raw.pop(name), stream, tracker)
    return found


def _of_axes(samples: Samples, study: Study, name: str) -> Samples:
    """A sensor's readings, with those of its axes that are analysed."""
    index = [_AXES.index(axis) for axis in study.axes_of(name)]
    if index == list(range(samples.value.shape[1])):
        return samples
    rotation = None if samples.rotation is None else samples.rotation[:, index]
    return Samples(samples.time, samples.arrival, samples.value[:, index], rotation, samples.force)


def _only_stream_of(study: Study, kind: type, whole: dict[str, Samples]) -> Samples | None:
    """The only stream of a kind, with the analysed axes; None where there is none or it is empty."""
    index = [_AXES.index(axis) for axis in study.axes]
    for name, stream in study.streams.items():
        if isinstance(stream, kind) and len(whole[name]):
            return Samples(whole[name].time, whole[name].arrival, whole[name].value[:, index])
    return None


def _mounted(
    study: Study, samples: dict[str, Samples], whole: dict[str, Samples], phones: dict[str, Phone]
) -> Mounted | None:
    """The samples corrected for the mounting of the first phone whose mounting is known; None if there is none."""
    for name, found in phones.items():
        if found.calibrated is None or found.lever_arm_mm is None:
            continue
        index = [_AXES.index(axis) for axis in study.axes]
        arm = arm_of(found.calibrated, found.lever_arm_mm) if found.lever_arm_mm.any() else None
        corrected = dict(samples)
        corrected[name] = _of_axes(found.calibrated.acceleration(), study, name)
        for stream, sensing in study.sensor_streams.items():
            if sensing.kind == "position" and arm is not None:
                corrected[stream] = _of_axes(less(arm, whole[stream]), study, stream)
        return Mounted(found.mounted_from_s, name, corrected, None if arm is None else arm.along(index))
    return None


def show(study: Study, name: str, loaded: Recording, times: FloatArray) -> Track:
    """What the study's estimator of that name would have shown at `times` (n,) in s."""
    order = np.argsort(times, kind="stable") if loaded.long_phone is not None else np.zeros(0, np.int64)
    pieces = in_pieces(study, name, loaded, times[order])
    if pieces is not None:
        tracks = [track for track, _ in pieces]
        mean, sd = np.empty((2, len(times), tracks[0].mean.shape[1]))
        mean[order], sd[order] = (np.concatenate([getattr(track, key) for track in tracks]) for key in ("mean", "sd"))
        return Track(times, mean, sd)
    estimator: Estimator = build_estimator(study, name)
    track = estimator.replay(loaded.samples, times)
    known = loaded.mounted
    if known is None or known.imu not in estimator.sensors or not np.any(times > known.from_s):
        return track
    after = times > known.from_s
    better = estimator.replay(known.samples, times[after])
    mean, sd = track.mean.copy(), track.sd.copy()
    mean[after] = better.mean + known.back(times[after])
    sd[after] = better.sd
    return Track(times, mean, sd)


def in_pieces(study: Study, name: str, loaded: Recording, times: FloatArray) -> Iterator[tuple[Track, Any]] | None:
    """The parts of an estimator's track at rising `times` (n,) in s, with its state after each.

    None where no phone is a long one, or the estimator, which then does not use it, cannot go on from a state.
    """
    estimator, phone = resuming(build_estimator(study, name)), loaded.long_phone
    if phone is None or estimator is None:
        return None
    if phone.name not in sensors_used(study, name):
        return piecewise.replayed(estimator, loaded.samples, None, times)
    pieces = (_of_axes(piece, study, phone.name) for piece in phone.pieces(loaded.origin_ns))
    return piecewise.replayed(estimator, loaded.samples, (phone.name, pieces), times)


def tracked(study: Study, name: str, loaded: Recording) -> Shown:
    """What the estimator would have shown at every instant of the recording, from its first estimate on."""
    return _known(loaded, show(study, name, loaded, loaded.times))


def tracked_in_parts(study: Study, name: str, loaded: Recording) -> Iterator[Shown]:
    """The same, some instants at a time where that is possible and the phone is a long one."""
    pieces = in_pieces(study, name, loaded, loaded.times)
    if pieces is None:
        yield tracked(study, name, loaded)
        return
    for track, _ in pieces:
        yield _known(loaded, track)


def _known(loaded: Recording, track: Track) -> Shown:
    """The part of a track that has estimates."""
    known: np.ndarray[Any, np.dtype[np.bool_]] = np.all(np.isfinite(track.mean), axis=1)
    where = run_of(known)
    return Shown(loaded.to_ns(track.time[where]), track.mean[where], track.sd[where])


def within(study: Study, name: str, loaded: Recording, begin_s: float, end_s: float) -> Samples:
    """A sensor's readings, at least those that were measured from `begin_s` until `end_s`."""
    phone = loaded.long_phone
    if phone is None or phone.name != name:
        return loaded.samples[name]
    parts: list[Samples] = []
    for piece in phone.pieces(loaded.origin_ns):
        inside = (piece.time >= begin_s) & (piece.time <= end_s)
        if inside.any() or not parts:
            parts.append(piecewise.marked(_of_axes(piece, study, name), inside))
    return piecewise.joined(parts)


def reference(study: Study, loaded: Recording) -> tuple[str, Samples] | None:
    """The reference that estimates are compared with, and its name: the recorded one, else all readings smoothed."""
    recorded = study.stream_of_kind("reference")
    if recorded is not None:
        return None if loaded.reference is None else (recorded, loaded.reference)
    if study.tracker is None or not study.estimators or not len(loaded.samples[study.tracker]):
        return None
    fixed = loaded.mounted if loaded.mounted is not None and loaded.mounted.from_s == -np.inf else None
    found = smooth(FusionKalman(_in_time(study)), fixed.samples if fixed else loaded.samples, loaded.times)
    value = found.mean + (fixed.back(loaded.times) if fixed else 0.0)
    known = np.isfinite(value).all(axis=1)
    return SMOOTHED, Samples(loaded.times[known], loaded.times[known], value[known])


def _in_time(study: Study) -> dict[str, Sensor]:
    """The sensors that observe a single instant, as a Kalman filter needs them."""
    return {name: sensor for name, sensor in sensors(study).items() if not any(term.at_s for term in sensor.terms)}


def _instants(study: Study, imu: pa.Table, positions: pa.Table, origin_ns: int) -> FloatArray:
    """The arrivals of the accelerations; of the frames where there is no IMU."""
    accelerations, frames = study.stream_of_kind("acceleration"), study.stream_of_kind("position")
    rows = tables.of_stream(imu, accelerations) if accelerations else tables.of_stream(positions, frames or "")
    return _rising_s(rows["arrival_ns"], origin_ns)


def _rising_s(arrival_ns: np.ndarray[Any, np.dtype[np.int64]], origin_ns: int) -> FloatArray:
    """Arrivals (n,) in s since the origin, each instant once."""
    if (arrival_ns[1:] <= arrival_ns[:-1]).any():
        arrival_ns = np.unique(arrival_ns)
    times: FloatArray = np.asarray((arrival_ns - origin_ns) * S_PER_NS)
    return times


def seeded(*names: str) -> np.random.Generator:
    """Random numbers that depend on names alone, so that a result does not depend on order or on other sessions."""
    digest = hashlib.sha256("\x1f".join(names).encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:8], "big"))


def samples(
    time_ns: np.ndarray[Any, Any],
    arrival_ns: np.ndarray[Any, Any],
    value: np.ndarray[Any, Any],
    origin_ns: int,
) -> Samples:
    """Readings as fusion_core's samples: in order of arrival, in seconds since `origin_ns`, each reading once.

    A reading with the same stamp and values as an earlier one is a copy and is left out (`quality` counts them).
    """
    order = np.lexsort((time_ns, arrival_ns))
    time_ns, arrival_ns, value = time_ns[order], arrival_ns[order], value[order]
    kept = np.flatnonzero(~pd.DataFrame(value).assign(stamp=time_ns).duplicated())
    from fusion_core.samples import Samples  # and with it the compiler, which most commands never need

    return Samples(
        (time_ns[kept] - origin_ns) * S_PER_NS,
        (arrival_ns[kept] - origin_ns) * S_PER_NS,
        np.ascontiguousarray(value[kept], dtype=np.float64),
    )
