"""Any ROS message in CDR or in ROS 1's own serialisation: read by the log's definition, many at once by templates.

The first message is walked through (`wire`), and all others of its length whose lengths and texts are the same bytes
are read at the same places. What fits no template is walked through by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.sessions.logs.log import IntArray, Source
from pipeline.sessions.logs.mcap.cdr import Bytes
from pipeline.sessions.logs.mcap.definition_text import Definition
from pipeline.sessions.logs.mcap.fields import (
    PAYLOAD_LIMIT,
    Decoder,
    Fields,
    Reading,
    check_size,
)
from pipeline.sessions.logs.mcap.layout import Layout, Path, find_layout, written
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.pick import OtherFrameError, at, pick
from pipeline.sessions.logs.mcap.stamps import split_stamp, split_stamps
from pipeline.sessions.logs.mcap.wire import Wire, figure, places

_TEMPLATES = 64  # tried for messages of one length; what fits none of them is walked through one by one
_ROWS_AT_ONCE = 1024

WireOf = Callable[[bytes], Wire]
Place = tuple[int, str]


def decoder(definition: Definition, type_name: str, content: str, source: Source, wire_of: WireOf) -> Decoder:
    """A decoder of a type's messages. ValueError where the type does not hold what the stream reads."""
    layout = find_layout(definition.leaves(), type_name, content, source)

    def one(payload: bytes) -> Reading:
        check_size(payload)
        wire = wire_of(payload)
        found = _located(payload, definition, wire, layout, source)
        if found.of_other_frame:
            raise OtherFrameError("it is of another frame")
        stamp = [figure(payload, place, wire) for place in found.stamp]
        seconds, nanoseconds = split_stamp(stamp, source.stamp_unit_s or 1.0)
        values = [0.0 if place is None else float(figure(payload, place, wire)) for place in found.figures]
        return Reading(seconds, nanoseconds, values, found.child, found.parent)

    def many(messages: Messages, which: IntArray, fields: Fields) -> None:
        for length in np.unique(messages.length[which]).tolist():
            if length <= PAYLOAD_LIMIT:
                alike = which[messages.length[which] == length]
                for begin in range(0, len(alike), _ROWS_AT_ONCE):
                    _decode_equally_long(messages, alike[begin : begin + _ROWS_AT_ONCE], fields)

    def _decode_equally_long(messages: Messages, which: IntArray, fields: Fields) -> None:
        """Use the first message not read yet as a template for others; one that makes no template is left."""
        rows = messages.rows(which)
        left: IntArray = np.arange(len(which))
        for _ in range(_TEMPLATES):
            if not len(left):
                return
            first = rows[left[0]].tobytes()
            try:
                wire = wire_of(first)
                found = _located(first, definition, wire, layout, source)
            except ValueError:
                left = left[1:]
                continue
            every = len(left) == len(rows)  # as mostly; rows need no copy then
            alike = _alike(rows if every else rows[left], rows[left[0]], found.fixed)
            own = left[alike]
            if found.of_other_frame:
                fields.of_other_frame[which[own]] = True
            else:
                read = _read(rows if len(own) == len(rows) else rows[own], found, wire, content, source)
                fields.take_named(which[own], read, found.child, found.parent)
            left = left[~alike]

    return Decoder(one, many)


@dataclass(frozen=True)
class _Located:
    """Where a message has what the stream reads, and which bytes it shares with those like it."""

    fixed: list[tuple[int, int]]
    of_other_frame: bool = False
    stamp: tuple[Place, ...] = ()
    figures: tuple[Place | None, ...] = ()
    child: str | None = None
    parent: str | None = None


def _located(payload: bytes, definition: Definition, wire: Wire, layout: Layout, source: Source) -> _Located:
    found = places(payload, definition, wire)
    fixed = [(0, min(2, wire.header)), *found.fixed]
    try:
        picked = pick(layout, source, found.counts.__getitem__, found.texts.__getitem__)
    except OtherFrameError:
        return _Located(fixed, of_other_frame=True)

    def place(path: Path) -> Place:
        try:
            return found.figures[at(path, picked.index)]
        except KeyError:
            raise ValueError(f"it has no {written(path)}") from None

    return _Located(
        fixed,
        False,
        tuple(place(path) for path in layout.stamp),
        tuple(None if path is None else place(path) for path in layout.figures),
        picked.child,
        None if layout.parent is None else found.texts[at(layout.parent, picked.index)],
    )


def _alike(rows: Bytes, first: Bytes, fixed: list[tuple[int, int]]) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which rows have the first one's bytes in the fixed spans."""
    where = np.concatenate([np.arange(begin, end) for begin, end in fixed])
    alike: np.ndarray[tuple[int], np.dtype[np.bool_]] = (rows[:, where] == first[where]).all(axis=1)
    return alike


def _read(rows: Bytes, found: _Located, wire: Wire, content: str, source: Source) -> Fields:
    """Stamps and values of messages that are alike."""
    read = Fields.none_of(len(rows), content)
    stamp = [_column(rows, place, wire) for place in found.stamp]
    read.seconds[:], read.nanoseconds[:] = split_stamps(stamp, source.stamp_unit_s or 1.0, len(rows))
    for index, place in enumerate(found.figures):
        if place is not None:
            read.values[:, index] = _column(rows, place, wire)
    return read


def _column(rows: Bytes, place: tuple[int, str], wire: Wire) -> np.ndarray[tuple[int], np.dtype[np.generic]]:
    begin, code = place
    kind = np.dtype(wire.order + code) if code != "?" else np.dtype("u1")
    cells = np.ascontiguousarray(rows[:, begin : begin + kind.itemsize])
    return cells.view(kind)[:, 0]
