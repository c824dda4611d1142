"""A phone's readings as accelerations in the tracker's frame, by the logged orientation or by one found from motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fusion_core import Samples, Sensor
from fusion_core.phone.calibration import Body, Calibration, calibrate, with_mounting
from fusion_core.phone.orientation import (
    carry_forward,
    heading,
    level_rotation,
    nearest,
    rotate,
    rotations,
    turn_about_vertical,
)
from pipeline.statistics.arrays import FloatArray
from pipeline.study.streams import AccelerationStream
from pipeline.tables.table import Columns

_MM_PER_M = 1000.0
_HEADING_SD_RAD = 0.3  # above it an orientation is not known
_TILT_S = 2.0  # of VQF: how long it averages accelerations to find the vertical, while the hand moves
_GYROSCOPE_BIAS_DEG_S = 10.0  # of VQF: phones are off by up to 4°/s

IN_LOG, CARRIED, FOUND = "in_log", "carried", "found"


@dataclass(frozen=True)
class Phone:
    """Accelerations whose orientation is known; `origins` counts them by where it came from, `left_out` the others.

    From `mounted_from_s` on the mounting is known: `calibrated` is the body with it, and `lever_arm_mm` (3,) goes from
    the accelerometer to the point that the tracker sees.
    """

    body: Body
    origins: dict[str, int]
    left_out: int
    calibrated: Body | None = None
    lever_arm_mm: FloatArray | None = None
    mounted_from_s: float = -np.inf
    calibration: Calibration | None = None


@dataclass(frozen=True)
class Imu:
    """A phone's readings: times (n,) in s, specific force (n, 3) in mm/s², angular velocity (n, 3) in rad/s."""

    time: FloatArray
    arrival: FloatArray
    force_mm_s2: FloatArray
    gyroscope_rad_s: FloatArray
    sensor: Sensor


Tracker = tuple[Samples, Sensor]
"""Positions of all three axes, and the sensor they are from."""


def phone(rows: Columns, times: tuple[FloatArray, FloatArray], sensor: Sensor) -> Imu:
    """The readings of a stream from its rows of `imu` and their times of measurement and arrival."""
    force, turning = (
        np.column_stack([rows[name.format(axis)] for axis in "xyz"]) for name in ("a{}_mm_s2", "g{}_rad_s")
    )
    return Imu(*times, force, turning, sensor)


def aligned(imu: Imu, logged: FloatArray, stream: AccelerationStream, tracker: Tracker | None) -> Phone:
    """A phone's accelerations with their orientations: `logged` (n, 4), NaN where unknown, or found from the motion.

    Causal: each acceleration is based on what was known when it arrived.
    """
    gravity = np.array(stream.gravity_mm_s2)
    in_log, rising = np.isfinite(logged).all(axis=1), bool(np.all(np.diff(imu.time) >= 0))
    origin = CARRIED if in_log.any() else FOUND
    if origin == FOUND:
        turned = _orientation_from_motion(imu, gravity, tracker)
    else:
        turned = carry_forward(imu.time, logged, imu.gyroscope_rad_s) if rising else logged
    known = np.isfinite(turned).all(axis=1)
    origins = {IN_LOG: int(in_log.sum()), origin: int((known & ~in_log).sum())}
    rotation = rotations(turned[known]) if known.any() else np.empty((0, 3, 3))
    body = Body(imu.time[known], imu.arrival[known], imu.force_mm_s2[known], rotation, gravity)
    return _with_mounting(Phone(body, origins, int((~known).sum())), stream, imu.sensor, tracker)


def _orientation_from_motion(imu: Imu, gravity: FloatArray, tracker: Tracker | None) -> FloatArray:
    """Orientations (n, 4) for a log without any: tilt by VQF, heading from the motion; NaN until both are known."""
    unknown = np.full((len(imu.time), 4), np.nan)
    if tracker is None or len(imu.time) < 2 or np.any(np.diff(imu.time) <= 0) or not len(tracker[0]):
        return unknown
    tilted = _tilt(imu)
    up, down = level_rotation(gravity), np.array([0.0, 0.0, -float(np.linalg.norm(gravity))])
    upright = Samples(imu.time, imu.arrival, rotate(tilted, imu.force_mm_s2) + down)
    positions = replace(tracker[0], value=rotate(up * np.array([-1.0, -1.0, -1.0, 1.0]), tracker[0].value))
    angle, sd = heading(positions, tracker[1], upright, imu.sensor)
    known = sd < _HEADING_SD_RAD
    unknown[known] = _turned(up, turn_about_vertical(tilted[known], angle[known]))
    return unknown


def _turned(first: FloatArray, then: FloatArray) -> FloatArray:
    from scipy.spatial.transform import Rotation

    both: FloatArray = (Rotation.from_quat(first) * Rotation.from_quat(then)).as_quat()
    return both


def _tilt(imu: Imu) -> FloatArray:
    """Orientations (n, 4) up to the heading, by VQF (Laidig and Seel 2023), which needs a regular grid.

    Each is that of the newest grid point before the reading, extrapolated by the gyroscope, so that none depends on
    later readings.
    """
    from scipy.spatial.transform import Rotation
    from vqf import VQF

    time, gyroscope = imu.time, imu.gyroscope_rad_s
    step_s = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + step_s / 2, step_s)
    on_grid = [
        np.ascontiguousarray(np.stack([np.interp(grid, time, column) for column in values.T], axis=1))
        for values in (gyroscope, imu.force_mm_s2 / _MM_PER_M)
    ]
    estimated = VQF(step_s, tauAcc=_TILT_S, biasClip=_GYROSCOPE_BIAS_DEG_S).updateBatch(*on_grid)["quat6D"]
    at = nearest(grid, time)
    rest = Rotation.from_rotvec(gyroscope * (time - grid[at])[:, None])
    turned: FloatArray = (Rotation.from_quat(estimated[at][:, [1, 2, 3, 0]]) * rest).as_quat()
    return turned


def _with_mounting(found: Phone, stream: AccelerationStream, sensor: Sensor, tracker: Tracker | None) -> Phone:
    """The phone with its mounting, as stated in study.yaml or as learned in the session's first `calibrate_s`."""
    from scipy.spatial.transform import Rotation

    body = found.body
    if not len(body.time):
        return found
    if stream.calibrate_s and tracker is not None:
        until_s = float(body.arrival[0]) + stream.calibrate_s
        learned = calibrate(*tracker, body, sensor, until_s)
        if learned is None:
            return found
        turned = replace(body, rotation=with_mounting(body.rotation, learned.mounting_rad))
        return replace(
            found, calibrated=turned, lever_arm_mm=learned.lever_arm_mm, mounted_from_s=until_s, calibration=learned
        )
    if stream.mounting_xyzw == (0.0, 0.0, 0.0, 1.0) and stream.lever_arm_mm == (0.0, 0.0, 0.0):
        return found
    turned = replace(body, rotation=body.rotation @ Rotation.from_quat(stream.mounting_xyzw).as_matrix())
    return replace(found, calibrated=turned, lever_arm_mm=np.array(stream.lever_arm_mm))


def described(found: Phone) -> dict[str, object]:
    """A row of the table `phones`, less session and stream."""
    row: dict[str, object] = {IN_LOG: 0, CARRIED: 0, FOUND: 0, **found.origins, "left_out": found.left_out}
    if found.calibration is not None:
        learned = found.calibration
        row["calibrated_until_s"] = found.mounted_from_s
        for index, axis in enumerate("xyz"):
            row[f"mounting_{axis}_deg"] = float(np.degrees(learned.mounting_rad[index]))
            row[f"mounting_sd_{axis}_deg"] = float(np.degrees(learned.mounting_sd_rad[index]))
            row[f"lever_arm_{axis}_mm"] = float(learned.lever_arm_mm[index])
            row[f"lever_arm_sd_{axis}_mm"] = float(learned.lever_arm_sd_mm[index])
    return row
