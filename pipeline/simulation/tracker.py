"""A tracker as explorations vary it."""

from __future__ import annotations

from typing import NamedTuple


class Tracker(NamedTuple):
    """A tracker by what is swept of it."""

    latency_s: float
    noise_sd_mm: float
    rate_hz: float

    def at_least(self, other: Tracker) -> bool:
        """Is it no worse in anything?"""
        late, noisy = self.latency_s <= other.latency_s, self.noise_sd_mm <= other.noise_sd_mm
        return late and noisy and self.rate_hz >= other.rate_hz
