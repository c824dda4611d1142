"""The paper's estimator: a transformed Gaussian-process prior over a sliding window (eqs. 9 to 24, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from fusion_core.estimator import replay_loop, require_positive, unknown
from fusion_core.kernels import IntArray, SquaredExponential
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, position_sensor

_CHUNK_NUMBERS = 4_000_000  # covariance entries held at once: 32 MB


@dataclass(frozen=True)
class Window:
    """The samples in the window: positions by measurement time, everything else since the oldest of them."""

    positions: tuple[Sample, ...] = ()
    others: tuple[tuple[str, Sample], ...] = ()


@dataclass(frozen=True)
class WindowGP:
    """Position now from the last `window` positions and every other reading since the oldest of them.

    The mean of the prior is an unknown constant (`mean="constant"`) or zero, as the paper prints it. With a
    position sensor alone this is the paper's position-only GP. `horizon_s` bounds the window in a pause of the
    tracker: readings older than that are left out.

    Raises ValueError for a window below 1, parameters not above 0, or sensors without a position among them.
    """

    sensors: Mapping[str, Sensor]
    window: int = 5
    signal_variance_mm2: float = 5.66e4
    inverse_scale_s2: float = 4.19
    mean: Literal["constant", "zero"] = "constant"
    horizon_s: float = 2.0

    def __post_init__(self) -> None:
        position_sensor(self.sensors)
        if self.window < 1:
            raise ValueError(f"window must be 1 or more positions, got {self.window}")
        if self.mean not in ("constant", "zero"):
            raise ValueError(f'mean must be "constant" or "zero", got {self.mean!r}')
        require_positive(horizon_s=self.horizon_s)
        SquaredExponential(self.signal_variance_mm2, self.inverse_scale_s2)

    @cached_property
    def _kernel(self) -> SquaredExponential:
        return SquaredExponential(self.signal_variance_mm2, self.inverse_scale_s2)

    def gains(self, lag: FloatArray, order: IntArray, noise_variance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The weights of the readings in the estimate of "now", and its variance (eqs. 23 and 24).

        `lag` (…, m) is each reading's time minus now in s, `order` (m,) its derivative, `noise_variance` (m,).
        Returns weights (…, m) and variance (…). With the constant mean the weights of positions sum to 1.
        """
        kernel = self._kernel
        now, zero = np.zeros((*lag.shape[:-1], 1)), np.zeros(1, np.int64)
        among = kernel.covariance(lag, order, lag, order) + np.diag(noise_variance)
        with_now = kernel.covariance(lag, order, now, zero)
        constant = np.broadcast_to(np.where(order == 0, 1.0, 0.0)[:, None], with_now.shape)
        solved = np.linalg.solve(among, np.concatenate([with_now, constant], axis=-1))
        weights, constant_weights = solved[..., 0], solved[..., 1]
        variance = self.signal_variance_mm2 - np.sum(with_now[..., 0] * weights, axis=-1)
        if self.mean == "constant":
            missing = 1.0 - np.sum(constant[..., 0] * weights, axis=-1)
            precision = np.sum(constant[..., 0] * constant_weights, axis=-1)
            weights = weights + constant_weights * (missing / precision)[..., None]
            variance = variance + missing**2 / precision
        return weights, variance

    def start(self) -> Window:
        """An empty window."""
        return Window()

    def update(self, state: Window, sensor: str, sample: Sample) -> Window:
        """The window with one more reading; a reading of a sensor not in use changes nothing."""
        if sensor not in self.sensors:
            return state
        if self.sensors[sensor].order != 0:
            return self._trimmed(replace(state, others=(*state.others, (sensor, sample))), sample.arrival)
        positions = sorted((*state.positions, sample), key=lambda reading: reading.time)
        return self._trimmed(replace(state, positions=tuple(positions[-self.window :])), sample.arrival)

    def _trimmed(self, state: Window, now: float) -> Window:
        """Without what can no longer count: readings older than the oldest position and than the horizon.

        Until the window is full an older frame may still arrive, and what came before the first frame waits.
        """
        oldest = state.positions[0].time if len(state.positions) == self.window else -np.inf
        since = max(oldest, now - self.horizon_s)
        if not state.others or state.others[0][1].time >= since:
            return state
        return replace(state, others=tuple(other for other in state.others if other[1].time >= since))

    def predict(self, state: Window, time: float) -> tuple[FloatArray, FloatArray]:
        """The position at `time`, from the window."""
        dimension = self.sensors[position_sensor(self.sensors)].dimension
        if not state.positions:
            return unknown(dimension)
        since = max(state.positions[0].time, time - self.horizon_s)
        others = [other for other in state.others if other[1].time >= since]
        readings = [*state.positions, *(sample for _, sample in others)]
        sensors = [self.sensors[position_sensor(self.sensors)]] * len(state.positions)
        sensors += [self.sensors[name] for name, _ in others]
        lag = np.array([reading.time - time for reading in readings])
        order = np.array([sensor.order for sensor in sensors])
        weights, variance = self.gains(lag, order, np.array([sensor.noise_sd**2 for sensor in sensors]))
        origin = state.positions[-1].value if self.mean == "constant" else np.zeros(dimension)
        values = np.array([reading.value for reading in readings])
        mean = origin + weights @ (values - np.where(order == 0, 1.0, 0.0)[:, None] * origin)
        return mean, np.full(dimension, np.sqrt(variance))

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """All windows of equal size at once; streams whose readings overtake each other take the plain loop."""
        used = {name: samples[name] for name in self.sensors if name in samples}
        names = [name for name in used if self.sensors[name].order != 0]
        in_order = all(np.all(np.diff(stream.time) >= 0) for stream in used.values())
        if not in_order or len(names) > 1 or len(used) - len(names) != 1:
            return replay_loop(self, samples, times)
        tracker = self.sensors[position_sensor(self.sensors)]
        mean = np.full((len(times), tracker.dimension), np.nan)
        variance = np.full(len(times), np.nan)
        for rows, lag, values, order, noise_variance in self._windows(used, names, times):
            weights, variance[rows] = self.gains(lag, order, noise_variance)
            is_position = np.where(order == 0, 1.0, 0.0)[None, :, None]
            newest = values[:, order == 0][:, -1]
            origin = newest if self.mean == "constant" else np.zeros_like(newest)
            centred = values - is_position * origin[:, None, :]
            mean[rows] = origin + (weights[:, None, :] @ centred)[:, 0]
        return Track(times, mean, np.repeat(np.sqrt(variance)[:, None], tracker.dimension, axis=1))

    def _windows(
        self, used: Mapping[str, Samples], names: list[str], times: FloatArray
    ) -> Iterator[tuple[IntArray, FloatArray, FloatArray, IntArray, FloatArray]]:
        """Groups of windows of one size: rows of `times`, lags (k, m), values (k, m, d), order (m,), noise (m,)."""
        frames = used[position_sensor(self.sensors)]
        tracker = self.sensors[position_sensor(self.sensors)]
        last = np.searchsorted(frames.arrival, times, side="right")
        first = np.maximum(last - self.window, 0)
        known = np.flatnonzero(last > 0)
        begin, end = np.zeros(len(times), np.int64), np.zeros(len(times), np.int64)
        if names:
            other = used[names[0]]
            since = np.maximum(frames.time[np.minimum(first, len(frames) - 1)], times - self.horizon_s)
            end = np.searchsorted(other.arrival, times, side="right")
            begin = np.minimum(np.searchsorted(other.time, since, side="left"), end)
        sizes = np.stack([last - first, end - begin], axis=1)[known]
        for n_positions, n_others in np.unique(sizes, axis=0):
            group = known[(sizes[:, 0] == n_positions) & (sizes[:, 1] == n_others)]
            order, noise_variance = np.zeros(n_positions, np.int64), np.full(n_positions, tracker.noise_sd**2)
            if n_others:
                sensor = self.sensors[names[0]]
                order = np.append(order, np.full(n_others, sensor.order))
                noise_variance = np.append(noise_variance, np.full(n_others, sensor.noise_sd**2))
            step = max(1, int(_CHUNK_NUMBERS // len(order) ** 2))
            for rows in np.split(group, np.arange(step, len(group), step)):
                picked = first[rows, None] + np.arange(n_positions)
                time, values = frames.time[picked], frames.value[picked]
                if n_others:
                    picked = begin[rows, None] + np.arange(n_others)
                    time = np.concatenate([time, other.time[picked]], axis=1)
                    values = np.concatenate([values, other.value[picked]], axis=1)
                yield rows, time - times[rows, None], values, order, noise_variance
