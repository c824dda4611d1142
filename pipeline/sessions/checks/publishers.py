"""Whether one sensor in one frame publishes on a topic, or several."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.sessions.checks.finding import Finding, of
from pipeline.sessions.checks.recorded import Positions, Recorded

FRAME_ID, PUBLISHERS = "frame_id", "one publisher"

_APART = 4.0  # times as far to the next message as to the one after that
_FAR_MM = 30.0


def frame_ids(recorded: Recorded) -> Iterator[Finding]:
    """The frame that the messages name. It is not used, but if it changes, the positions are in different frames."""
    for one in recorded.streams:
        names, number = one.frames.names, one.frames.number
        if not len(number):
            continue
        if len(names) < 2:
            yield Finding(of(FRAME_ID, one.name), "green", _named(names[0]), "one")
            continue
        changes = int(np.sum(np.diff(number) != 0))
        at_s = float(one.times.stamp_s[np.flatnonzero(np.diff(number) != 0)[0] + 1] - one.times.stamp_s.min())
        listed = ", ".join(_named(name) for name in names[:3])
        if changes > 10:
            cause = "two nodes publish on the topic; give each a topic of its own"
        else:
            cause = "the positions after it are of another frame; transform them into one frame, or cut the log there"
        message = f'"{one.name}" names several frames ({listed}), first changing {at_s:.0f} s in: {cause}'
        yield Finding(of(FRAME_ID, one.name), "red", f"{listed}; {changes} changes", "one", message)


def _named(name: str) -> str:
    return f'"{name[:60]}"' if name else "no name"


def publishers(recorded: Recorded) -> Iterator[Finding]:
    """Positions that alternate between two places: two nodes publish on one topic.

    Noticed if the two are at least 3 cm apart; two nodes that agree cannot be distinguished from one.
    """
    for positions in recorded.positions:
        if len(positions.value_mm) < 50:
            continue
        near, far = _steps(positions)
        found, expected = f"{far:.0f} mm to the next message, {near:.0f} to the one after", "one"
        if far < _FAR_MM or far < _APART * near:
            yield Finding(of(PUBLISHERS, positions.name), "green", "one", expected)
            continue
        message = (
            f'successive positions of "{positions.name}" go to and fro by {far:.0f} mm: two nodes publish on its '
            "topic; give each a topic of its own"
        )
        yield Finding(of(PUBLISHERS, positions.name), "red", found, expected, message)


def _steps(positions: Positions) -> tuple[float, float]:
    """Medians in mm: the nearest of the next three to each position but the next, and the next."""
    order = np.lexsort((positions.times.stamp_ns, positions.times.arrival_ns))
    value = positions.value_mm[order]
    steps = [value[lag:][: len(value) - 3] - value[: len(value) - 3] for lag in (1, 2, 3)]
    following = [np.sqrt(np.einsum("ij,ij->i", step, step)) for step in steps]
    return float(np.median(np.minimum(following[1], following[2]))), float(np.percentile(following[0], 60))
