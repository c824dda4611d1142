"""Kalman filters over a Wiener-process acceleration: position-only, and fused with accelerations."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit

from fusion_core.estimator import replay_loop, require_not_negative, require_positive, unknown
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, position_sensor


def wiener_acceleration(step_s: float, jerk_psd_mm2_s5: float) -> tuple[FloatArray, FloatArray]:
    """Transition F (3, 3) of position, velocity and acceleration over a step, and its process noise Q (3, 3).

    The continuous Wiener-process-acceleration model: Bar-Shalom, Li and Kirubarajan (2001), section 6.2.3.
    """
    dt = step_s
    transition = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    noise = jerk_psd_mm2_s5 * np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    return transition, noise


@dataclass(frozen=True)
class Moments:
    """Mean (k, d) and covariance (k, k), shared by all axes, of a state at `time` (s)."""

    time: float
    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class PositionKalman:
    """Position-only Kalman filter: what the study's "Kinect" condition displayed.

    A frame is taken as if measured on arrival, so the estimate is as late as the tracker; `ahead_s` extrapolates
    further (0.1 s in the paper's Table 1). `jerk_psd_mm2_s5` is the power spectral density of the jerk.
    """

    sensors: Mapping[str, Sensor]
    jerk_psd_mm2_s5: float = 3.4e6
    ahead_s: float = 0.0
    initial_speed_sd_mm_s: float = 500.0
    initial_acceleration_sd_mm_s2: float = 5000.0

    def __post_init__(self) -> None:
        position_sensor(self.sensors)
        require_positive(
            jerk_psd_mm2_s5=self.jerk_psd_mm2_s5,
            initial_speed_sd_mm_s=self.initial_speed_sd_mm_s,
            initial_acceleration_sd_mm_s2=self.initial_acceleration_sd_mm_s2,
        )
        require_not_negative(ahead_s=self.ahead_s)

    @property
    def _tracker(self) -> Sensor:
        return self.sensors[position_sensor(self.sensors)]

    def start(self) -> Moments | None:
        """No frame yet."""
        return None

    def update(self, state: Moments | None, sensor: str, sample: Sample) -> Moments | None:
        """One Kalman step a frame; other sensors change nothing."""
        if sensor != position_sensor(self.sensors):
            return state
        noise_variance = self._tracker.noise_sd**2
        if state is None:
            mean = np.vstack([sample.value, np.zeros((2, self._tracker.dimension))])
            spread = [noise_variance, self.initial_speed_sd_mm_s**2, self.initial_acceleration_sd_mm_s2**2]
            return Moments(sample.arrival, mean, np.diag(spread))
        transition, process = wiener_acceleration(sample.arrival - state.time, self.jerk_psd_mm2_s5)
        mean = transition @ state.mean
        covariance = transition @ state.covariance @ transition.T + process
        gain = covariance[:, 0] / (covariance[0, 0] + noise_variance)
        mean = mean + gain[:, None] * (sample.value - mean[0])
        # Joseph's form keeps the covariance symmetric and positive.
        keep = np.eye(3)
        keep[:, 0] -= gain
        covariance = keep @ covariance @ keep.T + noise_variance * np.outer(gain, gain)
        return Moments(sample.arrival, mean, covariance)

    def predict(self, state: Moments | None, time: float) -> tuple[FloatArray, FloatArray]:
        """Extrapolated from the newest frame's arrival to `time` + `ahead_s`."""
        if state is None:
            return unknown(self._tracker.dimension)
        step = max(time - state.time, 0.0) + self.ahead_s
        transition, process = wiener_acceleration(step, self.jerk_psd_mm2_s5)
        variance = transition[0] @ state.covariance @ transition[0] + process[0, 0]
        return transition[0] @ state.mean, np.full(self._tracker.dimension, np.sqrt(variance))

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """The plain loop."""
        return replay_loop(self, samples, times)


@njit(cache=True)
def _propagate(
    mean: FloatArray, covariance: FloatArray, dt: float, jerk_psd: float, bias_psd: float
) -> tuple[FloatArray, FloatArray]:
    """Position, velocity, acceleration and accelerometer bias `dt` later: mean (4, d), covariance (4, 4)."""
    transition = np.eye(4)
    transition[0, 1] = transition[1, 2] = dt
    transition[0, 2] = dt * dt / 2
    moved = transition @ covariance @ transition.T
    moved[0, 0] += jerk_psd * dt**5 / 20
    moved[0, 1] += jerk_psd * dt**4 / 8
    moved[1, 0] += jerk_psd * dt**4 / 8
    moved[0, 2] += jerk_psd * dt**3 / 6
    moved[2, 0] += jerk_psd * dt**3 / 6
    moved[1, 1] += jerk_psd * dt**3 / 3
    moved[1, 2] += jerk_psd * dt**2 / 2
    moved[2, 1] += jerk_psd * dt**2 / 2
    moved[2, 2] += jerk_psd * dt
    moved[3, 3] += bias_psd * dt
    return transition @ mean, moved


@njit(cache=True)
def _correct(
    mean: FloatArray, covariance: FloatArray, observed: FloatArray, value: FloatArray, noise_variance: float
) -> tuple[FloatArray, FloatArray]:
    """One reading: `observed` (4,) says which sum of states was measured as `value` (d,). Joseph's form."""
    column = covariance @ observed
    gain = column / (observed @ column + noise_variance)
    keep = np.eye(4)
    for row in range(4):
        for other in range(4):
            keep[row, other] -= gain[row] * observed[other]
    corrected = keep @ covariance @ keep.T
    updated = mean.copy()
    innovation = value - observed @ mean
    for row in range(4):
        for axis in range(mean.shape[1]):
            updated[row, axis] += gain[row] * innovation[axis]
        for other in range(4):
            corrected[row, other] += noise_variance * gain[row] * gain[other]
    return updated, corrected


_OBSERVED = (  # by the operator's order: position, velocity, acceleration with its bias
    np.array([1.0, 0.0, 0.0, 0.0]),
    np.array([0.0, 1.0, 0.0, 0.0]),
    np.array([0.0, 0.0, 1.0, 1.0]),
)


@dataclass(frozen=True)
class Entry:
    """A reading in the recent past and the moments once it was taken in."""

    sensor: str
    sample: Sample
    moments: Moments


@dataclass(frozen=True)
class Recent:
    """The recent readings by measurement time; `waiting` holds those from before the first position."""

    entries: tuple[Entry, ...] = ()
    waiting: tuple[tuple[str, Sample], ...] = ()
    too_late: int = 0


@dataclass(frozen=True)
class FusionKalman:
    """Multi-rate Kalman fusion of late positions with prompt accelerations, on their own time stamps.

    The state is position, velocity, acceleration (a Wiener process of `jerk_psd_mm2_s5`) and the accelerometer's
    bias in the tracker frame (a random walk of `bias_walk_mm_s2_per_sqrt_s`). A late reading is put in at the
    time it was measured and what came after is gone through again; readings later than `history_s` are left out
    and counted in the state.
    """

    sensors: Mapping[str, Sensor]
    jerk_psd_mm2_s5: float = 1e7
    bias_walk_mm_s2_per_sqrt_s: float = 30.0
    initial_bias_sd_mm_s2: float = 300.0
    initial_speed_sd_mm_s: float = 500.0
    initial_acceleration_sd_mm_s2: float = 5000.0
    history_s: float = 0.5

    def __post_init__(self) -> None:
        position_sensor(self.sensors)
        require_positive(
            jerk_psd_mm2_s5=self.jerk_psd_mm2_s5,
            initial_speed_sd_mm_s=self.initial_speed_sd_mm_s,
            initial_acceleration_sd_mm_s2=self.initial_acceleration_sd_mm_s2,
            history_s=self.history_s,
        )
        require_not_negative(
            bias_walk_mm_s2_per_sqrt_s=self.bias_walk_mm_s2_per_sqrt_s,
            initial_bias_sd_mm_s2=self.initial_bias_sd_mm_s2,
        )
        for name, sensor in self.sensors.items():
            if sensor.latency_s > self.history_s:
                raise ValueError(
                    f"history_s must cover the latency of every sensor: {name} is {sensor.latency_s} s late, "
                    f"history_s is {self.history_s}"
                )

    def start(self) -> Recent:
        """Nothing seen."""
        return Recent()

    def update(self, state: Recent, sensor: str, sample: Sample) -> Recent:
        """The reading put in at its measurement time, and what came after it gone through again."""
        if sensor not in self.sensors:
            return state
        if not state.entries:
            return self._first(state, sensor, sample)
        at = bisect_right(state.entries, sample.time, key=lambda entry: entry.sample.time)
        if at == 0:
            return Recent(state.entries, state.waiting, state.too_late + 1)
        entries = list(state.entries[:at])
        for name, reading in [(sensor, sample)] + [(e.sensor, e.sample) for e in state.entries[at:]]:
            entries.append(Entry(name, reading, self._taken_in(entries[-1].moments, name, reading)))
        keep = bisect_right(entries, entries[-1].sample.time - self.history_s, key=lambda entry: entry.sample.time)
        return Recent(tuple(entries[max(keep - 1, 0) :]), (), state.too_late)

    def _first(self, state: Recent, sensor: str, sample: Sample) -> Recent:
        """Start at the first position; other readings wait for it."""
        chosen = self.sensors[sensor]
        if chosen.order != 0:
            waiting = [w for w in state.waiting if w[1].time > sample.time - self.history_s]
            return Recent((), (*waiting, (sensor, sample)), state.too_late)
        mean = np.vstack([sample.value, np.zeros((3, chosen.dimension))])
        spread = (
            chosen.noise_sd,
            self.initial_speed_sd_mm_s,
            self.initial_acceleration_sd_mm_s2,
            self.initial_bias_sd_mm_s2,
        )
        first = Entry(sensor, sample, Moments(sample.time, mean, np.diag(np.square(spread))))
        started = Recent((first,), (), state.too_late)
        for name, reading in state.waiting:
            if reading.time > sample.time:
                started = self.update(started, name, reading)
        return started

    def _taken_in(self, moments: Moments, name: str, sample: Sample) -> Moments:
        sensor = self.sensors[name]
        mean, covariance = self._moved(moments, sample.time)
        value = np.ascontiguousarray(sample.value)
        mean, covariance = _correct(mean, covariance, _OBSERVED[sensor.order], value, sensor.noise_sd**2)
        return Moments(sample.time, mean, covariance)

    def _moved(self, moments: Moments, time: float) -> tuple[FloatArray, FloatArray]:
        step = max(time - moments.time, 0.0)
        moved: tuple[FloatArray, FloatArray] = _propagate(
            moments.mean, moments.covariance, step, self.jerk_psd_mm2_s5, self.bias_walk_mm_s2_per_sqrt_s**2
        )
        return moved

    def predict(self, state: Recent, time: float) -> tuple[FloatArray, FloatArray]:
        """The newest moments, moved on to `time`."""
        if not state.entries:
            return unknown(self.sensors[position_sensor(self.sensors)].dimension)
        mean, covariance = self._moved(state.entries[-1].moments, time)
        return mean[0], np.full(mean.shape[1], np.sqrt(covariance[0, 0]))

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """The plain loop."""
        return replay_loop(self, samples, times)
