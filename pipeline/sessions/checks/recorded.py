"""The input of the checks: one session's readings as logged, and what study.yaml says about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from pipeline.sessions.by_parts import in_memory, let_go, parts_of
from pipeline.sessions.checks.motion import Compared, compare, compare_positions, distant_lag_s
from pipeline.sessions.checks.tilt import upright, with_z_up
from pipeline.sessions.checks.turns import turned
from pipeline.sessions.logs.log import BoolArray, IntArray
from pipeline.sessions.usable import finite
from pipeline.statistics.arrays import FloatArray, run_of
from pipeline.tables.columns import S_PER_NS

_MOSTLY = 0.5  # of the readings: with fewer the log's orientations are left aside


@dataclass(frozen=True)
class Times:
    """When each message was stamped and when it arrived, (n,) in ns, in the order of the file.

    `late_s` is how much later than the measurement study.yaml says that a stamp is: 0 for `stamp: measurement`.
    `left_out` messages are not among them, because their values are no numbers or their times of another day.
    """

    stamp_ns: IntArray
    arrival_ns: IntArray
    origin_ns: int
    late_s: float = 0.0
    left_out: int = 0

    @property
    def stamp_s(self) -> FloatArray:
        """The stamps in s since the session's origin."""
        return _seconds(self.stamp_ns - self.origin_ns)

    @property
    def arrival_s(self) -> FloatArray:
        """The arrivals in s since the session's origin."""
        return _seconds(self.arrival_ns - self.origin_ns)

    @property
    def steps_s(self) -> FloatArray:
        """The steps between sorted stamps, those of length zero too."""
        stamp_ns = self.stamp_ns
        return _seconds(np.diff(stamp_ns if (stamp_ns[1:] >= stamp_ns[:-1]).all() else np.sort(stamp_ns)))


def _seconds(ns: IntArray) -> FloatArray:
    """Not kept by those who ask: of a long session each of them takes as much memory as the stamps."""
    found = ns.astype(np.float64)
    found *= S_PER_NS
    return found


@dataclass(frozen=True)
class Frames:
    """Which coordinate frame each message names: `number` (n,) counts into `names`; empty where that is not known."""

    names: tuple[str, ...] = ()
    number: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))


@dataclass(frozen=True)
class Positions:
    """Positions (n, 3) in mm. `noise_sd_mm` as study.yaml states it, None where it does not."""

    name: str
    kind: Literal["position", "reference", "display"]
    times: Times
    value_mm: FloatArray
    noise_sd_mm: float | None = None
    frames: Frames = Frames()


@dataclass(frozen=True)
class Imu:
    """Specific force (n, 3) in m/s², angular velocity (n, 3) in rad/s, orientation (n, 4) or NaN where unknown.

    The last two may be mapped from a file; `gyroscope_rad_s` and `orientation_xyzw` are in memory while they are used.

    `orientation_length` (n,) is the quaternion's own, NaN where the log says it is unknown; `force_disclaimed` and
    `gyroscope_disclaimed` (n,) say where a covariance of −1 tells the reader to disregard the values.
    `calibrated_later`: how it is mounted is learned from the session itself.
    """

    name: str
    times: Times
    force_m_s2: FloatArray
    gyroscope: FloatArray
    orientation: FloatArray
    orientation_length: FloatArray
    force_disclaimed: BoolArray
    gyroscope_disclaimed: BoolArray
    gravity_mm_s2: tuple[float, float, float] | None = None
    noise_sd_mm_s2: float | None = None
    calibrated_later: bool = False
    frames: Frames = Frames()

    @property
    def gyroscope_rad_s(self) -> FloatArray:
        """The angular velocity (n, 3)."""
        return in_memory(self.gyroscope)

    @property
    def orientation_xyzw(self) -> FloatArray:
        """The orientation (n, 4)."""
        return in_memory(self.orientation)

    @cached_property
    def oriented(self) -> BoolArray:
        """Where the orientation is known (n,)."""
        return finite(self.orientation, 4)

    @property
    def upright_m_s2(self) -> FloatArray:
        """The specific force where the orientation is known (k, 3), turned by it into the tracker's frame."""
        if not self.oriented.all():
            return turned(self.orientation_xyzw[self.oriented], self.force_m_s2[self.oriented])
        found = np.empty(self.force_m_s2.shape)
        for part in parts_of(len(found)):
            found[part] = turned(self.orientation[part], self.force_m_s2[part])
            let_go(self.orientation)
        return found


@dataclass(frozen=True)
class Events:
    """Events by arrival (n,), in mm (n, 3), NaN where they do not apply; `selects` (n,) marks the selections."""

    time_s: FloatArray
    selects: BoolArray
    target_mm: FloatArray
    selected_mm: FloatArray


@dataclass(frozen=True)
class Recorded:
    """One session. `targets_mm` (k, 2) are those of study.yaml's task, None where it names none.

    `px_per_mm` is the display's, None where it is not stated; `axes` are those that are analysed.
    """

    positions: tuple[Positions, ...] = ()
    imus: tuple[Imu, ...] = ()
    events: Events | None = None
    targets_mm: FloatArray | None = None
    target_size_mm: float = 0.0
    px_per_mm: float | None = None
    axes: tuple[int, ...] = (0, 1, 2)

    def of_kind(self, kind: str) -> Positions | None:
        """The first stream of positions of a kind."""
        return next((one for one in self.positions if one.kind == kind), None)

    @property
    def streams(self) -> Sequence[Positions | Imu]:
        """Every stream of positions and every phone."""
        return [*self.positions, *self.imus]

    @property
    def tracker(self) -> Positions | None:
        """The first tracker."""
        return self.of_kind("position")

    @property
    def imu(self) -> Imu | None:
        """The first phone."""
        return self.imus[0] if self.imus else None

    @cached_property
    def motion(self) -> Compared | None:
        """The tracker's movement beside the phone's; None where one of them is not there, or too short."""
        tracker, imu = self.tracker, self.imu
        if tracker is None or imu is None or len(imu.force_m_s2) < 2:
            return None
        return compare(*self._of_both(tracker, imu), bool(imu.oriented.mean() >= _MOSTLY))

    @cached_property
    def distant_lag_s(self) -> float | None:
        """The lag between tracker and phone at which they see one movement after all; None if at none."""
        tracker, imu = self.tracker, self.imu
        if tracker is None or imu is None or len(imu.force_m_s2) < 2:
            return None
        return distant_lag_s(*self._of_both(tracker, imu))

    @cached_property
    def reference_motion(self) -> Compared | None:
        """The tracker's movement beside the reference's, both by their own stamps."""
        tracker, reference = self.tracker, self.of_kind("reference")
        if tracker is None or reference is None:
            return None
        return compare_positions(tracker.times.stamp_s, tracker.value_mm, reference.times.stamp_s, reference.value_mm)

    @staticmethod
    def _of_both(tracker: Positions, imu: Imu) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Stamps and positions of the tracker, stamps and accelerations in mm/s² of the phone, in one frame."""
        if imu.oriented.mean() >= _MOSTLY:
            force, time_s = imu.upright_m_s2, imu.times.stamp_s[run_of(imu.oriented)]
            force *= 1e3
            return tracker.times.stamp_s, tracker.value_mm, time_s, force
        time_s, force = upright(imu.times.stamp_s, imu.force_m_s2, imu.gyroscope_rad_s)
        return tracker.times.stamp_s, with_z_up(tracker.value_mm, imu.gravity_mm_s2), time_s, force * 1e3
