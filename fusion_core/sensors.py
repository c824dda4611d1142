"""A sensor is data, not code (paper, eq. 10): what it observes of the position, how often, how late, how noisily."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

OPERATORS: Mapping[str, int] = {"position": 0, "velocity": 1, "acceleration": 2}
"""Each operator's order: how often the position is differentiated in time."""


@dataclass(frozen=True)
class Sensor:
    """`noise_sd` is in the operator's unit (mm, mm/s, mm/s²), `latency_s` how late a reading arrives.

    Raises ValueError for an unknown operator, noise that is not above zero, a negative latency or a dimension
    outside 1 to 3.
    """

    operator: str
    noise_sd: float
    latency_s: float = 0.0
    dimension: int = 3

    def __post_init__(self) -> None:
        if self.operator not in OPERATORS:
            raise ValueError(f"operator {self.operator!r} is not one of {', '.join(OPERATORS)}")
        if not self.noise_sd > 0:
            raise ValueError(f"noise_sd must be above 0, got {self.noise_sd}")
        if not self.latency_s >= 0:
            raise ValueError(f"latency_s must be 0 or more, got {self.latency_s}")
        if self.dimension not in (1, 2, 3):
            raise ValueError(f"dimension must be 1, 2 or 3, got {self.dimension}")

    @property
    def order(self) -> int:
        """How often the position is differentiated: 0, 1 or 2."""
        return OPERATORS[self.operator]


def position_sensor(sensors: Mapping[str, Sensor]) -> str:
    """The name of the first sensor that observes positions; ValueError if there is none."""
    for name, sensor in sensors.items():
        if sensor.order == 0:
            return name
    raise ValueError(f"an estimator needs a position sensor, got {', '.join(sensors) or 'no sensor'}")
