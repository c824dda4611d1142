"""The event-time Kalman path, compiled: readings taken in at the time they were measured, whenever they arrive.

Theory of operation
===================

A Kalman filter goes forward in time, and a tracker's frame arrives a tenth of a second after the accelerations that
were measured with it. So the filter keeps a short history: rows of readings by measurement time, each with the
moments (mean, covariance) after it was taken in. A reading that arrives late is put in at its place, and the rows
after it are computed again from there.

    measured   0.00   0.01   0.02   0.03  …  0.10   0.11
    sensor     imu    imu    imu    imu      imu    imu
                        ^
                        frame of 0.015 arrives at 0.115: a row here, and all rows after it once more (`take_in`)

State. For d axes the rows of mean and covariance are: position of all axes, velocity of all axes, acceleration of all
axes, …, then the constants that readings hold, such as a bias in the body's frame. The axes share one covariance
because constants couple them: a bias that is constant in the turning phone enters x, y and z of the tracker's frame
by `coupling`. Without constants the axes would be independent.

A row is computed from the row before and its own reading (`take_in`): moved on over dt (`_move_wiener`, or
`_move_anchored` for a motion that returns to a place), judged (`_judge`), corrected axis by axis (`_correct`), which
is allowed because the axes' noise is independent.

What the filter learns of its sensors stands in each row too (`adapted`), so that going back restores it: the log of
the accelerations' extra noise, the measured jerk, how many readings in a row were not believed. It is a function of
the rows before and of nothing else.

What must stay true. (1) A row depends on the row before it and on its own reading only: then inserting and going on
gives the same bits as taking everything in in order, and live, replay and simulation agree. (2) No row is dropped
before `history_s` has passed, or a late frame finds no place; it is counted then, not bent. (3) The covariance is
kept symmetric after each correction: without that, a last bit grows to 1e-7 mm within a minute. (4) `expect` moves on
from the newest row and changes nothing.

What may change. The motion (`Motion`), what is learnt of the sensors, the size of the history. Another state needs
its rows in `_observe` and `_correct`; lengths of tuples are what the compiler knows, and loops over them run five
times as fast.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.kalman.motion import Motion, add_wiener_noise, position_step, step
from fusion_core.samples import FloatArray

IntArray = npt.NDArray[np.int64]

# Columns of History.adapted.
_LOG_NOISE = 0  # log of the factor on the variance of the accelerations
_REJECTED = 1  # positions in a row that the gate has left out
JERK_PSD = 2  # what is used, where it is more than the prior says
_MEASURED_AT = 3  # when the newest acceleration was measured
SQUARED = 4  # squared innovation of the row's reading and log det of its variance; zeros for an accelerometer
LOG_DETERMINANT = 5
_MEASURED_JERK_PSD = 6
_LOW_PASSED = 7  # from here on: the accelerations, low-passed
ADAPTED = 10

SAME_S = 1e-6  # readings this close were measured at once: the later to arrive counts as the later
_LARGEST_SURPRISE = 3.0  # a squared innovation counts for no more, relative to what was expected
_LARGEST_LOG_NOISE = 14.0  # a thousand times the stated SD
_LOG_NOISE_OF_DOUBT = 3.0  # from here on the jerk is what the accelerations show
_LOW_PASS_S = 0.05
_JERK_HORIZON_S = 1.0
_REJECTED_IN_A_ROW = 3  # then the world has changed, and the reading is believed


class Model(NamedTuple):
    """A fusion filter's constants. Arrays are by sensor, in the order of the estimator's sensors.

    `states`, `axes` and `constants` are tuples for their lengths alone, which the compiler then knows: its loops over
    them run five times as fast.
    """

    states: tuple[int, ...]  # per axis
    axes: tuple[int, ...]
    constants: tuple[int, ...]
    motion: Motion
    initial_covariance: FloatArray  # (states, states) of one axis, at the first position
    initial_constant_variance: FloatArray  # (constants,)
    constant_psd: FloatArray  # (constants,): each is a random walk, if a slow one
    operators: FloatArray  # (sensors, states): the sum of states that a sensor observes
    biased: npt.NDArray[np.bool_]  # (sensors,): accelerometers
    observes: npt.NDArray[np.bool_]  # (sensors, dimension): the axes it sees
    noise_variance: FloatArray  # (sensors,)
    gates: FloatArray  # (sensors,): the largest squared innovation believed; infinite without a gate
    adaptation: float  # per reading, of the log variance of accelerations; 0 keeps it as stated


class History(NamedTuple):
    """Readings by measurement time and what is known after each; the first `count` rows are in use."""

    time: FloatArray  # (capacity,)
    sensor: IntArray  # (capacity,)
    value: FloatArray  # (capacity, dimension)
    coupling: FloatArray  # (capacity, dimension, constants): how far each constant enters the reading
    mean: FloatArray  # (capacity, size)
    covariance: FloatArray  # (capacity, size, size)
    adapted: FloatArray  # (capacity, ADAPTED)


class Readings(NamedTuple):
    """Readings of all sensors in order of arrival, as in `History`."""

    time: FloatArray
    sensor: IntArray
    value: FloatArray
    coupling: FloatArray


def empty_history(capacity: int, dimension: int, constants: int, states: int) -> History:
    """Room for `capacity` readings."""
    size = states * dimension + constants
    return History(
        np.empty(capacity),
        np.empty(capacity, np.int64),
        np.empty((capacity, dimension)),
        np.empty((capacity, dimension, constants)),
        np.empty((capacity, size)),
        np.empty((capacity, size, size)),
        np.empty((capacity, ADAPTED)),
    )


@compiled
def _less_constants(model: Model, coupling: FloatArray, covariance: FloatArray) -> None:
    """The first position less the constants it holds: what is unknown of these is unknown of it.

    So it is of the constant that an anchored motion returns to, which is the position less the motion.
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
    """The moments at the first position, which stands in row 0."""
    states, dimension = len(model.states), len(model.axes)
    mean, covariance = history.mean[0], history.covariance[0]
    mean[:], covariance[:], history.adapted[0] = 0.0, 0.0, 0.0
    history.adapted[0, _MEASURED_AT] = np.nan
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
    _less_constants(model, history.coupling[0], covariance)


@compiled
def _move_wiener(
    axes: tuple[int, ...],
    constants: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    row: int,
    dt: float,
    density: float,
) -> None:
    """F m and F P Fᵀ + Q for a Wiener process, from the row before into a row."""
    dimension, size, half = len(axes), 3 * len(axes) + len(constants), dt * dt / 2.0
    for state in range(size):
        mean[row, state] = mean[row - 1, state]
    for axis in range(dimension):
        speed, rate = dimension + axis, 2 * dimension + axis
        mean[row, axis] += dt * mean[row, speed] + half * mean[row, rate]
        mean[row, speed] += dt * mean[row, rate]
        for column in range(size):
            of_speed, of_rate = covariance[row - 1, speed, column], covariance[row - 1, rate, column]
            covariance[row, axis, column] = covariance[row - 1, axis, column] + dt * of_speed + half * of_rate
            covariance[row, speed, column] = of_speed + dt * of_rate
            covariance[row, rate, column] = of_rate
    for constant in range(3 * dimension, size):
        for column in range(size):
            covariance[row, constant, column] = covariance[row - 1, constant, column]
    for line in range(size):
        for axis in range(dimension):
            speed, rate = dimension + axis, 2 * dimension + axis
            of_rate = covariance[row, line, rate]
            covariance[row, line, axis] += dt * covariance[row, line, speed] + half * of_rate
            covariance[row, line, speed] += dt * of_rate
    for axis in range(dimension):
        add_wiener_noise(density, dt, covariance[row], dimension, axis)


@compiled
def whole_step(motion: Motion, dimension: int, size: int, dt: float, density: float) -> tuple[FloatArray, FloatArray]:
    """Transition and process noise of all states of all axes over `dt` seconds, (size, size); constants stay."""
    states = len(motion.stationary)
    one, noise = np.empty((states, states)), np.empty((states, states))
    step(motion, dt, density, one, noise)
    transition, added = np.eye(size), np.zeros((size, size))
    for axis in range(dimension):
        for state in range(states):
            for other in range(states):
                transition[state * dimension + axis, other * dimension + axis] = one[state, other]
                added[state * dimension + axis, other * dimension + axis] = noise[state, other]
    return transition, added


@compiled
def _move_anchored(
    motion: Motion, dimension: int, mean: FloatArray, covariance: FloatArray, row: int, dt: float, density: float
) -> None:
    """The same for a process that returns to a constant, by whole matrices."""
    transition, noise = whole_step(motion, dimension, mean.shape[1], dt, density)
    mean[row] = transition @ mean[row - 1]
    covariance[row] = transition @ covariance[row - 1] @ transition.T + noise


@compiled
def _observe(
    states: tuple[int, ...],
    axes: tuple[int, ...],
    constants: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    coupling: FloatArray,
    row: int,
    operators: FloatArray,
    sensor: int,
    axis: int,
    column: FloatArray,
) -> tuple[float, float]:
    """Covariance of one axis of a reading with the state, into `column`; the reading's own variance and mean.

    Plain arrays rather than structures and views, which are slow to hand on, since this is the innermost step.
    `coupling` is all zeros for a sensor without any.
    """
    dimension, first_constant = len(axes), len(states) * len(axes)
    expected, variance = 0.0, 0.0
    for other in range(first_constant + len(constants)):
        total = 0.0
        for constant in range(len(constants)):
            total += coupling[row, axis, constant] * covariance[row, first_constant + constant, other]
        for state in range(len(states)):
            total += operators[sensor, state] * covariance[row, state * dimension + axis, other]
        column[other] = total
    for constant in range(len(constants)):
        expected += coupling[row, axis, constant] * mean[row, first_constant + constant]
        variance += coupling[row, axis, constant] * column[first_constant + constant]
    for state in range(len(states)):
        expected += operators[sensor, state] * mean[row, state * dimension + axis]
        variance += operators[sensor, state] * column[state * dimension + axis]
    return variance, expected


@compiled
def _correct(
    states: tuple[int, ...],
    axes: tuple[int, ...],
    constants: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    row: int,
    column: FloatArray,
    precision: float,
    innovation: float,
) -> None:
    """One axis of a reading taken in. The covariance is kept symmetric: what is not would grow from round-off."""
    size = len(states) * len(axes) + len(constants)
    for state in range(size):
        gain = column[state] * precision
        mean[row, state] += gain * innovation
        for other in range(state + 1):
            both = (covariance[row, state, other] + covariance[row, other, state]) / 2.0 - gain * column[other]
            covariance[row, state, other] = covariance[row, other, state] = both


@compiled
def _squared_innovation(
    states: tuple[int, ...],
    axes: tuple[int, ...],
    constants: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    coupling: FloatArray,
    row: int,
    operators: FloatArray,
    observes: npt.NDArray[np.bool_],
    sensor: int,
    value: FloatArray,
    noise_variance: float,
    column: FloatArray,
) -> tuple[float, int, float]:
    """νᵀS⁻¹ν of a reading before it is taken in, how many axes it has, and log det S."""
    dimension, seen = len(axes), 0
    innovation, variance = np.zeros(dimension), np.eye(dimension)
    for axis in range(dimension):
        if not observes[sensor, axis]:
            continue
        seen += 1
        own, expected = _observe(
            states, axes, constants, mean, covariance, coupling, row, operators, sensor, axis, column
        )
        innovation[axis] = value[row, axis] - expected
        variance[axis, axis] = own + noise_variance
        for other in range(axis):
            if observes[sensor, other]:
                variance[axis, other] = 0.0
                for state in range(len(states)):
                    variance[axis, other] += operators[sensor, state] * column[state * dimension + other]
                for constant in range(len(constants)):
                    variance[axis, other] += coupling[row, other, constant] * column[len(states) * dimension + constant]
    squared, log_determinant = _whitened(innovation, variance)
    return squared, seen, log_determinant


@compiled
def _whitened(innovation: FloatArray, variance: FloatArray) -> tuple[float, float]:
    """νᵀS⁻¹ν and log det S, by Cholesky's factor of the lower triangle of `variance`, in place."""
    squared, log_determinant = 0.0, 0.0
    for row in range(len(innovation)):
        for column in range(row + 1):
            rest = variance[row, column]
            for k in range(column):
                rest -= variance[row, k] * variance[column, k]
            variance[row, column] = np.sqrt(rest) if row == column else rest / variance[column, column]
        rest = innovation[row]
        for k in range(row):
            rest -= variance[row, k] * innovation[k]
        innovation[row] = rest / variance[row, row]
        squared += innovation[row] ** 2
        log_determinant += 2.0 * np.log(variance[row, row])
    return squared, log_determinant


@compiled
def _measure_jerk(
    axes: tuple[int, ...],
    adapted: FloatArray,
    row: int,
    time: float,
    value: FloatArray,
    noise_variance: float,
    least: float,
) -> None:
    """How fast accelerations change: a Wiener process runs ahead of its low-pass of τ by a variance of q·τ/2.

    That is believed as far as positions surprise: a smooth motion, however fast, is foretold without it.
    """
    dt = time - adapted[row, _MEASURED_AT]
    adapted[row, _MEASURED_AT] = time
    if np.isnan(dt):
        for axis in range(len(axes)):
            adapted[row, _LOW_PASSED + axis] = value[row, axis]
    else:
        share, squared = dt / (dt + _LOW_PASS_S), 0.0
        for axis in range(len(axes)):
            ahead = value[row, axis] - adapted[row, _LOW_PASSED + axis]
            squared += ahead * ahead
            adapted[row, _LOW_PASSED + axis] += share * ahead
        density = 2.0 / _LOW_PASS_S * (squared / len(axes) - noise_variance)
        measured = adapted[row, _MEASURED_JERK_PSD]
        measured += dt / (dt + _JERK_HORIZON_S) * (density - measured)
        adapted[row, _MEASURED_JERK_PSD] = measured
        share = min(adapted[row, _LOG_NOISE] / _LOG_NOISE_OF_DOUBT, 1.0)
        adapted[row, JERK_PSD] = least * (max(measured, least) / least) ** share if share > 0.0 else least


@compiled
def _judge(adapted: FloatArray, row: int, squared: float, seen: int, gate: float, adaptation: float) -> bool:
    """Is a reading believed? Its surprise tells how far the accelerations can be trusted."""
    rejected = adapted[row, _REJECTED]
    believed = squared <= gate or rejected >= _REJECTED_IN_A_ROW
    adapted[row, _REJECTED] = 0.0 if believed else rejected + 1.0
    if believed or rejected > 0.0:  # a single stray reading says nothing of the accelerations
        log_noise = adapted[row, _LOG_NOISE] + adaptation * (min(squared / seen, _LARGEST_SURPRISE) - 1.0)
        adapted[row, _LOG_NOISE] = min(max(log_noise, 0.0), _LARGEST_LOG_NOISE)
    return believed


@compiled
def take_in(model: Model, history: History, first: int, count: int) -> None:
    """The moments of the rows from `first` on, each from those of the row before and its reading.

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
            _move_anchored(motion, len(axes), mean, covariance, row, dt, density)
        else:
            _move_wiener(axes, constants, mean, covariance, row, dt, density)
        for constant in range(len(constants)):
            at = len(states) * len(axes) + constant
            covariance[row, at, at] += constant_psd[constant] * dt
        for fact in range(ADAPTED):
            adapted[row, fact] = adapted[row - 1, fact]
        adapted[row, SQUARED], adapted[row, LOG_DETERMINANT] = 0.0, 0.0
        noise_variance, believed = noise_variances[sensor], True
        if not biased[sensor]:
            squared, seen, log_determinant = _squared_innovation(
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
            believed = _judge(adapted, row, squared, seen, gates[sensor], adaptation)
        elif adaptation > 0.0:
            _measure_jerk(axes, adapted, row, time[row], value, noise_variance, max(least_jerk_psd, 1.0))
            if adapted[row, _LOG_NOISE] > 0.0:
                noise_variance *= np.exp(adapted[row, _LOG_NOISE])
        for axis in range(len(axes) if believed else 0):  # one after the other, since their noise is independent
            if observes[sensor, axis]:
                variance, expected = _observe(
                    states, axes, constants, mean, covariance, coupling, row, operators, sensor, axis, column
                )
                innovation, precision = value[row, axis] - expected, 1.0 / (variance + noise_variance)
                _correct(states, axes, constants, mean, covariance, row, column, precision, innovation)


@compiled
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
    """A reading put among the rows from `oldest` to `count`, at its time, and what came after gone through again.

    Returns where it went, or `oldest` if it was measured before that row and so came too late.
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
    times[at], sensors[at] = time, sensor
    for axis in range(len(model.axes)):
        values[at, axis] = value[axis]
        for constant in range(len(model.constants)):
            couplings[at, axis, constant] = coupling[axis, constant]
    take_in(model, history, at, count + 1)
    return at


@compiled
def write_expected(
    states: tuple[int, ...],
    axes: tuple[int, ...],
    mean: FloatArray,
    covariance: FloatArray,
    row: int,
    of_position: FloatArray,
    noise: float,
    found: FloatArray,
    sd: FloatArray,
    index: int,
) -> None:
    """Writes position and SD into row `index` of `found` and `sd`, by the position's row of a transition."""
    for axis in range(len(axes)):
        total, variance = 0.0, noise
        for state in range(len(states)):
            at = state * len(axes) + axis
            total += of_position[state] * mean[row, at]
            for other in range(len(states)):
                shared = covariance[row, at, other * len(axes) + axis]
                variance += of_position[state] * of_position[other] * shared
        found[index, axis], sd[index, axis] = total, np.sqrt(variance)


@compiled
def expect(model: Model, history: History, row: int, time: float) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (dimension,) of the position at `time`, from the moments of a row."""
    mean, sd = np.empty((1, len(model.axes))), np.empty((1, len(model.axes)))
    of_position, dt = np.zeros(len(model.states)), max(time - history.time[row], 0.0)
    noise = position_step(model.motion, dt, history.adapted[row, JERK_PSD], of_position)
    write_expected(model.states, model.axes, history.mean, history.covariance, row, of_position, noise, mean, sd, 0)
    return mean[0], sd[0]


@compiled
def oldest_needed(time: FloatArray, oldest: int, count: int, history_s: float) -> int:
    """The row whose moments a reading may still build on: the newest of those older than the history."""
    since = time[count - 1] - history_s
    while oldest + 1 < count and time[oldest + 1] <= since:
        oldest += 1
    return oldest


@compiled
def inserted(
    model: Model,
    history: History,
    room: History,
    time: float,
    sensor: int,
    value: FloatArray,
    coupling: FloatArray,
    history_s: float,
) -> int:
    """`history` copied into `room`, which has one row more, with one more reading.

    Returns the oldest row that is still needed; −1 where the reading came too late.
    """
    count = at = len(history.time)
    while at > 0 and history.time[at - 1] > time + SAME_S:
        at -= 1
    room.time[:count], room.sensor[:count] = history.time, history.sensor
    room.value[:count], room.coupling[:count] = history.value, history.coupling
    room.mean[:at], room.covariance[:at], room.adapted[:at] = (
        history.mean[:at],
        history.covariance[:at],
        history.adapted[:at],
    )
    if insert(model, room, 0, count, time, sensor, value, coupling) == 0:
        return -1
    return oldest_needed(room.time, 0, count + 1, history_s)
