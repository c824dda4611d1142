"""A sender's reading in its own units and axes as SI in the tracker's frame, as study.yaml says of the sender. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fusion_core.phone.orientation import rotation
from fusion_core.phone.quaternion import product
from pipeline.live.events import Values
from pipeline.live.messages import Datagram
from pipeline.study.recording import M_S2, METRES, RAD_S, Sender

_M_PER_MM = 1e-3
_UNKNOWN = (math.nan,) * 4
_IN_METRES = ("rosbridge", "foxglove")


@dataclass(frozen=True)
class Units:
    """What turns a sender's numbers into SI; `turn` (3, 3) and `move_m` (3,) lead into the tracker's frame.

    Of an acceleration `axes` are those of the body, so an orientation is turned back by `back_xyzw` first, and then by
    `turn_xyzw`.
    """

    metres: float
    m_s2: float
    rad_s: float
    axes: tuple[tuple[int, float], ...]
    turn: tuple[tuple[float, ...], ...]
    move_m: tuple[float, ...]
    turn_xyzw: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    back_xyzw: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)


def units(sender: Sender) -> Units:
    """Those of a sender. Where it does not say: mm, but m in ROS and Foxglove (REP 103); m/s²; rad/s."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    def factor(table: object, usual: str) -> float:
        known = dict(table)  # type: ignore[call-overload]
        return float(next((known[unit] for unit in sender.units if unit in known), known[usual]))

    axes = tuple(("xyz".index(axis[-1]), -1.0 if axis.startswith("-") else 1.0) for axis in sender.axes)
    permuted = np.zeros((3, 3))
    for row, (column, sign) in enumerate(axes):
        permuted[row, column] = sign
    back = Rotation.from_matrix(permuted.T).as_quat() if np.linalg.det(permuted) > 0 else np.full(4, np.nan)
    world = Rotation.from_quat(sender.rotation_xyzw).as_quat()
    return Units(
        factor(METRES, "m" if sender.kind in _IN_METRES else "mm"),
        factor(M_S2, "m_s2"),
        factor(RAD_S, "rad_s"),
        axes,
        tuple(tuple(row) for row in rotation(np.array(sender.rotation_xyzw)).tolist()),
        tuple(part * _M_PER_MM for part in sender.translation_mm),
        tuple(world.tolist()),
        tuple(back.tolist()),
    )


def in_si(of: Units, content: str, reading: Datagram) -> Values | None:
    """The values of `events.Reading`; None where the reading is not of that content."""
    if content == "position":
        if reading.position is None:
            return None
        place = _permuted(of, reading.position, of.metres)
        turned = (sum(part * at for part, at in zip(row, place, strict=True)) for row in of.turn)
        return tuple(part + move for part, move in zip(turned, of.move_m, strict=True))
    if reading.acceleration is None:
        return None
    force = _permuted(of, reading.acceleration, of.m_s2)
    turning = _permuted(of, reading.angular_velocity or (0.0, 0.0, 0.0), of.rad_s)
    if reading.orientation is None:
        return (*force, *turning, *_UNKNOWN)
    return (*force, *turning, *product(of.turn_xyzw, product(reading.orientation, of.back_xyzw)))


def _permuted(of: Units, vector: Sequence[float], factor: float) -> Values:
    return tuple(sign * vector[index] * factor for index, sign in of.axes)
