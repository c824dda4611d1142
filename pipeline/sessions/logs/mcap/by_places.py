"""Reads messages of which one can be walked through: that shows where all others that are laid out like it have theirs.

What fits no template is walked through by itself. How a message is walked through is its encoding's own: ROS messages
in `wire`, flatbuffers in `flatbuffer`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.sessions.logs.log import BoolArray, IntArray, Source
from pipeline.sessions.logs.mcap.fields import Decoder, Fields, Reading, check_size
from pipeline.sessions.logs.mcap.layout import Kind, Layout, Path, find_layout, written
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.pick import OtherFrameError, at, pick
from pipeline.sessions.logs.mcap.places import Place, Places, figure
from pipeline.sessions.logs.mcap.stamps import split_stamp, split_stamps
from pipeline.sessions.logs.mcap.templates import Bytes, read_by_templates

WalkThrough = Callable[[bytes], Places]
"""Walks through a message; ValueError where its bytes do not fit its type."""

Figure = Place | float
"""Where a figure is, or its value if messages laid out so do not hold it."""


def decoder(
    leaves: Mapping[Path, Kind], type_name: str, content: str, source: Source, walk_through: WalkThrough
) -> Decoder:
    """A decoder of a type's messages. ValueError where the type does not hold what the stream reads."""
    layout = find_layout(leaves, type_name, content, source)

    def one(payload: bytes) -> Reading:
        check_size(payload)
        found = _located(walk_through(payload), layout, source)
        if found.of_other_frame:
            raise OtherFrameError("it is of another frame")
        stamp = [_figure(payload, place) for place in found.stamp]
        seconds, nanoseconds = split_stamp(stamp, source.stamp_unit_s or 1.0)
        values = [float(_figure(payload, place)) for place in found.figures]
        return Reading(seconds, nanoseconds, values, found.child, found.parent)

    def many(messages: Messages, which: IntArray, fields: Fields) -> None:
        def read_alike(rows: Bytes, own: IntArray) -> BoolArray:
            found = _located(walk_through(rows[0].tobytes()), layout, source)
            alike = _alike(rows, found.fixed)
            if found.of_other_frame:
                fields.of_other_frame[own[alike]] = True
            else:
                read = _read(rows if alike.all() else rows[alike], found, content, source)
                fields.take_named(own[alike], read, found.child, found.parent)
            return alike

        read_by_templates(messages, which, read_alike)

    return Decoder(one, many)


@dataclass(frozen=True)
class _Located:
    """Where a message has what the stream reads, and which bytes it shares with those like it."""

    fixed: list[tuple[int, int]]
    of_other_frame: bool = False
    stamp: tuple[Figure, ...] = ()
    figures: tuple[Figure, ...] = ()
    child: str | None = None
    parent: str | None = None


def _located(found: Places, layout: Layout, source: Source) -> _Located:
    try:
        picked = pick(layout, source, found.counts.__getitem__, found.texts.__getitem__)
    except OtherFrameError:
        return _Located(found.fixed, of_other_frame=True)

    def place(path: Path) -> Figure:
        path = at(path, picked.index)
        if path in found.unsent:
            return found.unsent[path]
        if path not in found.figures:
            raise ValueError(f"it has no {written(path)}")
        return found.figures[path]

    def place_beside(path: Path | None) -> Figure:
        """An angular velocity or orientation beside an acceleration; of zeros if this message was sent without it."""
        try:
            return 0.0 if path is None else place(path)
        except ValueError:
            return 0.0

    moved, beside = layout.figures[:3], layout.figures[3:]
    return _Located(
        found.fixed,
        False,
        tuple(place(path) for path in layout.stamp),
        (*(place(path) for path in moved if path is not None), *map(place_beside, beside)),
        picked.child,
        None if layout.parent is None else found.texts[at(layout.parent, picked.index)],
    )


def _figure(payload: bytes, place: Figure) -> float:
    return figure(payload, place) if isinstance(place, tuple) else place


def _alike(rows: Bytes, fixed: list[tuple[int, int]]) -> BoolArray:
    """Which rows have the first one's bytes in the fixed spans."""
    where = np.concatenate([np.arange(0), *(np.arange(begin, end) for begin, end in fixed)])
    alike: BoolArray = (rows[:, where] == rows[0, where]).all(axis=1)
    return alike


def _read(rows: Bytes, found: _Located, content: str, source: Source) -> Fields:
    """Stamps and values of messages that are alike."""
    read = Fields.none_of(len(rows), content)
    stamp = [_column(rows, place) for place in found.stamp]
    read.seconds[:], read.nanoseconds[:] = split_stamps(stamp, source.stamp_unit_s or 1.0, len(rows))
    for index, place in enumerate(found.figures):
        read.values[:, index] = _column(rows, place)
    return read


def _column(rows: Bytes, place: Figure) -> np.ndarray[tuple[int], np.dtype[np.generic]]:
    if not isinstance(place, tuple):
        return np.full(len(rows), place)
    begin, code = place
    kind = np.dtype(code.replace("?", "B"))  # a truth value is a number too
    cells = np.ascontiguousarray(rows[:, begin : begin + kind.itemsize])
    return cells.view(kind)[:, 0]
