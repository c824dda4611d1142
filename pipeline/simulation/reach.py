"""Simulated reaches with known truth, written as ordinary logs, which the pipeline then reads like any others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.sessions.logs.log import Content
from pipeline.sessions.logs.mcap import Message, in_order, write
from pipeline.sessions.recording import seeded
from pipeline.simulation.motion import minimum_jerk
from pipeline.statistics.arrays import FloatArray
from pipeline.study.folder import inside
from pipeline.study.settings import Study
from pipeline.study.simulation import ReachSimulation
from pipeline.study.streams import AccelerationStream, PositionStream, ReferenceStream

_EPOCH_NS = 1_700_000_000_000_000_000  # an arbitrary fixed instant, so that a simulated log is the same on every day
_MM_PER_M = 1000.0


@dataclass(frozen=True)
class _Streams:
    """The streams that a simulation writes."""

    tracker: PositionStream
    imu: AccelerationStream
    reference: ReferenceStream


def simulate(
    folder: Path,
    study: Study,
    begin: Callable[[int], None] = lambda total: None,
    done: Callable[[], None] = lambda: None,
) -> list[Path]:
    """Write every recording of the study's `simulation:` block; returns their paths.

    `begin` is called with the number of recordings, `done` after each. The seed determines everything; a recording does
    not depend on how many there are. Raises PipelineError where study.yaml lacks what the simulation needs.
    """
    settings = study.simulation
    assert isinstance(settings, ReachSimulation)  # noqa: S101 - tells the type checker
    if study.sessions is None or "{participant}" not in study.sessions or len(study.conditions) != 1:
        raise PipelineError(
            f"{folder / 'study.yaml'}: simulation: a reach needs one condition and sessions: with {{participant}} in it"
        )
    streams = _streams(folder, study)
    paths = []
    begin(settings.recordings)
    for index in range(settings.recordings):
        participant, condition = f"R{index + 1:02d}", study.conditions[0]
        name = study.sessions.format(participant=participant, condition=condition, session=f"{participant}_{condition}")
        path = inside(folder, name, f"{folder / 'study.yaml'}: sessions", must_exist=False)
        path.parent.mkdir(parents=True, exist_ok=True)
        facts = {
            "participant": participant,
            "condition": condition,
            "origin": f"simulated by Steadyhand: minimum-jerk reach, seed {settings.seed}",
        }
        write(path, facts, in_order(_reach(settings, streams, seeded(str(settings.seed), participant))))
        paths.append(path)
        done()
    return paths


def _streams(folder: Path, study: Study) -> _Streams:
    streams = {}
    for kind in ("position", "acceleration", "reference"):
        name = study.stream_of_kind(kind)
        if name is None:
            raise PipelineError(f"{folder / 'study.yaml'}: simulation: streams lacks one of kind {kind}")
        streams[kind] = study.streams[name]
    tracker, imu, reference = streams["position"], streams["acceleration"], streams["reference"]
    assert isinstance(tracker, PositionStream)  # noqa: S101 - tells the type checker
    assert isinstance(imu, AccelerationStream)  # noqa: S101
    assert isinstance(reference, ReferenceStream)  # noqa: S101
    return _Streams(tracker, imu, reference)


def _reach(settings: ReachSimulation, streams: _Streams, random: np.random.Generator) -> Iterator[Message]:
    """Tracker, accelerations and reference of one reach along x; noise on every axis."""
    length_s = settings.still_before_s + settings.reach_s + settings.still_after_s

    def times(rate_hz: float) -> FloatArray:
        """Regular times in s from a random phase, since sensors do not start together."""
        first: FloatArray = np.arange(random.uniform(0, 1 / rate_hz), length_s, 1 / rate_hz)
        return first

    def along_x(values: FloatArray) -> FloatArray:
        return np.column_stack([values, np.zeros((len(values), 2))])

    def hand(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        share, bend = minimum_jerk(time, settings.still_before_s, settings.reach_s)
        return along_x(settings.distance_mm * share), along_x(settings.distance_mm * bend)

    time = times(settings.reference_rate_hz)
    yield from _messages("position", streams.reference, time, hand(time)[0] / _MM_PER_M)
    time = times(settings.tracker_rate_hz)
    seen = hand(time)[0] + random.normal(0, streams.tracker.noise_sd_mm, (len(time), 3))
    yield from _messages("position", streams.tracker, time, seen / _MM_PER_M)
    time = times(settings.imu_rate_hz)
    felt = hand(time)[1] + random.normal(0, streams.imu.noise_sd_mm_s2, (len(time), 3))
    force = (felt - np.array(streams.imu.gravity_mm_s2)) / _MM_PER_M  # the phone is held as the tracker's frame is
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    turning = np.zeros((len(time), 3))
    yield from _messages("acceleration", streams.imu, time, np.hstack([force, turning, upright]))


def _messages(
    content: Content,
    stream: PositionStream | AccelerationStream | ReferenceStream,
    time: FloatArray,
    values: FloatArray,
) -> Iterator[Message]:
    """A stream's messages, late by its latency and stamped as it says."""
    measured = _EPOCH_NS + np.rint(time * 1e9).astype(np.int64)
    late = round(stream.latency_s * 1e9)
    for instant, value in zip(measured, values, strict=True):
        arrival = int(instant) + late
        yield Message(stream.topic, content, arrival if stream.stamp == "arrival" else int(instant), arrival, value)
