"""The number of participants at which a planned comparison reaches a stated power."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.statistics.power import Design, closed_form, paired_t_power
from pipeline.statistics.power_simulation import Share, Simulated, simulate
from pipeline.statistics.search import smallest

FEWEST = 2
_ROWS = 16  # of the table, about; more where the answer is
_STEPS = (1, 2, 4, 5, 10, 20, 25, 50, 100, 200)


@dataclass(frozen=True)
class Row:
    """Power with n participants: in closed form, if the test has one, and by simulation."""

    n: int
    closed_form: float | None
    simulated: Simulated


@dataclass(frozen=True)
class Needed:
    """The fewest participants by simulation, with the bounds of its error; None where that is more than the most."""

    n: int | None
    low: int | None
    high: int | None


@dataclass(frozen=True)
class SampleSize:
    """The answer: rows in the order of n, and the fewest participants by each way of computing power."""

    rows: tuple[Row, ...]
    closed_form: int | None
    simulated: Needed
    corrected: Needed | None

    @property
    def judged_by(self) -> int | None:
        """The fewest with the p that a report judges by: corrected for sphericity where it can be, and exact if so."""
        if self.corrected is not None:
            return self.corrected.n
        return self.closed_form if self.closed_form is not None else self.simulated.n


def sample_size(design: Design, power: float, studies: int, seed: int, most: int) -> SampleSize | None:
    """The fewest participants for this power, and the table around it; None if `most` are not enough.

    By simulation the power at neighbouring n is drawn anew, so the fewest is known only within the simulation's error.
    """

    @cache
    def at(n: int) -> Simulated:
        return simulate(design, n, studies, seed)

    exact = None
    if closed_form(design, FEWEST) is not None:
        exact = fewest(design, power, most)
        if exact is None:
            return None
    start = min(most, exact or _likely_for_ranks(design, power, most))
    simulated = needed(lambda n: at(n).own, power, start, most)
    if simulated.n is None and exact is None:
        return None
    corrected = None
    if at(start).corrected is not None:
        corrected = needed(lambda n: at(n).corrected or at(n).own, power, start, most)
    middle = exact or simulated.n or most
    answers = (simulated, corrected) if corrected else (simulated,)
    answers_n = [n for answer in answers for n in (answer.n, answer.low, answer.high) if n]
    numbers = {*spread(middle, most), middle, max(FEWEST, middle - 1), *answers_n}
    rows = tuple(Row(n, closed_form(design, n), at(n)) for n in sorted(numbers))
    return SampleSize(rows, exact, simulated, corrected)


def fewest(design: Design, power: float, most: int, start: int = FEWEST) -> int | None:
    """The fewest participants by the test's closed form, looked for from `start`; None if `most` are not enough."""
    return smallest(lambda n: (closed_form(design, n) or 0.0) >= power, FEWEST, most, start)


def _likely_for_ranks(design: Design, power: float, most: int) -> int:
    """Where to look for the signed-rank test's answer: by its asymptotic efficiency beside t's, 3/π."""
    by_t = smallest(lambda n: paired_t_power(design.dz, n, design.alpha) >= power, FEWEST, most, FEWEST) or most
    attainable = 1 + int(1 - np.log2(design.alpha))  # the least p of n pairs is 2 ** (1 - n)
    return max(int(np.ceil(by_t * np.pi / 3)), attainable)


def needed(share: Callable[[int], Share], power: float, start: int, most: int) -> Needed:
    """The fewest participants by simulated studies, looked for from `start`, and what bounds the simulation's error."""
    n = smallest(lambda n: share(n).power >= power, FEWEST, most, start)
    low = smallest(lambda n: share(n).interval()[1] >= power, FEWEST, most, n or most)
    high = smallest(lambda n: share(n).interval()[0] >= power, FEWEST, most, n or most)
    if n is not None:
        low, high = min(n, low or n), None if high is None else max(n, high)
    return Needed(n, low, high)


def spread(middle: int, most: int) -> Iterable[int]:
    """Round numbers of participants, from few to well beyond the middle one."""
    last = min(most, max(middle + 4, round(1.6 * middle)))
    step = next((step for step in _STEPS if last / step <= _ROWS), _STEPS[-1])
    return range(max(FEWEST, step), last + 1, step)
