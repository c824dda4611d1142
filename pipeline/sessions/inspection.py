"""Suggests how a log's topics could be used in a study: as which streams, with which keys in study.yaml; and checks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.sessions.checks import Finding, checked
from pipeline.sessions.checks.agreement import see_one_movement
from pipeline.sessions.checks.force import gravity_seen_mm_s2
from pipeline.sessions.checks.noise import noise_sd
from pipeline.sessions.checks.of_log import of_log
from pipeline.sessions.checks.recorded import Imu, Recorded
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Content, Log, MessageType, Readings, Source, Wanted
from pipeline.sessions.logs.tables.named import SENSOR_LOGGER, SINCE_START, TOTAL_ACCELERATION
from pipeline.sessions.stream_quality import quality_row
from pipeline.study.settings import Study
from pipeline.study.units import G_MM_S2

_CONTENTS: Sequence[Content] = ("position", "acceleration", "events")
_NEEDS: Mapping[Content, str] = {
    "position": "geometry_msgs/msg/PointStamped",
    "acceleration": "sensor_msgs/msg/Imu",
    "events": "steadyhand.Event in JSON",
}
_USABLE_SHARE = 0.5  # of a topic's messages: if fewer can be read, the topic holds something else
_LATE_MIN_S = 0.03
_DAY_NS = 86_400 * 10**9
_ALONG_DEG = 5.0  # gravity this close to an axis is taken to be along it


@dataclass(frozen=True)
class Topic:
    """A topic: its type, the content it can be used as and its readings; or `why_not` if it cannot be used."""

    name: str
    type: MessageType
    content: Content | None
    why_not: str
    frames: tuple[str, ...]
    rate_hz: float | None
    readings: Readings | None


@dataclass(frozen=True)
class Inspection:
    """The topics of a log, the streams it could have in study.yaml (as keys and values), and the checks' findings.

    `guessed` are the streams whose gravity the log does not show, so that the value given is a guess.
    """

    topics: tuple[Topic, ...]
    streams: Mapping[str, Mapping[str, Any]]
    events: str | None
    findings: tuple[Finding, ...]
    guessed: frozenset[str] = frozenset()

    @property
    def usable(self) -> bool:
        """Whether there is anything that a study could use."""
        return bool(self.streams) or self.events is not None


def inspected(path: Path, counted: Log) -> Inspection:
    """Reads a log again, now with its topics decoded; `counted` is the log as read without decoding."""
    decoded = _decoded(path, counted)
    by_seconds = _by_seconds_since_start(path, counted, decoded)
    decoded |= by_seconds
    topics = tuple(_topic(name, counted, decoded.get(name)) for name in sorted(counted.types))
    streams = _streams(topics)
    events = next((topic.name for topic in topics if topic.content == "events"), None)
    log = Log(counted.facts, {topic.name: topic.readings for topic in topics if topic.readings is not None})
    guessed: frozenset[str] = frozenset()
    if streams:
        recorded = of_log(log, _study(streams, events))
        guessed = frozenset(imu.name for imu in recorded.imus if not _tells_gravity(imu))
        streams = _measured(streams, recorded)
    findings = checked(of_log(log, _study(streams, events))) if streams else ()
    for stream in streams.values():
        if stream["topic"] in by_seconds:
            stream["fields"] = {"stamp": SINCE_START}
    return Inspection(topics, streams, events, findings, guessed)


def _decoded(path: Path, counted: Log) -> dict[str, tuple[Content, Readings]]:
    """Each topic's readings, as the content of its type or else the first that most of its messages can be read as."""
    found: dict[str, tuple[Content, Readings]] = {}
    for content in _CONTENTS:
        wanted = [
            Wanted(name, content)
            for name, one in counted.types.items()
            if one.content in (None, content) and name not in found
        ]
        if not wanted:
            continue
        for name, readings in read_log(path, wanted).topics.items():
            if readings.read and readings.read >= _USABLE_SHARE * counted.topics[name].read:
                found[name] = content, readings
    return found


def _by_seconds_since_start(
    path: Path, counted: Log, decoded: dict[str, tuple[Content, Readings]]
) -> dict[str, tuple[Content, Readings]]:
    """Topics of Sensor Logger by the seconds since its start, where others do not count since 1970 as it does."""
    begins = {name: int(readings.stamp_ns.min()) for name, (_, readings) in decoded.items() if readings.read}
    of_app = {name for name in begins if counted.types[name].name == SENSOR_LOGGER}
    others = [begin for name, begin in begins.items() if name not in of_app]
    if not of_app or not others or min(begins[name] for name in of_app) - max(others) < _DAY_NS:
        return {}
    wanted = [Wanted(name, decoded[name][0], Source(fields={"stamp": (SINCE_START,)})) for name in of_app]
    read = read_log(path, wanted).topics
    return {one.topic: (one.content, read[one.key]) for one in wanted}


def _topic(name: str, counted: Log, decoded: tuple[Content, Readings] | None) -> Topic:
    kind, every = counted.types[name], counted.topics.get(name)
    if decoded is not None:
        content, readings = decoded
        rate = quality_row("", name, readings, []).get("rate_hz") if content != "events" else None
        return Topic(name, kind, content, "", readings.claims.frames, rate, readings)
    if every is None or not every.read:
        return Topic(name, kind, None, "it has no messages", (), None, None)
    notes = "; ".join(every.notes).removeprefix("counted, but a study would lose them: ")
    needed = ", ".join(f"{content}: {needs}" for content, needs in _NEEDS.items())
    why = notes if kind.content is not None and notes else f"its type is none of those that are read ({needed})"
    return Topic(name, kind, None, why, (), None, None)


def _streams(topics: Iterable[Topic]) -> dict[str, dict[str, Any]]:
    """Streams by the topics' names: a reference or display if the name says so, otherwise the tracker and the phone."""
    found: dict[str, dict[str, Any]] = {}
    listed = list(topics)
    with_gravity = any(topic.name == TOTAL_ACCELERATION and topic.content == "acceleration" for topic in listed)
    for topic in listed:
        if topic.content not in ("position", "acceleration"):
            continue
        if with_gravity and topic.type.name == SENSOR_LOGGER and topic.name != TOTAL_ACCELERATION:
            continue
        kind: str = topic.content
        for other in ("reference", "display") if kind == "position" else ():
            if other in topic.name.lower() and all(one["kind"] != other for one in found.values()):
                kind = other
        name = _name(kind, topic.name, found)
        found[name] = {"topic": topic.name, "kind": kind}
        if kind == "acceleration":
            found[name]["gravity_mm_s2"] = [0.0, 0.0, -G_MM_S2]
    return found


def _name(kind: str, topic: str, taken: Mapping[str, object]) -> str:
    usual = {"position": "tracker", "acceleration": "imu"}.get(kind, kind)
    if usual not in taken:
        return usual
    own = re.sub(r"\W+", "_", topic).strip("_") or usual
    return own if own not in taken else f"{own}_{len(taken)}"


def _study(streams: Mapping[str, Mapping[str, Any]], events: str | None) -> Study:
    settings: dict[str, Any] = {"conditions": ["any"], "sessions": "{participant}_{condition}.mcap", "streams": streams}
    return Study.model_validate(settings | ({"events": {"topic": events}} if events is not None else {}))


def _measured(streams: dict[str, dict[str, Any]], recorded: Recorded) -> dict[str, dict[str, Any]]:
    """The streams with gravity, the noise and the tracker's lag as measured in this log."""
    for imu in recorded.imus:
        streams[imu.name]["gravity_mm_s2"] = _gravity(imu)
    motion, tracker = recorded.motion, recorded.tracker
    for positions in recorded.positions:
        measured = noise_sd(positions.times, positions.value_mm) if positions.kind == "position" else None
        if measured:
            streams[positions.name]["noise_sd_mm"] = float(f"{measured:.2g}")
    if tracker is not None and motion is not None and see_one_movement(motion) and motion.lag_s.value > _LATE_MIN_S:
        streams[tracker.name] |= {"stamp": "arrival", "latency_s": round(motion.lag_s.value, 2)}
    elif tracker is not None:
        streams[tracker.name] |= {"stamp": "measurement"}
    return streams


def _tells_gravity(imu: Imu) -> bool:
    """Whether the log has orientations, without which the direction of gravity is not known."""
    seen = gravity_seen_mm_s2(imu)
    return seen is not None and bool(np.any(seen))


def _gravity(imu: Imu) -> list[float]:
    """Gravity, 9806.65 mm/s² long: along the nearest axis if close to one; along −z if the log does not show it."""
    seen = gravity_seen_mm_s2(imu)
    if seen is None or not _tells_gravity(imu):
        return [0.0, 0.0, -G_MM_S2]
    direction = seen / np.linalg.norm(seen)
    axis = int(np.argmax(np.abs(direction)))
    if np.degrees(np.arccos(min(1.0, abs(float(direction[axis]))))) < _ALONG_DEG:
        direction = np.where(np.arange(3) == axis, np.sign(direction[axis]), 0.0)
    return [round(float(value), 2) + 0.0 for value in G_MM_S2 * direction]
