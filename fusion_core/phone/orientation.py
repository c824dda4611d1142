"""From the phone's frame to the tracker's: orientation, heading and gravity."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from fusion_core.kalman.event_time import EventTime
from fusion_core.kalman.fusion import FusionKalman
from fusion_core.phone.sightings import sightings
from fusion_core.samples import FloatArray, Samples
from fusion_core.sensors import Sensor

_HEADING_WALK_PER_SQRT_S = 0.02  # of the heading's cosine and sine: a gyroscope drifts
_LEVEL_BIAS_SD_MM_S2 = 300.0  # 2° of tilt, or an accelerometer's own
_LEVEL_BIAS_WALK_MM_S2 = 30.0
_AT_ONCE = 2**16


def rotate(quaternion_xyzw: FloatArray, vectors: FloatArray) -> FloatArray:
    """Vectors (n, 3) turned by unit quaternions (n, 4) or (4,), scalar last: body to tracker frame.

    Quaternions are brought to unit length first. Raises ValueError for one of length zero.
    """
    quaternion = np.broadcast_to(quaternion_xyzw, (len(vectors), 4))
    length = np.linalg.norm(quaternion, axis=1, keepdims=True)
    if np.any(length == 0):
        raise ValueError("a rotation needs a quaternion of length above 0, got (0, 0, 0, 0)")
    unit = quaternion / length
    axis, scalar = unit[:, :3], unit[:, 3:]
    twice = 2 * np.cross(axis, vectors)
    turned: FloatArray = vectors + scalar * twice + np.cross(axis, twice)
    return turned


def rotations(quaternion_xyzw: FloatArray) -> FloatArray:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4): each turns a column from the body's to the tracker's frame."""
    found = np.empty((len(quaternion_xyzw), 3, 3))
    for begin in range(0, len(quaternion_xyzw), _AT_ONCE):  # what is in between takes twice the memory of the result
        part = quaternion_xyzw[begin : begin + _AT_ONCE]
        for column, unit in enumerate(np.eye(3)):
            found[begin : begin + _AT_ONCE, :, column] = rotate(part, np.broadcast_to(unit, (len(part), 3)))
    return found


def rotation(quaternion_xyzw: FloatArray) -> FloatArray:
    """The rotation matrix (3, 3) of one quaternion (4,): as `rotations`, and many times as fast for one alone."""
    x, y, z, w = (quaternion_xyzw / math.sqrt(quaternion_xyzw.dot(quaternion_xyzw))).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def carry_forward(
    time: FloatArray, quaternion_xyzw: FloatArray, angular_velocity_rad_s: FloatArray, longest_s: float = 1.0
) -> FloatArray:
    """Orientations (n, 4) in which unknown ones (NaN) follow from the last known one by the gyroscope (n, 3) in rad/s.

    For up to `longest_s`, in which a gyroscope drifts by a degree or two; after that they stay unknown. `time` (n,) in
    s rises.
    """
    from scipy.spatial.transform import Rotation

    filled = quaternion_xyzw.copy()
    known: npt.NDArray[np.bool_] = np.isfinite(filled[:, 3])
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), -1))
    for row in np.flatnonzero(~known & (last >= 0)):
        step_s = time[row] - time[row - 1]
        if time[row] - time[last[row]] <= longest_s and np.isfinite(filled[row - 1, 3]):
            mid = (angular_velocity_rad_s[row - 1] + angular_velocity_rad_s[row]) / 2
            filled[row] = (Rotation.from_quat(filled[row - 1]) * Rotation.from_rotvec(mid * step_s)).as_quat()
    return filled


def level_rotation(gravity_mm_s2: FloatArray) -> FloatArray:
    """The smallest rotation (4,) from a frame whose z points up to the tracker's, in which gravity (3,) is as given."""
    from scipy.spatial.transform import Rotation

    up = -gravity_mm_s2 / np.linalg.norm(gravity_mm_s2)
    axis = np.cross([0.0, 0.0, 1.0], up)
    sine, cosine = float(np.linalg.norm(axis)), float(up[2])
    if sine < 1e-12:
        return np.array([0.0, 0.0, 0.0, 1.0]) if cosine > 0 else np.array([1.0, 0.0, 0.0, 0.0])
    turned: FloatArray = Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine)).as_quat()
    return turned


def heading(
    tracker: Samples, tracker_sensor: Sensor, acceleration: Samples, acceleration_sensor: Sensor
) -> tuple[FloatArray, FloatArray]:
    """The angle about the vertical between accelerations and tracker, and its SD, (n,) each in rad, from the motion.

    Both are in frames whose z points up: positions (m, 3) in mm, accelerations (n, 3) in mm/s² without gravity. Each
    angle is what is known when an acceleration arrives. The cosine and sine of the angle enter an acceleration
    linearly, so they are constants of the fusion filter beside its bias. Frames that did not see the hand say nothing.
    NaN before the first position; the SD is large until the hand has moved.
    """
    tracker = sightings(tracker, tracker_sensor.noise_sd)
    east, north = acceleration.value[:, 0], acceleration.value[:, 1]
    coupling = np.zeros((len(acceleration), 3, 5))
    coupling[:, :3, :3] = np.eye(3)
    coupling[:, 0, 3], coupling[:, 1, 3] = -east, -north
    coupling[:, 0, 4], coupling[:, 1, 4] = north, -east
    vertical = acceleration.value * np.array([0.0, 0.0, 1.0])
    readings = {"tracker": tracker, "imu": Samples(acceleration.time, acceleration.arrival, vertical)}
    steps = heading_filter(tracker_sensor, acceleration_sensor)
    couplings = {"tracker": np.zeros((len(tracker), 3, 5)), "imu": coupling}
    mean, covariance = steps.constants(readings, couplings, acceleration.arrival)
    cosine, sine = mean[:, 3], mean[:, 4]
    length = np.maximum(np.hypot(cosine, sine), 1e-9)
    angle = np.arctan2(sine, cosine)
    across = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    variance = np.einsum("ni,nij,nj->n", across, covariance[:, 3:, 3:], across)
    return angle, np.sqrt(variance) / length


def heading_filter(tracker_sensor: Sensor, acceleration_sensor: Sensor) -> EventTime:
    """The fusion filter of `tracker` and `imu` whose constants are three biases, and cosine and sine of the heading."""
    return FusionKalman({"tracker": tracker_sensor, "imu": acceleration_sensor}).event_time.with_constants(
        np.array([_LEVEL_BIAS_SD_MM_S2] * 3 + [1.0] * 2),
        np.array([_LEVEL_BIAS_WALK_MM_S2] * 3 + [_HEADING_WALK_PER_SQRT_S] * 2),
    )


def turn_about_vertical(quaternion_xyzw: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Orientations (n, 4) turned about the vertical by angles (n,)."""
    from scipy.spatial.transform import Rotation

    about_z = np.zeros((len(angle_rad), 3))
    about_z[:, 2] = angle_rad
    turned: FloatArray = (Rotation.from_rotvec(about_z) * Rotation.from_quat(quaternion_xyzw)).as_quat()
    return turned


def nearest(time: FloatArray, wanted: FloatArray) -> npt.NDArray[np.int64]:
    """For each of the times `wanted` (m,), the index of the newest of rising `time` (n,) not after it; 0 if none is."""
    return np.maximum(np.searchsorted(time, wanted, side="right") - 1, 0)
