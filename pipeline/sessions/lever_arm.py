"""The lever arm from a phone's accelerometer to the point that the tracker sees, as the phone is turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusion_core import Samples
from fusion_core.phone.calibration import Body
from pipeline.statistics.arrays import FloatArray


@dataclass(frozen=True)
class Arm:
    """The lever arm (n, d) in mm as the body was turned at `time` (n,), known since `arrival` (n,), both rising."""

    time: FloatArray
    arrival: FloatArray
    arm_mm: FloatArray

    def at(self, time: FloatArray, known_by: FloatArray) -> FloatArray:
        """The newest (m, d) measured by each `time` (m,) of what had arrived by `known_by` (m,); NaN where none had.

        What comes later is not used, though it may be nearer: a running study does not have it yet.
        """
        measured, arrived = (
            np.searchsorted(*both, side="right") for both in ((self.time, time), (self.arrival, known_by))
        )
        newest = np.minimum(measured, arrived) - 1
        found: FloatArray = self.arm_mm[np.maximum(newest, 0)]
        found[newest < 0] = np.nan
        return found

    def along(self, index: list[int]) -> Arm:
        """Some of the axes."""
        return Arm(self.time, self.arrival, self.arm_mm[:, index])


def arm_of(body: Body, lever_arm_mm: FloatArray) -> Arm:
    """The lever arm as the body was turned, without what was measured before something that had arrived already."""
    rows = body.time >= np.maximum.accumulate(body.time)
    return Arm(body.time[rows], body.arrival[rows], (body.rotation @ lever_arm_mm)[rows])


def less(arm: Arm, positions: Samples) -> Samples:
    """Positions less the lever arm, without those that arrived before any orientation."""
    value = positions.value - arm.at(positions.time, positions.arrival)
    known = np.isfinite(value).all(axis=1)
    return Samples(positions.time[known], positions.arrival[known], value[known])
