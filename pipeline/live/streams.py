"""Streams of study.yaml as a running study needs them: what is logged, and what an estimator makes of it.

A reading becomes a sample in the same way as when a report reads the log (`pipeline.sessions.recording`), from the very
numbers that are logged. So what was shown is what a replay gives; a test holds the two against each other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from fusion_core import Sample
from fusion_core.phone.orientation import rotation
from pipeline.errors import PipelineError
from pipeline.live.units import units
from pipeline.statistics.arrays import FloatArray
from pipeline.study.recording import WEIGHTED_TLX, Recording
from pipeline.study.settings import Study
from pipeline.study.streams import AccelerationStream, PositionStream, ReferenceStream
from pipeline.tables.columns import S_PER_NS

_MM_PER_M = 1000.0
_ALL_AXES = ("x", "y", "z")
KINDS = ("phone", "app", "udp_json", "osc", "lsl", "camera", "rosbridge", "foxglove", "demo")
"""The senders that work."""
_OF_OTHER_LOGS = ("unit", "turning_unit", "fields", "child", "parent", "stamp_unit", "arrival")


@dataclass(frozen=True)
class LiveStream:
    """A stream that readings come from. `late_ns` is subtracted from its stamps, as `stamp: arrival` says.

    Of a phone, `mounting` (3, 3) turns the accelerometer's axes into the body's, and `arm_mm` (3,) goes from it to the
    point that the tracker sees.
    """

    name: str
    topic: str
    content: Literal["position", "acceleration"]
    is_sensor: bool
    stamps_arrival: bool
    late_ns: int
    axes: tuple[int, ...]
    gravity_mm_s2: FloatArray = field(default_factory=lambda: np.zeros(3))
    mounting: FloatArray = field(default_factory=lambda: np.eye(3))
    arm_mm: FloatArray = field(default_factory=lambda: np.zeros(3))


def live_streams(study: Study, where: str) -> dict[str, LiveStream]:
    """The streams that have senders. Raises PipelineError, beginning with `where`, for what cannot be recorded live."""
    assert study.recording is not None  # noqa: S101 - checked before
    found = {}
    for name in study.recording.senders:
        stream = study.streams[name]
        late = stream.latency_s if stream.stamp == "arrival" or isinstance(stream, ReferenceStream) else 0.0
        common = (name, stream.topic)
        stamps, late_ns = stream.stamp == "arrival", round(late / S_PER_NS)
        if isinstance(stream, AccelerationStream):
            if stream.calibrate_s:
                raise PipelineError(
                    f"{where}: streams.{name}: calibrate_s: a live study learns no mounting; write what"
                    " `steadyhand fit` finds of a recording into mounting_xyzw and lever_arm_mm, or show"
                    " fusion_adaptive, which finds it by itself"
                )
            of_body = study.recording.senders[name].axes
            if not np.isfinite(units(study.recording.senders[name]).back_xyzw).all():
                raise PipelineError(
                    f"{where}: recording: senders.{name}: axes {list(of_body)} mirror the phone, which no turn does"
                )
            axes = tuple(_ALL_AXES.index(axis) for axis in study.axes)
            gravity = np.array(stream.gravity_mm_s2)
            mounting, arm = rotation(np.array(stream.mounting_xyzw)), np.array(stream.lever_arm_mm)
            found[name] = LiveStream(*common, "acceleration", True, stamps, late_ns, axes, gravity, mounting, arm)
        elif isinstance(stream, PositionStream | ReferenceStream):
            is_sensor = isinstance(stream, PositionStream)
            of_stream = study.axes_of(name) if is_sensor else study.axes
            axes = tuple(_ALL_AXES.index(axis) for axis in of_stream)
            found[name] = LiveStream(*common, "position", is_sensor, stamps, late_ns, axes)
        else:
            raise PipelineError(
                f"{where}: recording: senders: {name} is of kind {stream.kind}, which is not recorded live"
            )
    mounted = [name for name, one in found.items() if one.arm_mm.any() or not np.array_equal(one.mounting, np.eye(3))]
    if len(mounted) > 1:
        raise PipelineError(f"{where}: streams: {' and '.join(mounted)} both state a mounting; a live study takes one")
    return found


def sample_of(
    stream: LiveStream, stamp_ns: int, arrival_ns: int, values: tuple[float, ...], origin_ns: int
) -> Sample | None:
    """A logged reading as an estimator takes it; None for an acceleration without an orientation."""
    time, arrival = (stamp_ns - stream.late_ns - origin_ns) * S_PER_NS, (arrival_ns - origin_ns) * S_PER_NS
    axes = list(stream.axes)
    if stream.content == "position":
        return Sample(time, arrival, np.array(values)[axes] * _MM_PER_M)
    if not all(map(math.isfinite, values[6:10])):
        return None
    turn, force = rotation(np.array(values[6:10])) @ stream.mounting, np.array(values[:3]) * _MM_PER_M
    acceleration = turn @ force + stream.gravity_mm_s2
    return Sample(time, arrival, acceleration[axes], turn[axes], force)


def required(study: Study, where: str) -> Mapping[str, str]:
    """The study's streams and topics that a live study cannot do without, by what they are for.

    Raises PipelineError, beginning with `where`, naming what is missing.
    """
    if study.recording is None:
        raise PipelineError(f"{where}: has no `recording:`, which says how it is run; docs/live.md shows one")
    display = study.stream_of_kind("display")
    needs = {
        "streams: a stream of kind display, for what was shown": display,
        "events: a topic": study.events.topic if study.events else None,
        "task": study.task and "task",
        "sessions: {participant} and {condition} in the name of the logs": _names_both(study),
        "streams: a stream of kind position": study.tracker,
        "participants: the name of a file to be written": study.participants,
    }
    if study.recording.questionnaires:
        needs["questionnaires: the name of a file to be written"] = study.questionnaires
    for what, found in needs.items():
        if not found:
            raise PipelineError(f"{where}: a live study needs {what}")
    if not {"x", "y"} <= set(study.axes):
        raise PipelineError(f"{where}: axes: a live study shows x and y, found {list(study.axes)}")
    for condition in study.conditions:
        if condition not in study.shown:
            raise PipelineError(f'{where}: shown: has no estimator for "{condition}"; add the one it displays')
    _weights_have_a_rule(study, study.recording, where)
    _logs_are_plain(study, where)
    for name, sender in study.recording.senders.items():
        if sender.kind not in KINDS:
            raise PipelineError(
                f"{where}: recording: senders.{name}: {sender.kind} is not there yet; use {', '.join(KINDS)}"
            )
    for name, stream in study.sensor_streams.items():
        if name not in study.recording.senders:
            raise PipelineError(f"{where}: recording: senders: has none for {name}, of kind {stream.kind}; add one")
    assert display is not None and study.events is not None  # noqa: S101
    return {"display": study.streams[display].topic, "events": study.events.topic}


def _names_both(study: Study) -> str | None:
    pattern = study.sessions or ""
    return pattern if "{participant}" in pattern and "{condition}" in pattern and "{session}" not in pattern else None


def _weights_have_a_rule(study: Study, recording: Recording, where: str) -> None:
    for one in recording.questionnaires:
        scored = study.scoring.get(one.id)
        if one.pairs and (scored is None or scored.rule != WEIGHTED_TLX):
            raise PipelineError(
                f"{where}: recording: questionnaires: {WEIGHTED_TLX} asks for weights, and no rule says what to do with"
                f" them; write scoring: {{{one.id}: {{rule: {WEIGHTED_TLX}, range: [0, 100]}}}}"
            )


def _logs_are_plain(study: Study, where: str) -> None:
    """Raise PipelineError for what says how a log of somebody else's is to be read; a report would apply it to ours."""
    for name, stream in study.streams.items():
        for key in _OF_OTHER_LOGS:
            usual = type(stream).model_fields[key].default if key in type(stream).model_fields else None
            found = getattr(stream, key, None)
            if found and found != usual:
                of_sender = name in study.sensor_streams and key in ("unit", "turning_unit")
                instead = f"say it under recording: senders: {name}: unit" if of_sender else "remove it"
                raise PipelineError(
                    f"{where}: streams.{name}: {key}: {_in_words(found)} says how a log is read that others wrote; a"
                    f" live study's logs hold metres, m/s², rad/s and stamps of their own, so {instead}"
                )
        if stream.stamp == "log_time":
            raise PipelineError(
                f"{where}: streams.{name}: stamp: log_time is for logs without stamps, and a live study's have them;"
                " write stamp: arrival if the sender does not say when it measured"
            )
    if study.events is not None and study.events.arrival != "log":
        raise PipelineError(
            f"{where}: events: arrival: {study.events.arrival} says how a log is read that others wrote; remove it"
        )


def _in_words(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, Mapping) else str(value)
