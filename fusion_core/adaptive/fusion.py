"""The adaptive filter as an estimator: its members and priors, states that are values, and replay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from fusion_core.adaptive import layout, steps
from fusion_core.adaptive.found import Found, found
from fusion_core.adaptive.layout import FELT, ORIENTED, READING, ROWS, UNTURNED, Memory, Records
from fusion_core.checks import require_positive
from fusion_core.estimator import require_reading, require_readings
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, position_sensor, require_covered, require_fit

_RARE = 0.003  # how often a position of ordinary noise is taken for a surprise
_ROOM = 64  # rows, more than are kept between two readings of most phones
_NO_READINGS, _NO_TIMES, _NO_ROWS = np.empty((0, READING)), np.empty(0), np.empty((0, 0))

_PRIOR_SD = {
    layout.BIAS: (3, 300.0, 10.0),  # how many, SD, walk per √s: mm/s²
    layout.MOUNTING: (3, 0.05, 0.0),  # rad: 3°
    layout.OFFSET: (3, 100.0, 10.0),  # mm/s²: half a degree of tilt
    layout.TURN: (2, 0.1, 0.004),  # 6°, or 10 % of scale
    layout.ARM: (3, 50.0, 0.0),  # mm
}
_SPEED_SD = 500.0  # mm/s, as of fusion_kalman: a hand that reaches

_NOISE = (0.25, 0.4, 0.63, 1.0, 1.6, 2.5, 4.0)  # times the tracker's stated SD
_TRUST = (30.0, 100.0, 300.0, 1e3, 1e4, 1e5, 3e6)  # densities of acceleration errors, mm²/s³
_USUAL_TRUST, _TRUST_SPREAD = 200.0, 1.5  # what phones in the hand came to, and the SD of its logarithm
_NOISE_SPREAD = 0.35  # SD of the logarithm of noise over stated noise
# Correlated noise: its SD, times the stated one, its time in s, and the trust of accelerations with it.
_DRIFT_NOISE, _DRIFT_S, _DRIFT_TRUST = (0.63, 1.0, 1.6), (0.2, 1.0), (30.0, 100.0, 300.0, 1e4)
_DRIFT_WHITE = 0.1  # of the SD: with more, quick correlated noise is taken for a smaller one that is partly white
_DRIFT_ODDS = -3.0  # log odds of such noise before any position, one recording in twenty
_RATE_WALK = 30.0  # mm/s² per √s, of a member's acceleration error
_JERK_PSD, _ALONE_NOISE = (1e6, 1e7, 1e8, 1e9), (1.0, 2.0)  # of members that do not use the phone


@dataclass(frozen=True)
class FusionAdaptive:
    """One tracker and one accelerometer, which need be no more than roughly what they are stated to be.

    Found from the readings: the tracker's noise, its correlation and its clock, the accelerometer's bias, mounting and
    trust, and the lever arm from it to the tracked point. A stated latency is where the clock's search begins, a stated
    noise where the noise's does. Readings later than `history_s` are left out.

    Two clocks that disagree do not say which is wrong. `trusted_clock` names the sensor whose stamps, less its stated
    latency, are right. Without it the accelerometer's are believed, but for its share of a disagreement of some ms, and
    the SD counts its being wrong as likely.

    Raises ValueError for other sensors than these two, a sensor later than the history, or a clock of neither.
    """

    sensors: Mapping[str, Sensor]
    history_s: float = 0.5
    trusted_clock: str | None = None

    def __post_init__(self) -> None:
        require_fit(self.sensors)
        require_positive(history_s=self.history_s)
        require_covered(self.sensors, "history_s", self.history_s)
        orders = sorted(-1 if sensor.order is None else sensor.order for sensor in self.sensors.values())
        if orders != [0, 2] or any(sensor.axes is not None for sensor in self.sensors.values()):
            raise ValueError(
                "fusion_adaptive is for one tracker and one accelerometer, each of all axes; fusion_kalman takes any"
            )
        if self.trusted_clock is not None and self.trusted_clock not in self.sensors:
            raise ValueError(f"trusted_clock must be one of {', '.join(self.sensors)}, got {self.trusted_clock}")

    @cached_property
    def tracker(self) -> str:
        """The name of the position sensor."""
        return position_sensor(self.sensors)

    @property
    def dimension(self) -> int:
        """Of the position."""
        return self.sensors[self.tracker].dimension

    @cached_property
    def model(self) -> Records:
        """Priors and members, by what the sensors state: a record of `layout.MODEL`."""
        from scipy.special import chdtri  # two fifths of what importing this package would cost

        noise_sd, dimension = self.sensors[self.tracker].noise_sd, self.dimension
        prior, walk = np.zeros(layout.SIZE), np.zeros(layout.SIZE)
        prior[layout.POSITION : layout.POSITION + dimension] = noise_sd**2
        prior[layout.VELOCITY : layout.VELOCITY + dimension] = _SPEED_SD**2
        for begin, (count, sd, drift) in _PRIOR_SD.items():
            end = begin + (dimension if begin == layout.OFFSET else count)
            prior[begin:end], walk[begin:end] = sd**2, drift**2
        member, log_prior = _members(noise_sd)
        model = np.zeros(1, layout.MODEL)
        for field, value in {
            "dimension": dimension,
            "trusted": self._trusted,
            "prior": prior,
            "walk": walk,
            "member": member,
            "log_member": np.log(np.maximum(member, np.finfo(float).tiny)),
            "first_alone": np.sum(member[layout.USES_PHONE]),
            "log_prior": log_prior,
            "surprise": chdtri(dimension, _RARE),
            "history_s": self.history_s,
        }.items():
            model[field] = value
        return model

    @property
    def _trusted(self) -> int:
        if self.trusted_clock is None:
            return layout.NEITHER
        return layout.THE_TRACKER if self.trusted_clock == self.tracker else layout.THE_PHONE

    def start(self) -> Memory:
        """Nothing seen."""
        return layout.empty(1)

    def update(self, state: Memory, sensor: str, sample: Sample) -> Memory:
        """A copy of the state with the reading taken in; a position waits for the phone's readings up to its time."""
        if sensor not in self.sensors:
            return state
        require_reading(sensor, self.sensors[sensor], sample)
        reading = np.zeros((1, READING))
        self._write(reading, sensor, sample.time, sample.arrival, sample.value, sample.rotation, sample.force)
        room = self._copied(state)
        steps.go_through(self.model, room.state, room.phone, reading, _NO_TIMES, _NO_ROWS, _NO_ROWS, _NO_ROWS)
        return room

    def _copied(self, memory: Memory, more: int = 1) -> Memory:
        """A copy with room for some rows more, less the rows that are no longer needed."""
        count = memory.state["count"][0, ROWS]
        first = steps.oldest_needed(self.model, memory.state, memory.phone)
        room = Memory(memory.state.copy(), layout.room(int(count - first) + more))
        for to, of in zip(room.phone[:3], memory.phone[:3], strict=True):
            to[: count - first] = of[first:count]
        room.state["count"][0, ROWS] = count - first
        return room

    def predict(self, state: Memory, time: float) -> tuple[FloatArray, FloatArray]:
        """What is known, moved on to `time`."""
        mean, sd = np.empty((2, 1, self.dimension))
        steps.go_through(self.model, state.state, state.phone, _NO_READINGS, np.array([time]), mean, sd, _NO_ROWS)
        return mean[0], sd[0]

    def _write(
        self,
        readings: FloatArray,
        sensor: str,
        time: Any,
        arrival: Any,
        value: FloatArray,
        rotation: FloatArray | None,
        force: FloatArray | None,
    ) -> None:
        """One or more readings of a sensor into rows (n, READING), the columns of which are in `layout`."""
        dimension = self.dimension
        known = UNTURNED if rotation is None else ORIENTED if force is None else FELT
        readings[:, layout.TIME], readings[:, layout.ARRIVAL] = time, arrival
        readings[:, layout.IS_FRAME], readings[:, layout.ORIENTATION] = sensor == self.tracker, known
        readings[:, layout.READ : layout.READ + dimension] = value
        turned = readings[:, layout.ROTATION : layout.SPECIFIC].reshape(-1, 3, 3)
        turned[:, :dimension] = np.eye(dimension, 3) if rotation is None else rotation
        readings[:, layout.ROTATION : layout.SPECIFIC] = turned.reshape(-1, 9)
        if force is not None:
            readings[:, layout.SPECIFIC :] = force

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """The same steps in one compiled loop."""
        require_readings(self.sensors, samples)
        return self.traced(samples, times, np.empty((0, 0)))

    def traced(self, samples: Mapping[str, Samples], times: FloatArray, trace: FloatArray) -> Track:
        """The same; `trace` (n, FACTS + 2 SIZE) takes facts, mean and its SDs at `times`, which then must rise."""
        order = np.argsort(times, kind="stable")
        rising = np.asarray(times, dtype=np.float64)[order]
        readings = self._readings(samples)
        if len(rising):
            readings = readings[: np.searchsorted(readings[:, layout.ARRIVAL], rising[-1], side="right")]
        mean, sd = np.empty((2, len(times), self.dimension))
        memory = layout.empty(2 * self._most_kept(samples) + _ROOM)
        steps.go_through(self.model, memory.state, memory.phone, readings, rising, mean, sd, trace)
        back = np.argsort(order, kind="stable")
        return Track(times, mean[back], sd[back])

    @property
    def resumes(self) -> bool:
        """Always."""
        return True

    def resume(self, state: Memory, samples: Mapping[str, Samples], times: FloatArray) -> tuple[Track, Memory]:
        """`replay` of one piece of a recording, from the state after the piece before."""
        require_readings(self.sensors, samples)
        mean, sd = np.empty((2, len(times), self.dimension))
        room = self._copied(state, 2 * self._most_kept(samples) + _ROOM)
        steps.go_through(self.model, room.state, room.phone, self._readings(samples), times, mean, sd, _NO_ROWS)
        return Track(times, mean, sd), room

    def found(self, samples: Mapping[str, Samples]) -> list[Found]:
        """What the sensors turned out to be like by the end of a recording, beside what they are stated to be."""
        require_readings(self.sensors, samples)
        memory = layout.empty(2 * self._most_kept(samples) + _ROOM)
        readings = self._readings(samples)
        steps.go_through(self.model, memory.state, memory.phone, readings, _NO_TIMES, _NO_ROWS, _NO_ROWS, _NO_ROWS)
        return self.found_by(memory)

    def found_by(self, state: Memory) -> list[Found]:
        """The same after some readings."""
        return found(self.model, state)

    def _most_kept(self, samples: Mapping[str, Samples]) -> int:
        """The largest number of the phone's readings within the time that rows are kept."""
        most = 0
        for name, stream in samples.items():
            if name in self.sensors and name != self.tracker and len(stream):
                time = np.sort(stream.time)
                since = np.searchsorted(time, time - 2.0 * self.history_s - 1.0, side="left")
                most = int(np.max(np.arange(len(time)) + 1 - since))
        return most

    def _readings(self, samples: Mapping[str, Samples]) -> FloatArray:
        """All readings (n, READING) by arrival, in the sensors' order where they arrive at once."""
        streams = [(name, samples[name]) for name in self.sensors if name in samples]
        readings, end = np.zeros((sum(len(stream) for _, stream in streams), READING)), 0
        for name, stream in streams:
            begin, end = end, end + len(stream)
            columns = stream.time, stream.arrival, stream.value, stream.rotation, stream.force
            self._write(readings[begin:end], name, *columns)
        order = np.argsort(readings[:, layout.ARRIVAL], kind="stable")
        return np.asarray(readings[order])


def _members(noise_sd: float) -> tuple[FloatArray, FloatArray]:
    """The bank's members (MEMBER, n) and their log priors (n,)."""
    found: list[tuple[tuple[float, ...], float]] = []
    for noise, trust in product(_NOISE, _TRUST):
        parameters = ((noise * noise_sd) ** 2, trust, _RATE_WALK**2, 1.0, 0.0, 0.0)
        found.append((parameters, _log_odds(noise) + _log_trust(trust)))
    for noise, time_s, trust in product(_DRIFT_NOISE, _DRIFT_S, _DRIFT_TRUST):
        drift = (noise * noise_sd) ** 2
        parameters = (_DRIFT_WHITE**2 * drift, trust, _RATE_WALK**2, 1.0, drift, time_s)
        found.append((parameters, _log_odds(noise) + _log_trust(trust) + _DRIFT_ODDS))
    for noise, jerk_psd in product(_ALONE_NOISE, _JERK_PSD):
        found.append((((noise * noise_sd) ** 2, 0.0, jerk_psd, 0.0, 0.0, 0.0), _log_odds(noise)))
    columns = np.array([parameters for parameters, _ in found]).T.copy()
    return columns, np.array([odds for _, odds in found])


def _log_odds(noise: float) -> float:
    """The stated noise is right within a factor of 1.4, more or less: a few seconds of positions say more."""
    return float(-0.5 * (np.log(noise) / _NOISE_SPREAD) ** 2)


def _log_trust(psd: float) -> float:
    return float(-0.5 * (np.log(psd / _USUAL_TRUST) / _TRUST_SPREAD) ** 2)
