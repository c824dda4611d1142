"""The heading of a phone, reading by reading: the filter of `orientation.heading`, for a loop."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fusion_core.kalman.event_time import EventTime
from fusion_core.phone.orientation import heading_filter
from fusion_core.phone.sightings import Sighting, sighted
from fusion_core.samples import FloatArray, Sample
from fusion_core.sensors import Sensor


@dataclass(frozen=True)
class Heading:
    """What is known: the filter's own state, and the tracker's newest sighting of the hand."""

    moments: Any
    sighting: Sighting | None = None


@dataclass(frozen=True)
class HeadingFilter:
    """The angle about the vertical between a phone's accelerations and a tracker's positions, from how both move.

    Readings are in frames whose z points up, those without gravity; times in s. The state is passed in and returned.
    """

    tracker: Sensor
    phone: Sensor

    @cached_property
    def _steps(self) -> EventTime:
        return heading_filter(self.tracker, self.phone)

    def start(self) -> Heading:
        """The state before any reading."""
        return Heading(self._steps.start())

    def position(self, state: Heading, time: float, arrival: float, position_mm: FloatArray) -> Heading:
        """The state after a position (3,) in mm, if it is one of the hand."""
        sighting, seen = sighted(state.sighting, time, position_mm, self.tracker.noise_sd)
        if seen is None:
            return Heading(state.moments, sighting)
        return Heading(self._steps.update(state.moments, "tracker", Sample(time, arrival, seen)), sighting)

    def acceleration(self, state: Heading, time: float, arrival: float, acceleration_mm_s2: FloatArray) -> Heading:
        """The state after an acceleration (3,) in mm/s²."""
        east, north, up = acceleration_mm_s2.tolist()
        coupling = np.array([[1.0, 0, 0, -east, north], [0, 1.0, 0, -north, -east], [0, 0, 1.0, 0, 0]])
        reading = Sample(time, arrival, np.array([0.0, 0.0, up]), coupling)
        return Heading(self._steps.update(state.moments, "imu", reading), state.sighting)

    def angle(self, state: Heading) -> tuple[float, float]:
        """The angle and its SD in rad; NaN and infinity before the first position."""
        constants = self._steps.newest_constants(state.moments)
        if constants is None:
            return float("nan"), float("inf")
        mean, covariance = constants
        cosine, sine = mean[3:]
        angle = np.arctan2(sine, cosine)
        across = np.array([-np.sin(angle), np.cos(angle)])
        variance = across @ covariance[3:, 3:] @ across
        return float(angle), float(np.sqrt(variance) / max(np.hypot(cosine, sine), 1e-9))
