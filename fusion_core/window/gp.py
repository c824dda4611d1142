"""The paper's estimator: a transformed Gaussian-process prior over a sliding window (eqs. 9 to 24, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from fusion_core.checks import require_not_negative, require_one_of, require_positive
from fusion_core.estimator import replay_loop, require_reading, require_readings, unknown
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, Term, position_sensor, require_covered, require_fit
from fusion_core.window import batch, kernels, regular, weights
from fusion_core.window.kernels import IntArray

_ACCELERATION = 2
_MEANS = {"zero": weights.ZERO, "constant": weights.CONSTANT, "window": weights.WINDOW}
_MOST_SETS = 64  # sets of patterns whose stacked weights are remembered
_MOST_PATTERNS = 4096  # patterns of regular windows whose weights are remembered
Pattern = tuple[int, int, int, int]
"""A regular window: how many positions and other readings, and how many ns ago the newest of each was measured."""


class Schedule(NamedTuple):
    """The windows to come: their `spans` (4, n), and `which` row (n,) of `weights` (k, m) each uses; −1: irregular."""

    spans: IntArray
    which: IntArray
    weights: FloatArray
    sensors: tuple[int, int]  # the tracker's and the other's index in `prior`
    prior: weights.Prior


@dataclass(frozen=True)
class Window:
    """The samples in the window: the newest positions by measurement time, and other readings since the oldest one."""

    positions: tuple[Sample, ...] = ()
    others: tuple[tuple[str, Sample], ...] = ()


@dataclass(frozen=True)
class WindowGP:
    """Position now from the last `window` positions and every other reading since the oldest of them.

    The mean of the prior is an unknown constant (`mean="constant"`), the average of the window's positions
    (`"window"`), or zero, as the paper prints it. Accelerations are exact second derivatives or, with
    `derivative="finite_difference"`, the paper's second difference (18) of positions `difference_step_s` apart. With
    `bias_sd_mm_s2` above 0 an accelerometer may be off by a constant over the window. With a position sensor alone
    this is the paper's position-only GP. `horizon_s` bounds the window in a pause of the tracker: readings older than
    that are left out.

    Where every sensor's `rate_hz` is stated, a window whose readings keep to it takes weights computed once for all
    such windows (`path="auto"`); `"event_time"` computes those of each window from its own times. The two agree to
    1e-6 mm.

    Raises ValueError for a window below 1, parameters not above 0, sensors that do not fit together, or one that is
    later than the horizon.
    """

    sensors: Mapping[str, Sensor]
    window: int = 5
    signal_variance_mm2: float = 5.66e4
    inverse_scale_s2: float = 4.19
    mean: Literal["constant", "window", "zero"] = "constant"
    derivative: Literal["exact", "finite_difference"] = "exact"
    difference_step_s: float = 1 / 90
    bias_sd_mm_s2: float = 0.0
    horizon_s: float = 2.0
    path: Literal["auto", "event_time"] = "auto"

    def __post_init__(self) -> None:
        require_fit(self.sensors)
        if self.window < 1:
            raise ValueError(f"window must be 1 or more positions, got {self.window}")
        require_one_of("mean", self.mean, ("constant", "window", "zero"))
        require_one_of("derivative", self.derivative, ("exact", "finite_difference"))
        require_one_of("path", self.path, ("auto", "event_time"))
        require_positive(horizon_s=self.horizon_s, difference_step_s=self.difference_step_s)
        require_not_negative(bias_sd_mm_s2=self.bias_sd_mm_s2)
        require_positive(signal_variance_mm2=self.signal_variance_mm2, inverse_scale_s2=self.inverse_scale_s2)
        require_covered(self.sensors, "horizon_s", self.horizon_s)

    @cached_property
    def _tracker(self) -> str:
        return position_sensor(self.sensors)

    @property
    def _dimension(self) -> int:
        return self.sensors[self._tracker].dimension

    def _terms(self, name: str) -> tuple[Term, ...]:
        """What a sensor observes; accelerations as the paper's second difference if `derivative` says so."""
        sensor = self.sensors[name]
        if sensor.order != _ACCELERATION or self.derivative == "exact":
            return sensor.terms
        step = self.difference_step_s
        return tuple(Term(weight / step**2, 0, at * step) for weight, at in ((1.0, -1), (-2.0, 0), (1.0, 1)))

    def gains(self, lag: FloatArray, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """The weights of the readings in the estimate of "now", and its variance (eqs. 23 and 24).

        `lag` (…, m) is each reading's time minus now in s, `names` the m sensors. Returns weights (…, m) and variance
        (…). With a constant mean the weights of positions sum to 1.
        """
        flat = np.ascontiguousarray(lag, dtype=np.float64).reshape(-1, len(names))
        weights, variance = self._gains(flat, np.zeros(len(flat)), names)
        return weights.reshape(lag.shape), variance.reshape(lag.shape[:-1])

    def _gains(self, time: FloatArray, now: FloatArray, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """As `gains`, of readings at `time` (n, m) when it is `now` (n,)."""
        weights_and_variance: tuple[FloatArray, FloatArray] = weights.gains(
            self._prior, time, now, np.array([self._index[name] for name in names], np.int64)
        )
        return weights_and_variance

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.sensors)}

    @cached_property
    def _prior(self) -> weights.Prior:
        accelerations = np.array([sensor.order == _ACCELERATION for sensor in self.sensors.values()])
        return weights.Prior(
            float(self.signal_variance_mm2),
            _MEANS[self.mean],
            kernels.covariances(
                [self._terms(name) for name in self.sensors],
                self.signal_variance_mm2,
                self.inverse_scale_s2,
                np.where(accelerations, self.bias_sd_mm_s2**2, 0.0).tolist(),
            ),
            noise_variance=np.array([sensor.noise_sd**2 for sensor in self.sensors.values()], np.float64),
            constant=np.array([self._constant[name] for name in self.sensors], np.float64),
            is_tracker=np.array([name == self._tracker for name in self.sensors]),
        )

    def start(self) -> Window:
        """An empty window."""
        return Window()

    def update(self, state: Window, sensor: str, sample: Sample) -> Window:
        """The window with one more reading; a reading of a sensor not in use changes nothing."""
        if sensor not in self.sensors:
            return state
        require_reading(sensor, self.sensors[sensor], sample)
        if sensor != self._tracker:
            return self._trimmed(replace(state, others=(*state.others, (sensor, sample))), sample.arrival)
        positions = sorted((*state.positions, sample), key=lambda reading: reading.time)
        return self._trimmed(replace(state, positions=tuple(positions[-self.window :])), sample.arrival)

    def _trimmed(self, state: Window, now: float) -> Window:
        """The window without readings that are older than the oldest position or the horizon, and so cannot count.

        Until the window is full, an older frame may still arrive, so readings before the oldest position are kept.
        """
        oldest = state.positions[0].time if len(state.positions) == self.window else -np.inf
        since = max(oldest, now - self.horizon_s)
        if not state.others or state.others[0][1].time >= since:
            return state
        return replace(state, others=tuple(other for other in state.others if other[1].time >= since))

    def predict(self, state: Window, time: float) -> tuple[FloatArray, FloatArray]:
        """Mean and SD (d,) in mm of the position at `time`, from the readings in the window."""
        if not state.positions:
            return unknown(self._dimension)
        since = max(state.positions[0].time, time - self.horizon_s)
        readings = [(self._tracker, sample) for sample in state.positions]
        readings += [(name, sample) for name, sample in state.others if sample.time >= since]
        mean, sd = np.empty(self._dimension), np.empty(self._dimension)
        origin = state.positions[-1].value if self.mean != "zero" else np.zeros(self._dimension)
        for axes in self._axes_alike:
            chosen = readings
            if self._partial:
                chosen = [(name, sample) for name, sample in readings if axes[0] in self._sees[name]]
            names = tuple(name for name, _ in chosen)
            weights, variance = self._weights(names, np.array([sample.time for _, sample in chosen]), time)
            constant = np.array([self._constant[name] for name in names])
            if len(axes) == self._dimension and not self._partial:
                values = np.array([sample.value for _, sample in chosen])
            else:
                values = np.array([sample.value[self._own_axis[name][axes]] for name, sample in chosen])
            mean[axes] = origin[axes] + weights @ (values - constant[:, None] * origin[axes])
            sd[axes] = np.sqrt(variance)
        return mean, sd

    @cached_property
    def _sees(self) -> dict[str, tuple[int, ...]]:
        return {name: sensor.sees(self._dimension) for name, sensor in self.sensors.items()}

    @cached_property
    def _partial(self) -> bool:
        """Whether some sensor sees only the axes that it names."""
        return any(sensor.axes is not None for sensor in self.sensors.values())

    @cached_property
    def _own_axis(self) -> dict[str, IntArray]:
        """For each sensor, which of its own axes each axis of the position is (d,)."""
        own_axis = {}
        for name, axes in self._sees.items():
            own_axis[name] = np.zeros(self._dimension, np.int64)
            own_axis[name][list(axes)] = np.arange(len(axes))
        return own_axis

    @cached_property
    def _constant(self) -> dict[str, float]:
        """What each sensor would read if the hand stayed at 1 mm."""
        return {name: sum(t.weight for t in self._terms(name) if t.derivative == 0) for name in self.sensors}

    @cached_property
    def _axes_alike(self) -> list[list[int]]:
        """Groups of axes that the same sensors see; the axes of a group have the same weights."""
        groups: dict[tuple[str, ...], list[int]] = {}
        for axis in range(self._dimension):
            groups.setdefault(tuple(name for name, axes in self._sees.items() if axis in axes), []).append(axis)
        return list(groups.values())

    def _weights(self, names: tuple[str, ...], measured: FloatArray, now: float) -> tuple[FloatArray, FloatArray]:
        """Weights (m,) and variance of one window; a regular window's are looked up by its pattern."""
        if self._regular_names is not None:
            n_positions = names.count(self._tracker)
            rates = [float(self.sensors[name].rate_hz or 0.0) for name in self._regular_names]
            if regular.is_regular(measured, n_positions, rates[0], rates[-1]):
                newest = int(regular.in_ns(now - measured[n_positions - 1]))
                last = int(regular.in_ns(now - measured[-1])) if len(names) > n_positions else 0
                return self._weights_of_pattern((n_positions, len(names) - n_positions, newest, last))
        weights, variance = self._gains(measured[None, :], np.array([now]), names)
        return weights[0], variance[0]

    @cached_property
    def _regular_names(self) -> tuple[str, ...] | None:
        """The tracker and at most one other sensor, where regular windows can be looked up; None where they cannot."""
        names = (self._tracker, *(name for name in self.sensors if name != self._tracker))
        rated = all(sensor.rate_hz is not None for sensor in self.sensors.values())
        return names if self.path == "auto" and len(names) <= 2 and rated and len(self._axes_alike) == 1 else None

    @cached_property
    def _known_patterns(self) -> dict[Pattern, tuple[FloatArray, FloatArray]]:
        return {}

    def _weights_of_pattern(self, pattern: Pattern) -> tuple[FloatArray, FloatArray]:
        """Weights (m,) and variance of a regular window. They depend on the pattern alone, so they are remembered."""
        known = self._known_patterns.get(pattern)
        if known is None:
            names = self._regular_names or ()
            n_positions, n_others, newest, last = pattern
            lag = -newest * 1e-9 - np.arange(n_positions)[::-1] / float(self.sensors[names[0]].rate_hz or 1.0)
            if n_others:
                steps = np.arange(n_others)[::-1] / float(self.sensors[names[-1]].rate_hz or 1.0)
                lag = np.concatenate([lag, -last * 1e-9 - steps])
            known = self.gains(lag, (names[0],) * n_positions + (names[-1],) * n_others)
            if len(self._known_patterns) < _MOST_PATTERNS:
                self._known_patterns[pattern] = known
        return known

    @cached_property
    def _known_pattern_sets(self) -> dict[bytes, tuple[FloatArray, FloatArray]]:
        return {}

    def _weights_of_patterns(self, patterns: IntArray) -> tuple[FloatArray, FloatArray]:
        """Weights (k, m), padded with zeros, and SDs (k,) of k patterns of regular windows; remembered by the set."""
        key = patterns.tobytes()
        known = self._known_pattern_sets.get(key)
        if known is None:
            weights = np.zeros((len(patterns), int(patterns[:, :2].sum(axis=1).max(initial=1))))
            spread = np.empty(len(patterns))
            for row, (n_positions, n_others, newest, last) in enumerate(patterns.tolist()):
                of_pattern, variance = self._weights_of_pattern((n_positions, n_others, newest, last))
                weights[row, : len(of_pattern)], spread[row] = of_pattern, np.sqrt(variance)
            known = weights, spread
            if len(self._known_pattern_sets) < _MOST_SETS:
                self._known_pattern_sets[key] = known
        return known

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """All windows at once; more than one other stream, or readings out of order, take the plain loop."""
        require_readings(self.sensors, samples)
        used = {name: samples[name] for name in self.sensors if name in samples}
        names = [name for name in used if name != self._tracker]
        in_order = all(np.all(stream.time[1:] >= stream.time[:-1]) for stream in used.values())
        if not in_order or len(names) > 1 or self._tracker not in used or len(self._axes_alike) > 1:
            return replay_loop(self, samples, times)
        times = np.asarray(times, dtype=np.float64)
        frames = used[self._tracker]
        others = used[names[0]] if names else Samples(np.empty(0), np.empty(0), np.empty((0, self._dimension)))
        spans = self._spans(frames, others, times)
        mean = np.full((len(times), self._dimension), np.nan)
        sd = np.full((len(times), self._dimension), np.nan)
        left = np.flatnonzero(spans[1] > 0)
        if self._regular_names is not None:
            left = self._regular_windows(frames, others, times, spans, mean, sd)
        if len(left):
            other = self._index[names[0]] if names else 0
            streams = batch.Streams(
                self._index[self._tracker],
                np.ascontiguousarray(frames.time, dtype=np.float64),
                np.ascontiguousarray(frames.value, dtype=np.float64),
                other,
                np.ascontiguousarray(others.time, dtype=np.float64),
                np.ascontiguousarray(others.value, dtype=np.float64),
            )
            batch.estimates(self._prior, streams, times, spans, left, mean, sd)
        return Track(times, mean, sd)

    def _spans(self, frames: Samples, others: Samples, times: FloatArray) -> IntArray:
        spans: IntArray = regular.spans(
            times, frames.time, frames.arrival, others.time, others.arrival, self.window, self.horizon_s
        )
        return spans

    def schedule(self, samples: Mapping[str, Samples], times: FloatArray) -> Schedule:
        """The windows at rising `times`: what depends on the readings' times alone, before any value is known.

        For a tracker and at most one other sensor, whose readings do not overtake each other.
        """
        names = [name for name in self.sensors if name != self._tracker]
        frames = samples[self._tracker]
        others = samples[names[0]] if names else Samples(np.empty(0), np.empty(0), np.empty((0, self._dimension)))
        spans = self._spans(frames, others, times)
        which, weights = np.full(len(times), -1), np.empty((0, 0))
        if self._regular_names is not None:
            rates = [float(self.sensors[name].rate_hz or 1.0) for name in self._regular_names]
            which, patterns = regular.patterns(times, frames.time, others.time, spans, rates[0], rates[-1])
            weights, _ = self._weights_of_patterns(patterns)
        sensors = (self._index[self._tracker], self._index[names[0]] if names else 0)
        return Schedule(spans, which, weights, sensors, self._prior)

    def _regular_windows(
        self,
        frames: Samples,
        others: Samples,
        times: FloatArray,
        spans: IntArray,
        mean: FloatArray,
        sd: FloatArray,
    ) -> IntArray:
        """Fills the rows of regular windows by the weights of their patterns; returns the indices of the other rows."""
        names = self._regular_names or ()
        rates = [float(self.sensors[name].rate_hz or 1.0) for name in names]
        which, patterns = regular.patterns(times, frames.time, others.time, spans, rates[0], rates[-1])
        weights, spread = self._weights_of_patterns(patterns)
        regular.apply(
            which,
            spans,
            weights,
            spread,
            np.ascontiguousarray(frames.value.T, dtype=np.float64),
            np.ascontiguousarray(others.value.T, dtype=np.float64),
            mean,
            sd,
        )
        return np.flatnonzero((which < 0) & (spans[1] > 0))
