"""Accelerations of a phone whose log has no orientation, in a frame whose vertical is the tracker's."""

from __future__ import annotations

import numpy as np

from pipeline.statistics.arrays import FloatArray

_TILT_S = 2.0  # how long VQF averages accelerations to find the vertical, while the hand moves


def levelled(
    time_s: FloatArray, force_m_s2: FloatArray, gyroscope_rad_s: FloatArray, gravity_mm_s2: tuple[float, ...] | None
) -> tuple[FloatArray, FloatArray]:
    """Times (k,) and specific forces (k, 3), upright but turned about the vertical by an angle that nobody knows.

    By VQF (Laidig and Seel 2023). Up is z where study.yaml says nothing of gravity. Empty with fewer than two readings.
    """
    from fusion_core.alignment import level, rotate

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
    found = VQF(step_s, tauAcc=_TILT_S).updateBatch(rate, force)["quat6D"][:, [1, 2, 3, 0]]
    up = level(np.array(gravity_mm_s2 if gravity_mm_s2 is not None else (0.0, 0.0, -1.0)))
    return grid, rotate(up, rotate(found, force))
