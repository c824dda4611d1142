"""The data of the event-time filter: its constants (`Model`), and readings with the moments after each (`History`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.kalman.motion import Motion
from fusion_core.samples import FloatArray

IntArray = npt.NDArray[np.int64]

# Columns of History.adapted.
LOG_NOISE = 0  # log of the factor by which the variance of the accelerations is larger than stated
REJECTED = 1  # how many positions in a row the gate has rejected
JERK_PSD = 2  # in use where it is above the prior's
MEASURED_AT = 3  # when the newest acceleration was measured
SQUARED = 4  # squared innovation of the row's reading; 0 for an accelerometer
LOG_DETERMINANT = 5  # log determinant of the innovation's covariance; 0 for an accelerometer
MEASURED_JERK_PSD = 6
LOW_PASSED = 7  # the first of three columns: the accelerations of each axis, low-passed
ADAPTED = 10  # the number of columns

SAME_S = 1e-6  # readings this close were measured at once: the later to arrive counts as the later


class Model(NamedTuple):
    """What a fusion filter knows beforehand. Arrays of length `sensors` are in the order of the estimator's sensors.

    The contents of `states`, `axes` and `constants` mean nothing: they are tuples because the compiler knows a tuple's
    length, and loops of known length run five times as fast.
    """

    states: tuple[int, ...]  # per axis
    axes: tuple[int, ...]
    constants: tuple[int, ...]
    motion: Motion
    initial_covariance: FloatArray  # (states, states) of one axis, at the first position
    initial_constant_variance: FloatArray  # (constants,)
    constant_psd: FloatArray  # (constants,): of the random walk that each constant makes; 0 if it is truly constant
    operators: FloatArray  # (sensors, states): the weights of the sum of states that a sensor observes
    biased: npt.NDArray[np.bool_]  # (sensors,): accelerometers
    observes: npt.NDArray[np.bool_]  # (sensors, dimension): the axes it sees
    noise_variance: FloatArray  # (sensors,)
    gates: FloatArray  # (sensors,): the largest squared innovation that is accepted; infinite without a gate
    adaptation: float  # step of the accelerations' log variance per position; 0 keeps the variance as stated


class History(NamedTuple):
    """Readings in order of measurement, and the moments after each; only some rows may be in use.

    A row's mean holds the positions of all axes, then the velocities, and so on, then the constants: `size` values.
    """

    time: FloatArray  # (capacity,)
    sensor: IntArray  # (capacity,)
    value: FloatArray  # (capacity, dimension)
    coupling: FloatArray  # (capacity, dimension, constants): what each constant contributes to the reading
    mean: FloatArray  # (capacity, size)
    covariance: FloatArray  # (capacity, size, size)
    adapted: FloatArray  # (capacity, ADAPTED)


class Readings(NamedTuple):
    """Readings of all sensors in order of arrival; the fields are those of `History`."""

    time: FloatArray
    sensor: IntArray
    value: FloatArray
    coupling: FloatArray


def empty_history(capacity: int, dimension: int, constants: int, states: int) -> History:
    """A history with room for `capacity` readings; its values are not initialised."""
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


@compiled(inner=True)
def copy_rows(of: History, into: History, first: int, count: int, at: int) -> None:
    """The rows first:count of a history into another from row `at` on; or further up into the same.

    By single numbers: what copies a whole array also says which shapes do not fit, and that text takes longer to
    compile than the filter's correction.
    """
    for row in range(first, count):
        to = at + row - first
        into.time[to], into.sensor[to] = of.time[row], of.sensor[row]
        for axis in range(of.value.shape[1]):
            into.value[to, axis] = of.value[row, axis]
            for constant in range(of.coupling.shape[2]):
                into.coupling[to, axis, constant] = of.coupling[row, axis, constant]
        for state in range(of.mean.shape[1]):
            into.mean[to, state] = of.mean[row, state]
            for other in range(of.mean.shape[1]):
                into.covariance[to, state, other] = of.covariance[row, state, other]
        for fact in range(ADAPTED):
            into.adapted[to, fact] = of.adapted[row, fact]


@compiled(inner=True)
def write_reading(
    history: History, row: int, time: float, sensor: int, value: FloatArray, coupling: FloatArray
) -> None:
    """A reading into a row, whose moments are still to be computed."""
    history.time[row], history.sensor[row] = time, sensor
    for axis in range(len(value)):
        history.value[row, axis] = value[axis]
        for constant in range(coupling.shape[1]):
            history.coupling[row, axis, constant] = coupling[axis, constant]
