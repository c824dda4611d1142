"""The door for a loop that runs: what an estimator shows at an instant, from what has arrived by then, compiled.

Who runs a loop, a simulation or a live study, needs none of the estimators' compiled steps:

- `live(estimator, names, readings, rotation, instants)` makes an estimator ready, once the times of all readings are
  known, as they are in a simulation; `show` then writes what is displayed at an instant and may be called from compiled
  code. It calls the very steps that `replay` calls, so a replay of the log gives what was displayed to the last bits.
- Where readings come one by one, as in a live study, `start`, `update` and `predict` of the estimator do the same, a
  reading at a time (`fusion_core.estimator.Estimator`). So does an estimator that has no compiled form here.

What may change: `Live` and its parts are the door's own, and nobody else looks into them. What must not: `show` takes
readings in by arrival and none that arrives after the instant, or a display would know the future.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fusion_core.compilation import compiled
from fusion_core.estimator import Estimator
from fusion_core.filters import Raw
from fusion_core.kalman import position_steps
from fusion_core.kalman.event_replay import arrive
from fusion_core.kalman.event_steps import History, Model, expect
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
    """The position-only filter and its moments."""

    noise_variance: float
    initial_sd: tuple[float, float]
    jerk_psd_mm2_s5: float
    ahead_s: float
    mean: FloatArray
    covariance: FloatArray


class EventPath(NamedTuple):
    """The event-time filter, its room, and its readings in the order in which they arrive."""

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
    """One estimator of whichever kind; the parts of the others are there for their types alone."""

    kind: int
    at: IntArray  # upcoming reading; of the event path the oldest row and the count of rows
    kalman: Kalman
    window: Schedule
    event: EventPath


class Readings(NamedTuple):
    """What the sensors have read so far, a row a reading, in s since the session's origin; values are filled in."""

    frame_time: FloatArray
    frame_arrival: FloatArray
    frame_mm: FloatArray
    force_time: FloatArray
    force_arrival: FloatArray
    force_mm_s2: FloatArray


@compiled
def show(live: Live, readings: Readings, instants: FloatArray, index: int, shown: FloatArray) -> None:
    """Writes what is displayed at an instant into its row of `shown`; NaN before there is anything to show."""
    if live.kind == _WINDOW:
        _show_window(live.window, readings, instants[index], index, shown[index])
    elif live.kind == _EVENT_TIME:
        _show_event_time(live, readings, instants[index], shown[index])
    else:
        _show_position(live, readings, instants[index], shown[index])


@compiled
def _show_position(live: Live, readings: Readings, now: float, shown: FloatArray) -> None:
    """The newest frame, held or filtered."""
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
                mean, covariance = position_steps.moved(kalman.mean, kalman.covariance, dt, kalman.jerk_psd_mm2_s5)
                position_steps.correct(mean, covariance, value, kalman.noise_variance)
            kalman.mean[:], kalman.covariance[:] = mean, covariance
        upcoming += 1
    live.at[_UPCOMING] = upcoming
    if upcoming == 0:
        shown[:] = np.nan
    elif live.kind == _RAW:
        shown[:] = readings.frame_mm[upcoming - 1]
    else:
        dt = max(now - arrival[upcoming - 1], 0.0) + kalman.ahead_s
        shown[:] = position_steps.ahead(kalman.mean, kalman.covariance, dt, kalman.jerk_psd_mm2_s5)[0]


@compiled
def _show_window(window: Schedule, readings: Readings, now: float, index: int, shown: FloatArray) -> None:
    """The weighted sum over the window: weights depend on times alone."""
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
    """All that has arrived taken in at its time, and the newest moments moved on to now."""
    event, upcoming, span = live.event, live.at[_UPCOMING], (live.at[_OLDEST], live.at[_COUNT])
    while upcoming < len(event.arrival) and event.arrival[upcoming] <= now:
        row = event.row[upcoming]
        value = readings.frame_mm[row] if event.is_frame[upcoming] else readings.force_mm_s2[row]
        time, sensor, coupling = event.time[upcoming], event.sensor[upcoming], event.coupling[upcoming]
        span = arrive(event.model, event.history, span, time, sensor, value, coupling, event.history_s)
        upcoming += 1
    live.at[_UPCOMING], live.at[_OLDEST], live.at[_COUNT] = upcoming, span[0], span[1]
    if span[1] == 0:
        shown[:] = np.nan
        return
    shown[:] = expect(event.model, event.history, span[1] - 1, now)[0]


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
    """The readings to come, whose values are the number of their row."""

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
    rows, arrival, room = path.in_order({name: one for name, one in samples.items() if name in path.sensors})
    order = list(path.sensors)
    return EventPath(
        path.model,
        room,
        float(path.history_s),
        rows.sensor == order.index(names[0]),
        rows.sensor,
        rows.value[:, 0].astype(np.int64),
        rows.time,
        arrival,
        rows.coupling,
    )
