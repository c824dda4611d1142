"""The event-time path over whole streams, compiled: what would have been shown at each time."""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.kalman.event_history import JERK_PSD, History, Model, Readings, copy_rows, write_reading
from fusion_core.kalman.event_steps import begin, insert, oldest_needed, write_prediction
from fusion_core.kalman.motion import position_step
from fusion_core.samples import FloatArray


@compiled(inner=True)
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
        write_reading(history, 0, time, sensor, value, coupling)
        begin(model, history)
        return 0, 1
    if count == len(history.time):
        copy_rows(history, history, oldest, count, 0)
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
    span: tuple[int, int],
) -> tuple[FloatArray, FloatArray, tuple[int, int]]:
    """Mean and SD (n, dimension) at rising `times`, from readings in order of arrival, the first of them a position.

    Unless they are empty, `constants` are filled with the mean (n, constants) and covariance (n, constants, constants)
    of the constants. `history` is working memory: it needs more rows than there are readings in any `history_s`. Its
    rows in use are `span` (oldest, count), at first (0, 0); the span at the end is returned too.
    """
    dimension = len(model.axes)
    mean, sd = np.full((len(times), dimension), np.nan), np.full((len(times), dimension), np.nan)
    recent, adapted, of_position = history.time, history.adapted, np.zeros(len(model.states))
    (oldest, count), upcoming = span, 0
    for index in range(len(times)):
        while upcoming < len(arrival) and arrival[upcoming] <= times[index]:
            time, sensor = readings.time[upcoming], readings.sensor[upcoming]
            value, coupling = readings.value[upcoming], readings.coupling[upcoming]
            oldest, count = insert_reading(model, history, (oldest, count), time, sensor, value, coupling, history_s)
            upcoming += 1
        if count > 0:
            if len(constants[0]):
                begins = len(model.states) * dimension
                for one in range(len(model.constants)):
                    constants[0][index, one] = history.mean[count - 1, begins + one]
                    for other in range(len(model.constants)):
                        shared = history.covariance[count - 1, begins + one, begins + other]
                        constants[1][index, one, other] = shared
            row = count - 1
            noise = position_step(
                model.motion, max(times[index] - recent[row], 0.0), adapted[row, JERK_PSD], of_position
            )
            write_prediction(
                model.states, model.axes, history.mean, history.covariance, row, of_position, noise, mean, sd, index
            )
    return mean, sd, (oldest, count)
