"""The fixed-gain path of Kalman fusion, compiled: the gains of regular streams settle, so they are computed once.

With one tracker and one accelerometer at stated rates, and the bias in the tracker's frame, the axes are independent
and have the same gains. Frames and accelerations come in a cycle that repeats, so a gain depends only on the number of
accelerations since the newest frame, and a table holds them all. The times of readings are still the measured ones;
only the gains assume the stated rates.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.kalman.event_history import SAME_S
from fusion_core.kalman.motion import add_wiener_noise
from fusion_core.samples import FloatArray

STATES = 4  # position, velocity, acceleration and bias of one axis
_MOST_CYCLES = 200_000
_SETTLED = 1e-14  # relative change of the covariance over a cycle
_WITHOUT_FRAMES_S = 2.0  # the table covers this much time without a frame


class Schedule(NamedTuple):
    """The cycle that repeats: `per_frame` accelerations `period_s` apart, the first of them `after_s` after a frame."""

    jerk_psd_mm2_s5: float
    bias_psd: float
    tracker_variance: float
    imu_variance: float
    period_s: float
    per_frame: int
    after_s: float


class Gains(NamedTuple):
    """Settled gains (n, 4): row 0 is a frame's, row k that of the k-th acceleration after it.

    `covariance` (n, 4, 4) is that of the state after the reading of each row.
    """

    axes: tuple[int, ...]  # for its length alone, which the compiler then knows
    gain: FloatArray
    covariance: FloatArray
    jerk_psd_mm2_s5: float


@lru_cache(maxsize=64)
def settled_gains(schedule: Schedule, dimension: int) -> Gains:
    """The gains of a schedule, found by repeating its cycle until the covariance no longer changes."""
    count = schedule.per_frame + int(np.ceil(_WITHOUT_FRAMES_S / schedule.period_s))
    gain, covariance = np.empty((count + 1, STATES)), np.empty((count + 1, STATES, STATES))
    settle(schedule, gain, covariance)
    return Gains((0,) * dimension, gain, covariance, schedule.jerk_psd_mm2_s5)


@compiled
def settle(schedule: Schedule, gain: FloatArray, covariance: FloatArray) -> None:
    """Fills the table of `Gains`."""
    of_position, of_acceleration = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    now = np.diag(np.array([schedule.tracker_variance, 250e3, 25e6, 90e3]))
    gains = np.zeros(STATES)
    for _ in range(_MOST_CYCLES):
        before = now.copy()
        for k in range(schedule.per_frame):
            now = _predict(schedule, now, schedule.after_s if k == 0 else schedule.period_s)
            now = _correct(now, of_acceleration, schedule.imu_variance, gains)
        now = _predict(schedule, now, schedule.period_s - schedule.after_s)
        now = _correct(now, of_position, schedule.tracker_variance, gains)
        if np.abs(now - before).max() <= _SETTLED * np.abs(now).max():
            break
    gain[0], covariance[0] = gains, now
    for k in range(1, len(gain)):
        now = _predict(schedule, now, schedule.after_s if k == 1 else schedule.period_s)
        now = _correct(now, of_acceleration, schedule.imu_variance, gains)
        gain[k], covariance[k] = gains, now


@compiled
def _predict(schedule: Schedule, covariance: FloatArray, dt: float) -> FloatArray:
    """The covariance (4, 4) of one axis `dt` seconds later."""
    transition = np.eye(STATES)
    transition[0, 1] = transition[1, 2] = dt
    transition[0, 2] = dt * dt / 2.0
    moved = transition @ covariance @ transition.T
    add_wiener_noise(schedule.jerk_psd_mm2_s5, dt, moved, 1, 0)
    moved[3, 3] += schedule.bias_psd * dt
    return moved


@compiled
def _correct(covariance: FloatArray, observed: FloatArray, noise_variance: float, gains: FloatArray) -> FloatArray:
    """The covariance after a reading, whose gains (4,) are written into `gains`."""
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
    """Room for `count` readings, all zeros."""
    return Rows(
        np.zeros(count),
        np.zeros(count, np.bool_),
        np.zeros((count, dimension)),
        np.zeros((count, STATES, dimension)),
        np.zeros(count, np.int64),
    )


@compiled(inline="always")
def _update_row(gains: Gains, rows: Rows, row: int, before: int) -> None:
    """Computes the mean of a row from that of the row `before` and its own reading."""
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
def insert_into_copy(gains: Gains, rows: Rows, copy: Rows, time: float, is_frame: bool, value: FloatArray) -> int:
    """Copies `rows` into `copy`, which has one row more, and inserts a reading; returns its row, 0 if too late."""
    count = len(rows.time)
    at = count
    while at > 0 and rows.time[at - 1] > time + SAME_S:
        at -= 1
    if at == 0:
        return 0
    for row in range(count):
        to = row if row < at else row + 1
        copy.time[to], copy.is_frame[to], copy.value[to] = rows.time[row], rows.is_frame[row], rows.value[row]
        if row < at:
            copy.mean[to], copy.since[to] = rows.mean[row], rows.since[row]
    copy.time[at], copy.is_frame[at], copy.value[at] = time, is_frame, value
    for row in range(at, count + 1):
        _update_row(gains, copy, row, row - 1)
    return at


@compiled(inner=True, inline="always")
def write_prediction(
    gains: Gains, rows: Rows, row: int, time: float, mean: FloatArray, sd: FloatArray, index: int
) -> None:
    """Writes the position at `time`, predicted from a row, and its SD into row `index` of `mean` and `sd`."""
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
def predict_position(gains: Gains, rows: Rows, row: int, time: float) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (dimension,) of the position at `time`, predicted from the mean of a row."""
    mean, sd = np.empty((1, rows.value.shape[1])), np.empty((1, rows.value.shape[1]))
    write_prediction(gains, rows, row, time, mean, sd, 0)
    return mean[0], sd[0]


@compiled(inline="always")
def _insert_into_ring(
    gains: Gains, ring: Rows, last: int, time: float, is_frame: bool, value: FloatArray, at: int
) -> int:
    """Inserts a reading in order of measurement; the newest row was `last` − 1. Returns how many rows it went back.

    The ring's length is a power of two, so that `row & mask` is the row's place in it.
    """
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
        _update_row(gains, ring, again & mask, (again - 1) & mask)
    return back


@compiled
def replay(
    gains: Gains,
    frames: tuple[FloatArray, FloatArray, FloatArray],
    accelerations: tuple[FloatArray, FloatArray, FloatArray],
    times: FloatArray,
    ring: Rows,
) -> tuple[FloatArray, FloatArray, bool]:
    """Mean and SD (n, dimension) at rising `times`, from streams (time, arrival, value) in order of both.

    The number of `ring`'s rows is a power of two; the third result is false where a reading went back by more rows than
    that, and the estimates cannot be used. The filter starts when the first frame arrives, with the accelerations that
    were measured after it.
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
                whole &= _insert_into_ring(gains, ring, last, frames[0][frame], True, frames[2], frame) < mask
                frame += 1
            else:
                whole &= (
                    _insert_into_ring(gains, ring, last, accelerations[0][force], False, accelerations[2], force) < mask
                )
                force += 1
        if last < 0:
            mean[index], sd[index] = np.nan, np.nan
        else:
            write_prediction(gains, ring, last & mask, now, mean, sd, index)
    return mean, sd, whole
