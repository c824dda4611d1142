"""The position-only Kalman filter over a Wiener-process acceleration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fusion_core.checks import require_not_negative, require_positive
from fusion_core.estimator import replay_loop, unknown
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
