"""The file of a log, walked record by record and not by its index.

So a log without its end gives every whole chunk, a message outside the chunks is not lost, and no length in the file is
believed before it is checked. `records` says what each record holds, `damage` what a user is told of a damaged log.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import DEFAULT_LIMITS, Limits
from pipeline.sessions.logs.mcap import damage
from pipeline.sessions.logs.mcap.file import unpacked
from pipeline.sessions.logs.mcap.inflate import CHUNK_LIMIT
from pipeline.sessions.logs.mcap.records import HOW_TO_LIFT, RECORD_HEAD, share_out, take_loose, take_record
from pipeline.sessions.logs.mcap.resume import next_place
from pipeline.sessions.logs.mcap.walk import Taker, Walk

MAGIC = b"\x89MCAP0\r\n"

# A log may unpack to the study's limit, or to 64 times its own size if that is more: a decompression bomb goes beyond.
_INFLATION_LIMIT = 64
# And it may hold the study's limit of messages, or one in 16 bytes if that is more: empty ones would fill the memory.
_BYTES_PER_MESSAGE = 16
_BLOCK = 2**20
# Others, such as attachments, are skipped.
_USED = frozenset(
    {
        Opcode.FOOTER,
        Opcode.SCHEMA,
        Opcode.CHANNEL,
        Opcode.MESSAGE,
        Opcode.CHUNK,
        Opcode.MESSAGE_INDEX,
        Opcode.METADATA,
        Opcode.STATISTICS,
        Opcode.DATA_END,
    }
)


def walk_log(path: Path, wanted: Mapping[str, Mapping[str, Taker]] | None, limits: Limits = DEFAULT_LIMITS) -> Walk:
    """Everything of a log: its facts, its channels, and the messages of the wanted topics (of others the number only).

    Those of wanted topics are handed to their takers as they are read. With None, every topic is wanted whose schema
    says what it holds. SessionError if the file is no MCAP log, would unpack to far more bytes than any session has
    (a decompression bomb), or contradicts itself.
    """
    size = path.stat().st_size
    walk = Walk(
        wanted,
        max(limits.unpacked_bytes, _INFLATION_LIMIT * size),
        max(limits.messages, size // _BYTES_PER_MESSAGE),
        max(limits.unpacked_bytes, CHUNK_LIMIT),
    )
    with unpacked(path, walk) as (file, size):
        _walk_file(walk, file, size)
    _adopt_orphans(walk)
    if walk.unlisted_faults:
        walk.faults.append(damage.further_faults(walk.unlisted_faults))
    if not any(topic.read for topic in walk.topics.values()):
        raise SessionError("; ".join(["it holds no message that can be read", *walk.faults]))
    return walk


def _walk_file(walk: Walk, file: BinaryIO, size: int) -> None:
    start = file.read(len(MAGIC))
    if not start:
        raise SessionError("the file is empty")
    if start != MAGIC:
        raise SessionError("not an MCAP file: it does not begin with the MCAP mark")
    checksum = zlib.crc32(start)
    position = file.tell()
    while not walk.complete:
        before, previous, position = checksum, position, file.tell()
        head = file.read(RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            take_loose(walk)
            walk.note(damage.NO_SUMMARY)
            walk.unknown_loss = True
            return
        opcode, length = RECORD_HEAD.unpack(head)
        left = size - file.tell() - length
        if opcode == 0 or left < 0 or (opcode == Opcode.FOOTER and left > len(MAGIC)):
            if not _skip_damage(walk, file, opcode, previous):
                return
            continue
        checksum = zlib.crc32(head, checksum)
        if opcode not in _USED:
            checksum = _skip_record(file, length, checksum)
            continue
        if length > walk.inflated_limit:
            raise SessionError(f"refused: a record of {length // 2**20} MiB; {HOW_TO_LIFT}")
        body = file.read(length)
        if opcode == Opcode.DATA_END:
            _check_data_end(walk, body, before)
        checksum = zlib.crc32(body, checksum)
        take_record(walk, opcode, head, body)
    if file.read(len(MAGIC)) != MAGIC:
        walk.note(damage.NO_LAST_BYTES)


def _skip_damage(walk: Walk, file: BinaryIO, opcode: int, previous: int) -> bool:
    """Go on behind damage, where a chunk or the summary is recognised by its bytes; False where there is none.

    The search begins within the record before, at `previous`: a wrong length in it may have led here.
    """
    position = file.tell()
    take_loose(walk)
    walk.unknown_loss = True
    place = next_place(file, previous + 1)
    if place is None:
        walk.note(damage.truncated(position, opcode))
        return False
    walk.note(damage.resumed(position, place))
    file.seek(place.position)
    return True


def _skip_record(file: BinaryIO, length: int, checksum: int) -> int:
    """The checksum after a record that is not needed, such as an attachment, which may be large: read in blocks."""
    while length > 0:
        block = file.read(min(length, _BLOCK))
        if not block:
            break
        checksum = zlib.crc32(block, checksum)
        length -= len(block)
    return checksum


def _check_data_end(walk: Walk, body: bytes, checksum: int) -> None:
    stated = struct.unpack("<I", body[:4])[0] if len(body) >= 4 else 0
    if stated not in (0, checksum) and not walk.faults:
        walk.note(damage.WRONG_CHECKSUM)


def _adopt_orphans(walk: Walk) -> None:
    """Give messages of unknown channels to their topics, now that the summary has named the channels again.

    The first definition of a channel may have been lost in a damaged chunk.
    """
    share_out(walk)
    walk.unshared, walk.orphans = walk.orphans, []
    share_out(walk)
    without_topic = sum(map(len, walk.orphans))
    if without_topic:
        walk.note(damage.messages_without_topic(without_topic))
        walk.unknown_loss = True
