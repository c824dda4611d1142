"""Smoothing, compiled: what later readings say about an earlier instant (Rauch, Tung and Striebel 1965).

The steps back take the motion, the number of axes and the constants' random walks in place of the whole `Model`, whose
tuples would have them compiled anew for every number of axes and constants: they take long to compile, and are products
of whole matrices, which gain nothing from loops of known length.
"""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.kalman.event_history import JERK_PSD, History, Model, Readings
from fusion_core.kalman.event_prediction import whole_step
from fusion_core.kalman.event_replay import insert_reading
from fusion_core.kalman.event_steps import write_prediction
from fusion_core.kalman.motion import Motion, position_step
from fusion_core.samples import FloatArray


@compiled
def _step(
    motion: Motion, dimension: int, constant_psd: FloatArray, dt: float, jerk_psd: float
) -> tuple[FloatArray, FloatArray]:
    """Transition and process noise over `dt` seconds, (size, size); constants are slow random walks."""
    moving = len(motion.stationary) * dimension
    transition, noise = whole_step(motion, dimension, moving + len(constant_psd), dt, jerk_psd)
    for constant in range(len(constant_psd)):
        noise[moving + constant, moving + constant] = constant_psd[constant] * dt
    return transition, noise


@compiled(inner=True)
def step_back(
    motion: Motion,
    dimension: int,
    constant_psd: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
    dt: float,
    jerk_psd: float,
    later_mean: FloatArray,
    later_covariance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Smoothed mean and covariance of a row, from its filtered ones and the smoothed ones `dt` seconds later."""
    transition, noise = _step(motion, dimension, constant_psd, dt, jerk_psd)
    expected = transition @ covariance @ transition.T + noise
    for state in range(len(mean)):
        expected[state, state] += 1e-12 * (
            1.0 + expected[state, state]
        )  # invertible where dt is 0: such a step has no noise
    gain = np.linalg.solve(expected, transition @ covariance).T
    smoothed = mean + gain @ (later_mean - transition @ mean)
    spread = covariance + gain @ (later_covariance - expected) @ gain.T
    return smoothed, (spread + spread.T) / 2.0


@compiled
def _to_row(
    motion: Motion,
    dimension: int,
    constant_psd: FloatArray,
    history: History,
    row: int,
    later_mean: FloatArray,
    later_covariance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Smoothed mean and covariance of a row, from those of the next."""
    dt, jerk_psd = history.time[row + 1] - history.time[row], history.adapted[row, JERK_PSD]
    own = history.mean[row], history.covariance[row]
    return step_back(motion, dimension, constant_psd, *own, dt, jerk_psd, later_mean, later_covariance)


@compiled
def _at(
    motion: Motion,
    dimension: int,
    constant_psd: FloatArray,
    history: History,
    row: int,
    time: float,
    later_mean: FloatArray,
    later_covariance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Mean and SD of the position at `time`, between a row and the next, whose smoothed moments are given."""
    jerk_psd = history.adapted[row, JERK_PSD]
    transition, noise = _step(motion, dimension, constant_psd, time - history.time[row], jerk_psd)
    mean = transition @ history.mean[row]
    covariance = transition @ history.covariance[row] @ transition.T + noise
    rest = history.time[row + 1] - time
    mean, covariance = step_back(
        motion, dimension, constant_psd, mean, covariance, rest, jerk_psd, later_mean, later_covariance
    )
    return mean[:dimension].copy(), np.sqrt(np.diag(covariance)[:dimension])


@compiled(inner=True)
def smoothed_at(
    motion: Motion,
    dimension: int,
    constant_psd: FloatArray,
    history: History,
    oldest: int,
    count: int,
    time: float,
) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (dimension,) of the position at `time`, within the rows from `oldest` to `count`."""
    mean, covariance = history.mean[count - 1].copy(), history.covariance[count - 1].copy()
    row = count - 2
    while row > oldest and history.time[row] > time:
        mean, covariance = _to_row(motion, dimension, constant_psd, history, row, mean, covariance)
        row -= 1
    return _at(motion, dimension, constant_psd, history, row, time, mean, covariance)


@compiled
def replay_late(
    model: Model,
    readings: Readings,
    arrival: FloatArray,
    times: FloatArray,
    history: History,
    history_s: float,
    lag_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (n, dimension) of the position `lag_s` before each of `times`, given all that had arrived by then.

    Everything else is as in `event_replay.replay`. A function of its own, since it takes half as long to compile as
    that, and is seldom used. What takes in the readings that arrived is written in both: a function for it would take
    every first replay a fifth longer to compile.
    """
    dimension = len(model.axes)
    mean, sd = np.full((len(times), dimension), np.nan), np.full((len(times), dimension), np.nan)
    of_position = np.zeros(len(model.states))
    oldest, count, upcoming = int(0), int(0), 0  # noqa: RUF046, UP018 - for a bare 0 all is compiled once more
    for index in range(len(times)):
        while upcoming < len(arrival) and arrival[upcoming] <= times[index]:
            time, sensor = readings.time[upcoming], readings.sensor[upcoming]
            value, coupling = readings.value[upcoming], readings.coupling[upcoming]
            oldest, count = insert_reading(model, history, (oldest, count), time, sensor, value, coupling, history_s)
            upcoming += 1
        wanted, row = times[index] - lag_s, count - 1
        if count > 0 and wanted >= history.time[row]:
            jerk_psd = history.adapted[row, JERK_PSD]
            noise = position_step(model.motion, wanted - history.time[row], jerk_psd, of_position)
            write_prediction(
                model.states, model.axes, history.mean, history.covariance, row, of_position, noise, mean, sd, index
            )
        elif count > 0 and wanted >= history.time[oldest]:
            there, sd_there = smoothed_at(model.motion, dimension, model.constant_psd, history, oldest, count, wanted)
            for axis in range(dimension):
                mean[index, axis], sd[index, axis] = there[axis], sd_there[axis]
    return mean, sd


@compiled
def smooth(
    motion: Motion, dimension: int, constant_psd: FloatArray, history: History, times: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (n, dimension) at rising `times`, given all rows; NaN outside them."""
    position, sd = np.full((len(times), dimension), np.nan), np.full((len(times), dimension), np.nan)
    count, index = len(history.time), len(times) - 1
    mean, covariance = history.mean[count - 1].copy(), history.covariance[count - 1].copy()
    while index >= 0 and times[index] >= history.time[count - 1]:
        if times[index] == history.time[count - 1]:
            for axis in range(dimension):
                position[index, axis], sd[index, axis] = mean[axis], np.sqrt(covariance[axis, axis])
        index -= 1
    for row in range(count - 2, -1, -1):
        while index >= 0 and times[index] >= history.time[row]:
            there, sd_there = _at(motion, dimension, constant_psd, history, row, times[index], mean, covariance)
            for axis in range(dimension):
                position[index, axis], sd[index, axis] = there[axis], sd_there[axis]
            index -= 1
        mean, covariance = _to_row(motion, dimension, constant_psd, history, row, mean, covariance)
    return position, sd
