"""Turning by quaternions (x, y, z, w) of about unit length; without scipy, whose import costs more than a check."""

from __future__ import annotations

import numpy as np

from pipeline.statistics.arrays import FloatArray

_AT_ONCE = 2**16


def turned(orientation_xyzw: FloatArray, vectors: FloatArray) -> FloatArray:
    """Vectors (n, 3) turned by quaternions (n, 4) of about unit length, or all by one (1, 4)."""
    found = np.empty((len(vectors), 3))
    for begin in range(0, len(vectors), _AT_ONCE):  # what is in between takes five times the memory of the result
        part = slice(begin, begin + _AT_ONCE)
        quaternions, own = orientation_xyzw if len(orientation_xyzw) == 1 else orientation_xyzw[part], vectors[part]
        axis, scalar = quaternions[:, :3], quaternions[:, 3:]
        twice = 2 * _cross(axis, own)
        found[part] = own + scalar * twice + _cross(axis, twice)
    return found


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """The cross products (n, 3) of vectors: what `np.cross` gives, which copies both before."""
    found = np.empty((max(len(first), len(second)), 3))
    for axis, (one, other) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.subtract(first[:, one] * second[:, other], first[:, other] * second[:, one], out=found[:, axis])
    return found


def rotation_vector(before: FloatArray, after: FloatArray) -> FloatArray:
    """The turn (n, 3) in rad, in the body's frame, between quaternions (n, 4) of about unit length."""
    vector = before[:, 3:] * after[:, :3] - after[:, 3:] * before[:, :3] - _cross(before[:, :3], after[:, :3])
    scalar = np.sum(before * after, axis=1)
    vector, scalar = vector * np.where(scalar < 0, -1.0, 1.0)[:, None], np.abs(scalar)
    length = np.linalg.norm(vector, axis=1)
    angle = 2 * np.arctan2(length, scalar)
    found: FloatArray = vector * np.where(length > 1e-12, angle / np.maximum(length, 1e-12), 2.0)[:, None]
    return found
