"""A hand that does what the checks want: still, turned, swept, and what tracker and phone measure of it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.live.watch import Row
from pipeline.statistics.arrays import FloatArray

EPOCH_NS = 1_764_350_000_000_000_000
GRAVITY_M_S2 = np.array([0.0, -9.80665, 0.0])
STILL_S, TURN_S, SWEEP_S = 2.5, 5.0, 14.0
LENGTH_S = STILL_S + TURN_S + SWEEP_S
_PACES_HZ = ((0.7, 1.1, 0.4), (1.3, 0.5, 0.9), (0.45, 1.7, 1.2))  # of x, y, z: not periodic together
_REACH_M = np.array([0.10, 0.04, 0.05])
_STEP_S = 1e-4
_TREMOR_RAD = 0.002  # of a hand that holds still: no orientation stands to the last digit


def position_m(time_s: FloatArray) -> FloatArray:
    """Where the hand is (n, 3): at rest, then swept."""
    swept = np.maximum(time_s - STILL_S - TURN_S, 0.0)
    begins = 1 - np.exp(-((swept / 0.5) ** 3))
    moved = [np.sum([np.sin(2 * np.pi * pace * swept + axis) for pace in _PACES_HZ[axis]], axis=0) for axis in range(3)]
    found: FloatArray = np.array([0.0, 0.5, 1.2]) + begins[:, None] * np.column_stack(moved) * _REACH_M
    return found


def _attitude(time_s: FloatArray) -> Rotation:
    turned = np.clip(time_s - STILL_S, 0.0, TURN_S)
    begins = np.sin(np.pi * turned / TURN_S) ** 2
    paces = (0.5, 0.7, 0.9)
    trembles = [_TREMOR_RAD * np.sin(2 * np.pi * (pace + 0.3) * time_s) for pace in paces]
    turns = [0.5 * begins * np.sin(2 * np.pi * pace * turned) for pace in paces]
    return Rotation.from_rotvec(np.column_stack(turns) + np.column_stack(trembles))


def phone(rate_hz: float = 90.0, seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Times (n,) in s, and specific force, angular velocity and orientation xyzw (n, 10)."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, LENGTH_S, 1 / rate_hz)
    acceleration = (position_m(time + _STEP_S) - 2 * position_m(time) + position_m(time - _STEP_S)) / _STEP_S**2
    attitude = _attitude(time)
    force = attitude.inv().apply(acceleration - GRAVITY_M_S2) + random.normal(0, 0.05, (len(time), 3))
    ahead = (attitude.inv() * _attitude(time + _STEP_S)).as_rotvec() / _STEP_S
    rate = ahead + random.normal(0, 0.002, (len(time), 3))
    return time, np.hstack([force, rate, attitude.as_quat()])


def tracker(rate_hz: float = 30.0, seed: int = 2) -> tuple[FloatArray, FloatArray]:
    """Times (n,) in s and positions in m (n, 3)."""
    time = np.arange(0.0, LENGTH_S, 1 / rate_hz)
    return time, position_m(time) + np.random.default_rng(seed).normal(0, 0.004, (len(time), 3))


def rows(time_s: FloatArray, values: FloatArray, late_s: float, stamped_late: bool = False) -> tuple[Row, ...]:
    """Readings as the checks take them, `late_s` on their way; `stamped_late` by their arrival."""
    found = []
    for at, value in zip(time_s, values, strict=True):
        measured, arrived = EPOCH_NS + round(at * 1e9), EPOCH_NS + round((at + late_s) * 1e9)
        turned = tuple(value[6:10].tolist()) if len(value) == 10 else None
        found.append(Row(arrived if stamped_late else measured, arrived, tuple(value.tolist()), turned))
    return tuple(found)
