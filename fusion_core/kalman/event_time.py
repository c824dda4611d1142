"""The event-time path of Kalman fusion: every reading is used at the time it was measured, whenever it arrives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fusion_core.estimator import unknown
from fusion_core.kalman import event_replay, event_steps, smoothing_steps
from fusion_core.kalman.event_history import History, Model, Readings, empty_history
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, position_sensor

_COMPILED: set[tuple[int, ...]] = set()  # the signatures that this process has compiled or loaded from the cache


@dataclass(frozen=True)
class Recent:
    """The recent readings with the moments after each.

    `waiting` are readings that arrived before the first position, `too_late` counts those left out as too late.
    """

    history: History | None = None
    waiting: tuple[tuple[str, Sample], ...] = ()
    too_late: int = 0


@dataclass(frozen=True)
class EventTime:
    """The filter over a history of readings. `in_body_frame`: the bias is constant in the phone's frame."""

    sensors: Mapping[str, Sensor]
    model: Model
    in_body_frame: bool
    history_s: float

    @property
    def dimension(self) -> int:
        """The number of the position's axes."""
        return len(self.model.axes)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.sensors)}

    def _coupling(self, name: str, rotation: FloatArray | None) -> FloatArray:
        """How the bias enters one reading (d, constants) or n readings (n, d, constants): rotated, or not at all."""
        if not self.model.biased[self._index[name]]:
            return self._no_coupling
        if rotation is None or not self.in_body_frame:
            return self._unrotated
        return np.ascontiguousarray(rotation)

    @cached_property
    def _no_coupling(self) -> FloatArray:
        return np.zeros((self.dimension, len(self.model.constants)))

    @cached_property
    def _unrotated(self) -> FloatArray:
        return np.eye(self.dimension, len(self.model.constants))

    def _empty_history(self, capacity: int) -> History:
        return empty_history(capacity, self.dimension, len(self.model.constants), len(self.model.states))

    def _on_all_axes(self, name: str, value: FloatArray) -> FloatArray:
        """A sensor's values (…, d) with those of the axes it sees in their places, and zeros elsewhere."""
        sensor = self.sensors[name]
        if sensor.axes is None:
            return np.ascontiguousarray(value, dtype=np.float64)
        whole = np.zeros((*value.shape[:-1], self.dimension))
        whole[..., list(sensor.axes)] = value
        return whole

    def start(self) -> Recent:
        """The state before any reading. The steps are compiled now, so that no reading waits for the compiler."""
        if self._signature not in _COMPILED:
            _COMPILED.add(self._signature)
            self._compile()
        return Recent()

    @property
    def _signature(self) -> tuple[int, ...]:
        """The sizes that compiled code depends on."""
        return len(self.model.states), len(self.model.axes), len(self.model.constants)

    def _compile(self) -> None:
        """Calls each step once."""
        history = self._empty_history(1)
        history.time[0] = history.sensor[0] = 0
        value, coupling = np.zeros(self.dimension), np.zeros((self.dimension, len(self.model.constants)))
        history.value[0], history.coupling[0] = value, coupling
        event_steps.begin(self.model, history)
        event_steps.insert_into_copy(
            self.model, history, self._empty_history(2), 0.01, 0, value, coupling, self.history_s
        )
        event_steps.predict_position(self.model, history, 0, 0.01)

    def update(self, state: Recent, sensor: str, sample: Sample) -> Recent:
        """The state with the reading inserted in order of measurement; later readings are processed again."""
        if state.history is None:
            return self._first(state, sensor, sample)
        return self._next(state, state.history, sensor, sample)

    def _next(self, state: Recent, history: History, sensor: str, sample: Sample) -> Recent:
        room, index = self._empty_history(len(history.time) + 1), self._index[sensor]
        value, coupling = self._on_all_axes(sensor, sample.value), self._coupling(sensor, sample.rotation)
        oldest = event_steps.insert_into_copy(
            self.model, history, room, sample.time, index, value, coupling, self.history_s
        )
        if oldest < 0:
            return replace(state, too_late=state.too_late + 1)
        return Recent(History._make([column[oldest:] for column in room]), (), state.too_late)

    def _first(self, state: Recent, sensor: str, sample: Sample) -> Recent:
        """Starts at the first position; readings that arrive before it wait."""
        if sensor != position_sensor(self.sensors):
            waiting = [w for w in state.waiting if w[1].time > sample.time - self.history_s]
            return Recent(None, (*waiting, (sensor, sample)), state.too_late)
        first = self._empty_history(1)
        first.time[0], first.sensor[0] = sample.time, self._index[sensor]
        first.value[0], first.coupling[0] = sample.value, self._coupling(sensor, sample.rotation)
        event_steps.begin(self.model, first)
        started = Recent(first, (), state.too_late)
        for name, reading in state.waiting:
            if reading.time > sample.time:
                started = self.update(started, name, reading)
        return started

    def predict(self, state: Recent, time: float) -> tuple[FloatArray, FloatArray]:
        """Mean and SD (d,) of the position at `time`, predicted from the newest moments."""
        if state.history is None:
            return unknown(self.dimension)
        moments: tuple[FloatArray, FloatArray] = event_steps.predict_position(
            self.model, state.history, len(state.history.time) - 1, time
        )
        return moments

    def newest_constants(self, state: Recent) -> tuple[FloatArray, FloatArray] | None:
        """Mean (constants,) and covariance (constants, constants) of the constants; None before the first position."""
        if state.history is None:
            return None
        begins = len(self.model.states) * self.dimension
        return state.history.mean[-1, begins:], state.history.covariance[-1, begins:, begins:]

    def replay(self, samples: Mapping[str, Samples], times: FloatArray, lag_s: float = 0.0) -> Track:
        """The same steps in one compiled loop; with `lag_s` above 0, of the position `lag_s` before each time."""
        if lag_s > 0.0:
            return Track(times, *self._run_late(samples, times, lag_s))
        biases = len(self.model.constants)
        nothing = np.empty((0, biases)), np.empty((0, biases, biases))
        return Track(times, *self._run(*self._readings(samples), times, nothing))

    def _run_late(
        self, samples: Mapping[str, Samples], times: FloatArray, lag_s: float
    ) -> tuple[FloatArray, FloatArray]:
        order = np.argsort(times, kind="stable")
        mean, sd = np.full((2, len(times), self.dimension), np.nan)
        rising, (readings, arrival) = np.asarray(times, dtype=np.float64)[order], self._readings(samples)
        mean[order], sd[order] = smoothing_steps.replay_late(
            self.model, readings, arrival, rising, self._room(readings), self.history_s, lag_s
        )
        return mean, sd

    def constants(
        self, samples: Mapping[str, Samples], couplings: Mapping[str, FloatArray], times: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Mean (n, constants) and covariance (n, constants, constants) of the constants, given what has arrived.

        `couplings` has, for each sensor, (m, d, constants): what each constant contributes to its m readings. NaN
        before the first position.
        """
        count = len(self.model.constants)
        mean, covariance = np.full((len(times), count), np.nan), np.full((len(times), count, count), np.nan)
        self._run(*self._readings(samples, couplings), times, (mean, covariance))
        return mean, covariance

    def _run(
        self,
        readings: Readings,
        arrival: FloatArray,
        times: FloatArray,
        constants: tuple[FloatArray, FloatArray],
    ) -> tuple[FloatArray, FloatArray]:
        """Mean and SD (n, d) at `times`, in any order; fills `constants` unless they are empty (rising times only)."""
        room, wanted = self._room(readings), np.asarray(times, dtype=np.float64)
        if (wanted[1:] >= wanted[:-1]).all():
            found: tuple[FloatArray, FloatArray, object] = event_replay.replay(
                self.model, readings, arrival, wanted, room, self.history_s, constants, (0, 0)
            )
            return found[:2]
        order = np.argsort(times, kind="stable")
        mean, sd = np.full((2, len(times), self.dimension), np.nan)
        rising = wanted[order]
        mean[order], sd[order], _ = event_replay.replay(
            self.model, readings, arrival, rising, room, self.history_s, constants, (0, 0)
        )
        return mean, sd

    def resume(self, state: Recent, samples: Mapping[str, Samples], times: FloatArray) -> tuple[Track, Recent]:
        """`replay` of one piece of a recording, from the state after the piece before."""
        readings, arrival = self._readings(samples, begun=state.history is not None)
        before, kept = state.history, 0 if state.history is None else len(state.history.time)
        within = readings.time if before is None else np.concatenate([before.time, readings.time])
        room = self._empty_history(2 * _most_within(np.sort(within), self.history_s) + kept + 8)
        for column, known in zip(room, before or (), strict=before is not None):
            column[:kept] = known
        # One time more than is asked for, so that the readings after the last are in the state as well.
        rising = np.append(np.asarray(times, dtype=np.float64), np.max(arrival, initial=np.max(times, initial=-np.inf)))
        biases = len(self.model.constants)
        nothing = np.empty((0, biases)), np.empty((0, biases, biases))
        mean, sd, (oldest, count) = event_replay.replay(
            self.model, readings, arrival, rising, room, self.history_s, nothing, (0, kept)
        )
        history = History._make([column[oldest:count].copy() for column in room]) if count else None
        return Track(times, mean[:-1], sd[:-1]), Recent(history, state.waiting, state.too_late)

    def _room(self, readings: Readings) -> History:
        """A history with more rows than the readings need at any time."""
        return self._empty_history(2 * _most_within(np.sort(readings.time), self.history_s) + 8)

    def in_order(self, samples: Mapping[str, Samples]) -> tuple[Readings, FloatArray, History]:
        """All readings in order of arrival, when each is used (n,) in s, and an empty history for them."""
        readings, arrival = self._readings(samples)
        return readings, arrival, self._room(readings)

    def filtered(self, samples: Mapping[str, Samples]) -> History | None:
        """All readings from the first position on, in order of measurement, with the moments after each.

        None without a position.
        """
        readings, _ = self._readings(samples)
        if len(readings.time) == 0:
            return None
        by_time = np.argsort(readings.time[1:], kind="stable") + 1
        later = by_time[readings.time[by_time] >= readings.time[0]]
        rows = np.concatenate([[0], later])
        history = self._empty_history(len(rows))
        for column, read in zip(history[:4], readings, strict=True):
            column[:] = read[rows]
        event_steps.begin(self.model, history)
        event_steps.update_rows(self.model, history, 1, len(rows))
        return history

    def with_constants(self, initial_sd: FloatArray, walk: FloatArray) -> EventTime:
        """The same filter with other constants than a bias.

        `initial_sd` (constants,) is their SD before any reading, `walk` (constants,) that of their random walk per √s.
        """
        model = self.model._replace(
            constants=(0,) * len(initial_sd),
            initial_constant_variance=np.square(initial_sd, dtype=np.float64),
            constant_psd=np.square(walk, dtype=np.float64),
        )
        return replace(self, model=model)

    def _readings(
        self, samples: Mapping[str, Samples], couplings: Mapping[str, FloatArray] | None = None, begun: bool = False
    ) -> tuple[Readings, FloatArray]:
        """All readings in order of arrival from the first position on, followed by those that waited for it.

        With `begun` there was a position before, and no reading waits.
        """
        streams = {name: samples[name] for name in self.sensors if name in samples and len(samples[name])}
        time = np.concatenate([np.zeros(0), *(stream.time for stream in streams.values())])
        arrival = np.concatenate([np.zeros(0), *(stream.arrival for stream in streams.values())])
        numbers = [np.full(len(stream), self._index[name], np.int64) for name, stream in streams.items()]
        sensor = np.concatenate([np.zeros(0, np.int64), *numbers])
        order = np.argsort(arrival, kind="stable")
        if not begun:
            order = self._from_first(time[order], sensor[order], order)
        # Each stream goes to its places at once: the couplings of a long recording are not held twice.
        places = np.full(len(time), -1)
        places[order] = np.arange(len(order))
        value = np.empty((len(order), self.dimension))
        coupling = np.empty((len(order), self.dimension, len(self.model.constants)))
        begin = 0
        for name, stream in streams.items():
            place = places[begin : begin + len(stream)]
            begin += len(stream)
            kept = slice(None) if (place >= 0).all() else place >= 0
            of_stream = couplings[name] if couplings else self._coupling(name, stream.rotation)
            value[place[kept]] = self._on_all_axes(name, stream.value)[kept]
            coupling[place[kept]] = of_stream if of_stream.ndim == 2 else of_stream[kept]
        begins = arrival[order[0]] if len(order) else np.inf
        return Readings(time[order], sensor[order], value, coupling), np.maximum(arrival[order], begins)

    def _from_first(self, time: FloatArray, sensor: Any, order: Any) -> Any:
        """`order` from the first position on; readings that arrived before it are kept if measured after it."""
        positions = np.flatnonzero(sensor == self._index[position_sensor(self.sensors)])
        if len(positions) == 0:
            return order[:0]
        first = int(positions[0])
        waiting = np.arange(first)
        newest_later = np.maximum.accumulate(time[:first][::-1])[::-1]
        kept = waiting[(time[:first] > time[first]) & (time[:first] > newest_later - self.history_s)]
        return order[np.concatenate([[first], kept, np.arange(first + 1, len(order))])]


def _most_within(time: FloatArray, span_s: float) -> int:
    """The largest number of readings within any stretch of `span_s` seconds."""
    if len(time) == 0:
        return 0
    return int(np.max(np.arange(len(time)) + 1 - np.searchsorted(time, time - span_s, side="left")))
