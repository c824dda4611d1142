"""What senders that are asked for readings have in common: the stream they feed, and how figures become readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.live.events import Reading
from pipeline.live.messages import Datagram, Four, Three
from pipeline.live.setup import Setup
from pipeline.live.units import Units, in_si, units

_LARGEST = 1e6  # as of every figure in a message
_POSITION, _MOTION, _ORIENTED = 3, 6, 10  # numbers of a reading
READINGS_PER_SECOND = 1000.0
"""As many as one source may send by UDP."""


@dataclass(frozen=True)
class Feed:
    """A stream: its name, what its readings hold and their units; its stamps are its arrivals where `unstamped`."""

    stream: str
    content: str
    units: Units
    unstamped: bool = False

    def reading(self, figures: Datagram | None, now: int, sent_ms: float | None = None) -> Reading | None:
        """Figures that arrived at `now` as a reading; None where they are not of the stream's kind."""
        values = None if figures is None else in_si(self.units, self.content, figures)
        return None if values is None else Reading(self.stream, None, now, values, None, sent_ms)


def feed(setup: Setup, name: str) -> Feed:
    """That of a stream."""
    stream = setup.streams[name]
    return Feed(name, stream.content, units(setup.recording.senders[name]), stream.stamps_arrival)


def figures_of(
    stream: str, position: Three | None, motion: tuple[Three, Three] | None, turned: Four | None = None
) -> Datagram:
    """A position, or a specific force with an angular velocity, as a datagram would hold it."""
    force, turning = (None, None) if motion is None else motion
    return Datagram("", stream, None, None, position, force, turning, turned)


def of_numbers(stream: str, content: str, numbers: Sequence[object]) -> Datagram | None:
    """A reading that comes as a row of numbers; None where there are too many or too few of them, or one is none."""
    figures = [float(one) for one in numbers if isinstance(one, int | float) and not isinstance(one, bool)]
    if len(figures) != len(numbers) or not are_plausible(figures):
        return None
    if content == "position" and len(figures) == _POSITION:
        return figures_of(stream, three(figures), None)
    if content == "acceleration" and len(figures) in (_MOTION, _ORIENTED):
        return figures_of(stream, None, (three(figures), three(figures[3:])), orientation(figures[6:]))
    return None


def counts(content: str) -> tuple[int, ...]:
    """How many numbers a reading may have."""
    return (_POSITION,) if content == "position" else (_MOTION, _ORIENTED)


def are_plausible(figures: Sequence[float]) -> bool:
    """Whether all are finite, and none beyond all range."""
    return all(math.isfinite(one) and abs(one) <= _LARGEST for one in figures)


def orientation(figures: Sequence[float]) -> Four | None:
    """A quaternion xyzw; None where there is none, or its length is not about 1."""
    if len(figures) != 4 or not 0.8 < sum(part * part for part in figures) < 1.25:
        return None
    return figures[0], figures[1], figures[2], figures[3]


def three(figures: Sequence[float]) -> Three:
    """The first three."""
    return figures[0], figures[1], figures[2]
