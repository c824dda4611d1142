"""The sensors' noise as measured from the readings themselves, compared with what study.yaml states.

Theory. A hand is slow compared with a sensor's rate: over four successive readings its path is nearly a parabola, which
the third difference removes, while white noise of SD s gives a third difference of SD √20 s. What remains of the
movement can only add to that, so stretches whose steps are far larger are left out, and of the others only the quietest
quarter is used: a brisk hand that never pauses is not judged. Noise that is correlated from reading to reading, such as
that of a filtered tracker, gives less and is not noticed. The quietest quarter is quieter than white noise on average:
by simulation, by a seventh for windows of 30 readings of three axes and by a quarter for one axis. The result is
corrected for that.

Where the steps of twenty windows are nothing but noise, the result is within a tenth of the true value (at most 1.09
times it in 500 simulated sessions), so an excess of a fifth is reported there; elsewhere only one of a half is.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.by_parts import parts_of
from pipeline.sessions.checks.band import rising
from pipeline.sessions.checks.finding import Finding, Status, graded, of
from pipeline.sessions.checks.force import LARGE_M_S2
from pipeline.sessions.checks.recorded import Recorded, Times
from pipeline.sessions.logs.log import BoolArray
from pipeline.statistics.arrays import FloatArray

TRACKER_NOISE, IMU_NOISE = "tracker noise", "accelerometer noise"

_SCALE = np.sqrt(20.0)  # of the third difference: 1 + 9 + 9 + 1
_QUIET = 0.25
_WINDOW = 30  # readings
_QUIETEST = (0.76, 0.83, 0.86)  # what is found of white noise of SD 1, by the number of axes
_LIKE_NOISE = 0.25  # of the steps: noise alone leaves 0.7 of them, a movement far less
_NOTHING_BUT_NOISE = 0.55
_CLEAR = 20  # windows of nothing but noise
_EVEN = 0.5  # of a step: by how much four readings may be unevenly spaced
_TRACKER = (1.5, 2.5)
_TRACKER_CLEAR = (1.2, 2.5)  # where the figure is within a tenth of the truth
_IMU = (4.0, 10.0)
_UNIT = 1.8  # times as far as another sensor says


def tracker_noise(recorded: Recorded) -> Iterator[Finding]:
    """The tracker's noise compared with `noise_sd_mm`: if that is too small, every filter trusts the tracker too much.

    Only noise above the stated one is a finding: a tracker that smooths has slow errors, which do not scatter.
    """
    for positions in recorded.positions:
        if positions.noise_sd_mm is None:
            continue
        measured = noise_sd(positions.times, positions.value_mm)
        if measured is None or measured == 0:
            continue
        amber, red = _TRACKER
        clear = _quiet(positions.times, positions.value_mm, _NOTHING_BUT_NOISE)
        if clear is not None and clear[1] >= _CLEAR:
            measured, (amber, red) = clear[0], _TRACKER_CLEAR
        ratio = measured / positions.noise_sd_mm
        if ratio > amber and _other_unit(recorded):
            continue  # the scatter is that of the unit, which has a check of its own
        found, expected = f"{measured:.2g} mm", f"{positions.noise_sd_mm:g} mm by study.yaml"
        status = graded(ratio, amber, red)
        if status != "green":
            message = (
                f'the readings of "{positions.name}" scatter by {measured:.2g} mm and study.yaml states '
                f"{positions.noise_sd_mm:g}: set noise_sd_mm: {measured:.2g}, else the fusion believes them too much"
            )
        else:
            message = ""
        yield Finding(of(TRACKER_NOISE, positions.name), status, found, expected, message)


def accelerometer_noise(recorded: Recorded) -> Iterator[Finding]:
    """The accelerometer's noise compared with `noise_sd_mm_s2`.

    Only noise above the stated one is a finding: the stated SD also covers errors of tilt.
    """
    for imu in recorded.imus:
        if imu.noise_sd_mm_s2 is None:
            continue
        measured = noise_sd(imu.times, imu.force_m_s2, 1e3)
        if measured is None:
            continue
        ratio = measured / imu.noise_sd_mm_s2
        if ratio > _IMU[0] and float(np.median(np.linalg.norm(imu.force_m_s2, axis=1))) > LARGE_M_S2:
            continue
        found, expected = f"{measured:.2g} mm/s²", f"{imu.noise_sd_mm_s2:g} mm/s² by study.yaml"
        status: Status = "red" if ratio > _IMU[1] else "amber" if ratio > _IMU[0] else "green"
        message = ""
        if status != "green":
            message = (
                f'the readings of "{imu.name}" scatter by {measured:.2g} mm/s² and study.yaml states '
                f"{imu.noise_sd_mm_s2:g}: set noise_sd_mm_s2: {measured:.2g}, or look for vibration"
            )
        yield Finding(of(IMU_NOISE, imu.name), status, found, expected, message)


def _other_unit(recorded: Recorded) -> bool:
    """Does the tracker move much farther than the phone or the reference says?"""
    compared = (recorded.motion, recorded.reference_motion)
    return any(one is not None and one.scale.low > _UNIT for one in compared)


def noise_sd(times: Times, value: FloatArray, scale: float = 1.0) -> float | None:
    """SD of the white noise per axis, from the quietest quarter of the readings (n, d); None with fewer than 100.

    Repeated and unevenly spaced readings are left out. A figure is so many times its value.
    """
    found = _quiet(times, value, _LIKE_NOISE, scale)
    return None if found is None else found[0]


def _quiet(times: Times, value: FloatArray, like_noise: float, scale: float = 1.0) -> tuple[float, int] | None:
    """The same SD, and how many windows are enough like noise; the quietest quarter is taken of these."""
    stamp_s, value = rising(times.stamp_s, value)
    fresh = np.ones(len(value), bool)
    for part in parts_of(len(value) - 1):
        fresh[1:][part] = np.any(_differences(value, part, 1, scale) != 0, axis=1)
    if not fresh.all():
        stamp_s, value = stamp_s[fresh], value[fresh]
    if len(stamp_s) < 100:
        return None
    steps = np.diff(stamp_s)
    usual = float(np.median(steps))
    even = np.abs(steps - usual) < _EVEN * usual
    sound = even[:-2] & even[1:-1] & even[2:]
    del stamp_s, steps
    left = _of_sound(value, sound, 3, scale)
    left /= _SCALE
    alive = np.any(left != 0, axis=0)  # an axis that is constant has no noise to be judged
    count = len(left) // _WINDOW
    if count < 3 or not alive.any():
        return None
    variance = _by_window(left if alive.all() else left[:, alive], count)
    del left
    moved = _of_sound(value, sound, 1, scale)
    variance = variance[variance > like_noise**2 * _by_window(moved if alive.all() else moved[:, alive], count)]
    if len(variance) < 3:
        return None
    quiet = np.sort(variance)[: max(2, round(_QUIET * len(variance)))]
    return float(np.sqrt(np.mean(quiet))) / _QUIETEST[int(alive.sum()) - 1], len(variance)


def _of_sound(value: FloatArray, sound: BoolArray, order: int, scale: float) -> FloatArray:
    """The third differences of four readings each, or the middle one of their steps, where those are `sound`."""
    found, end = np.empty((int(sound.sum()), value.shape[1])), 0
    for part in parts_of(len(sound)):
        middle = slice(part.start + (3 - order) // 2, part.stop + (3 - order) // 2)
        own = _differences(value, middle, order, scale)[: len(sound) - part.start][sound[part]]
        found[end : end + len(own)] = own
        end += len(own)
    return found


def _differences(value: FloatArray, rows: slice, order: int, scale: float) -> FloatArray:
    """Those differences of the figures that begin at some rows."""
    return np.diff(value[rows.start : rows.stop + order] * scale, order, axis=0)


def _by_window(values: FloatArray, count: int) -> FloatArray:
    """The mean square (count,) of values (n, d) over each so many readings."""
    windows, found = values[: count * _WINDOW].reshape(count, -1), np.empty(count)
    for part in parts_of(count):
        found[part] = np.mean(windows[part] ** 2, axis=1)
    return found
