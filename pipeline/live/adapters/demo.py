"""Simulated senders and participants: a hand that moves by what the phone shows, and the sensors that measure it.

The participant and the sensors are those of `pipeline.simulation`; only what is displayed comes from the running study.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.live.events import Reading
from pipeline.simulation import loop_steps
from pipeline.simulation.hand_steps import DONE, PHASE, PLANS
from pipeline.simulation.loop_steps import STEP_NS, TAP_S
from pipeline.simulation.sensing import gyroscope
from pipeline.simulation.session import Setting, felt, prepare
from pipeline.statistics.arrays import FloatArray

_MM_PER_M = 1000.0


@dataclass(frozen=True)
class Tap:
    """The participant has pressed, at this recorder time."""

    at_ns: int


class Participant:
    """One simulated participant in one task, from `begins_ns` on, for at most `length_s`."""

    def __init__(self, setting: Setting, participant: str, condition: str, begins_ns: int, length_s: float) -> None:
        self.begins_ns = begins_ns
        self.ready = prepare(setting, participant, condition, length_s)
        self.dimension = len(setting.study.axes)
        _, self._tracker, _, self._imu = setting.streams
        self._gyroscope = gyroscope(self.ready.phone)
        frames, phone = self.ready.frames.arrival_ns, self.ready.phone.arrival_ns
        arrival = np.concatenate([frames, phone])
        self._order = np.argsort(arrival, kind="stable")
        self._arrival = arrival[self._order].tolist()
        self._count, self._upcoming, self._tapped = len(frames), 0, 0

    @property
    def next_ns(self) -> int | None:
        """When the next reading arrives; None after the last."""
        if self._upcoming == len(self._arrival):
            return None
        return self.begins_ns + int(self._arrival[self._upcoming])

    @property
    def done(self) -> bool:
        """Whether the last target has been selected."""
        return bool(self.ready.hand.progress[PHASE] == DONE)

    @property
    def taps(self) -> FloatArray:
        """When and where each target was selected (targets, 5), as in `pipeline.simulation.loop_steps`."""
        return self.ready.session.taps

    @property
    def plans(self) -> int:
        """How often a movement was planned anew."""
        return int(self.ready.hand.progress[PLANS])

    def sees(self, position_mm: tuple[float, float]) -> None:
        """The display has changed."""
        session = self.ready.session
        session.shown[0, :2] = position_mm
        session.next[2] = 1

    def move(self) -> tuple[list[Tap], Reading]:
        """Move on until the next reading arrives: the presses until then, and the reading."""
        row, arrival = int(self._order[self._upcoming]), int(self._arrival[self._upcoming])
        self._upcoming += 1
        loop_steps.walk(*self.ready.walking, max(-(-arrival // STEP_NS), 1))  # type: ignore[call-arg]
        return self._taps(), self._reading(row, self.begins_ns + arrival)

    def _taps(self) -> list[Tap]:
        found = []
        while self._tapped < len(self.taps) and np.isfinite(self.taps[self._tapped, TAP_S]):
            found.append(Tap(self.begins_ns + round(float(self.taps[self._tapped, TAP_S]) * 1e9)))
            self._tapped += 1
        return found

    def _reading(self, row: int, arrival_ns: int) -> Reading:
        if row < self._count:
            return self._frame(row, arrival_ns)
        row -= self._count
        phone = self.ready.phone
        gravity = np.array(self._imu.gravity_mm_s2)
        force = felt(phone, gravity, self.ready.session.trace, row) / _MM_PER_M
        values = (*force.tolist(), *self._gyroscope[row].tolist(), *phone.logged_xyzw[row].tolist())
        return Reading(self.ready.names[1], self.begins_ns + int(phone.time_ns[row]), arrival_ns, values, row)

    def _frame(self, row: int, arrival_ns: int) -> Reading:
        frames, place = self.ready.frames, self.ready.readings.frame_mm[row]
        z = place[2] if self.dimension == 3 else frames.noise_mm[row, 2]
        values = tuple(float(value) / _MM_PER_M for value in (place[0], place[1], z))
        return Reading(self.ready.names[0], self.begins_ns + int(frames.time_ns[row]), arrival_ns, values, row)
