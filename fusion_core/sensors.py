"""A sensor is data, not code (paper, eq. 10): what it observes of the position, how often, how late, how noisily."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fusion_core.checks import require_not_negative, require_positive

OPERATORS: Mapping[str, int] = {"position": 0, "velocity": 1, "acceleration": 2}
"""Each named operator's order: how often the position is differentiated in time."""


@dataclass(frozen=True)
class Term:
    """`weight` times a derivative of the position, `at_s` after the reading's own time (before it, if negative)."""

    weight: float
    derivative: int = 0
    at_s: float = 0.0

    def __post_init__(self) -> None:
        if self.derivative not in OPERATORS.values():
            raise ValueError(f"derivative must be 0, 1 or 2, got {self.derivative}")
        for name, value in (("weight", self.weight), ("at_s", self.at_s)):
            if not np.isfinite(value):
                raise ValueError(f"{name} must be a number, got {value}")


@dataclass(frozen=True)
class Sensor:
    """`noise_sd` is in the operator's unit (mm, mm/s, mm/s²), `latency_s` how late a reading arrives.

    `operator` is "position", "velocity", "acceleration", or terms whose sum is observed, such as a displacement:
    `(Term(1), Term(-1, at_s=-0.033))`. `axes` says which of the position's axes it sees, counted from 0, where these
    are not all; `dimension` how many. `rate_hz` is needed only where gains are fixed beforehand.

    Raises ValueError for an unknown operator, noise or a rate that is not above zero, a negative latency, a
    dimension outside 1 to 3, or axes that do not fit it.
    """

    operator: str | tuple[Term, ...]
    noise_sd: float
    latency_s: float = 0.0
    dimension: int = 3
    rate_hz: float | None = None
    axes: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        if isinstance(self.operator, str) and self.operator not in OPERATORS:
            raise ValueError(f"operator {self.operator!r} is not one of {', '.join(OPERATORS)}")
        if not any(term.weight for term in self.terms):
            raise ValueError("operator needs a term whose weight is not 0")
        require_positive(noise_sd=self.noise_sd)
        require_not_negative(latency_s=self.latency_s)
        if self.dimension not in (1, 2, 3):
            raise ValueError(f"dimension must be 1, 2 or 3, got {self.dimension}")
        if self.rate_hz is not None:
            require_positive(rate_hz=self.rate_hz)
        if self.axes is not None and (
            len(set(self.axes)) != len(self.axes) or len(self.axes) != self.dimension or not set(self.axes) <= {0, 1, 2}
        ):
            raise ValueError(
                f"axes must be {self.dimension} of 0, 1 and 2, as many as the dimension, got {list(self.axes)}"
            )

    @property
    def terms(self) -> tuple[Term, ...]:
        """The operator as a sum of terms."""
        if isinstance(self.operator, str):
            return (Term(1.0, OPERATORS[self.operator]),)
        return self.operator

    @property
    def order(self) -> int | None:
        """How often the position is differentiated: 0, 1 or 2; None for an operator of the user's own."""
        return OPERATORS[self.operator] if isinstance(self.operator, str) else None

    def sees(self, dimension: int) -> tuple[int, ...]:
        """The axes that it observes, of a position of `dimension` axes.

        Raises ValueError where they do not fit: a sensor of fewer axes than the position must say which it sees.
        """
        axes = tuple(range(self.dimension)) if self.axes is None else self.axes
        if max(axes) >= dimension or (self.axes is None and self.dimension != dimension):
            raise ValueError(
                f"a sensor of dimension {self.dimension} must say which axes of the {dimension} it sees: axes=(0, …)"
            )
        return axes


def position_sensor(sensors: Mapping[str, Sensor]) -> str:
    """The name of the first sensor that observes whole positions. Raises ValueError if there is none."""
    for name, sensor in sensors.items():
        if sensor.order == 0 and sensor.axes is None:
            return name
    raise ValueError(f"an estimator needs a position sensor, got {', '.join(sensors) or 'no sensor'}")


def require_fit(sensors: Mapping[str, Sensor]) -> int:
    """The position's dimension. Raises ValueError, naming the sensor, where one does not fit it."""
    dimension = sensors[position_sensor(sensors)].dimension
    for name, sensor in sensors.items():
        try:
            sensor.sees(dimension)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    return dimension


def require_covered(sensors: Mapping[str, Sensor], name: str, span_s: float) -> None:
    """Raise ValueError where a sensor is later than the span an estimator keeps, which is its parameter `name`."""
    for late, sensor in sensors.items():
        if sensor.latency_s > span_s:
            raise ValueError(
                f"{name} must cover the latency of every sensor: {late} is {sensor.latency_s} s late, "
                f"{name} is {span_s}"
            )
