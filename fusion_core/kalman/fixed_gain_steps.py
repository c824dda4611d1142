"""The fixed-gain path of Kalman fusion, compiled: for regular streams, whose gains settle and need no recomputing.

One tracker and one accelerometer at stated rates, the bias in the tracker's frame: then the axes are independent and
alike, and the gains are those of one axis in the cycle of frame and accelerations that repeats. They stand in a table
by the number of accelerations since the newest frame. Times are still the true ones; only the gains are nominal.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.kalman.event_steps import SAME_S
from fusion_core.kalman.motion import add_wiener_noise
from fusion_core.samples import FloatArray

STATES = 4  # position, velocity, acceleration and bias of one axis
_MOST_CYCLES = 200_000
_SETTLED = 1e-14  # relative change of the covariance over a cycle
_WITHOUT_FRAMES_S = 2.0  # how far the table goes on where no frame comes


class Schedule(NamedTuple):
    """What repeats: accelerations `period_s` apart, the first of them `after_s` after a frame."""

    jerk_psd_mm2_s5: float
    bias_psd: float
    tracker_variance: float
    imu_variance: float
    period_s: float
    per_frame: int
    after_s: float


class Gains(NamedTuple):
    """Settled gains (k, 4), row 0 of a frame, row k of the k-th acceleration after it; covariances (k, 4, 4) after."""

    axes: tuple[int, ...]  # for its length alone, which the compiler then knows
    gain: FloatArray
    covariance: FloatArray
    jerk_psd_mm2_s5: float


@lru_cache(maxsize=64)
def settled(schedule: Schedule, dimension: int) -> Gains:
    """The gains of a schedule, by running its covariance until a cycle no longer changes it."""
    count = schedule.per_frame + int(np.ceil(_WITHOUT_FRAMES_S / schedule.period_s))
    gain, covariance = np.empty((count + 1, STATES)), np.empty((count + 1, STATES, STATES))
    _settle(schedule, gain, covariance)
    return Gains((0,) * dimension, gain, covariance, schedule.jerk_psd_mm2_s5)


@compiled
def _settle(schedule: Schedule, gain: FloatArray, covariance: FloatArray) -> None:
    """Fills the table of `Gains`."""
    of_position, of_acceleration = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    now = np.diag(np.array([schedule.tracker_variance, 250e3, 25e6, 90e3]))
    gains = np.zeros(STATES)
    for _ in range(_MOST_CYCLES):
        before = now.copy()
        for k in range(schedule.per_frame):
            now = _moved(schedule, now, schedule.after_s if k == 0 else schedule.period_s)
            now = _updated(now, of_acceleration, schedule.imu_variance, gains)
        now = _moved(schedule, now, schedule.period_s - schedule.after_s)
        now = _updated(now, of_position, schedule.tracker_variance, gains)
        if np.abs(now - before).max() <= _SETTLED * np.abs(now).max():
            break
    gain[0], covariance[0] = gains, now
    for k in range(1, len(gain)):
        now = _moved(schedule, now, schedule.after_s if k == 1 else schedule.period_s)
        now = _updated(now, of_acceleration, schedule.imu_variance, gains)
        gain[k], covariance[k] = gains, now


@compiled
def _moved(schedule: Schedule, covariance: FloatArray, dt: float) -> FloatArray:
    transition = np.eye(STATES)
    transition[0, 1] = transition[1, 2] = dt
    transition[0, 2] = dt * dt / 2.0
    moved = transition @ covariance @ transition.T
    add_wiener_noise(schedule.jerk_psd_mm2_s5, dt, moved, 1, 0)
    moved[3, 3] += schedule.bias_psd * dt
    return moved


@compiled
def _updated(covariance: FloatArray, observed: FloatArray, noise_variance: float, gains: FloatArray) -> FloatArray:
    """The covariance after a reading; its gains go into `gains`."""
    column = covariance @ observed
    precision = 1.0 / (observed @ column + noise_variance)
    gains[:] = column * precision
    return covariance - np.outer(column, column) * precision


class Rows(NamedTuple):
    """Recent readings by measurement time and the mean after each."""

    time: FloatArray  # (n,)
    is_frame: npt.NDArray[np.bool_]  # (n,)
    value: FloatArray  # (n, dimension)
    mean: FloatArray  # (n, 4, dimension)
    since: npt.NDArray[np.int64]  # (n,): accelerations since the newest frame, this one included


def empty_rows(count: int, dimension: int) -> Rows:
    """Room for `count` readings."""
    return Rows(
        np.zeros(count),
        np.zeros(count, np.bool_),
        np.zeros((count, dimension)),
        np.zeros((count, STATES, dimension)),
        np.zeros(count, np.int64),
    )


@compiled(inline="always")
def _take_in(gains: Gains, rows: Rows, row: int, before: int) -> None:
    """The mean of a row from that of the row `before` and its reading."""
    dt = max(rows.time[row] - rows.time[before], 0.0)
    half = dt * dt / 2.0
    frame = rows.is_frame[row]
    since = 0 if frame else rows.since[before] + 1
    rows.since[row] = since
    which = min(since, gains.gain.shape[0] - 1)
    of_position, of_speed = gains.gain[which, 0], gains.gain[which, 1]
    of_rate, of_bias = gains.gain[which, 2], gains.gain[which, 3]
    for axis in range(len(gains.axes)):
        rate, bias = rows.mean[before, 2, axis], rows.mean[before, 3, axis]
        position = rows.mean[before, 0, axis] + dt * rows.mean[before, 1, axis] + half * rate
        speed = rows.mean[before, 1, axis] + dt * rate
        innovation = rows.value[row, axis] - (position if frame else rate + bias)
        rows.mean[row, 0, axis] = position + of_position * innovation
        rows.mean[row, 1, axis] = speed + of_speed * innovation
        rows.mean[row, 2, axis] = rate + of_rate * innovation
        rows.mean[row, 3, axis] = bias + of_bias * innovation


@compiled
def inserted(gains: Gains, rows: Rows, room: Rows, time: float, is_frame: bool, value: FloatArray) -> int:
    """`rows` copied into `room`, which has one more, with one more reading. Where it went; 0 if it was too late."""
    count = len(rows.time)
    at = count
    while at > 0 and rows.time[at - 1] > time + SAME_S:
        at -= 1
    if at == 0:
        return 0
    for row in range(count):
        to = row if row < at else row + 1
        room.time[to], room.is_frame[to], room.value[to] = rows.time[row], rows.is_frame[row], rows.value[row]
        if row < at:
            room.mean[to], room.since[to] = rows.mean[row], rows.since[row]
    room.time[at], room.is_frame[at], room.value[at] = time, is_frame, value
    for row in range(at, count + 1):
        _take_in(gains, room, row, row - 1)
    return at


@compiled(inline="always")
def expect(gains: Gains, rows: Rows, row: int, time: float, mean: FloatArray, sd: FloatArray, index: int) -> None:
    """Writes position and SD at `time`, from the mean of a row, into row `index` of `mean` and `sd`."""
    dt = max(time - rows.time[row], 0.0)
    half = dt * dt / 2.0
    which = min(rows.since[row], gains.covariance.shape[0] - 1)
    known = gains.covariance
    variance = known[which, 0, 0] + dt * (2.0 * known[which, 0, 1] + dt * (known[which, 1, 1] + known[which, 0, 2]))
    faster = known[which, 1, 2] + dt * (known[which, 2, 2] / 4.0 + dt * gains.jerk_psd_mm2_s5 / 20.0)
    spread = np.sqrt(variance + dt * dt * dt * faster)
    for axis in range(len(gains.axes)):
        mean[index, axis] = rows.mean[row, 0, axis] + dt * rows.mean[row, 1, axis] + half * rows.mean[row, 2, axis]
        sd[index, axis] = spread


@compiled
def expect_one(gains: Gains, rows: Rows, row: int, time: float) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (dimension,) at `time`, from the mean of a row."""
    mean, sd = np.empty((1, rows.value.shape[1])), np.empty((1, rows.value.shape[1]))
    expect(gains, rows, row, time, mean, sd, 0)
    return mean[0], sd[0]


@compiled(inline="always")
def _put_in(gains: Gains, ring: Rows, last: int, time: float, is_frame: bool, value: FloatArray, at: int) -> int:
    """One more reading at its time, the newest row being `last` − 1; how many rows it went back."""
    mask, row, back = len(ring.time) - 1, last, 0
    while ring.time[(row - 1) & mask] > time + SAME_S and back < mask:
        to, of = row & mask, (row - 1) & mask
        ring.time[to], ring.is_frame[to] = ring.time[of], ring.is_frame[of]
        for axis in range(len(gains.axes)):
            ring.value[to, axis] = ring.value[of, axis]
        row, back = row - 1, back + 1
    ring.time[row & mask], ring.is_frame[row & mask] = time, is_frame
    for axis in range(len(gains.axes)):
        ring.value[row & mask, axis] = value[at, axis]
    for again in range(row, last + 1):
        _take_in(gains, ring, again & mask, (again - 1) & mask)
    return back


@compiled
def replay(
    gains: Gains,
    frames: tuple[FloatArray, FloatArray, FloatArray],
    accelerations: tuple[FloatArray, FloatArray, FloatArray],
    times: FloatArray,
    ring: Rows,
) -> tuple[FloatArray, FloatArray, bool]:
    """Mean and SD (n, dimension) at `times`, which rise, of streams (time, arrival, value) that are in order of both.

    `ring` is a power of two of rows; the last result is false where a reading went back by more than that. The first
    frame's arrival is the start; accelerations measured after it count from then on.
    """
    dimension, mask = frames[2].shape[1], len(ring.time) - 1
    mean, sd, whole = np.empty((len(times), dimension)), np.empty((len(times), dimension)), True
    last, frame, force = -1, 0, 0
    for index in range(len(times)):
        now = times[index]
        if last < 0 and frames[1][0] <= now:
            last, frame = 0, 1
            ring.time[0], ring.is_frame[0], ring.value[0], ring.since[0] = frames[0][0], True, frames[2][0], 0
            ring.mean[0] = 0.0
            ring.mean[0, 0] = frames[2][0]
            while force < len(accelerations[0]) and (
                accelerations[0][force] < frames[0][0]
                or (accelerations[0][force] == frames[0][0] and accelerations[1][force] < frames[1][0])
            ):
                force += 1
        while last >= 0:
            frame_at = frames[1][frame] if frame < len(frames[1]) else np.inf
            force_at = accelerations[1][force] if force < len(accelerations[1]) else np.inf
            if min(frame_at, force_at) > now:
                break
            last += 1
            if frame_at <= force_at:
                whole &= _put_in(gains, ring, last, frames[0][frame], True, frames[2], frame) < mask
                frame += 1
            else:
                whole &= _put_in(gains, ring, last, accelerations[0][force], False, accelerations[2], force) < mask
                force += 1
        if last < 0:
            mean[index], sd[index] = np.nan, np.nan
        else:
            expect(gains, ring, last & mask, now, mean, sd, index)
    return mean, sd, whole
