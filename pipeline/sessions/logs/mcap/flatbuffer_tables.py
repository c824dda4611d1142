"""Tables in a flatbuffer, as far as reading one needs it: a table is found by its vtable, a field by its number in it.

A table begins with the distance back to its vtable (int32). The vtable holds its own size and the table's (uint16
each), then for each field the distance from the table's begin, 0 for a field that is not there. Texts, vectors and
tables within a table are references: the distance from the reference on (uint32). A vector and a text begin with their
length. Everything is little-endian. (https://flatbuffers.dev/internals)
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from pipeline.sessions.logs.mcap.fields import UNFIT

_UINT16, _INT32, _UINT32 = struct.Struct("<H"), struct.Struct("<i"), struct.Struct("<I")


@dataclass(frozen=True)
class Buffer:
    """The bytes, and which spans of them have been followed: references, vtables, lengths and texts."""

    data: bytes
    followed: list[tuple[int, int]] = field(default_factory=list)

    def root(self) -> int:
        """Where the outermost table begins."""
        return self.target(0)

    def target(self, at: int) -> int:
        """Where a reference leads."""
        return at + self._number(_UINT32, at)

    def length(self, at: int) -> int:
        """The length of the vector or text at `at`; what it holds follows behind."""
        return self._number(_UINT32, at)

    def text(self, at: int) -> str:
        """The text at `at`. ValueError where it is none."""
        begin, size = at + 4, self.length(at)
        self.within(begin, size)
        self.followed.append((begin, begin + size))
        return self.data[begin : begin + size].decode()

    def fields(self, table: int) -> tuple[int, ...]:
        """Where each field of a table is, 0 for one that is not there."""
        vtable = table - self._number(_INT32, table)
        size = self._number(_UINT16, vtable)
        if size < 4 or size % 2:
            raise ValueError(UNFIT)
        self.within(vtable, size)
        self.followed.append((vtable, vtable + size))
        offsets = struct.unpack_from(f"<{size // 2 - 2}H", self.data, vtable + 4)
        return tuple(offset and table + offset for offset in offsets)

    def within(self, begin: int, size: int) -> None:
        """Raise ValueError for a span that is not within the bytes."""
        if not 0 <= begin <= begin + size <= len(self.data):
            raise ValueError(UNFIT)

    def _number(self, kind: struct.Struct, at: int) -> int:
        self.within(at, kind.size)
        self.followed.append((at, at + kind.size))
        number: int = kind.unpack_from(self.data, at)[0]
        return number


def field_at(places: tuple[int, ...], number: int) -> int:
    """Where field `number` is; 0 for none, as of one that is younger than the writer."""
    return places[number] if number < len(places) else 0


def references(buffer: Buffer, vector: int, most: int) -> Iterator[int]:
    """Where the elements of a vector of references lead. ValueError for more than `most`."""
    count = buffer.length(vector)
    if count > most:
        raise ValueError(UNFIT)
    for index in range(count):
        yield buffer.target(vector + 4 + 4 * index)
