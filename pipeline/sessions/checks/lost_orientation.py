"""Orientations that jump: optics took other markers for the phone's, or a compass came near iron."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks.finding import Finding, of
from pipeline.sessions.checks.recorded import Imu, Recorded
from pipeline.sessions.checks.turns import rotation_vector
from pipeline.statistics.arrays import FloatArray

JUMPS = "jumps of the orientation"

# As fusion_core.adaptive.believed, which leaves such readings out.
_FASTEST_RAD_S = 35.0  # 2000° a second: as far as gyroscopes of phones go
_AT_ONCE_RAD = 0.1
_REPEATED_S = 0.03  # an orientation may be found less often than readings are logged
_MANY = 0.01


def orientation_jumps(recorded: Recorded) -> Iterator[Finding]:
    """Turns between neighbouring readings that are faster than any hand's; away and back again are two."""
    for imu in recorded.imus:
        steps = _steps(imu)
        if steps is None:
            continue
        time, angle, most = steps
        at = np.flatnonzero(angle > most)
        found, expected = f"{len(at)}", "0"
        if not len(at):
            yield Finding(of(JUMPS, imu.name), "green", found, expected)
            continue
        begin_s, furthest_deg = float(time[at[0]] - time[0]), float(np.degrees(angle[at].max()))
        message = (
            f'{begin_s:.0f} s into the session the orientation of "{imu.name}" jumps, {len(at)} times in all, by up to '
            f"{furthest_deg:.0f}° from one reading to the next: no hand turns a phone so fast. What finds it lost the "
            "phone (optics took other markers for its own, or a compass came near iron), and gravity then looks like a "
            "movement; say for such readings that the orientation is unknown by orientation_covariance[0] = -1: the "
            "gyroscope carries it on. fusion_adaptive leaves them out itself"
        )
        yield Finding(of(JUMPS, imu.name), "red" if len(at) > _MANY * len(time) else "amber", found, expected, message)


def _steps(imu: Imu) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """When each step ends (n - 1,) in s, by how much it turns in rad, and how much a hand can turn a phone in it."""
    rows = np.flatnonzero(imu.oriented)
    if len(rows) < 50:
        return None
    order = rows[np.argsort(imu.times.stamp_s[rows], kind="stable")]
    time, orientation = imu.times.stamp_s[order], imu.orientation_xyzw[order]
    step = np.diff(time)
    angle = np.linalg.norm(rotation_vector(orientation[:-1], orientation[1:]), axis=1)
    new_at = np.maximum.accumulate(np.where(np.concatenate([[True], angle > 0.0]), np.arange(len(time)), 0))
    repeated = np.minimum(time - time[new_at], _REPEATED_S)[:-1]
    lasted = np.maximum(step, float(np.median(step))) + repeated
    return time[1:], angle, _AT_ONCE_RAD + _FASTEST_RAD_S * lasted
