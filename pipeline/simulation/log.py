"""A simulated session as a log: what each sensor, the display and the recorder would have written."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.sessions.logs.mcap import Message, in_order, write
from pipeline.simulation.hand_steps import IntArray
from pipeline.simulation.loop_steps import STEP_NS, TAP_S, TAP_X, TAP_Y
from pipeline.simulation.sensing import gyroscope
from pipeline.simulation.session import Outcome, Setting, reference_ns
from pipeline.statistics.arrays import FloatArray
from pipeline.study.streams import PositionStream, ReferenceStream

EPOCH_NS = 1_700_000_000_000_000_000  # an arbitrary fixed instant, so that a simulated log is the same on every day
_MM_PER_M = 1000.0
_NEXT_S = (
    1e-6  # a trial starts this long after the selection before it; at the same time, the selection would belong to it
)


def write_log(path: Path, setting: Setting, participant: str, condition: str, order: int, outcome: Outcome) -> None:
    """Write a session's log."""
    facts = {
        "participant": participant,
        "condition": condition,
        "order": str(order),
        "origin": f"simulated by Steadyhand: {setting.simulation.model} participant, seed {setting.simulation.seed}",
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path, facts, in_order(_messages(setting, outcome)))


def _messages(setting: Setting, outcome: Outcome) -> Iterator[Message]:
    study = setting.study
    _, tracker, _, imu = setting.streams
    frames, phone = outcome.frames, outcome.phone
    seen = np.zeros((len(outcome.frame_mm), 3))
    seen[:, : outcome.frame_mm.shape[1]] = outcome.frame_mm
    if outcome.frame_mm.shape[1] < 3:
        seen[:, 2] = frames.noise_mm[:, 2]  # the hand stays in the plane
    for row, value in enumerate(seen / _MM_PER_M):
        yield _position(tracker, int(frames.time_ns[row]), int(frames.arrival_ns[row]), value)
    force = np.einsum("nij,nj->ni", phone.to_body, _plane(outcome, phone.time_ns) - np.array(imu.gravity_mm_s2))
    values = np.hstack([(force + phone.error_mm_s2) / _MM_PER_M, gyroscope(phone), phone.logged_xyzw])
    for row, value in enumerate(values):
        arrival = EPOCH_NS + int(phone.arrival_ns[row])
        stamp = arrival if imu.stamp == "arrival" else EPOCH_NS + int(phone.time_ns[row])
        yield Message(imu.topic, "acceleration", stamp, arrival, value)
    yield from _shown(setting, outcome)
    for name in study.streams:
        stream = study.streams[name]
        if isinstance(stream, ReferenceStream):
            time_ns = reference_ns(setting, outcome.ends_s)
            for at, value in zip(time_ns, _between(outcome, time_ns, slice(0, 2)) / _MM_PER_M, strict=True):
                yield Message(stream.topic, "position", EPOCH_NS + int(at), EPOCH_NS + int(at), value)
    yield from _events(setting, outcome)


def _position(stream: PositionStream, measured_ns: int, arrival_ns: int, value: FloatArray) -> Message:
    arrival = EPOCH_NS + arrival_ns
    return Message(
        stream.topic, "position", arrival if stream.stamp == "arrival" else EPOCH_NS + measured_ns, arrival, value
    )


def _shown(setting: Setting, outcome: Outcome) -> Iterator[Message]:
    """The display's messages, from the first position that it shows."""
    name = setting.study.stream_of_kind("display")
    if name is None:
        return
    topic = setting.study.streams[name].topic
    shown = np.zeros((len(outcome.shown), 3))
    shown[:, : outcome.shown.shape[1]] = outcome.shown / _MM_PER_M
    for at, value in zip(outcome.instant_ns, shown, strict=True):
        if np.isfinite(value).all():
            yield Message(topic, "position", EPOCH_NS + int(at), EPOCH_NS + int(at), value)


def _between(outcome: Outcome, time_ns: IntArray, columns: slice) -> FloatArray:
    """Two columns of the trace, interpolated at some times as in the loop, and a column of zeros: (n, 3)."""
    after = np.maximum(-(-time_ns // STEP_NS), 1)
    share = 1.0 - (after * STEP_NS - time_ns) / STEP_NS
    found = np.zeros((len(time_ns), 3))
    before, end = outcome.trace[after - 1, columns], outcome.trace[after, columns]
    found[:, :2] = before + share[:, None] * (end - before)
    return found


def _plane(outcome: Outcome, time_ns: IntArray) -> FloatArray:
    """The hand's acceleration (n, 3) in mm/s² at some times; zero across the plane."""
    return _between(outcome, time_ns, slice(2, 4))


def _events(setting: Setting, outcome: Outcome) -> Iterator[Message]:
    """The events' messages. Each trial starts when the previous target was selected."""
    assert setting.study.events is not None  # noqa: S101 - checked before anything is simulated
    topic = setting.study.events.topic

    def message(seconds: float, **event: object) -> Message:
        at = EPOCH_NS + round(seconds * 1e9)
        return Message(topic, "events", at, at, event=event)

    yield message(outcome.begins_s, type="session_start")
    begin = outcome.begins_s
    for index, (target, tap) in enumerate(zip(outcome.targets_mm, outcome.taps, strict=True)):
        aimed = {"target_x": target[0] / _MM_PER_M, "target_y": target[1] / _MM_PER_M}
        yield message(begin, type="trial_start", trial=index + 1, **aimed)
        if not np.isfinite(tap[TAP_S]):
            break
        at = {"x": tap[TAP_X] / _MM_PER_M, "y": tap[TAP_Y] / _MM_PER_M}
        yield message(float(tap[TAP_S]), type="selection", trial=index + 1, **at)
        begin = float(tap[TAP_S]) + _NEXT_S
    yield message(outcome.ends_s, type="session_end")
