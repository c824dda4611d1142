"""The position-only Kalman filter over a Wiener-process acceleration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fusion_core.checks import require_not_negative, require_positive
from fusion_core.estimator import replay_loop, unknown
from fusion_core.kalman import position_steps
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, position_sensor


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
    further (0.1 s in the paper's Table 1). `jerk_psd_mm2_s5` is the power spectral density of the jerk of a
    Wiener-process acceleration (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.3).
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
        """One Kalman step per frame; readings of other sensors change nothing."""
        if sensor != position_sensor(self.sensors):
            return state
        noise_variance, value = self._tracker.noise_sd**2, np.ascontiguousarray(sample.value, dtype=np.float64)
        if state is None:
            return Moments(sample.arrival, *position_steps.begin(value, noise_variance, *self._initial_sd))
        step_s = sample.arrival - state.time
        mean, covariance = position_steps.predict(state.mean, state.covariance, step_s, self.jerk_psd_mm2_s5)
        position_steps.correct(mean, covariance, value, noise_variance)
        return Moments(sample.arrival, mean, covariance)

    @property
    def _initial_sd(self) -> tuple[float, float]:
        return float(self.initial_speed_sd_mm_s), float(self.initial_acceleration_sd_mm_s2)

    def predict(self, state: Moments | None, time: float) -> tuple[FloatArray, FloatArray]:
        """Extrapolated from the newest frame's arrival to `time` + `ahead_s`."""
        if state is None:
            return unknown(self._tracker.dimension)
        step_s = max(time - state.time, 0.0) + self.ahead_s
        mean, sd = position_steps.predict_position(state.mean, state.covariance, step_s, self.jerk_psd_mm2_s5)
        return mean, np.full(self._tracker.dimension, sd)

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """The same steps in one compiled loop."""
        frames = samples.get(position_sensor(self.sensors))
        if frames is None:
            return replay_loop(self, samples, times)
        order = np.argsort(times, kind="stable")
        mean, sd = np.empty((2, len(times), self._tracker.dimension))
        mean[order], sd[order] = position_steps.replay(
            np.asarray(frames.arrival, dtype=np.float64),
            np.ascontiguousarray(frames.value, dtype=np.float64),
            np.asarray(times, dtype=np.float64)[order],
            self._tracker.noise_sd**2,
            self._initial_sd,
            float(self.jerk_psd_mm2_s5),
            float(self.ahead_s),
        )
        return Track(times, mean, sd)
