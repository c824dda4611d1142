"""The minimum-jerk movement."""

from __future__ import annotations

import numpy as np

from pipeline.statistics.arrays import FloatArray


def minimum_jerk(time: FloatArray, begin_s: float, duration_s: float) -> tuple[FloatArray, FloatArray]:
    """Share of the way (n,) and its second derivative (n,) in 1/s² at `time` (n,) in s (Flash and Hogan 1985)."""
    unit = np.clip((time - begin_s) / duration_s, 0.0, 1.0)
    position = 10 * unit**3 - 15 * unit**4 + 6 * unit**5
    acceleration = (60 * unit - 180 * unit**2 + 120 * unit**3) / duration_s**2
    return position, acceleration
