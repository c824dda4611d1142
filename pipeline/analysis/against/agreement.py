"""Our figures and another program's side by side: which agree, which differ, and for which known reason."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.analysis.against.known_reasons import REASONS
from pipeline.analysis.against.problems import Problem
from pipeline.analysis.against.theirs import Figure, Theirs
from pipeline.analysis.against.ways import ours
from pipeline.statistics import OK

_RELATIVE = 1e-6  # what another order of the same additions may do
_ABSOLUTE = 1e-12


@dataclass(frozen=True)
class Difference:
    """A figure that is not ours, and why, or None where no known reason meets it."""

    quantity: str
    ours: float | None
    theirs: float
    reason: str | None


@dataclass(frozen=True)
class Agreement:
    """What one call of another program says of a problem: the figures that agree, those that differ, or its failure."""

    call: str
    agree: Sequence[str]
    differ: Sequence[Difference]
    failure: str | None = None

    @property
    def unexplained(self) -> list[Difference]:
        """The differences without a known reason."""
        return [one for one in self.differ if one.reason is None]


def held_against(problem: Problem, theirs: Theirs) -> Agreement:
    """Each figure of an answer beside ours."""
    agree, differ = [], []
    for quantity, figure in theirs.figures.items():
        own = ours(problem.row, quantity)
        if _same(own, figure):
            agree.append(quantity)
        else:
            differ.append(Difference(quantity, own, figure.value, _reason(problem, theirs, quantity)))
    return Agreement(theirs.call, agree, differ, theirs.failure)


def _same(own: float | None, figure: Figure) -> bool:
    """Equal but for round-off and for what the program does not print; undefined for both is the same too."""
    if own is None or math.isnan(own):
        return math.isnan(figure.value)
    if math.isinf(own) or math.isinf(figure.value):
        return own == figure.value
    return abs(own - figure.value) <= max(_ABSOLUTE, _RELATIVE * abs(own), figure.room)


def _reason(problem: Problem, theirs: Theirs, quantity: str) -> str | None:
    """The first known reason that leads to the other program's figure."""
    if problem.row["status"] != OK:
        return f"ours is {problem.row['status']}"
    figure = theirs.figures[quantity]
    if math.isnan(figure.value):
        return "it has no number for these data"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a way that does not apply may divide by zero, and meets nothing then
        for reason in REASONS:
            if problem.procedure in reason.procedures and quantity in reason.quantities:
                value = reason.in_their_way(problem, theirs.figures, quantity)
                if value is not None and _same(value, figure):
                    return reason.text
    return None
