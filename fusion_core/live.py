"""Estimators in a running loop, compiled: what is shown at an instant, from the readings that have arrived by then.

A loop, whether a simulation or a live study, uses this module and none of the estimators' compiled steps:

- `live(estimator, names, readings, rotation, instants)` makes an estimator ready, once the times of all readings are
  known, as they are in a simulation; `show` then writes what is displayed at an instant and may be called from compiled
  code. It calls the very steps that `replay` calls, so a replay of the log gives what was displayed to the last bits.
- Where readings come one by one, as in a live study, use the estimator's `start`, `update` and `predict`
  (`fusion_core.estimator.Estimator`), which give the same. So does an estimator that has no compiled form here.

What may change: `Live` and its parts are private to this module. What must not: `show` takes readings in order of
arrival, and none that arrives after the instant, or a display would know the future.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.estimator import Estimator
from fusion_core.filters import Raw
from fusion_core.kalman import position_steps
from fusion_core.kalman.event_history import History, Model
from fusion_core.kalman.event_replay import insert_reading
from fusion_core.kalman.event_steps import predict_position
from fusion_core.kalman.event_time import EventTime
from fusion_core.kalman.fusion import FusionKalman
from fusion_core.kalman.position import PositionKalman
from fusion_core.samples import FloatArray, Samples
from fusion_core.window import weights as window_weights
from fusion_core.window.gp import Schedule, WindowGP
from fusion_core.window.kernels import IntArray

_RAW, _POSITION_KALMAN, _WINDOW, _EVENT_TIME = 0, 1, 2, 3
_UPCOMING, _OLDEST, _COUNT = 0, 1, 2


class Kalman(NamedTuple):
    """The position-only filter: its parameters, and its moments: mean (3, d) and covariance (3, 3)."""

    noise_variance: float
    initial_sd: tuple[float, float]
    jerk_psd_mm2_s5: float
    ahead_s: float
    mean: FloatArray
    covariance: FloatArray


class EventPath(NamedTuple):
    """The event-time filter, its history, and its readings in order of arrival."""

    model: Model
    history: History
    history_s: float
    is_frame: npt.NDArray[np.bool_]
    sensor: IntArray
    row: IntArray
    time: FloatArray
    arrival: FloatArray
    coupling: FloatArray


class Live(NamedTuple):
    """One estimator of any kind. Compiled code needs every field, so those of the other kinds hold unused defaults."""

    kind: int
    at: IntArray  # upcoming reading; of the event path the oldest row and the count of rows
    kalman: Kalman
    window: Schedule
    event: EventPath


class Readings(NamedTuple):
    """What the sensors have read so far, one row per reading; times (n,) in s since the session's origin.

    Times are known beforehand; the loop fills in the values (n, d) as they are measured.
    """

    frame_time: FloatArray
    frame_arrival: FloatArray
    frame_mm: FloatArray
    force_time: FloatArray
    force_arrival: FloatArray
    force_mm_s2: FloatArray


@compiled(inner=True, inline="always")
def show(live: Live, readings: Readings, instants: FloatArray, index: int, shown: FloatArray) -> None:
    """Writes the position displayed at `instants[index]` into `shown[index]` (d,) in mm; NaN before the first frame."""
    if live.kind == _WINDOW:
        _show_window(live.window, readings, instants[index], index, shown[index])
    elif live.kind == _EVENT_TIME:
        _show_event_time(live, readings, instants[index], shown[index])
    else:
        _show_position(live, readings, instants[index], shown[index])


@compiled
def _show_position(live: Live, readings: Readings, now: float, shown: FloatArray) -> None:
    """Writes the newest frame (d,), as it is or filtered."""
    kalman, arrival = live.kalman, readings.frame_arrival
    upcoming = live.at[_UPCOMING]
    while upcoming < len(arrival) and arrival[upcoming] <= now:
        if live.kind == _POSITION_KALMAN:
            value = readings.frame_mm[upcoming]
            if upcoming == 0:
                mean, covariance = position_steps.begin(
                    value, kalman.noise_variance, kalman.initial_sd[0], kalman.initial_sd[1]
                )
            else:
                dt = arrival[upcoming] - arrival[upcoming - 1]
                mean, covariance = position_steps.predict(kalman.mean, kalman.covariance, dt, kalman.jerk_psd_mm2_s5)
                position_steps.correct(mean, covariance, value, kalman.noise_variance)
            for row in range(3):
                _copy(mean[row], kalman.mean[row])
                _copy(covariance[row], kalman.covariance[row])
        upcoming += 1
    live.at[_UPCOMING] = upcoming
    if upcoming == 0:
        shown[:] = np.nan
    elif live.kind == _RAW:
        _copy(readings.frame_mm[upcoming - 1], shown)
    else:
        dt = max(now - arrival[upcoming - 1], 0.0) + kalman.ahead_s
        _copy(position_steps.predict_position(kalman.mean, kalman.covariance, dt, kalman.jerk_psd_mm2_s5)[0], shown)


@compiled
def _show_window(window: Schedule, readings: Readings, now: float, index: int, shown: FloatArray) -> None:
    """Writes the weighted sum over the window; the weights depend on times alone."""
    first, last = window.spans[0, index], window.spans[1, index]
    begin, end = window.spans[2, index], window.spans[3, index]
    positions, others = last - first, end - begin
    if positions == 0:
        shown[:] = np.nan
        return
    regular = window.which[index] >= 0
    if regular:
        weights = window.weights[window.which[index]]
    else:
        time, sensor = np.empty((1, positions + others)), np.empty(positions + others, np.int64)
        for row in range(positions):
            time[0, row], sensor[row] = readings.frame_time[first + row], window.sensors[0]
        for row in range(others):
            time[0, positions + row], sensor[positions + row] = readings.force_time[begin + row], window.sensors[1]
        weights = window_weights.gains(window.prior, time, np.array([now]), sensor)[0][0]
    for axis in range(len(shown)):
        origin = 0.0 if regular or window.prior.mean == window_weights.ZERO else readings.frame_mm[last - 1, axis]
        total = origin
        for row in range(positions):
            total += weights[row] * (readings.frame_mm[first + row, axis] - origin)
        for row in range(others):
            total += weights[positions + row] * readings.force_mm_s2[begin + row, axis]
        shown[axis] = total


@compiled
def _show_event_time(live: Live, readings: Readings, now: float, shown: FloatArray) -> None:
    """Inserts all readings that have arrived, and writes the position predicted from the newest moments."""
    event, upcoming, span = live.event, live.at[_UPCOMING], (live.at[_OLDEST], live.at[_COUNT])
    while upcoming < len(event.arrival) and event.arrival[upcoming] <= now:
        row = event.row[upcoming]
        value = readings.frame_mm[row] if event.is_frame[upcoming] else readings.force_mm_s2[row]
        time, sensor, coupling = event.time[upcoming], event.sensor[upcoming], event.coupling[upcoming]
        span = insert_reading(event.model, event.history, span, time, sensor, value, coupling, event.history_s)
        upcoming += 1
    live.at[_UPCOMING], live.at[_OLDEST], live.at[_COUNT] = upcoming, span[0], span[1]
    if span[1] == 0:
        shown[:] = np.nan
        return
    _copy(predict_position(event.model, event.history, span[1] - 1, now)[0], shown)


@compiled
def _copy(values: FloatArray, into: FloatArray) -> None:
    """Element by element: an assignment of slices takes long to compile, for the message about unlike shapes."""
    for index in range(len(values)):
        into[index] = values[index]


def live(
    estimator: Estimator, names: tuple[str, str], readings: Readings, rotation: FloatArray, instants: FloatArray
) -> Live | None:
    """An estimator ready to run; None where it has no compiled form. `names` are those of tracker and phone.

    Only the times of `readings` and the phone's `rotation` (n, d, 3) are looked at.
    """
    if not set(estimator.sensors) <= set(names) or names[0] not in estimator.sensors:
        return None
    kinds = {Raw: _RAW, PositionKalman: _POSITION_KALMAN, WindowGP: _WINDOW, FusionKalman: _EVENT_TIME}
    kind = kinds.get(type(estimator))
    if kind is None or (isinstance(estimator, FusionKalman) and estimator.path != "event_time"):
        return None
    both = dict(estimator.sensors)
    window = estimator if isinstance(estimator, WindowGP) else WindowGP({names[0]: both[names[0]]})
    fusion = estimator if isinstance(estimator, FusionKalman) else FusionKalman({names[0]: both[names[0]]})
    kalman = estimator if isinstance(estimator, PositionKalman) else PositionKalman({names[0]: both[names[0]]})
    samples = _samples(readings, names, rotation)
    nothing = np.empty(0) if kind != _WINDOW else instants
    return Live(
        kind,
        np.zeros(3, np.int64),
        _kalman(kalman, both[names[0]].noise_sd, readings.frame_mm.shape[1]),
        window.schedule({name: samples[name] for name in window.sensors}, nothing),
        _event_path(fusion.event_time, names, samples if kind == _EVENT_TIME else {}),
    )


def _samples(readings: Readings, names: tuple[str, str], rotation: FloatArray) -> dict[str, Samples]:
    """The readings to come; each value is the number of its row, by which the real value is looked up later."""

    def numbered(count: int, like: FloatArray) -> FloatArray:
        return np.repeat(np.arange(count, dtype=np.float64)[:, None], like.shape[1], axis=1)

    frames = Samples(readings.frame_time, readings.frame_arrival, numbered(len(readings.frame_time), readings.frame_mm))
    forces = numbered(len(readings.force_time), readings.force_mm_s2)
    return {names[0]: frames, names[1]: Samples(readings.force_time, readings.force_arrival, forces, rotation)}


def _kalman(estimator: PositionKalman, noise_sd_mm: float, dimension: int) -> Kalman:
    return Kalman(
        float(noise_sd_mm) ** 2,
        (float(estimator.initial_speed_sd_mm_s), float(estimator.initial_acceleration_sd_mm_s2)),
        float(estimator.jerk_psd_mm2_s5),
        float(estimator.ahead_s),
        np.zeros((3, dimension)),
        np.zeros((3, 3)),
    )


def _event_path(path: EventTime, names: tuple[str, str], samples: dict[str, Samples]) -> EventPath:
    used = {name: stream for name, stream in samples.items() if name in path.sensors}
    rows, arrival, history = path.in_order(used)
    order = list(path.sensors)
    return EventPath(
        path.model,
        history,
        float(path.history_s),
        rows.sensor == order.index(names[0]),
        rows.sensor,
        rows.value[:, 0].astype(np.int64),
        rows.time,
        arrival,
        rows.coupling,
    )
