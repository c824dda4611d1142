"""Which single mistake would explain that gravity does not cancel: each is undone in turn, and the mean examined."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.sessions.checks.motion import Compared
from pipeline.sessions.checks.recorded import Imu
from pipeline.sessions.checks.turns import turned
from pipeline.statistics.arrays import FloatArray
from pipeline.study.units import G_M_S2

_EXPLAINS_M_S2 = 0.7  # of the mean that is left once the mistake is undone
_TURNED_DEG = 15.0
_AT_MOST = 2000  # readings looked at: a mean needs no more


@dataclass(frozen=True)
class Cause:
    """A mistake in words, with its remedy, and the mean acceleration in m/s² that would be left without it."""

    text: str
    left_m_s2: float


def causes(imu: Imu, motion: Compared | None) -> list[Cause]:
    """The mistakes without which the mean acceleration is below 0.7 m/s², the likeliest first.

    A flipped accelerometer and a flipped `gravity_mm_s2` look the same here; the tracker's movement tells them apart.
    """
    step = max(1, int(imu.oriented.sum()) // _AT_MOST)
    force = imu.force_m_s2[imu.oriented][::step]
    quaternion = imu.orientation_xyzw[imu.oriented][::step]
    gravity = np.array(imu.gravity_mm_s2) / 1e3 if imu.gravity_mm_s2 is not None else None
    flipped = motion is not None and motion.mirrored > 0.9 and motion.axes == "-x -y -z"
    as_phone = motion is not None and motion.explained > 0.3 and motion.mirrored < 0.1
    turned_away = motion is not None and motion.turn_deg.low > _TURNED_DEG
    likely = []
    for text, tried_force, tried_turn, tried_gravity in _tried(force, quaternion, gravity):
        upright = turned(tried_turn, tried_force)
        if tried_gravity is None:
            left = abs(float(np.linalg.norm(upright.mean(axis=0))) - G_M_S2)
        else:
            left = float(np.linalg.norm(upright.mean(axis=0) + tried_gravity))
        if left < _EXPLAINS_M_S2:
            likely.append(Cause(text, left))
    if flipped:
        likely = [cause for cause in likely if "sign is flipped" in cause.text] or likely
    elif as_phone:  # a wrong gravity_mm_s2 leaves the movement as it is, a wrong axis or orientation does not
        likely = [cause for cause in likely if ("gravity_mm_s2" in cause.text) != turned_away] or likely
    return likely


def _tried(
    force: FloatArray, quaternion: FloatArray, gravity: FloatArray | None
) -> Iterator[tuple[str, FloatArray, FloatArray, FloatArray | None]]:
    """Each mistake undone: words, force, orientation and gravity."""
    if gravity is not None:
        mean = turned(quaternion, force).mean(axis=0)
        if abs(np.linalg.norm(mean) - G_M_S2) < _EXPLAINS_M_S2:
            shown = ", ".join(f"{value:.0f}" for value in np.where(abs(mean) < 1.0, 0.0, -1e3 * mean))
            yield (
                f"gravity_mm_s2 has another axis, sign or unit than the orientation; by this log it is [{shown}]",
                force,
                quaternion,
                -mean,
            )
        yield (
            "its sign is flipped (iOS); change the sign of the accelerations when logging",
            -force,
            quaternion,
            gravity,
        )
    first_is_w = quaternion[:, [1, 2, 3, 0]]
    yield "the orientation is logged as w, x, y, z; log x, y, z, w", force, first_is_w, gravity
    conjugate = quaternion * np.array([-1.0, -1.0, -1.0, 1.0])
    yield (
        "the orientation turns the tracker's frame into the phone's; log its inverse (the conjugate)",
        force,
        conjugate,
        gravity,
    )
    for order in ((2, 1, 0), (1, 0, 2), (0, 2, 1), (1, 2, 0), (2, 0, 1)):
        names = ", ".join("xyz"[axis] for axis in order)
        yield (
            f"the phone's axes are logged in the order {names} instead of x, y, z; reorder them",
            force[:, order],
            quaternion,
            gravity,
        )
    for axis, name in enumerate("xyz"):
        mirrored = force * np.where(np.arange(3) == axis, -1.0, 1.0)
        yield (
            f"the accelerometer's {name} axis is mirrored; change its sign when logging",
            mirrored,
            quaternion,
            gravity,
        )
    for pair in ("xy", "yz", "xz"):
        both = force * np.where([name in pair for name in "xyz"], -1.0, 1.0)
        yield (
            f"the accelerometer's {pair[0]} and {pair[1]} axes point the other way; change their signs when logging",
            both,
            quaternion,
            gravity,
        )
    for axis, name in enumerate("xyz"):
        for sign, how in ((1.0, "+90°"), (-1.0, "-90°")):
            yield (
                f"the accelerometer's axes are turned by {how} about {name}, as by the screen's orientation; log the "
                "device's own axes",
                _quarter(force, axis, sign),
                quaternion,
                gravity,
            )
    size = float(np.linalg.norm(turned(quaternion, force).mean(axis=0)))
    if gravity is not None and size > 0 and abs(size / G_M_S2 - 1) > 0.2:
        yield (
            f"its values are {size / G_M_S2:.2g} times too large: another unit (3.3 times is feet/s²); log m/s²",
            force * G_M_S2 / size,
            quaternion,
            gravity,
        )


def _quarter(force: FloatArray, axis: int, sign: float) -> FloatArray:
    """Turned by a quarter about an axis, the other way round than the mistake that it undoes."""
    before, after = (axis + 1) % 3, (axis + 2) % 3
    found = force.copy()
    found[:, before], found[:, after] = sign * force[:, after], -sign * force[:, before]
    return found
