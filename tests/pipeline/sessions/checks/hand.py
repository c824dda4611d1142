"""A session as a hand would make it: reaches from target to target, a phone that turns, sensors that err a little."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.sessions.logs.log import Claims, Content, Log, Readings
from pipeline.sessions.logs.mcap import Message
from pipeline.study.settings import Study

EPOCH_NS = 1_700_000_000_000_000_000
_PRESS_S = 0.1


@dataclass(frozen=True)
class Hand:
    """How a session is: rates in Hz, the direction of gravity, how briskly and how far the hand moves and turns."""

    seed: int = 0
    seconds: float = 45.0
    tracker_hz: float = 30.0
    imu_hz: float = 90.0
    latency_s: float = 0.1
    stamp: str = "arrival"
    noise_mm: float = 8.0
    imu_noise_mm_s2: float = 60.0
    gravity: tuple[float, float, float] = (0.0, 0.0, -1.0)
    reach_s: float = 0.8
    span_mm: tuple[float, float, float] = (300.0, 250.0, 150.0)
    turn_rad: float = 0.4
    tilt_error_rad: float = 0.015
    jitter_s: float = 0.001
    lost: float = 0.01
    oriented: bool = True
    random: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "random", np.random.default_rng(self.seed))


@dataclass(frozen=True)
class Path:
    """Reaches one after the other: when each begins (k,), how long it lasts (k,), from where to where (k + 1, 3)."""

    begin_s: np.ndarray
    lasts_s: np.ndarray
    place_mm: np.ndarray

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position in mm and acceleration in mm/s² (n, 3) of minimum-jerk reaches (Flash and Hogan 1985)."""
        reach = np.clip(np.searchsorted(self.begin_s, time, side="right") - 1, 0, len(self.begin_s) - 1)
        lasts = self.lasts_s[reach]
        share = np.clip((time - self.begin_s[reach]) / lasts, 0.0, 1.0)
        way = (self.place_mm[reach + 1] - self.place_mm[reach]) * 1.0
        covered = share**3 * (10 - 15 * share + 6 * share**2)
        bend = (60 * share - 180 * share**2 + 120 * share**3) / lasts**2
        return self.place_mm[reach] + way * covered[:, None], way * bend[:, None]


def session(hand: Hand) -> tuple[Log, Study]:
    """The log and the study that it is of."""
    random = hand.random
    path = _path(hand, random)
    gravity = 9806.65 * np.array(hand.gravity)
    tracker_s = _times(hand.tracker_hz, hand, random)
    imu_s = _times(hand.imu_hz, hand, random, lost=0.0)
    reference_s = np.arange(0.0, hand.seconds, 1 / 90)
    seen = path.at(tracker_s)[0] + random.normal(0, hand.noise_mm, (len(tracker_s), 3))
    log = Log(
        {},
        {
            "/tracker/position": _positions(tracker_s, hand.latency_s, hand.stamp, seen),
            "/phone/imu": _imu(hand, random, path, imu_s, gravity),
            "/reference/position": _positions(reference_s, 0.0, "measurement", path.at(reference_s)[0]),
            "/display/position": _positions(reference_s, 0.0, "measurement", _displayed(path, reference_s)),
            "/events": _events(hand, path),
        },
    )
    return log, _study(hand, gravity, path)


def _path(hand: Hand, random: np.random.Generator) -> Path:
    begin, lasts, at = [], [], 1.0
    while at < hand.seconds + 2:
        begin.append(at)
        lasts.append(hand.reach_s * random.uniform(0.7, 1.4))
        at += lasts[-1] + random.uniform(0.1, 0.8)
    centre = np.array([100.0, 400.0, 300.0])
    place = centre + random.uniform(-1, 1, (len(begin) + 1, 3)) * np.array(hand.span_mm)
    return Path(np.array(begin), np.array(lasts), place)


def _times(rate_hz: float, hand: Hand, random: np.random.Generator, lost: float | None = None) -> np.ndarray:
    time = np.arange(0.0, hand.seconds, 1 / rate_hz) + 0.01
    time = time + np.clip(random.normal(0, hand.jitter_s, len(time)), -0.3 / rate_hz, 0.3 / rate_hz)
    found: np.ndarray = time[random.random(len(time)) >= (hand.lost if lost is None else lost)]
    return found


def _ns(seconds: np.ndarray) -> np.ndarray:
    return EPOCH_NS + np.rint(seconds * 1e9).astype(np.int64)


def _positions(time: np.ndarray, latency_s: float, stamp: str, value_mm: np.ndarray) -> Readings:
    arrival = _ns(time + latency_s)
    stamps = arrival if stamp == "arrival" else _ns(time)
    frame = np.zeros(len(time), np.int64)
    return Readings(stamps, arrival, value_mm / 1e3, sampled=True, claims=Claims(("tracker",), frame))


def _displayed(path: Path, time: np.ndarray) -> np.ndarray:
    return path.at(np.maximum(time - 0.03, 0.0))[0]


def _imu(hand: Hand, random: np.random.Generator, path: Path, time: np.ndarray, gravity: np.ndarray) -> Readings:
    held = Rotation.from_rotvec(random.normal(0, 0.5, 3))
    phase, speed = random.uniform(0, 2 * np.pi, (3, 3)), random.uniform(0.2, 1.5, (3, 3))

    def turn(at: np.ndarray) -> Rotation:
        waves = np.sin(at[:, None, None] * speed + phase).sum(axis=2)
        return Rotation.from_rotvec(hand.turn_rad / np.sqrt(3) * waves) * held

    body = turn(time)
    step = 1e-3
    rate = (turn(time - step).inv() * turn(time + step)).as_rotvec() / (2 * step)
    force = body.inv().apply(path.at(time)[1] - gravity) / 1e3
    force = force + random.normal(0, hand.imu_noise_mm_s2 / 1e3, force.shape) + random.normal(0, 0.05, 3)
    logged = Rotation.from_rotvec(random.normal(0, hand.tilt_error_rad, 3)) * body
    turned = logged.as_quat() if hand.oriented else np.full((len(time), 4), np.nan)
    values = np.hstack([force, rate + random.normal(0, 0.005, rate.shape), turned])
    claims = Claims(
        ("phone",),
        np.zeros(len(time), np.int64),
        np.full(len(time), 1.0 if hand.oriented else np.nan),
        np.zeros(len(time), bool),
        np.zeros(len(time), bool),
    )
    return Readings(_ns(time), _ns(time + 0.002), values, sampled=True, claims=claims)


def _events(hand: Hand, path: Path) -> Readings:
    listed: list[tuple[float, dict[str, Any]]] = [(0.6, {"type": "session_start", "trial": None})]
    for number, begin in enumerate(path.begin_s):
        at = begin + path.lasts_s[number] + _PRESS_S
        if at > hand.seconds - 0.5 or (number + 1 < len(path.begin_s) and at > path.begin_s[number + 1] + 0.5):
            continue
        target = path.place_mm[number + 1] / 1e3
        shown = _displayed(path, np.array([at]))[0] / 1e3
        aim = {f"target_{axis}": float(value) for axis, value in zip("xy", target, strict=False)}
        where = {axis: float(value) for axis, value in zip("xyz", shown, strict=True)}
        listed.append((float(begin), {"type": "trial_start", "trial": number, **aim}))
        listed.append((float(at), {"type": "selection", "trial": number, **where}))
    time = _ns(np.array([at for at, _ in listed]))
    return Readings(time, time, np.zeros((len(listed), 0)), tuple(event for _, event in listed))


def _study(hand: Hand, gravity: np.ndarray, path: Path) -> Study:
    latency = hand.latency_s if hand.stamp == "arrival" else 0.0
    return Study.model_validate(
        {
            "conditions": ["a"],
            "sessions": "data/{participant}_{condition}.mcap",
            "streams": {
                "tracker": {
                    "topic": "/tracker/position",
                    "kind": "position",
                    "stamp": hand.stamp,
                    "latency_s": latency,
                    "noise_sd_mm": hand.noise_mm,
                },
                "imu": {
                    "topic": "/phone/imu",
                    "kind": "acceleration",
                    "gravity_mm_s2": gravity.tolist(),
                    "noise_sd_mm_s2": 100,
                },
                "reference": {"topic": "/reference/position", "kind": "reference"},
                "display": {"topic": "/display/position", "kind": "display"},
            },
            "events": {"topic": "/events"},
            "task": {
                "targets_mm": path.place_mm[:, :2].tolist(),
                "canvas_x_mm": [-5000, 5000],
                "canvas_y_mm": [-5000, 5000],
            },
        }
    )


def messages(log: Log) -> list[Message]:
    """The log's messages, to be written to a file."""
    found: list[Message] = []
    for topic, readings in log.topics.items():
        times = zip(readings.stamp_ns.tolist(), readings.arrival_ns.tolist(), strict=True)
        for row, (stamp, arrival) in enumerate(times):
            if readings.events:
                event = {key: value for key, value in readings.events[row].items() if value is not None}
                found.append(Message(topic, "events", stamp, arrival, event=event))
            else:
                content: Content = "position" if readings.values.shape[1] == 3 else "acceleration"
                found.append(Message(topic, content, stamp, arrival, readings.values[row]))
    return found
