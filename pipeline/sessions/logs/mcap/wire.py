"""Where each field of a serialised ROS message lies, by walking through its bytes along its definition.

Four ways to write the same fields (OMG DDS-XTypes 1.3, 7.4; wiki.ros.org/msg):

    ros1    no header, little-endian, nothing aligned, texts without a final zero
    CDR     4 bytes of header; every figure aligned to its own size, counted from behind the header
    CDR 2   the same, but nothing aligned to more than 4 bytes; before a sequence of messages or texts its bytes
    delimited CDR 2   the same, and before each message its bytes

Messages in which every length and every text are the same have all their figures at the same places. So one message
that was walked through is a template for all others like it, which `by_places` reads at once.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from pipeline.sessions.logs.mcap.definition_text import SIZES, Definition, Field
from pipeline.sessions.logs.mcap.fields import UNFIT
from pipeline.sessions.logs.mcap.layout import Path
from pipeline.sessions.logs.mcap.places import Places

_STEPS_LIMIT = 20_000  # fields walked through: a message of so many holds no sensor's reading
_CDR2, _DELIMITED = (6, 7), (8, 9)


@dataclass(frozen=True)
class Wire:
    """A way to write fields: byte order, the largest alignment, bytes of header, and what else stands before them."""

    order: str
    alignment: int
    header: int
    terminated: bool = True
    sized_sequences: bool = False
    sized_messages: bool = False


ROS1 = Wire("<", 1, 0, terminated=False)


def wire_of(payload: bytes) -> Wire:
    """The way in which a CDR message is written, by its header. ValueError for one that is not read."""
    if len(payload) < 4 or payload[0] != 0:
        raise ValueError(UNFIT)
    order = "<" if payload[1] & 1 else ">"
    if payload[1] in (0, 1):
        return Wire(order, 8, 4)
    if payload[1] in (*_CDR2, *_DELIMITED):
        return Wire(order, 4, 4, sized_sequences=True, sized_messages=payload[1] in _DELIMITED)
    raise ValueError(f"it is written in a representation of CDR that is not read ({payload[0]:02x} {payload[1]:02x})")


def places(payload: bytes, definition: Definition, wire: Wire) -> Places:
    """Walk through a message. ValueError where its bytes do not fit the definition."""
    walk = _Walk(payload, definition, wire)
    walk.message(definition.name, ())
    # Senders may pad a message to the next multiple of eight bytes.
    if not walk.at <= len(payload) < walk.at + 8:
        raise ValueError(UNFIT)
    return walk.places


class _Walk:
    """One walk through a message's bytes; `at` is the next byte."""

    def __init__(self, payload: bytes, definition: Definition, wire: Wire) -> None:
        self.payload, self.messages, self.wire = payload, definition.messages, wire
        self.places, self.at, self.steps = Places(fixed=[(0, min(2, wire.header))]), wire.header, 0

    def message(self, name: str, path: Path) -> None:
        if self.wire.sized_messages:
            self._number_of_bytes()
        for one in self.messages[name]:
            self.steps += 1
            if self.steps > _STEPS_LIMIT:
                raise ValueError(UNFIT)
            self._field(one, (*path, one.name))

    def _field(self, one: Field, path: Path) -> None:
        if one.count is None:
            self._one(one.kind, path)
            return
        if self.wire.sized_sequences and one.kind not in SIZES:
            self._number_of_bytes()
        count = self._number_of_bytes() if one.count < 0 else one.count
        self.places.counts[path] = count
        if one.kind in SIZES:
            self._figures(one.kind, path, count)
            return
        for index in range(count):
            self.steps += 1
            if self.steps > _STEPS_LIMIT:
                raise ValueError(UNFIT)
            self._one(one.kind, (*path, index))

    def _one(self, kind: str, path: Path) -> None:
        if kind in SIZES:
            code, size = SIZES[kind]
            self._align(size)
            self.places.figures[path] = self._take(size), self.wire.order + code
        elif kind in self.messages:
            self.message(kind, path)
        elif kind == "string":
            self._text(path)
        else:
            raise ValueError(f"its schema has a field of type {kind}, which is not read")

    def _figures(self, kind: str, path: Path, count: int) -> None:
        """An array of numbers, of which only the first few get a path each: the others are never read one by one."""
        code, size = SIZES[kind]
        if count:
            self._align(size)
        first = self._take(size * count)
        for index in range(min(count, 64)):
            self.places.figures[*path, index] = first + size * index, self.wire.order + code

    def _text(self, path: Path) -> None:
        size = self._number_of_bytes()
        begin = self._take(size)
        self.places.fixed.append((begin, begin + size))
        text = self.payload[begin : begin + size]
        # CDR ends a text with a zero, and some senders leave an empty one without it.
        self.places.texts[path] = (text[:-1] if self.wire.terminated else text).decode()

    def _number_of_bytes(self) -> int:
        self._align(4)
        begin = self._take(4)
        self.places.fixed.append((begin, begin + 4))
        number: int = struct.unpack_from(f"{self.wire.order}I", self.payload, begin)[0]
        return number

    def _align(self, size: int) -> None:
        boundary = min(size, self.wire.alignment)
        self.at += -(self.at - self.wire.header) % boundary

    def _take(self, size: int) -> int:
        begin, self.at = self.at, self.at + size
        if self.at > len(self.payload):
            raise ValueError(UNFIT)
        return begin
