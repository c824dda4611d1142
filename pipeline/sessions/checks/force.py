"""The specific force and gravity: size, and whether both cancel over a session."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks.causes import Cause, causes
from pipeline.sessions.checks.finding import Finding, graded, of
from pipeline.sessions.checks.recorded import Imu, Recorded
from pipeline.statistics.arrays import FloatArray
from pipeline.study.units import G_M_S2

FORCE, GRAVITY, REST = "specific force", "length of gravity", "mean acceleration"

_SMALL_M_S2 = 3.0  # the median of |f|: in g about 1, without gravity 0.4 to 2; a brisk hand's is above 9.7
LARGE_M_S2 = 60.0
_UNITS = ((981.0, "cm/s² or thousandths of g"), (9807.0, "mm/s²"))
_UNIT_NEAR = 1.4  # a brisk hand's median is above g
_STEADY = 0.6  # |mean f| over mean |f| within a second: gravity alone makes it nearly 1
_MEAN_AMBER_M_S2, _MEAN_RED_M_S2 = 1.0, 3.0  # recordings without a fault: 0.03 to 0.39; with one: 8.8 to 19.7
_CALIBRATED = 2.0  # times as much: a mounting that is learned may be off by 10°
_EARTH = (9.7, 9.9)
_PLANET = (9.0, 10.6)


def specific_force(recorded: Recorded) -> Iterator[Finding]:
    """The median size of the specific force. Only its lower side and gross units are judged: a brisk hand exceeds g."""
    for imu in recorded.imus:
        size = np.linalg.norm(imu.force_m_s2, axis=1)
        if not len(size):
            continue
        median = float(np.median(size))
        found, expected = f"{median:.3g} m/s²", "about 9.8 m/s²"
        message = _force_message(imu, median)
        yield Finding(of(FORCE, imu.name), "red" if message else "green", found, expected, message)


def _force_message(imu: Imu, median: float) -> str:
    values = f'the accelerometer\'s values of "{imu.name}"'
    if median == 0:
        return f"{values} are all zero: it is not connected, or not logged; there is nothing to fuse"
    if median < _SMALL_M_S2:
        if 0.5 < median < 2.0 and steadiness(imu) > _STEADY:
            return f"{values} are about {median:.1f} where 9.8 m/s² is expected: they are in g; multiply by 9.80665"
        return (
            f"{values} are about {median:.2g} where 9.8 m/s² is expected, and in no lasting direction: gravity seems "
            "removed (a phone's linear or user acceleration); log the total acceleration, with gravity"
        )
    if median > LARGE_M_S2:
        near = [unit for size, unit in _UNITS if size / _UNIT_NEAR < median < size * _UNIT_NEAR]
        unit = f"they are in {near[0]}" if near else "they are the sensor's raw counts, or in another unit"
        return f"{values} are about {median:.0f} where 9.8 m/s² is expected: {unit}; log m/s²"
    return ""


def steadiness(imu: Imu) -> float:
    """The median over a second of |mean f| / mean |f|: nearly 1 where gravity is in it, far less where it is not."""
    time = imu.times.stamp_s
    second = np.floor(time - time.min()).astype(np.int64)
    order = np.argsort(second, kind="stable")
    starts = np.flatnonzero(np.diff(second[order], prepend=-1))
    force = imu.force_m_s2[order]
    mean = np.linalg.norm(np.add.reduceat(force, starts, axis=0), axis=1)
    total = np.add.reduceat(np.linalg.norm(force, axis=1), starts)
    return float(np.median(mean / np.maximum(total, 1e-12)))


def gravity_length(recorded: Recorded) -> Iterator[Finding]:
    """The length of `gravity_mm_s2`, which on the ground is between 9764 and 9834."""
    for imu in recorded.imus:
        if imu.gravity_mm_s2 is None:
            continue
        length = float(np.linalg.norm(imu.gravity_mm_s2)) / 1e3
        found, expected = f"{length:.4g} m/s²", "9.7 to 9.9 m/s²"
        if _EARTH[0] <= length <= _EARTH[1]:
            yield Finding(of(GRAVITY, imu.name), "green", found, expected)
            continue
        near = _PLANET[0] <= length <= _PLANET[1]
        cause = (
            "it is in m/s²; write mm/s², as in [0, 0, -9806.65]"
            if _PLANET[0] <= length * 1e3 <= _PLANET[1]
            else "write mm/s², as in [0, 0, -9806.65]"
        )
        message = f"streams.{imu.name}.gravity_mm_s2 is {length * 1e3:.4g} mm/s² long where 9807 is expected: {cause}"
        yield Finding(of(GRAVITY, imu.name), "amber" if near else "red", found, expected, message)


def mean_acceleration(recorded: Recorded) -> Iterator[Finding]:
    """The mean acceleration over a session, which is near zero for a hand that stays in the room.

    Needs an orientation in the log. If the phone never turns, a wrong but constant orientation is not noticed where
    gravity_mm_s2 was set by it. A wrong heading does not change the vertical and is not noticed here either.
    """
    for imu in recorded.imus:
        size_m_s2 = float(np.median(np.linalg.norm(imu.force_m_s2, axis=1)))
        if imu.oriented.sum() < 10 or not _SMALL_M_S2 <= size_m_s2 <= LARGE_M_S2:
            continue  # the unit is wrong, which *specific force* says
        if imu.gravity_mm_s2 is None:
            yield from _without_gravity(imu)
            continue
        mean = imu.upright_m_s2.mean(axis=0) + np.array(imu.gravity_mm_s2) / 1e3
        size = float(np.linalg.norm(mean))
        leeway = _CALIBRATED if imu.calibrated_later else 1.0
        status = graded(size / leeway, _MEAN_AMBER_M_S2, _MEAN_RED_M_S2)
        found, expected = f"{size:.2g} m/s²", "below 1 m/s²"
        message = ""
        if status != "green":
            message = (
                f'after gravity "{imu.name}" still accelerates by {size:.1f} m/s² on average, which no hand does: '
                f"{_likely(imu, recorded)}"
            )
        yield Finding(of(REST, imu.name), status, found, expected, message)


def _without_gravity(imu: Imu) -> Iterator[Finding]:
    """Without a gravity_mm_s2: the force in the upright frame must have a constant direction and a length of g."""
    mean = imu.upright_m_s2.mean(axis=0)
    size = float(np.linalg.norm(mean))
    found, expected = f"the upright force is {size:.3g} m/s² long on average", "9.3 to 10.3 m/s²"
    good = abs(size - G_M_S2) < _MEAN_AMBER_M_S2 / 2
    message = f'by its orientation "{imu.name}" does not stay upright: {_likely(imu, None)}'
    yield Finding(of(REST, imu.name), "green" if good else "amber", found, expected, "" if good else message)


def gravity_seen_mm_s2(imu: Imu) -> FloatArray | None:
    """Minus the mean upright force (3,): what `gravity_mm_s2` would be by this log; None without an orientation."""
    return None if imu.oriented.sum() < 10 else -1e3 * imu.upright_m_s2.mean(axis=0)


def _likely(imu: Imu, recorded: Recorded | None) -> str:
    """The single mistakes that would explain it, in words."""
    likely: list[Cause] = causes(imu, recorded.motion if recorded is not None else None)
    if not likely:
        return "check the accelerometer's unit and axes, the orientation's order (x, y, z, w) and gravity_mm_s2"
    return "; or ".join(cause.text for cause in likely[:2])
