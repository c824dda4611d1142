"""What estimates are compared with: the recorded reference, or smoothed readings where there is none."""

from __future__ import annotations

from collections.abc import Iterable

SMOOTHED = "smoothed readings"
"""The value of `accuracy.reference` where no reference was recorded: the tracker's own readings, smoothed."""


def reference_phrase(references: Iterable[str]) -> str:
    """What errors are distances from, as part of a sentence; `references` come from the rows of `accuracy`."""
    names = set(references)
    if SMOOTHED not in names:
        return "the reference"
    return f"the {SMOOTHED}" if names == {SMOOTHED} else f"the reference or {SMOOTHED}"
