"""The position-only Kalman filter, compiled. All axes have the same sensor and so share one covariance.

Arrays are copied element by element: an assignment of slices, with the message about shapes that do not fit, takes
longer to compile than the whole filter.
"""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.kalman.motion import add_wiener_noise
from fusion_core.samples import FloatArray


@compiled
def begin(
    value: FloatArray, noise_variance: float, speed_sd: float, acceleration_sd: float
) -> tuple[FloatArray, FloatArray]:
    """Mean (3, d) and covariance (3, 3) of position, velocity and acceleration at the first frame."""
    mean, covariance = np.zeros((3, len(value))), np.zeros((3, 3))
    for axis in range(len(value)):
        mean[0, axis] = value[axis]
    covariance[0, 0], covariance[1, 1], covariance[2, 2] = noise_variance, speed_sd**2, acceleration_sd**2
    return mean, covariance


@compiled
def predict(
    mean: FloatArray, covariance: FloatArray, dt: float, jerk_psd_mm2_s5: float
) -> tuple[FloatArray, FloatArray]:
    """Mean (3, d) and covariance (3, 3) `dt` seconds later, by the Wiener-process-acceleration model."""
    transition = np.eye(3)
    transition[0, 1] = transition[1, 2] = dt
    transition[0, 2] = dt * dt / 2.0
    later = transition @ covariance @ transition.T
    add_wiener_noise(jerk_psd_mm2_s5, dt, later, 1, 0)
    return transition @ mean, later


@compiled
def correct(mean: FloatArray, covariance: FloatArray, value: FloatArray, noise_variance: float) -> None:
    """Corrects mean and covariance by a frame, in place. Joseph's form keeps the covariance symmetric and positive."""
    keep, gain, variance = np.eye(3), np.empty(3), covariance[0, 0] + noise_variance
    for row in range(3):
        gain[row] = covariance[row, 0] / variance
        keep[row, 0] -= gain[row]
    for axis in range(len(value)):
        innovation = value[axis] - mean[0, axis]
        for row in range(3):
            mean[row, axis] += gain[row] * innovation
    kept = keep @ covariance @ keep.T
    for row in range(3):
        for column in range(3):
            covariance[row, column] = kept[row, column] + noise_variance * (gain[row] * gain[column])


@compiled
def predict_position(
    mean: FloatArray, covariance: FloatArray, dt: float, jerk_psd_mm2_s5: float
) -> tuple[FloatArray, float]:
    """Position (d,) and its SD `dt` seconds after the newest frame."""
    later, spread = predict(mean, covariance, dt, jerk_psd_mm2_s5)
    return later[0], np.sqrt(spread[0, 0])


@compiled
def replay(
    arrival: FloatArray,
    value: FloatArray,
    times: FloatArray,
    noise_variance: float,
    initial_sd: tuple[float, float],
    jerk_psd_mm2_s5: float,
    ahead_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (n, d) at rising `times`, from frames (m, d) in order of arrival."""
    shown, sd = np.full((len(times), value.shape[1]), np.nan), np.full((len(times), value.shape[1]), np.nan)
    mean, covariance, upcoming = np.zeros((3, value.shape[1])), np.zeros((3, 3)), 0
    for index in range(len(times)):
        while upcoming < len(arrival) and arrival[upcoming] <= times[index]:
            if upcoming == 0:
                mean, covariance = begin(value[0], noise_variance, initial_sd[0], initial_sd[1])
            else:
                dt = arrival[upcoming] - arrival[upcoming - 1]
                mean, covariance = predict(mean, covariance, dt, jerk_psd_mm2_s5)
                correct(mean, covariance, value[upcoming], noise_variance)
            upcoming += 1
        if upcoming > 0:
            dt = max(times[index] - arrival[upcoming - 1], 0.0) + ahead_s
            position, sd_mm = predict_position(mean, covariance, dt, jerk_psd_mm2_s5)
            for axis in range(len(position)):
                shown[index, axis], sd[index, axis] = position[axis], sd_mm
    return shown, sd
