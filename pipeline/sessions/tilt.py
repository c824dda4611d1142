"""A phone's orientation up to its heading, from its gyroscope and accelerometer, reading by reading.

VQF (Laidig and Seel 2023) needs readings at a fixed rate, and a phone's come as they please. So they are interpolated
at points `STEP_S` apart, counted from the first reading: all points up to a reading are known once it is there, and
none depends on a later one. The same steps are taken in a running study and in its replay, so both know the same.

`step` is pure, for a loop that holds the state; `tilts` takes the same steps over a whole recording.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fusion_core.phone.quaternion import product, turn
from pipeline.statistics.arrays import FloatArray

if TYPE_CHECKING:
    from vqf import VQF

STEP_S = (
    0.005  # VQF takes a reading to hold for a whole step, so a coarse one lags: at 90 Hz 0.94° at 10 ms, 0.74° at 5 ms
)
_AVERAGED_S = 2.0  # how long VQF averages accelerations to find the vertical, while the hand moves
_GYROSCOPE_BIAS_DEG_S = 10.0  # the largest that VQF allows; phones are off by up to 4°/s
_LONGEST_GAP_S = 1.0  # what the phone did in a longer one is not guessed; the vertical is found again afterwards
_MM_PER_M = 1000.0


@dataclass(frozen=True)
class Reading:
    """One reading in the phone's frame: time in s, angular velocity (3,) in rad/s, specific force (3,) in mm/s²."""

    time: float
    gyroscope_rad_s: FloatArray
    force_mm_s2: FloatArray


@dataclass(frozen=True)
class Tilt:
    """What is known after some readings: the newest of them, VQF's own state, and the grid it has taken.

    The newest grid point is `points` − 1 steps after `origin_s`; `at_grid_wxyz` (4,) is the orientation there.
    """

    newest: Reading | None = None
    origin_s: float = 0.0
    points: int = 0
    at_grid_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    vqf: Any = None


def step(state: Tilt, reading: Reading) -> tuple[Tilt, FloatArray | None]:
    """The state after one more reading, and the orientation then, xyzw (4,), body to a frame whose z points up.

    None for a reading that is not newer than those before, which changes nothing.
    """
    vqf = _vqf()
    if state.vqf is not None:
        vqf.state = state.vqf
    after = _advanced(state, reading, vqf)
    if after is state:
        return state, None
    kept = Tilt(after.newest, after.origin_s, after.points, after.at_grid_wxyz, vqf.state)
    return kept, _carried_on(after, reading)


def tilts(time: FloatArray, gyroscope_rad_s: FloatArray, force_mm_s2: FloatArray) -> FloatArray:
    """The orientation (n, 4) at each reading, as `step` gives them; NaN where a reading is not newer than those before.

    `time` (n,) in s, `gyroscope_rad_s` (n, 3) and `force_mm_s2` (n, 3) in order of arrival.
    """
    found = np.full((len(time), 4), np.nan)
    state, vqf = Tilt(), _vqf()
    for row, at in enumerate(time.tolist()):
        reading = Reading(at, gyroscope_rad_s[row], force_mm_s2[row])
        after = _advanced(state, reading, vqf)
        if after is not state:
            found[row], state = _carried_on(after, reading), after
    return found


def _vqf() -> VQF:
    from vqf import VQF

    return VQF(STEP_S, tauAcc=_AVERAGED_S, biasClip=_GYROSCOPE_BIAS_DEG_S)


def _advanced(state: Tilt, reading: Reading, vqf: VQF) -> Tilt:
    """The state with `vqf` fed all grid points up to the reading; `state` itself for one that is not newer."""
    before, origin_s, points = state.newest, state.origin_s, state.points
    if before is not None and reading.time <= before.time:
        return state
    if before is None or reading.time - before.time > _LONGEST_GAP_S:
        vqf.update(*_for_vqf(reading.gyroscope_rad_s, reading.force_mm_s2))
        return Tilt(reading, reading.time, 1, _orientation(vqf))
    upcoming = origin_s + points * STEP_S
    if upcoming > reading.time:
        return Tilt(reading, origin_s, points, state.at_grid_wxyz)
    turn = reading.gyroscope_rad_s - before.gyroscope_rad_s
    push = reading.force_mm_s2 - before.force_mm_s2
    while upcoming <= reading.time:
        share = (upcoming - before.time) / (reading.time - before.time)
        vqf.update(*_for_vqf(before.gyroscope_rad_s + share * turn, before.force_mm_s2 + share * push))
        points += 1
        upcoming = origin_s + points * STEP_S
    return Tilt(reading, origin_s, points, _orientation(vqf))


def _for_vqf(gyroscope_rad_s: FloatArray, force_mm_s2: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.ascontiguousarray(gyroscope_rad_s, np.float64), np.ascontiguousarray(force_mm_s2 / _MM_PER_M)


def _orientation(vqf: VQF) -> tuple[float, float, float, float]:
    w, x, y, z = vqf.getQuat6D().tolist()
    return w, x, y, z


def _carried_on(state: Tilt, reading: Reading) -> FloatArray:
    """The orientation at the reading, xyzw (4,): that of the newest grid point, turned on by the gyroscope."""
    rest_s = reading.time - (state.origin_s + (state.points - 1) * STEP_S)
    w, x, y, z = state.at_grid_wxyz
    turned = product((x, y, z, w), turn(reading.gyroscope_rad_s.tolist(), rest_s))
    return np.array(turned) / float(np.sqrt(sum(part * part for part in turned)))
