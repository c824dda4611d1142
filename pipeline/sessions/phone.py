"""A phone's readings as accelerations in the tracker's frame, by the logged orientation or by one found from motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fusion_core import Samples, Sensor
from fusion_core.phone.calibration import Body, Calibration, calibrate, with_mounting
from fusion_core.phone.orientation import (
    carry_forward,
    heading,
    level_rotation,
    rotate,
    rotations,
    turn_about_vertical,
)
from pipeline.sessions.tilt import tilts
from pipeline.statistics.arrays import FloatArray, run_of
from pipeline.study.streams import AccelerationStream
from pipeline.tables.columns import S_PER_NS
from pipeline.tables.table import Columns

HEADING_SD_RAD = 0.3
"""Of a heading: above it an orientation is not known."""

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

    def until(self, count: int) -> Imu:
        """The first `count` readings."""
        return Imu(
            self.time[:count], self.arrival[:count], self.force_mm_s2[:count], self.gyroscope_rad_s[:count], self.sensor
        )


Tracker = tuple[Samples, Sensor]
"""Positions of all three axes, and the sensor they are from."""


def logged_readings(
    rows: Columns, stream: AccelerationStream, sensor: Sensor, origin_ns: int
) -> tuple[Imu, FloatArray]:
    """The readings of a stream from its rows of `imu`, with the orientations in the log (n, 4)."""
    late_ns = round((stream.latency_s if stream.stamped_on_arrival else 0.0) / S_PER_NS)
    times = (rows["time_ns"] - late_ns - origin_ns) * S_PER_NS, (rows["arrival_ns"] - origin_ns) * S_PER_NS
    force, turning = (
        np.column_stack([rows[name.format(axis)] for axis in "xyz"]) for name in ("a{}_mm_s2", "g{}_rad_s")
    )
    logged = np.column_stack([rows[column] for column in ("qx", "qy", "qz", "qw")])
    return Imu(*times, force, turning, sensor), logged


def aligned(imu: Imu, logged: FloatArray, stream: AccelerationStream, tracker: Tracker | None) -> Phone:
    """A phone's accelerations with their orientations: `logged` (n, 4), NaN where unknown, or found from the motion.

    Causal: each acceleration is based on what was known when it arrived.
    """
    gravity = np.array(stream.gravity_mm_s2)
    turned, origins = _orientations(imu, logged, gravity, tracker)
    known: npt.NDArray[np.bool_] = np.all(np.isfinite(turned), axis=1)
    where = run_of(known)
    rotation = rotations(turned[where]) if known.any() else np.empty((0, 3, 3))
    body = Body(imu.time[where], imu.arrival[where], imu.force_mm_s2[where], rotation, gravity)
    return _with_mounting(Phone(body, origins, int((~known).sum())), stream, imu.sensor, tracker)


def _orientations(
    imu: Imu, logged: FloatArray, gravity: FloatArray, tracker: Tracker | None
) -> tuple[FloatArray, dict[str, int]]:
    """Orientations (n, 4), NaN where unknown, and how many are from where.

    Up to the first one in the log they are found from the motion; after it, gaps are carried on by the gyroscope.
    """
    in_log = np.isfinite(logged).all(axis=1)
    if len(logged) and in_log.all():
        return logged, {IN_LOG: len(logged), CARRIED: 0}
    first = int(np.argmax(in_log)) if in_log.any() else len(logged)
    turned = logged.copy()
    turned[:first] = _orientation_from_motion(imu.until(first), gravity, tracker)
    rows = first + np.flatnonzero(_not_older(imu.time[first:]))
    turned[rows] = carry_forward(imu.time[rows], logged[rows], imu.gyroscope_rad_s[rows])
    known = np.logical_and(np.isfinite(turned).all(axis=1), ~in_log)
    after = np.arange(len(known)) >= first
    origins = {IN_LOG: int(in_log.sum())}
    if in_log.any():
        origins[CARRIED] = int((known & after).sum())
    if (known & ~after).any() or not in_log.any():
        origins[FOUND] = int((known & ~after).sum())
    return turned, origins


def _not_older(time: FloatArray) -> npt.NDArray[np.bool_]:
    """Which readings (n,), in order of arrival, were not measured before one that had arrived already."""
    in_order: npt.NDArray[np.bool_] = time >= np.maximum.accumulate(time)
    return in_order


def _orientation_from_motion(imu: Imu, gravity: FloatArray, tracker: Tracker | None) -> FloatArray:
    """Orientations (n, 4) for a log without any: tilt by VQF, heading from the motion; NaN until both are known.

    It stays NaN at a reading that was measured before one that had arrived already.
    """
    unknown = np.full((len(imu.time), 4), np.nan)
    if tracker is None or not len(imu.time) or not len(tracker[0]):
        return unknown
    tilted = tilts(imu.time, imu.gyroscope_rad_s, imu.force_mm_s2)
    rows = np.flatnonzero(np.isfinite(tilted).all(axis=1))
    up, down = level_rotation(gravity), np.array([0.0, 0.0, -float(np.linalg.norm(gravity))])
    upright = Samples(imu.time[rows], imu.arrival[rows], rotate(tilted[rows], imu.force_mm_s2[rows]) + down)
    positions = replace(tracker[0], value=rotate(up * np.array([-1.0, -1.0, -1.0, 1.0]), tracker[0].value))
    angle, sd = heading(positions, tracker[1], upright, imu.sensor)
    known = sd < HEADING_SD_RAD
    unknown[rows[known]] = _turned(up, turn_about_vertical(tilted[rows[known]], angle[known]))
    return unknown


def _turned(first: FloatArray, then: FloatArray) -> FloatArray:
    from scipy.spatial.transform import Rotation

    both: FloatArray = (Rotation.from_quat(first) * Rotation.from_quat(then)).as_quat()
    return both


def _with_mounting(found: Phone, stream: AccelerationStream, sensor: Sensor, tracker: Tracker | None) -> Phone:
    """The phone with its mounting, as stated in study.yaml or as learned in the session's first `calibrate_s`."""
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
    from scipy.spatial.transform import Rotation

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
