"""Ways to spoil a log: each takes and gives a log and its study, or the readings of one topic.

They work by the topics of the studies here, on a simulated session and on a real one alike.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.sessions.logs.log import Log, Readings
from pipeline.study.settings import Study

TRACKER, REFERENCE, IMU, EVENTS = "/tracker/position", "/reference/position", "/phone/imu", "/events"
Case = tuple[Log, Study]


def with_topic(log: Log, topic: str, readings: Readings) -> Log:
    """The log with other readings of a topic."""
    return Log(log.facts, {**log.topics, topic: readings}, log.faults)


def change(topic: str, how: Callable[[Readings], Readings]) -> Callable[[Log, Study], Case]:
    """A fault of one topic alone."""

    def spoil(log: Log, study: Study) -> Case:
        return (with_topic(log, topic, how(log.topics[topic])) if topic in log.topics else log), study

    return spoil


def values(topic: str, how: Callable[[np.ndarray], np.ndarray]) -> Callable[[Log, Study], Case]:
    """A fault of a topic's values alone."""
    return change(topic, lambda readings: replace(readings, values=how(readings.values.copy())))


def settings(stream: str, **keys: Any) -> Callable[[Log, Study], Case]:
    """A fault of study.yaml alone."""

    def spoil(log: Log, study: Study) -> Case:
        data = study.model_dump(exclude_none=True, exclude_defaults=True, mode="json")
        data["streams"][stream] |= keys
        return log, Study.model_validate(data)

    return spoil


def both(first: Callable[[Log, Study], Case], second: Callable[[Log, Study], Case]) -> Callable[[Log, Study], Case]:
    """One after the other."""
    return lambda log, study: second(*first(log, study))


def force(how: Callable[[np.ndarray], np.ndarray]) -> Callable[[Log, Study], Case]:
    """A fault of the accelerometer."""

    def spoil(value: np.ndarray) -> np.ndarray:
        value[:, :3] = how(value[:, :3])
        return value

    return values(IMU, spoil)


def orientation(how: Callable[[np.ndarray], np.ndarray]) -> Callable[[Log, Study], Case]:
    """A fault of the orientation."""

    def spoil(value: np.ndarray) -> np.ndarray:
        value[:, 6:10] = how(value[:, 6:10])
        return value

    return values(IMU, spoil)


def later(readings: Readings, seconds: float, arrival: bool = True) -> Readings:
    """The same readings with later times."""
    by = round(seconds * 1e9)
    return replace(readings, stamp_ns=readings.stamp_ns + by, arrival_ns=readings.arrival_ns + (by if arrival else 0))


def without_gravity(value: np.ndarray) -> np.ndarray:
    """What a phone calls linear acceleration: specific force less gravity, in the phone's frame."""
    known = np.isfinite(value[:, 6])
    mean = Rotation.from_quat(value[known, 6:10]).apply(value[known, :3]).mean(axis=0)
    value[known, :3] -= Rotation.from_quat(value[known, 6:10]).inv().apply(np.tile(mean, (int(known.sum()), 1)))
    return value


def lost_as_zeros(value: np.ndarray) -> np.ndarray:
    """The tracker sends zeros for three seconds."""
    value[len(value) // 2 : len(value) // 2 + 90] = 0.0
    return value


def lost_as_held(value: np.ndarray) -> np.ndarray:
    """The tracker sends its last position for five seconds."""
    begin = len(value) // 2
    value[begin : begin + 150] = value[begin]
    return value


def republished(readings: Readings) -> Readings:
    """Each position twice, 16 ms apart."""
    half = round(0.0167e9)

    def twice(times: np.ndarray) -> np.ndarray:
        return np.column_stack([times, times + half]).ravel()

    return _picked(
        replace(readings, stamp_ns=twice(readings.stamp_ns), arrival_ns=twice(readings.arrival_ns)),
        np.repeat(np.arange(readings.read), 2),
    )


def _picked(readings: Readings, rows: np.ndarray) -> Readings:
    """Values and claims of some rows, whose times are set already."""
    claims = readings.claims
    picked = {
        key: getattr(claims, key)[rows] if len(getattr(claims, key)) else getattr(claims, key)
        for key in ("frame", "orientation_length", "force_disclaimed", "gyroscope_disclaimed")
    }
    return replace(readings, values=readings.values[rows], claims=replace(claims, **picked))


def doubled_stamps(readings: Readings) -> Readings:
    """Every fifth stamp is that before."""
    stamp = readings.stamp_ns.copy()
    stamp[5::5] = stamp[4:-1:5]
    return replace(readings, stamp_ns=stamp)


def frame_changes(readings: Readings) -> Readings:
    """From the middle on in another frame, half a metre aside."""
    half = readings.read // 2
    value = readings.values.copy()
    value[half:] += [0.5, 0.0, 0.0]
    frame = np.zeros(readings.read, np.int64)
    frame[half:] = 1
    return replace(readings, values=value, claims=replace(readings.claims, frames=("tracker", "map"), frame=frame))


def two_publishers(readings: Readings) -> Readings:
    """A second node publishes a metre aside, half a step later."""
    half = int(np.median(np.diff(readings.stamp_ns)) // 2)
    interleaved = replace(
        readings,
        stamp_ns=np.column_stack([readings.stamp_ns, readings.stamp_ns + half]).ravel(),
        arrival_ns=np.column_stack([readings.arrival_ns, readings.arrival_ns + half]).ravel(),
    )
    found = _picked(interleaved, np.repeat(np.arange(readings.read), 2))
    value = found.values.copy()
    value[1::2] += [1.0, 0.0, 0.0]
    return replace(found, values=value)


def clock_steps(readings: Readings, seconds: float, arrival: bool) -> Readings:
    """The clock is set in the middle: that of the stamps, or that of the recorder with it."""
    by = np.where(np.arange(readings.read) >= readings.read // 2, round(seconds * 1e9), 0)
    return replace(
        readings, stamp_ns=readings.stamp_ns + by, arrival_ns=readings.arrival_ns + (by if arrival else 0 * by)
    )


def every_clock_back(log: Log, study: Study) -> Case:
    """The recorder's computer is set back by 0.15 s, all streams with it."""
    middle = np.median(log.topics[IMU].arrival_ns)
    topics = {}
    for topic, readings in log.topics.items():
        by = np.where(readings.arrival_ns >= middle, -round(0.15e9), 0)
        topics[topic] = replace(readings, stamp_ns=readings.stamp_ns + by, arrival_ns=readings.arrival_ns + by)
    return Log(log.facts, topics, log.faults), study


def in_bursts(readings: Readings) -> Readings:
    """Ten readings at a time, stamped as they arrived."""
    last = np.minimum(np.arange(readings.read) // 10 * 10 + 9, readings.read - 1)
    stamp = readings.stamp_ns[last] + (np.arange(readings.read) % 10) * 200_000
    return replace(readings, stamp_ns=stamp, arrival_ns=stamp + 2_000_000)


def whole_seconds(readings: Readings) -> Readings:
    """The nanoseconds are lost."""
    return replace(readings, stamp_ns=readings.stamp_ns // 10**9 * 10**9)


def jittered(readings: Readings) -> Readings:
    """Stamps that stray by 30 ms."""
    stray = np.random.default_rng(0).normal(0, 0.03e9, readings.read).astype(np.int64)
    return replace(readings, stamp_ns=readings.stamp_ns + stray)


def as_if_milliseconds(log: Log, study: Study) -> Case:
    """Milliseconds stand where nanoseconds are expected, in stamps and in the log."""
    topics = {}
    for topic, readings in log.topics.items():
        first = int(min(one.arrival_ns.min() for one in log.topics.values()))
        topics[topic] = replace(
            readings,
            stamp_ns=first + (readings.stamp_ns - first) // 10**6,
            arrival_ns=first + (readings.arrival_ns - first) // 10**6,
        )
    return Log(log.facts, topics, log.faults), study


def of_length(readings: Readings, length: float) -> Readings:
    """Quaternions of another length; the reader takes those for unknown."""
    value = readings.values.copy()
    value[:, 6:10] = np.nan
    size = np.full(readings.read, length)
    return replace(readings, values=value, claims=replace(readings.claims, orientation_length=size))


def disclaimed(readings: Readings) -> Readings:
    """The gyroscope is on another topic: zeros here, with a covariance of −1."""
    value = readings.values.copy()
    value[:, 3:6] = 0.0
    return replace(
        readings, values=value, claims=replace(readings.claims, gyroscope_disclaimed=np.ones(readings.read, bool))
    )


def events(**scale: float) -> Callable[[Log, Study], Case]:
    """Coordinates of events, each times a factor."""

    def how(readings: Readings) -> Readings:
        changed = [
            {key: value * scale.get(key, 1.0) if isinstance(value, float) else value for key, value in event.items()}
            for event in readings.events
        ]
        return replace(readings, events=tuple(changed))

    return change(EVENTS, how)


def swapped_targets(readings: Readings) -> Readings:
    """x and y of the targets exchanged."""
    changed: list[Mapping[str, object]] = []
    for event in readings.events:
        x, y = event.get("target_x"), event.get("target_y")
        changed.append({**event, "target_x": y, "target_y": x} if x is not None else event)
    return replace(readings, events=tuple(changed))


def frozen(value: np.ndarray) -> np.ndarray:
    """The phone repeats one reading from the middle on."""
    half = len(value) // 2
    value[half:] = value[half]
    return value


def taken_for_another(quaternion: np.ndarray) -> np.ndarray:
    """Twice, for 25 readings, the optics take other markers for the phone's: it is turned by 70°."""
    turn = Rotation.from_euler("y", 70.0, degrees=True)
    for begin in (len(quaternion) // 3, len(quaternion) // 2):
        part = slice(begin, begin + 25)
        quaternion[part] = (turn * Rotation.from_quat(quaternion[part])).as_quat()
    return quaternion


def about(axis: str, degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    """Positions turned about an axis."""
    turn = Rotation.from_euler(axis, degrees, degrees=True)
    return turn.apply


def in_degrees(value: np.ndarray) -> np.ndarray:
    """The gyroscope in degrees per second."""
    value[:, 3:6] = np.degrees(value[:, 3:6])
    return value


def lost_now_and_then(value: np.ndarray) -> np.ndarray:
    """Every fortieth value is NaN, as from a driver that sends a message whether or not it sees anything."""
    value[::40] = np.nan
    return value


def thinned(readings: Readings) -> Readings:
    """A third of the messages never come, at random."""
    kept = np.random.default_rng(4).random(readings.read) > 1 / 3
    claims = readings.claims
    if len(claims.frame):
        claims = replace(claims, frame=claims.frame[kept])
    return replace(
        readings,
        stamp_ns=readings.stamp_ns[kept],
        arrival_ns=readings.arrival_ns[kept],
        values=readings.values[kept],
        claims=claims,
    )


def gyroscope(how: Callable[[np.ndarray], np.ndarray]) -> Callable[[Log, Study], Case]:
    """A fault of the gyroscope."""

    def spoil(value: np.ndarray) -> np.ndarray:
        value[:, 3:6] = how(value[:, 3:6])
        return value

    return values(IMU, spoil)


def without_orientation(spoil: Callable[[Log, Study], Case]) -> Callable[[Log, Study], Case]:
    """A fault of a phone whose log has no orientation."""
    return both(orientation(lambda q: q * np.nan), spoil)


def seldom(readings: Readings) -> Readings:
    """A tenth of the phone's readings, as of an app that is set to save power."""
    return _picked(
        replace(readings, stamp_ns=readings.stamp_ns[::10], arrival_ns=readings.arrival_ns[::10]),
        np.arange(0, readings.read, 10),
    )


def twice(readings: Readings) -> Readings:
    """Every message a second time after the last, as where a log was appended to itself."""
    return _picked(
        replace(readings, stamp_ns=np.tile(readings.stamp_ns, 2), arrival_ns=np.tile(readings.arrival_ns, 2)),
        np.tile(np.arange(readings.read), 2),
    )


def faster_clock(readings: Readings) -> Readings:
    """A clock that gains 0.4 s over the session."""
    since = readings.stamp_ns - readings.stamp_ns[0]
    return replace(readings, stamp_ns=readings.stamp_ns + np.rint(0.4e9 * since / since[-1]).astype(np.int64))


def nearly_w_first(quaternion: np.ndarray) -> np.ndarray:
    """w first, and a hundredth of noise."""
    found = quaternion[:, [3, 0, 1, 2]] + np.random.default_rng(2).normal(0, 0.01, quaternion.shape)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def found_anew(value: np.ndarray) -> np.ndarray:
    """From the middle on a metre aside, along each axis."""
    value[len(value) // 2 :] += 1.0
    return value


def strays(value: np.ndarray) -> np.ndarray:
    """Every 37th position is 0.8 m aside."""
    value[20::37, 0] += 0.8
    return value


def late_orientation(readings: Readings) -> Readings:
    """Each reading has the orientation of 0.3 s before."""
    at = np.searchsorted(readings.stamp_ns, readings.stamp_ns - round(0.3e9))
    value = readings.values.copy()
    value[:, 6:10] = value[at, 6:10]
    return replace(readings, values=value)


def placed(how: Callable[[float, float], tuple[float, float]]) -> Callable[[Log, Study], Case]:
    """Coordinates of targets and selections by a function of x and y."""

    def change_events(readings: Readings) -> Readings:
        changed: list[Mapping[str, object]] = []
        for event in readings.events:
            new = dict(event)
            for x, y in (("x", "y"), ("target_x", "target_y")):
                if event.get(x) is not None:
                    new[x], new[y] = how(float(str(event[x])), float(str(event[y])))
            changed.append(new)
        return replace(readings, events=tuple(changed))

    return change(EVENTS, change_events)


def from_other(topic: str, other: Log) -> Callable[[Log, Study], Case]:
    """One topic of another session's log."""
    return lambda log, study: (with_topic(log, topic, other.topics[topic]), study)


def gravity(log: Log, study: Study, factor: float) -> Case:
    """Gravity times a factor; by 0 along another axis."""
    stated = getattr(study.streams["imu"], "gravity_mm_s2")  # noqa: B009 - of this kind of stream alone
    wrong = [stated[2], stated[0], stated[1]] if factor == 0 else [value * factor for value in stated]
    return settings("imu", gravity_mm_s2=wrong)(log, study)
