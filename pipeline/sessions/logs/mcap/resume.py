"""Finds where reading can resume behind damage: at the next record that cannot be mistaken for other bytes."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import BinaryIO

from mcap.opcode import Opcode

_COMPRESSIONS = (b"zstd", b"lz4", b"")
_CHUNK = struct.Struct("<BQQQQII")  # opcode, length, two times, size, checksum, length of the compression's name
_LENGTH = struct.Struct("<Q")
_RECORD_HEAD_BYTES = 9
_FOOTER = struct.Struct("<BQQQI")
_MAGIC_BYTES = 8
_FIRST_BLOCK = 2**12
_BLOCK = 2**20


@dataclass(frozen=True)
class Place:
    """A position in the file, in bytes, and what is there."""

    position: int
    what: str


def next_place(file: BinaryIO, begin: int) -> Place | None:
    """The first chunk from `begin` on, else the summary, else the end of a whole file; None where there is neither."""
    end = file.seek(0, 2)
    chunk = _next_chunk(file, begin, end)
    if chunk is not None:
        return Place(chunk, "the next chunk")
    footer = end - _MAGIC_BYTES - _FOOTER.size
    if footer < begin:
        return None
    file.seek(footer)
    opcode, length, summary, _, _ = _FOOTER.unpack(file.read(_FOOTER.size))
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _RECORD_HEAD_BYTES:
        return None
    return Place(summary, "the summary") if begin <= summary < footer else Place(footer, "its end")


def _next_chunk(file: BinaryIO, begin: int, end: int) -> int | None:
    """A chunk states its length twice, around the name of its compression: where both agree, it is one."""
    longest = _CHUNK.size + max(map(len, _COMPRESSIONS)) + _LENGTH.size
    size = _FIRST_BLOCK
    while begin < end:
        file.seek(begin)
        block = file.read(size + longest)
        at = block.find(Opcode.CHUNK, 0, size)
        while at >= 0:
            if _is_chunk(block[at : at + longest], end - begin - at):
                return begin + at
            at = block.find(Opcode.CHUNK, at + 1, size)
        begin += size
        size = min(2 * size, _BLOCK)
    return None


def _is_chunk(head: bytes, room: int) -> bool:
    """Whether these bytes, with `room` bytes from their first to the file's end, begin a whole chunk."""
    if len(head) < _CHUNK.size:
        return False
    _, length, _, _, _, _, name_bytes = _CHUNK.unpack_from(head)
    name = head[_CHUNK.size : _CHUNK.size + name_bytes]
    if name_bytes > 4 or name not in _COMPRESSIONS or len(head) < _CHUNK.size + name_bytes + _LENGTH.size:
        return False
    (inner,) = _LENGTH.unpack_from(head, _CHUNK.size + name_bytes)
    outer = _CHUNK.size - _RECORD_HEAD_BYTES + name_bytes + _LENGTH.size + int(inner)
    return bool(length == outer and _RECORD_HEAD_BYTES + length <= room)
