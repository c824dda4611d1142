"""One thing wrong in a copy of a log, each as a recorder, a driver or a study.yaml has done it.

Every fault takes and gives a log and its study, by the topics of the studies here; it works on a simulated session and
on a real one alike.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.sessions.logs.log import Log, Readings
from pipeline.study.settings import Study

TRACKER, REFERENCE, IMU, EVENTS = "/tracker/position", "/reference/position", "/phone/imu", "/events"
Case = tuple[Log, Study]


@dataclass(frozen=True)
class Fault:
    """What is wrong, the check that must say so, and words its message must contain."""

    name: str
    spoil: Callable[[Log, Study], Case]
    check: str
    says: str


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


MM = ("speed", "millimetres")
MEAN, LAG, FRAME = "mean acceleration", "lag", "frame of the movement"

FAULTS: tuple[Fault, ...] = (
    Fault("positions in mm", both(values(TRACKER, lambda v: v * 1e3), values(REFERENCE, lambda v: v * 1e3)), *MM),
    Fault("tracker in mm", values(TRACKER, lambda v: v * 1e3), "size of the movement", "millimetres"),
    Fault("reference in mm", values(REFERENCE, lambda v: v * 1e3), *MM),
    Fault("tracker in cm", values(TRACKER, lambda v: v * 1e2), "size of the movement", "centimetres"),
    Fault("accelerometer in g", force(lambda v: v / 9.80665), "specific force", "in g"),
    Fault("accelerometer in g, iOS sign", force(lambda v: -v / 9.80665), "specific force", "in g"),
    Fault("sign flipped", force(lambda v: -v), MEAN, "sign"),
    Fault("gravity removed", values(IMU, without_gravity), "specific force", "gravity seems removed"),
    Fault("gravity's sign", lambda log, study: _gravity(log, study, -1), MEAN, "gravity_mm_s2"),
    Fault("gravity's axis", lambda log, study: _gravity(log, study, 0), MEAN, "gravity_mm_s2"),
    Fault("gravity in m/s²", lambda log, study: _gravity(log, study, 1e-3), "length of gravity", "m/s²"),
    Fault("phone 50 ms late", change(IMU, lambda r: later(r, 0.05)), LAG, "ms later"),
    Fault("phone 50 ms early", change(IMU, lambda r: later(r, -0.05)), LAG, "ms later"),
    Fault("phone 200 ms late", change(IMU, lambda r: later(r, 0.2)), LAG, "ms later"),
    Fault("stamped on arrival", settings("tracker", stamp="measurement", latency_s=0.0), LAG, "stamp: arrival"),
    Fault("latency twice the truth", settings("tracker", latency_s=0.2), LAG, "set latency_s: 0."),
    Fault("left-handed z", values(TRACKER, lambda v: v * [1, 1, -1]), FRAME, "mirror image"),
    Fault("left-handed x", values(TRACKER, lambda v: v * [-1, 1, 1]), FRAME, "mirror image"),
    Fault("tracker's x and y exchanged", values(TRACKER, lambda v: v[:, [1, 0, 2]]), FRAME, "exchanged"),
    Fault("tracker is y up", values(TRACKER, about("x", -90)), FRAME, "another order"),
    Fault("heading off by 90°", values(TRACKER, about("z", 90)), FRAME, "heading"),
    Fault("quaternion w first", orientation(lambda q: q[:, [3, 0, 1, 2]]), MEAN, "w, x, y, z"),
    Fault("quaternion inverted", orientation(lambda q: q * [-1, -1, -1, 1]), "gyroscope", "inverted"),
    Fault("orientation a placeholder", orientation(lambda q: q * 0 + [0, 0, 0, 1]), "gyroscope", "frozen"),
    Fault("orientation all zeros", change(IMU, lambda r: of_length(r, 0.0)), "orientation", "all zeros"),
    Fault("gyroscope in °/s", values(IMU, in_degrees), "gyroscope", "degrees"),
    Fault(
        "gyroscope in °/s, no orientation",
        both(
            orientation(lambda q: q * np.nan),
            values(IMU, in_degrees),
        ),
        "gyroscope",
        "degrees",
    ),
    Fault("phone's axes z, y, x", force(lambda v: v[:, ::-1]), MEAN, "z, y, x"),
    Fault("phone's z mirrored", force(lambda v: v * [1, 1, -1]), MEAN, "z axis is mirrored"),
    Fault("phone frozen from half", values(IMU, frozen), "frozen readings", "repeats one reading"),
    Fault("tracker lost: zeros", values(TRACKER, lost_as_zeros), "exact zeros", "zeros while it sees nothing"),
    Fault("tracker lost: held", values(TRACKER, lost_as_held), "held positions", "last position"),
    Fault("tracker republished", change(TRACKER, republished), "held positions", "faster than the tracker"),
    Fault("another frame in mid-log", change(TRACKER, frame_changes), "frame_id", "several frames"),
    Fault("two publishers", change(TRACKER, two_publishers), "one publisher", "two nodes"),
    Fault("tracker's clock forward", change(TRACKER, lambda r: clock_steps(r, 0.3, False)), "clock", "was set"),
    Fault("tracker's clock back", change(TRACKER, lambda r: clock_steps(r, -0.15, False)), "clock", "was set"),
    Fault("recorder's clock back", every_clock_back, "clock", "goes back"),
    Fault("whole seconds", change(TRACKER, whole_seconds), "rounded stamps", "multiple of 1 s"),
    Fault("phone in bursts", change(IMU, in_bursts), "bursts", "about 10"),
    Fault("tracker's stamps stray", change(TRACKER, jittered), "regular stamps", "irregular"),
    Fault("doubled stamps", change(IMU, doubled_stamps), "identical stamps", "stamp of another"),
    Fault("milliseconds as nanoseconds", as_if_milliseconds, "rate", "milliseconds"),
    Fault("quaternions of length 2", change(IMU, lambda r: of_length(r, 2.0)), "orientation", "no rotation"),
    Fault("no gyroscope, covariance −1", change(IMU, disclaimed), "covariances", "disregarded"),
    Fault("accelerometer all zero", force(lambda v: v * 0), "specific force", "all zero"),
    Fault("accelerometer clipped", force(lambda v: np.clip(v, -10.2, 9.3)), "clipped readings", "clipped"),
    Fault("noise understated", settings("tracker", noise_sd_mm=3.0), "tracker noise", "noise_sd_mm: "),
    Fault("noise understated by a fifth", settings("tracker", noise_sd_mm=6.4), "tracker noise", "noise_sd_mm: "),
    Fault("values that are no numbers", values(TRACKER, lost_now_and_then), "unusable samples", "send nothing while"),
    Fault("most frames lost", change(TRACKER, thinned), "missing samples", "the recorder does not keep up"),
)
"""Of streams and study.yaml."""

EVENT_FAULTS: tuple[Fault, ...] = (
    Fault("targets in mm", events(target_x=1e3, target_y=1e3), "targets", "millimetres"),
    Fault("targets' x and y exchanged", change(EVENTS, swapped_targets), "targets", "exchanged"),
    Fault("selections in mm", events(x=1e3, y=1e3, z=1e3), "selections", "millimetres"),
    Fault("events an hour off", change(EVENTS, lambda r: later(r, 3600)), "span of the events", "another clock"),
    Fault("events 2 s late", change(EVENTS, lambda r: later(r, 2.0)), "selections", "2.0 s earlier"),
    Fault("events 0.5 s late", change(EVENTS, lambda r: later(r, 0.5)), "selections", "0.5 s earlier"),
)
"""Of events."""


def _gravity(log: Log, study: Study, factor: float) -> Case:
    """Gravity times a factor; by 0 along another axis."""
    stated = getattr(study.streams["imu"], "gravity_mm_s2")  # noqa: B009 - of this kind of stream alone
    wrong = [stated[2], stated[0], stated[1]] if factor == 0 else [value * factor for value in stated]
    return settings("imu", gravity_mm_s2=wrong)(log, study)
