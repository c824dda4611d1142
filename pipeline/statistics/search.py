"""The smallest whole number that has a property which every larger one has too."""

from __future__ import annotations

from collections.abc import Callable


def smallest(reaches: Callable[[int], bool], low: int, high: int, start: int) -> int | None:
    """The smallest whole number from low to high that reaches it, where every larger one does; None if none does.

    Looked for from `start` in growing steps until it lies between two numbers, then by halves.
    """
    below, reached, at, step = low - 1, high + 1, start, 1
    while reached - below > 1:
        if reaches(at):
            reached = at
        else:
            below = at
        if low <= below and reached <= high:
            at = (below + reached) // 2
        else:
            at = max(low, reached - step) if reached <= high else min(high, below + step)
            step *= 2
    return reached if reached <= high else None
