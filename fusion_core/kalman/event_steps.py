"""The event-time Kalman filter, compiled: each reading is used at the time it was measured, whenever it arrives.

Theory of operation
===================

A Kalman filter goes forward in time, and a tracker's frame arrives a tenth of a second after the accelerations that
were measured with it. So the filter keeps a short history: one row for each reading, in order of measurement, with the
moments (mean and covariance) after that reading. A reading that arrives late is inserted in order of measurement, and
the rows after it are computed again.

    measured   0.00   0.01   0.02   0.03  …  0.10   0.11
    sensor     imu    imu    imu    imu      imu    imu
                        ^
                        frame of 0.015 arrives at 0.115: insert a row here, compute all later rows again (`update_rows`)

State. For d axes the rows of mean and covariance are: position of all axes, velocity of all axes, acceleration of all
axes, …, then the constants that readings hold, such as a bias in the body's frame. The axes share one covariance
because constants couple them: a bias that is constant in the turning phone enters x, y and z of the tracker's frame
by `coupling`. Without constants the axes would be independent.

A row is computed from the row before it and from its own reading (`update_rows`), in four files:

    event_history      what stands in a row, and the filter's constants
    event_prediction   the moments of the row before, moved on over dt: `move_wiener`, or `move_anchored` for a motion
                       that returns to a place
    event_adaptation   whether a position is accepted (`judge`), and what the filter learns about its sensors
    event_correction   the reading used, one axis after the other (allowed because the axes' noise is independent)

What the filter learns about its sensors stands in each row too (`History.adapted`), so that going back to an earlier
row restores it: the log of the accelerations' extra noise, the measured jerk, how many positions in a row the gate has
rejected.

What must stay true. (1) A row depends only on the row before it and on its own reading. Then inserting a late reading
gives the same bits as processing all readings in order, and live, replay and simulation agree. (2) No row is dropped
before `history_s` has passed, because a late frame could not be inserted any more. A frame that is later still is
counted and not used. (3) The covariance is made symmetric in each correction: otherwise round-off grows to 1e-7 mm
within a minute. (4) `predict_position` starts from the newest row and changes nothing.

What may change. The motion (`Motion`), what is learnt about the sensors, the size of the history. Another kind of
state needs its part in `observe` and `correct`. `Model` holds tuples whose lengths the compiler knows, because loops
over them run five times as fast.
"""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.kalman.event_adaptation import judge, measure_jerk
from fusion_core.kalman.event_correction import correct, observe, squared_innovation
from fusion_core.kalman.event_history import (
    ADAPTED,
    JERK_PSD,
    LOG_DETERMINANT,
    LOG_NOISE,
    MEASURED_AT,
    SAME_S,
    SQUARED,
    History,
    Model,
    copy_rows,
    write_reading,
)
from fusion_core.kalman.event_prediction import move_anchored, move_wiener
from fusion_core.kalman.motion import position_step
from fusion_core.samples import FloatArray


@compiled
def _subtract_constants(model: Model, coupling: FloatArray, covariance: FloatArray) -> None:
    """Adds the constants' uncertainty to the first position, which is known only up to the constants in its reading.

    The same holds for the place that an anchored motion returns to, since it is the position less the motion.
    """
    dimension, states = len(model.axes), len(model.states)
    for axis in range(dimension):
        for constant in range(len(model.constants)):
            shared = coupling[axis, constant] * model.initial_constant_variance[constant]
            at = states * dimension + constant
            for state in range(0, states, states - 1 if model.motion.anchored else states):
                row = state * dimension
                covariance[row + axis, at] -= shared
                covariance[at, row + axis] -= shared
                for other_state in range(0, states, states - 1 if model.motion.anchored else states):
                    for other in range(dimension):
                        covariance[row + axis, other_state * dimension + other] += shared * coupling[other, constant]


@compiled
def begin(model: Model, history: History) -> None:
    """Fills the moments of row 0, whose reading is the first position."""
    states, dimension = len(model.states), len(model.axes)
    mean, covariance = history.mean[0], history.covariance[0]
    mean[:], covariance[:], history.adapted[0] = 0.0, 0.0, 0.0
    history.adapted[0, MEASURED_AT] = np.nan
    for axis in range(dimension):
        mean[axis] = history.value[0, axis]
        if model.motion.anchored:
            mean[(states - 1) * dimension + axis] = history.value[0, axis]
        for row in range(states):
            for column in range(states):
                covariance[row * dimension + axis, column * dimension + axis] = model.initial_covariance[row, column]
    for constant in range(len(model.constants)):
        at = states * dimension + constant
        covariance[at, at] = model.initial_constant_variance[constant]
    _subtract_constants(model, history.coupling[0], covariance)


@compiled
def update_rows(model: Model, history: History, first: int, count: int) -> None:
    """Computes the moments of the rows first:count, each from the row before and its own reading.

    All fields are taken out of their structures before the loop: in it, each access would cost as much as a step.
    """
    time, sensors, value, coupling = history.time, history.sensor, history.value, history.coupling
    mean, covariance, adapted = history.mean, history.covariance, history.adapted
    states, axes, constants, motion = model.states, model.axes, model.constants, model.motion
    operators, observes, biased = model.operators, model.observes, model.biased
    noise_variances, gates, adaptation = model.noise_variance, model.gates, model.adaptation
    least_jerk_psd, anchored, constant_psd = motion.jerk_psd_mm2_s5, motion.anchored, model.constant_psd
    column = np.empty(mean.shape[1])
    for row in range(first, count):
        sensor, dt = sensors[row], max(time[row] - time[row - 1], 0.0)
        density = max(least_jerk_psd, adapted[row - 1, JERK_PSD])
        if anchored:
            move_anchored(motion, len(axes), mean, covariance, row, dt, density)
        else:
            move_wiener(axes, constants, mean, covariance, row, dt, density)
        for constant in range(len(constants)):
            at = len(states) * len(axes) + constant
            covariance[row, at, at] += constant_psd[constant] * dt
        for fact in range(ADAPTED):
            adapted[row, fact] = adapted[row - 1, fact]
        adapted[row, SQUARED], adapted[row, LOG_DETERMINANT] = 0.0, 0.0
        noise_variance, accepted = noise_variances[sensor], True
        if not biased[sensor]:
            squared, seen, log_determinant = squared_innovation(
                states,
                axes,
                constants,
                mean,
                covariance,
                coupling,
                row,
                operators,
                observes,
                sensor,
                value,
                noise_variance,
                column,
            )
            adapted[row, SQUARED], adapted[row, LOG_DETERMINANT] = squared, log_determinant
            accepted = judge(adapted, row, squared, seen, gates[sensor], adaptation)
        elif adaptation > 0.0:
            measure_jerk(axes, adapted, row, time[row], value, noise_variance, max(least_jerk_psd, 1.0))
            if adapted[row, LOG_NOISE] > 0.0:
                noise_variance *= np.exp(adapted[row, LOG_NOISE])
        for axis in range(len(axes) if accepted else 0):  # one after the other, since their noise is independent
            if observes[sensor, axis]:
                variance, expected = observe(
                    states, axes, constants, mean, covariance, coupling, row, operators, sensor, axis, column
                )
                innovation, precision = value[row, axis] - expected, 1.0 / (variance + noise_variance)
                correct(states, axes, constants, mean, covariance, row, column, precision, innovation)


@compiled(inner=True)
def insert(
    model: Model,
    history: History,
    oldest: int,
    count: int,
    time: float,
    sensor: int,
    value: FloatArray,
    coupling: FloatArray,
) -> int:
    """Inserts a reading among the rows oldest:count in order of measurement, and computes the later rows again.

    Returns its row, or `oldest` if it was measured before that row: then it came too late and nothing has changed.
    """
    times, sensors, values, couplings = history.time, history.sensor, history.value, history.coupling
    at = count
    while at > oldest and times[at - 1] > time + SAME_S:
        at -= 1
    if at == oldest:
        return oldest
    for row in range(count, at, -1):
        times[row], sensors[row] = times[row - 1], sensors[row - 1]
        for axis in range(len(model.axes)):
            values[row, axis] = values[row - 1, axis]
            for constant in range(len(model.constants)):
                couplings[row, axis, constant] = couplings[row - 1, axis, constant]
    write_reading(history, at, time, sensor, value, coupling)
    update_rows(model, history, at, count + 1)
    return at


@compiled(inner=True)
def write_prediction(
    states: tuple[int, ...],
    axes: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    row: int,
    of_position: FloatArray,
    noise: float,
    position: FloatArray,
    sd: FloatArray,
    index: int,
) -> None:
    """Writes the position predicted from a row, and its SD, into row `index` of `position` and `sd` (n, dimension).

    `of_position` (states,) is the position's row of the transition, `noise` its process noise in mm².
    """
    for axis in range(len(axes)):
        total, variance = 0.0, noise
        for state in range(len(states)):
            at = state * len(axes) + axis
            total += of_position[state] * mean[row, at]
            for other in range(len(states)):
                shared = covariance[row, at, other * len(axes) + axis]
                variance += of_position[state] * of_position[other] * shared
        position[index, axis], sd[index, axis] = total, np.sqrt(variance)


@compiled
def predict_position(model: Model, history: History, row: int, time: float) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (dimension,) of the position at `time`, predicted from the moments of a row."""
    mean, sd = np.empty((1, len(model.axes))), np.empty((1, len(model.axes)))
    of_position, dt = np.zeros(len(model.states)), max(time - history.time[row], 0.0)
    noise = position_step(model.motion, dt, history.adapted[row, JERK_PSD], of_position)
    write_prediction(model.states, model.axes, history.mean, history.covariance, row, of_position, noise, mean, sd, 0)
    return mean[0], sd[0]


@compiled(inner=True)
def oldest_needed(time: FloatArray, oldest: int, count: int, history_s: float) -> int:
    """The oldest row that a late reading may still be inserted after: the newest of those older than `history_s`."""
    since = time[count - 1] - history_s
    while oldest + 1 < count and time[oldest + 1] <= since:
        oldest += 1
    return oldest


@compiled
def insert_into_copy(
    model: Model,
    history: History,
    copy: History,
    time: float,
    sensor: int,
    value: FloatArray,
    coupling: FloatArray,
    history_s: float,
) -> int:
    """Copies `history` into `copy`, which has one row more, and inserts a reading there.

    Returns the oldest row that is still needed, or −1 where the reading came too late.
    """
    count, oldest = len(history.time), int(0)  # noqa: RUF046, UP018 - as in `event_replay.replay`
    copy_rows(history, copy, 0, count, 0)
    if insert(model, copy, oldest, count, time, sensor, value, coupling) == oldest:
        return -1
    return oldest_needed(copy.time, oldest, count + 1, history_s)
