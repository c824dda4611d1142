"""What the checks before a task look at: the last readings of every stream, and what has been seen of them. Pure.

Readings are kept in small pieces, so that one more copies a few dozen and not all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from pipeline.live.changes import changed

KEPT_NS = 20_000_000_000
_PIECE = 64
_REACHED_MM = 60.0  # a corner counts from here on: nobody aims at it
_MM_PER_M = 1000.0

Colour = Literal["green", "amber", "red", "off"]


@dataclass(frozen=True)
class Row:
    """A reading as it is logged, and the orientation xyzw that its sender gave, None where it gave none.

    Of a phone, `values` has its orientation against the tracker once that is known, `turned_xyzw` the browser's own.
    """

    stamp_ns: int
    arrival_ns: int
    values: tuple[float, ...]
    turned_xyzw: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Kept:
    """The last readings of a stream, the newest in `newest`."""

    pieces: tuple[tuple[Row, ...], ...] = ()
    newest: tuple[Row, ...] = ()

    def since(self, arrival_ns: int) -> tuple[Row, ...]:
        """Those that have arrived since then, in order."""
        return tuple(row for piece in (*self.pieces, self.newest) for row in piece if row.arrival_ns >= arrival_ns)


@dataclass(frozen=True)
class Light:
    """What a check found: one sentence, with the remedy where it is not green."""

    id: str
    light: Colour
    text: str


@dataclass(frozen=True)
class Watched:
    """What is kept for the checks, and what they found last. `reached` are the corners of the task that were seen."""

    streams: Mapping[str, Kept] = field(default_factory=dict)
    reached: frozenset[int] = frozenset()
    found: Mapping[str, Light] = field(default_factory=dict)
    claims: tuple[Light, ...] = ()
    under_way: bool = False
    examined_ns: int = 0


@dataclass(frozen=True)
class Request:
    """What is to be examined: the readings of the last 20 s by stream, and how well a phone's heading is known.

    `heading_sd_rad` is None where orientations come with the readings.
    """

    rows: Mapping[str, tuple[Row, ...]]
    heading_sd_rad: float | None = None


def kept(watched: Watched, name: str, row: Row) -> Watched:
    """With one more reading of a stream."""
    before = watched.streams.get(name, Kept())
    newest = (*before.newest, row)
    if len(newest) < _PIECE:
        after = Kept(before.pieces, newest)
    else:
        oldest = row.arrival_ns - KEPT_NS
        pieces = tuple(piece for piece in before.pieces if piece[-1].arrival_ns >= oldest)
        after = Kept((*pieces, newest), ())
    return changed(watched, streams={**watched.streams, name: after})


def corners(
    path_mm: Sequence[tuple[float, float]], targets_mm: Sequence[tuple[float, float]]
) -> list[tuple[float, ...]]:
    """The corners (x, y) of the rectangle around the task's path and targets; fewer where it has no height or width."""
    xs, ys = zip(*path_mm, *targets_mm, strict=True)
    return list(dict.fromkeys((x, y) for y in (min(ys), max(ys)) for x in (min(xs), max(xs))))


def reached(watched: Watched, of_task_mm: Sequence[tuple[float, ...]], position_m: Sequence[float]) -> Watched:
    """With the corner that the tracker sees the hand at, if it is at one."""
    place = position_m[0] * _MM_PER_M, position_m[1] * _MM_PER_M
    for number, corner in enumerate(of_task_mm):
        if number not in watched.reached and math.dist(corner, place) <= _REACHED_MM:
            return changed(watched, reached=watched.reached | {number})
    return watched
