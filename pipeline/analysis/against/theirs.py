"""What another program says: its figures by our names for them, or why it has none."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.analysis.against.problems import Problem
from pipeline.study.comparison import Comparison


@dataclass(frozen=True)
class Figure:
    """A number, and how far its printed digits (or the end of an iterative fit) leave it open."""

    value: float
    room: float = 0.0


Found = Mapping[str, float | Figure | None]
"""Figures by name: those of the table `comparisons` and of its details."""


@dataclass(frozen=True)
class Theirs:
    """The call as users write it, and its figures; or the message with which it failed."""

    call: str
    figures: Mapping[str, Figure] = field(default_factory=dict)
    failure: str | None = None


class NotOffered(Exception):  # noqa: N818 - no error, but what a library does not have
    """What a function of a library does not do; its text says what it does instead."""


@dataclass(frozen=True)
class Call:
    """A function of a library as users write it, and what makes its figures of a problem's data and options.

    Which kind of data that is follows from the procedure.
    """

    text: str
    run: Callable[[Any, Comparison], Found]


Calls = Mapping[str, Sequence[Call]]
"""The calls of a library for each procedure."""


def ask(calls: Calls, problem: Problem) -> list[Theirs]:
    """What each of a library's functions for the problem says; a library that fails is no fault of ours."""
    answers = []
    for call in calls.get(problem.procedure, ()):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = call.run(problem.data, problem.entry)
        except NotOffered as limit:
            answers.append(Theirs(call.text, failure=str(limit)))
        except Exception as error:  # noqa: BLE001 - whatever a library raises is its answer
            answers.append(Theirs(call.text, failure=_message(error)))
        else:
            answers.append(Theirs(call.text, figures_of(found)))
    return answers


def figures_of(found: Found) -> dict[str, Figure]:
    """Plain numbers as figures, without those that are not given."""
    return {
        name: value if isinstance(value, Figure) else Figure(float(value))
        for name, value in found.items()
        if value is not None
    }


def _message(error: Exception) -> str:
    """The first line of what it says; some errors say only what kind they are."""
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__


def rounded(value: float, decimals: int) -> Figure:
    """A figure that the program prints with so many decimals."""
    return Figure(float(value), 0.5 * 10.0**-decimals * (1 + 1e-9))


def fitted(value: float) -> Figure:
    """A figure of an iterative fit, which stops where it hardly changes any more."""
    return Figure(float(value), 1e-4 * abs(value) if math.isfinite(value) else 0.0)
