"""Estimators without a model of motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fusion_core.estimator import unknown
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
        """By one look-up of the newest arrival."""
        name = position_sensor(self.sensors)
        tracker, frames = self.sensors[name], samples[name]
        newest = np.searchsorted(frames.arrival, times, side="right") - 1
        known = newest >= 0
        mean = np.full((len(times), tracker.dimension), np.nan)
        sd = np.full((len(times), tracker.dimension), np.nan)
        mean[known] = frames.value[newest[known]]
        sd[known] = tracker.noise_sd
        return Track(times, mean, sd)
