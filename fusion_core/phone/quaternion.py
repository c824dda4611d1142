"""Two operations on single quaternions, scalar last, in plain numbers: for loops that turn one reading at a time.

Over whole recordings SciPy's Rotation does the same; of one alone it takes longer to make than to turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

_SMALL_RAD = 1e-3  # below it the series is exact to the last digit, and no quotient is of zeros


def product(first: Sequence[float], then: Sequence[float]) -> tuple[float, float, float, float]:
    """The product of two quaternions xyzw: `then` is applied first to a vector."""
    ax, ay, az, aw = first
    bx, by, bz, bw = then
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def turn(angular_velocity_rad_s: Sequence[float], seconds: float) -> tuple[float, float, float, float]:
    """The turn xyzw of an angular velocity (3,) that lasts so long."""
    x, y, z = (rate * seconds for rate in angular_velocity_rad_s)
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 - angle * angle / 48 if angle < _SMALL_RAD else math.sin(angle / 2) / angle
    return x * scale, y * scale, z * scale, math.cos(angle / 2)
