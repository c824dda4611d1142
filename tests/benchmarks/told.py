"""How good a filter would be that is told whatever lasts: a measure of what there is to be had on a recording.

It is told the tracker's noise and latency. Its accelerations are less what a least-squares fit to the *reference* finds
wrong with them over the whole recording (bias, mounting, an offset in the room, heading and scale), and it knows the
lever arm. What is left is white noise and a drift, the sizes of which are those that turn out best in hindsight. No
filter can have any of that; one that comes as near finds it all by itself. Where a sensor changes within the recording,
this one is fooled by its own constants.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter

from fusion_core import Samples
from fusion_core.samples import FloatArray
from tests.benchmarks.departures import SENSORS, Recorded, Source

_STEP_S, _SMOOTH = 0.01, 25  # a quarter of a second, over which optics' positions tell an acceleration
_GAP_S, _ABOUT_GAPS = 0.05, 61  # steps about a gap of the optics in which they tell none
_WILD_MM_S2 = 5000.0  # no error of an accelerometer: the optics took another body
_PSD = np.array([30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5])  # mm²/s³
_WALK = np.array([0.0, 30.0, 100.0, 200.0])  # mm/s² per √s
_SPEED_SD, _DRIFT_SD = 500.0, 100.0
_LEVEL = np.array([1.0, 1.0, 0.0])  # gravity is along the third axis in these recordings
_UP = np.array([0.0, 0.0, 1.0])


def rmse_mm(source: Source, whole: Recorded) -> float:
    """The smallest 3-D RMSE, of all sizes that were tried, at the times an estimator is asked for."""
    imu, tracker = whole.samples["imu"], whole.samples["tracker"]
    assert imu.rotation is not None
    wrong, arm = _fitted(source, imu)
    heard = Samples(imu.time, imu.arrival, imu.value - wrong)
    frames = tracker.time, tracker.value - _turned(imu, tracker.time) @ arm
    position = _filtered(heard, frames, tracker.arrival, whole.times)
    error = position + (_turned(imu, whole.times) @ arm - whole.truth)[:, None]
    return float(np.min(np.sqrt(np.mean(np.sum(error**2, axis=2), axis=0))))


def _fitted(source: Source, imu: Samples) -> tuple[FloatArray, FloatArray]:
    """What is wrong with each acceleration (n, 3), and the lever arm (3,), by the reference."""
    reference = source.reference
    first, last = max(imu.time[0], reference.time[0]), min(imu.time[-1], reference.time[-1])
    time = np.arange(first + 0.3, last - 0.3, _STEP_S)
    true = _second_derivative(interpolated(reference.time, reference.value, time))
    heard, turned = interpolated(imu.time, imu.value, time), _turned(imu, time)
    assert imu.force is not None
    causes = _causes(turned, interpolated(imu.time, imu.force, time), heard)
    causes = _smoothed(causes)
    of_arm = -_second_derivative(turned.reshape(-1, 9)).reshape(-1, 3, 3)
    off = _smoothed(heard) - true
    gap = np.interp(time, reference.time[:-1], np.diff(reference.time)) > _GAP_S
    known = (uniform_filter1d(gap.astype(float), _ABOUT_GAPS) == 0.0) & (np.abs(off).max(axis=1) < _WILD_MM_S2)
    all_causes = np.concatenate([causes, of_arm], axis=2)[known]
    found = np.linalg.lstsq(all_causes.reshape(-1, all_causes.shape[2]), off[known].reshape(-1), rcond=None)[0]
    own = _causes(_turned(imu, imu.time), imu.force, imu.value)
    return own @ found[:-3], found[-3:]


def _causes(turned: FloatArray, force: FloatArray, heard: FloatArray) -> FloatArray:
    """How far each error enters an acceleration, (n, 3, 11): R, R [f]×, the identity, the level part and its normal."""
    x, y, z = force.T
    none = np.zeros_like(x)
    across = np.stack([np.stack(row, axis=1) for row in ((none, -z, y), (z, none, -x), (-y, x, none))], axis=1)
    level = heard * _LEVEL
    room = np.broadcast_to(np.eye(3), turned.shape)
    return np.concatenate([turned, turned @ across, room, np.stack([level, np.cross(_UP, level)], axis=2)], axis=2)


def _second_derivative(value: FloatArray) -> FloatArray:
    found: FloatArray = savgol_filter(value, _SMOOTH, 3, deriv=2, delta=_STEP_S, axis=0)
    return found


def _smoothed(value: FloatArray) -> FloatArray:
    """An acceleration as `_second_derivative` of its place would show it, so that both are smoothed alike."""
    place = value
    for _ in range(2):
        place = cumulative_trapezoid(place, dx=_STEP_S, axis=0, initial=0)
    return _second_derivative(place)


def interpolated(time: FloatArray, value: FloatArray, wanted: FloatArray) -> FloatArray:
    """Each column of `value` (n, d) at the times `wanted` (m,), by straight lines."""
    return np.column_stack([np.interp(wanted, time, column) for column in value.T])


def _turned(imu: Samples, wanted: FloatArray) -> FloatArray:
    """Rotations (m, 3, 3) of the next reading."""
    assert imu.rotation is not None
    found: FloatArray = imu.rotation[np.searchsorted(imu.time, wanted).clip(0, len(imu.time) - 1)]
    return found


class _Integrals(NamedTuple):
    """First and second integrals of straight lines between readings, from the first on."""

    time: FloatArray
    value: FloatArray
    speed: FloatArray
    place: FloatArray

    def at(self, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both (m, 3) at some times."""
        row = np.clip(np.searchsorted(self.time, wanted, side="right") - 1, 0, len(self.time) - 2)
        since = (wanted - self.time[row])[:, None]
        rise = (self.value[row + 1] - self.value[row]) / (self.time[row + 1] - self.time[row])[:, None]
        speed = self.speed[row] + since * (self.value[row] + since / 2 * rise)
        place = self.place[row] + since * (self.speed[row] + since / 2 * (self.value[row] + since / 3 * rise))
        return speed, place


def _integrals(heard: Samples) -> _Integrals:
    step = np.diff(heard.time)[:, None]
    first, last, none = heard.value[:-1], heard.value[1:], np.zeros((1, 3))
    speed = np.vstack([none, np.cumsum(step * (first + last) / 2, axis=0)])
    place = np.vstack([none, np.cumsum(step * speed[:-1] + step**2 / 6 * (2 * first + last), axis=0)])
    return _Integrals(heard.time, heard.value, speed, place)


def _filtered(
    heard: Samples, frames: tuple[FloatArray, FloatArray], arrival: FloatArray, times: FloatArray
) -> FloatArray:
    """Positions (m, sizes, 3) at `times`, of a Kalman filter for each size of noise and drift; all axes are alike."""
    integrals, (time, value) = _integrals(heard), frames
    psd, walk = (one.ravel() for one in np.meshgrid(_PSD, _WALK))
    mean, spread = np.zeros((len(psd), 3, 3)), np.zeros((len(psd), 3, 3))
    noise = SENSORS["tracker"].noise_sd ** 2
    mean[:, 0] = value[0]
    spread[:, 0, 0], spread[:, 1, 1], spread[:, 2, 2] = noise, _SPEED_SD**2, _DRIFT_SD**2 * (walk > 0.0)
    speed, place = integrals.at(time)
    known = np.empty((len(time), *mean.shape))
    known[0] = mean
    for frame in range(1, len(time)):
        dt = time[frame] - time[frame - 1]
        moved = np.array([[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
        mean = moved @ mean
        mean[:, 0] += place[frame] - place[frame - 1] - dt * speed[frame - 1]
        mean[:, 1] += speed[frame] - speed[frame - 1]
        spread = moved @ spread @ moved.T + psd[:, None, None] * _white(dt)
        spread[:, 2, 2] += walk**2 * dt
        gain = spread[:, :, 0] / (spread[:, 0, 0] + noise)[:, None]
        mean += gain[:, :, None] * (value[frame] - mean[:, 0])[:, None, :]
        spread -= gain[:, :, None] * spread[:, :1, :]
        known[frame] = mean
    newest: npt.NDArray[np.int64] = np.searchsorted(arrival, times, side="right") - 1
    ahead = (times - time[newest])[:, None]
    _, there = integrals.at(times)
    gone = there - place[newest] - ahead * speed[newest]
    own = known[newest]
    return own[:, :, 0] + ahead[:, :, None] * (own[:, :, 1] + ahead[:, :, None] / 2 * own[:, :, 2]) + gone[:, None]


def _white(dt: float) -> FloatArray:
    """What white noise of density 1 on the acceleration adds."""
    return np.array([[dt**3 / 3, dt**2 / 2, 0.0], [dt**2 / 2, dt, 0.0], [0.0, 0.0, 0.0]])
