"""The fixed-gain path of Kalman fusion: for regular streams, whose gains settle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fusion_core.estimator import replay_loop, unknown
from fusion_core.kalman import fixed_gain_steps
from fusion_core.kalman.event_history import SAME_S
from fusion_core.kalman.fixed_gain_steps import Gains, Rows, Schedule
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, position_sensor

_WHOLE = 1e-6  # how far a ratio of rates may be from a whole number, relative to it
_RING = 1024  # rows that a batch keeps for late readings; a power of two


@dataclass(frozen=True)
class Recent:
    """The recent readings with the mean after each; `after_s` is how long after a frame the next acceleration comes.

    `waiting` holds the accelerations from before the first frame.
    """

    rows: Rows | None = None
    after_s: float = 0.0
    waiting: tuple[Sample, ...] = ()
    too_late: int = 0


@dataclass(frozen=True)
class FixedGain:
    """Fusion with the gains that the filter settles to.

    Raises ValueError unless the sensors are one tracker and one accelerometer of all axes, both with a rate, the
    accelerometer's a multiple of the tracker's.
    """

    sensors: Mapping[str, Sensor]
    jerk_psd_mm2_s5: float
    bias_psd: float
    history_s: float

    def __post_init__(self) -> None:
        orders = sorted(str(sensor.order) for sensor in self.sensors.values())
        if orders != ["0", "2"] or any(sensor.axes is not None for sensor in self.sensors.values()):
            raise ValueError(
                "path fixed_gain needs one position sensor and one acceleration sensor of all axes, got "
                + ", ".join(f"{name} ({sensor.operator})" for name, sensor in self.sensors.items())
            )
        for name, sensor in self.sensors.items():
            if sensor.rate_hz is None:
                raise ValueError(f"path fixed_gain needs the rate of every sensor; {name} has no rate_hz")
        ratio = self._imu.rate_hz / self._tracker.rate_hz  # type: ignore[operator]
        if abs(ratio - round(ratio)) > _WHOLE * ratio or round(ratio) < 1:
            raise ValueError(
                f"path fixed_gain needs an acceleration rate that is a multiple of the position rate, "
                f"got {self._imu.rate_hz} and {self._tracker.rate_hz} Hz"
            )

    @cached_property
    def _tracker_name(self) -> str:
        return position_sensor(self.sensors)

    @property
    def _tracker(self) -> Sensor:
        return self.sensors[self._tracker_name]

    @property
    def _imu_name(self) -> str:
        return next(name for name in self.sensors if name != self._tracker_name)

    @property
    def _imu(self) -> Sensor:
        return self.sensors[self._imu_name]

    def _after_s(self, frame_time: float, acceleration_time: float | None) -> float:
        """How long after a frame the next acceleration is measured, in s, from the first frame and acceleration."""
        period_s = 1.0 / float(self._imu.rate_hz or 1.0)
        if acceleration_time is None:
            return period_s
        after_s = round((acceleration_time - frame_time) % period_s, 9)
        return period_s if after_s <= SAME_S else min(after_s, period_s)

    def _gains(self, after_s: float) -> Gains:
        imu_rate_hz, tracker_rate_hz = float(self._imu.rate_hz or 1.0), float(self._tracker.rate_hz or 1.0)
        return fixed_gain_steps.settled_gains(
            Schedule(
                self.jerk_psd_mm2_s5,
                self.bias_psd,
                self._tracker.noise_sd**2,
                self._imu.noise_sd**2,
                1.0 / imu_rate_hz,
                round(imu_rate_hz / tracker_rate_hz),
                after_s,
            ),
            self._tracker.dimension,
        )

    def start(self) -> Recent:
        """Nothing seen."""
        return Recent()

    def update(self, state: Recent, sensor: str, sample: Sample) -> Recent:
        """The state with the reading inserted in order of measurement; later readings are processed again."""
        is_frame = sensor == self._tracker_name
        if state.rows is None:
            if is_frame:
                return self._first(state, sample)
            waiting = tuple(w for w in state.waiting if w.time > sample.time - self.history_s)
            return replace(state, waiting=(*waiting, sample))
        count = len(state.rows.time)
        room = fixed_gain_steps.empty_rows(count + 1, self._tracker.dimension)
        value = np.ascontiguousarray(sample.value, dtype=np.float64)
        gains = self._gains(state.after_s)
        if fixed_gain_steps.insert_into_copy(gains, state.rows, room, sample.time, is_frame, value) == 0:
            return replace(state, too_late=state.too_late + 1)
        oldest = max(int(np.searchsorted(room.time, room.time[-1] - self.history_s, side="right")) - 1, 0)
        return replace(state, rows=Rows._make(column[oldest:] for column in room))

    def _first(self, state: Recent, sample: Sample) -> Recent:
        """The state at the first frame, with the accelerations that waited for it."""
        rows = fixed_gain_steps.empty_rows(1, self._tracker.dimension)
        rows.time[0], rows.is_frame[0], rows.value[0], rows.mean[0, 0] = sample.time, True, sample.value, sample.value
        later = [reading for reading in state.waiting if reading.time > sample.time]
        after_s = self._after_s(sample.time, min((reading.time for reading in later), default=None))
        started = Recent(rows, after_s)
        for reading in later:
            started = self.update(started, self._imu_name, reading)
        return started

    def predict(self, state: Recent, time: float) -> tuple[FloatArray, FloatArray]:
        """The newest mean, moved on to `time`, with the SD that the filter settles to."""
        if state.rows is None:
            return unknown(self._tracker.dimension)
        newest = len(state.rows.time) - 1
        moments: tuple[FloatArray, FloatArray] = fixed_gain_steps.predict_position(
            self._gains(state.after_s), state.rows, newest, time
        )
        return moments

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """By one compiled loop where both streams are in order of measurement; otherwise by the plain loop."""
        frames, accelerations = samples.get(self._tracker_name), samples.get(self._imu_name)
        times = np.asarray(times, dtype=np.float64)
        if frames is None or accelerations is None or not len(frames) or not _rising(times):
            return replay_loop(self, samples, times)
        in_order = _rising(frames.time) and _rising(accelerations.time)
        lateness = max(_latest(frames), _latest(accelerations))
        if not in_order or lateness >= self.history_s:
            return replay_loop(self, samples, times)
        later = np.searchsorted(accelerations.time, frames.time[0], side="right")
        known = later < len(accelerations) and accelerations.arrival[later] <= frames.arrival[0]
        gains = self._gains(self._after_s(frames.time[0], float(accelerations.time[later]) if known else None))
        ring = fixed_gain_steps.empty_rows(_RING, self._tracker.dimension)
        mean, sd, whole = fixed_gain_steps.replay(gains, _columns(frames), _columns(accelerations), times, ring)
        return Track(times, mean, sd) if whole else replay_loop(self, samples, times)


def _rising(times: FloatArray) -> bool:
    """Whether no time is before the one before it."""
    return bool(np.all(times[1:] >= times[:-1]))


def _latest(samples: Samples) -> float:
    """The largest delay between measurement and arrival, in s."""
    return float(np.max(samples.arrival - samples.time, initial=0.0))


def _columns(samples: Samples) -> tuple[FloatArray, FloatArray, FloatArray]:
    return samples.time, samples.arrival, np.ascontiguousarray(samples.value, dtype=np.float64)
