"""How a phone's sensor is mounted on the body that the tracker sees: mounting error and lever arm, from its motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusion_core.kalman.fusion import FusionKalman
from fusion_core.phone.orientation import nearest
from fusion_core.samples import FloatArray, Samples
from fusion_core.sensors import Sensor

_MOUNTING_SD_RAD = 0.09  # 5°
_LEVER_ARM_SD_MM = 100.0


@dataclass(frozen=True)
class Calibration:
    """How a phone's accelerometer is mounted, each estimate with its SD.

    `mounting_rad` (3,) is a small rotation of the accelerometer's axes; `lever_arm_mm` (3,) goes from the accelerometer
    to the point that the tracker sees, in the body's frame.
    """

    mounting_rad: FloatArray
    mounting_sd_rad: FloatArray
    lever_arm_mm: FloatArray
    lever_arm_sd_mm: FloatArray


@dataclass(frozen=True)
class Body:
    """A phone's accelerations: specific force (n, 3) in mm/s², body-to-tracker rotations (n, 3, 3), gravity (3,)."""

    time: FloatArray
    arrival: FloatArray
    force_mm_s2: FloatArray
    rotation: FloatArray
    gravity_mm_s2: FloatArray

    def acceleration(self) -> Samples:
        """Accelerations (n, 3) in mm/s² in the tracker's frame: a = R f + g. At rest f points up and a is zero."""
        value = np.einsum("nij,nj->ni", self.rotation, self.force_mm_s2)
        value += self.gravity_mm_s2
        return Samples(self.time, self.arrival, value, self.rotation, self.force_mm_s2)


def calibrate(
    tracker: Samples, tracker_sensor: Sensor, body: Body, acceleration_sensor: Sensor, until_s: float
) -> Calibration | None:
    """Mounting and lever arm, from what has arrived by `until_s`; None without a position by then. Causal.

    Both enter the readings linearly, a rotation by δ as R(f × δ) in an acceleration and an arm r as R r in a position.
    So they are constants of the fusion filter beside its bias, which also gives their SDs.
    """
    force, turned = body.force_mm_s2, body.rotation
    coupling = np.zeros((len(force), 3, 9))
    coupling[:, :, :3] = turned
    coupling[:, :, 3:6] = turned @ _cross(force)
    of_frames = np.zeros((len(tracker), 3, 9))
    of_frames[:, :, 6:] = turned[nearest(body.time, tracker.time)]
    estimator = FusionKalman({"tracker": tracker_sensor, "imu": acceleration_sensor})
    bias_sd, walk = estimator.initial_bias_sd_mm_s2, estimator.bias_walk_mm_s2_per_sqrt_s
    steps = estimator.event_time.with_constants(
        np.repeat([bias_sd, _MOUNTING_SD_RAD, _LEVER_ARM_SD_MM], 3), np.repeat([walk, 0.0, 0.0], 3)
    )
    readings = {"tracker": tracker, "imu": body.acceleration()}
    mean, covariance = steps.constants(readings, {"tracker": of_frames, "imu": coupling}, np.array([until_s]))
    if not np.isfinite(mean).all():
        return None
    sd = np.sqrt(np.diag(covariance[0]))
    return Calibration(mean[0, 3:6], sd[3:6], mean[0, 6:], sd[6:])


def with_mounting(rotation: FloatArray, mounting_rad: FloatArray) -> FloatArray:
    """Rotations (n, 3, 3) from the accelerometer's axes to the tracker's frame, given the body's and the mounting."""
    from scipy.spatial.transform import Rotation

    turned: FloatArray = rotation @ Rotation.from_rotvec(mounting_rad).as_matrix()
    return turned


def _cross(vectors: FloatArray) -> FloatArray:
    """Matrices (n, 3, 3) whose product with w is v × w."""
    x, y, z = vectors.T
    zero = np.zeros(len(vectors))
    rows = [np.stack(row, axis=1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, axis=1)
