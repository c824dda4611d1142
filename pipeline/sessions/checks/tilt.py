"""A phone whose log has no orientation: upright by gyroscope and gravity, the heading unknown."""

from __future__ import annotations

import numpy as np

from pipeline.sessions.checks.turns import turned
from pipeline.statistics.arrays import FloatArray

_TILT_S = 2.0  # how long VQF averages accelerations to find the vertical, while the hand moves


def upright(time_s: FloatArray, force_m_s2: FloatArray, gyroscope_rad_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times (k,) and specific forces (k, 3) in a frame whose z points up, turned about it by an unknown angle.

    By VQF (Laidig and Seel 2023), on a regular grid. Empty with fewer than two readings.
    """
    time_s, first = np.unique(time_s, return_index=True)
    if len(time_s) < 2:
        return np.zeros(0), np.zeros((0, 3))
    from vqf import VQF

    step_s = float(np.median(np.diff(time_s)))
    count = min(int((time_s[-1] - time_s[0]) / step_s) + 1, 4 * len(time_s))
    grid = time_s[0] + step_s * np.arange(count)
    rate, force = (
        np.ascontiguousarray(np.column_stack([np.interp(grid, time_s, column) for column in value[first].T]))
        for value in (gyroscope_rad_s, force_m_s2)
    )
    orientation = VQF(step_s, tauAcc=_TILT_S).updateBatch(rate, force)["quat6D"][:, [1, 2, 3, 0]]
    return grid, turned(orientation, force)


def with_z_up(position_mm: FloatArray, gravity_mm_s2: tuple[float, float, float] | None) -> FloatArray:
    """Positions (n, 3) turned by the least rotation that makes z point against gravity; as they are without one."""
    if gravity_mm_s2 is None:
        return position_mm
    down = np.array(gravity_mm_s2) / np.linalg.norm(gravity_mm_s2)
    axis, cosine = np.cross(-down, [0.0, 0.0, 1.0]), -float(down[2])
    if cosine < -1 + 1e-9:
        return np.asarray(position_mm * np.array([1.0, -1.0, -1.0]))
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    found: FloatArray = position_mm @ (np.eye(3) + cross + cross @ cross / (1 + cosine)).T
    return found
