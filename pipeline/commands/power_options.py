"""What the options of `power` state, and the checks that refuse an impossible one."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.errors import PipelineError
from pipeline.statistics.power import TESTS

ASSUMED_CORRELATION = 0.5
_LARGEST_EFFECT = 100.0


@dataclass(frozen=True)
class Expected:
    """The planned study, as the command line states it."""

    test: str
    effect: float | None
    difference: float | None
    sd: float | None
    correlation: float | None
    conditions: int
    alpha: float
    n: int | None = None
    levels: str | None = None
    groups: int | None = None
    epsilon: float = 1.0
    bound: float | None = None
    sds: str | None = None
    size_ratio: float = 1.0

    @property
    def is_one_factor(self) -> bool:
        """Whether it is a test of one factor within participants, with their number as the question."""
        stated = (self.n, self.levels, self.groups, self.bound, self.sds)
        return self.test in TESTS and stated == (None,) * 5 and self.epsilon == self.size_ratio == 1


@dataclass(frozen=True)
class Search:
    """The power wanted, how many studies to simulate from which seed, and the most participants to consider."""

    power: float
    simulations: int
    seed: int
    most: int


def require_size(option: str, value: float) -> float:
    """An effect's size without its sign, which changes no power."""
    if not 0 < abs(value) <= _LARGEST_EFFECT:
        raise PipelineError(f"{option}: should not be 0, and its size at most {_LARGEST_EFFECT:g}, found {value:g}")
    return abs(value)


def require_between(option: str, value: float, low: float, high: float) -> None:
    if not low < value < high:
        raise PipelineError(f"{option}: should lie between {low:.3g} and {high:g}, found {value:g}")
