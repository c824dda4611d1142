"""The event-time path over whole streams, compiled: what would have been shown at each time."""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.kalman.event_history import JERK_PSD, History, Model, Readings
from fusion_core.kalman.event_steps import begin, insert, oldest_needed, write_prediction
from fusion_core.kalman.motion import position_step
from fusion_core.samples import FloatArray


@compiled
def _shift_down(history: History, first: int, count: int) -> None:
    """Moves the rows first:count to the top of the history, which makes room at its end."""
    for row in range(first, count):
        history.time[row - first] = history.time[row]
        history.sensor[row - first] = history.sensor[row]
        history.value[row - first] = history.value[row]
        history.coupling[row - first] = history.coupling[row]
        history.mean[row - first] = history.mean[row]
        history.covariance[row - first] = history.covariance[row]
        history.adapted[row - first] = history.adapted[row]


@compiled
def insert_reading(
    model: Model,
    history: History,
    span: tuple[int, int],
    time: float,
    sensor: int,
    value: FloatArray,
    coupling: FloatArray,
    history_s: float,
) -> tuple[int, int]:
    """Inserts a reading into `history`, whose rows in use are `span` (oldest, count); returns the new span.

    The first reading must be a position. One that comes too late changes nothing.
    """
    oldest, count = span
    if count == 0:
        history.time[0], history.sensor[0], history.value[0], history.coupling[0] = time, sensor, value, coupling
        begin(model, history)
        return 0, 1
    if count == len(history.time):
        _shift_down(history, oldest, count)
        oldest, count = 0, count - oldest
    if insert(model, history, oldest, count, time, sensor, value, coupling) > oldest:
        count += 1
        oldest = oldest_needed(history.time, oldest, count, history_s)
    return oldest, count


@compiled
def replay(
    model: Model,
    readings: Readings,
    arrival: FloatArray,
    times: FloatArray,
    history: History,
    history_s: float,
    constants: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (n, dimension) at rising `times`, from readings in order of arrival, the first of them a position.

    Unless they are empty, `constants` are filled with the mean (n, constants) and covariance (n, constants, constants)
    of the constants. `history` is working memory: it needs more rows than there are readings in any `history_s`.
    """
    dimension = len(model.axes)
    mean, sd = np.full((len(times), dimension), np.nan), np.full((len(times), dimension), np.nan)
    recent, adapted, of_position = history.time, history.adapted, np.zeros(len(model.states))
    oldest, count, upcoming = 0, 0, 0
    for index in range(len(times)):
        while upcoming < len(arrival) and arrival[upcoming] <= times[index]:
            time, sensor = readings.time[upcoming], readings.sensor[upcoming]
            value, coupling = readings.value[upcoming], readings.coupling[upcoming]
            oldest, count = insert_reading(model, history, (oldest, count), time, sensor, value, coupling, history_s)
            upcoming += 1
        if count > 0:
            if len(constants[0]):
                begins = len(model.states) * dimension
                constants[0][index] = history.mean[count - 1, begins:]
                constants[1][index] = history.covariance[count - 1, begins:, begins:]
            row = count - 1
            noise = position_step(
                model.motion, max(times[index] - recent[row], 0.0), adapted[row, JERK_PSD], of_position
            )
            write_prediction(
                model.states, model.axes, history.mean, history.covariance, row, of_position, noise, mean, sd, index
            )
    return mean, sd
