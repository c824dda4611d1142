"""From the phone's frame to the tracker's: orientation and gravity."""

from __future__ import annotations

import numpy as np

from fusion_core.samples import FloatArray


def rotate(quaternion_xyzw: FloatArray, vectors: FloatArray) -> FloatArray:
    """Vectors (n, 3) turned by unit quaternions (n, 4) or (4,), scalar last: body to tracker frame.

    Quaternions are brought to unit length first; ValueError for one of length zero.
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


def tracker_acceleration(
    specific_force_mm_s2: FloatArray, quaternion_xyzw: FloatArray, gravity_mm_s2: FloatArray
) -> FloatArray:
    """Acceleration (n, 3) in the tracker frame: a = R f + g. At rest f points up and a is zero."""
    return rotate(quaternion_xyzw, specific_force_mm_s2) + gravity_mm_s2
