"""In a demo the pointer is the hand: it is followed smoothly, and a simulated tracker and phone measure it."""

from __future__ import annotations

from collections import deque

import numpy as np

from pipeline.live.events import Reading
from pipeline.live.streams import LiveStream
from pipeline.study.settings import Study
from pipeline.study.streams import AccelerationStream, PositionStream

_TRACKER_HZ, _PHONE_HZ = 30.0, 90.0
_FOLLOWS_RAD_S = 25.0  # how quickly the hand is where the pointer is: 63 % in 80 ms
_NS_PER_S = 1e9
_LONGEST_STEP_NS = 200_000_000


class MouseHand:
    """A critically damped pull towards the pointer, and the readings that sensors make of it."""

    def __init__(self, study: Study, streams: dict[str, LiveStream], start_mm: tuple[float, float], at_ns: int) -> None:
        self._pointer = np.array(start_mm, dtype=np.float64)
        self._place, self._velocity = self._pointer.copy(), np.zeros(2)
        self._random = np.random.default_rng(0)
        self._at_ns, self._waiting = at_ns, deque[Reading]()
        self._study, self._streams = study, streams
        self._next = dict.fromkeys(streams, at_ns)

    def points_at(self, x_mm: float, y_mm: float) -> None:
        """The pointer is there now."""
        self._pointer[:] = x_mm, y_mm

    def readings(self, at_ns: int) -> list[Reading]:
        """What arrives by `at_ns`."""
        if at_ns - self._at_ns > _LONGEST_STEP_NS:  # the machine slept
            self._at_ns = at_ns - _LONGEST_STEP_NS
            self._next = {name: max(due, self._at_ns) for name, due in self._next.items()}
        while True:
            name = min(self._next, key=self._next.__getitem__)
            due = self._next[name]
            if due > at_ns:
                break
            acceleration = self._move(due)
            self._waiting.append(self._measured(name, due, acceleration))
            rate = _PHONE_HZ if self._streams[name].content == "acceleration" else _TRACKER_HZ
            self._next[name] = due + round(_NS_PER_S / rate)
        arrived = [reading for reading in self._waiting if reading.arrival_ns <= at_ns]
        self._waiting = deque(reading for reading in self._waiting if reading.arrival_ns > at_ns)
        return sorted(arrived, key=lambda reading: reading.arrival_ns)

    def _move(self, to_ns: int) -> np.ndarray:
        """Move on to a time; the acceleration (2,) in mm/s² there. The exact motion towards a pointer that stands."""
        step_s, pull = max(to_ns - self._at_ns, 0) / _NS_PER_S, _FOLLOWS_RAD_S
        off = self._place - self._pointer
        drift = self._velocity + pull * off
        decay = np.exp(-pull * step_s)
        self._place = self._pointer + (off + drift * step_s) * decay
        self._velocity = (self._velocity - pull * drift * step_s) * decay
        self._at_ns = max(to_ns, self._at_ns)
        acceleration: np.ndarray = -2 * pull * self._velocity - pull**2 * (self._place - self._pointer)
        return acceleration

    def _measured(self, name: str, at_ns: int, acceleration: np.ndarray) -> Reading:
        stream = self._study.streams[name]
        arrival = at_ns + round(stream.latency_s * _NS_PER_S)
        if isinstance(stream, AccelerationStream):
            noise = self._random.normal(0.0, stream.noise_sd_mm_s2, 3)
            force = (np.array([*acceleration, 0.0]) - np.array(stream.gravity_mm_s2) + noise) / 1e3
            return Reading(name, at_ns, arrival, (*force.tolist(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
        sd = stream.noise_sd_mm if isinstance(stream, PositionStream) else 0.0
        place = (np.array([*self._place, 0.0]) + self._random.normal(0.0, sd, 3)) / 1e3
        return Reading(name, at_ns, arrival, tuple(place.tolist()))
