"""Estimators without a model of motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fusion_core.checks import require_not_negative, require_positive
from fusion_core.estimator import replay_loop, resume_loop, unknown
from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor, position_sensor


@dataclass(frozen=True)
class Raw:
    """The tracker as it comes: the newest frame, held until the next arrives. SD: the sensor's noise."""

    sensors: Mapping[str, Sensor]

    def __post_init__(self) -> None:
        position_sensor(self.sensors)

    def start(self) -> Sample | None:
        """No frame yet."""
        return None

    def update(self, state: Sample | None, sensor: str, sample: Sample) -> Sample | None:
        """The newest frame by arrival; samples of other sensors change nothing."""
        return sample if sensor == position_sensor(self.sensors) else state

    def predict(self, state: Sample | None, time: float) -> tuple[FloatArray, FloatArray]:
        """The held frame."""
        tracker = self.sensors[position_sensor(self.sensors)]
        if state is None:
            return unknown(tracker.dimension)
        return state.value, np.full(tracker.dimension, tracker.noise_sd)

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """The same for all times at once, by a search for the newest frame that has arrived."""
        name = position_sensor(self.sensors)
        tracker = self.sensors[name]
        if name not in samples:
            return replay_loop(self, samples, times)
        frames = samples[name]
        newest = np.searchsorted(frames.arrival, times, side="right") - 1
        known = newest >= 0
        mean = np.full((len(times), tracker.dimension), np.nan)
        sd = np.full((len(times), tracker.dimension), np.nan)
        mean[known] = frames.value[newest[known]]
        sd[known] = tracker.noise_sd
        return Track(times, mean, sd)

    @property
    def resumes(self) -> bool:
        """Always."""
        return True

    def resume(
        self, state: Sample | None, samples: Mapping[str, Samples], times: FloatArray
    ) -> tuple[Track, Sample | None]:
        """`replay` of one piece of a recording, which begins with the frame held."""
        track, frames = self.replay(samples, times), samples.get(position_sensor(self.sensors))
        if state is not None:
            held = np.isnan(track.sd[:, 0])
            track.mean[held], track.sd[held] = self.predict(state, np.nan)
        return track, frames[len(frames) - 1] if frames is not None and len(frames) else state


@dataclass(frozen=True)
class Smoothed:
    """A filter's position (d,), its rate of change (d,), and the measurement time they are of, in s."""

    time: float
    position: FloatArray
    rate: FloatArray


@dataclass(frozen=True)
class Smoother:
    """The base of filters that take one step per frame. Their SD is the sensor's noise: they know no better.

    A frame older than the newest comes too late to be smoothed and changes nothing.
    """

    sensors: Mapping[str, Sensor]

    def __post_init__(self) -> None:
        position_sensor(self.sensors)

    def smoothed(self, state: Smoothed, value: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray]:
        """Position and rate after one more frame, a step later."""
        raise NotImplementedError

    def start(self) -> Smoothed | None:
        """No frame yet."""
        return None

    def update(self, state: Smoothed | None, sensor: str, sample: Sample) -> Smoothed | None:
        """One step per frame; readings of other sensors change nothing."""
        if sensor != position_sensor(self.sensors):
            return state
        if state is None:
            return Smoothed(sample.time, sample.value, np.zeros_like(sample.value))
        step_s = sample.time - state.time
        return state if step_s <= 0 else Smoothed(sample.time, *self.smoothed(state, sample.value, step_s))

    def predict(self, state: Smoothed | None, time: float) -> tuple[FloatArray, FloatArray]:
        """The filtered frame, held."""
        tracker = self.sensors[position_sensor(self.sensors)]
        if state is None:
            return unknown(tracker.dimension)
        return state.position, np.full(tracker.dimension, tracker.noise_sd)

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """The plain loop."""
        return replay_loop(self, samples, times)

    @property
    def resumes(self) -> bool:
        """Always."""
        return True

    def resume(
        self, state: Smoothed | None, samples: Mapping[str, Samples], times: FloatArray
    ) -> tuple[Track, Smoothed | None]:
        """The plain loop over one piece of a recording."""
        return resume_loop(self, state, samples, times)


@dataclass(frozen=True)
class OneEuro(Smoother):
    """The 1 € filter (Casiez, Roussel and Vogel 2012): a low-pass whose cut-off rises with the hand's speed.

    cut-off = `min_cutoff_hz` + `beta_per_mm` · speed, the speed itself low-passed at `rate_cutoff_hz`. The speed is
    the vector's, not each axis's, so that the estimate does not depend on the frame's orientation.
    """

    min_cutoff_hz: float = 1.0
    beta_per_mm: float = 0.01
    rate_cutoff_hz: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(min_cutoff_hz=self.min_cutoff_hz, rate_cutoff_hz=self.rate_cutoff_hz)
        require_not_negative(beta_per_mm=self.beta_per_mm)

    def smoothed(self, state: Smoothed, value: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray]:
        """First the rate, then the position at the cut-off that goes with it."""
        rate = state.rate + _share(self.rate_cutoff_hz, step_s) * ((value - state.position) / step_s - state.rate)
        cutoff_hz = self.min_cutoff_hz + self.beta_per_mm * float(np.linalg.norm(rate))
        return state.position + _share(cutoff_hz, step_s) * (value - state.position), rate


def _share(cutoff_hz: float, step_s: float) -> float:
    """How much of a new reading a first-order low-pass takes on."""
    return 1.0 / (1.0 + 1.0 / (2.0 * np.pi * cutoff_hz * step_s))


@dataclass(frozen=True)
class Holt(Smoother):
    """Double exponential smoothing (Holt 1957), the Kinect's own smoother, with prediction ahead.

    Level and trend are those of the measurement time, over true time steps. The estimate is extrapolated along the
    trend by up to `ahead_s`: with the tracker's latency there, the lag goes and the trend's noise comes in.
    """

    level_weight: float = 0.5
    trend_weight: float = 0.25
    ahead_s: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        require_not_negative(ahead_s=self.ahead_s)
        for name, weight in (("level_weight", self.level_weight), ("trend_weight", self.trend_weight)):
            if not 0 < weight <= 1:
                raise ValueError(f"{name} must be above 0 and at most 1, got {weight}")

    def smoothed(self, state: Smoothed, value: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray]:
        """The level between what the trend expects and what was seen, the trend between its own and the level's."""
        expected = state.position + state.rate * step_s
        level = expected + self.level_weight * (value - expected)
        return level, state.rate + self.trend_weight * ((level - state.position) / step_s - state.rate)

    def predict(self, state: Smoothed | None, time: float) -> tuple[FloatArray, FloatArray]:
        """The level, extrapolated along the trend to `time`, but by `ahead_s` at most."""
        held, sd = super().predict(state, time)
        if state is None:
            return held, sd
        return held + float(np.clip(time - state.time, 0.0, self.ahead_s)) * state.rate, sd
