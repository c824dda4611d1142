"""The container, walked record by record and not by its index: so a log without its end gives every whole chunk, a
message outside the chunks is not lost, and no length in the file is believed before it is checked.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, MessageIndex, Metadata, Schema, Statistics

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import Content, IntArray
from pipeline.sessions.logs.mcap.inflate import CHUNK_LIMIT, DAMAGED, check_stated_size, inflate
from pipeline.sessions.logs.mcap.messages import Messages, joined, messages_at, record_starts
from pipeline.sessions.logs.mcap.resume import next_place
from pipeline.sessions.logs.mcap.schemas import content_of

_Record = TypeVar("_Record", bound=McapRecord)

MAGIC = b"\x89MCAP0\r\n"

BROKEN = (McapError, struct.error, UnicodeDecodeError, ValueError, EOFError, OverflowError)
"""What reading a damaged record raises."""

_INFLATED_LIMIT = 64 * 2**20  # bytes a log may always inflate to; beyond it, so many times its own size
_INFLATION_LIMIT = 64
_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGES_LIMIT = 500_000  # a log may always hold; beyond it, one for so many bytes of its size
_BYTES_PER_MESSAGE = 16
_BLOCK = 2**20
_FAULTS_LIMIT = 20
_DEFINITION_LIMIT = 2**20  # bytes of a schema or channel


@dataclass
class Topic:
    """What has been collected of one topic while the file is read."""

    parts: list[Messages] = field(default_factory=list)
    channels: list[int] = field(default_factory=list)
    content: Content | None = None  # by the schema of its channels, as far as that tells
    in_damaged_chunks: int = 0

    @property
    def read(self) -> int:
        """How many of its messages have been found."""
        return sum(map(len, self.parts))


@dataclass
class Walk:
    """What is known so far. A damaged chunk's message indexes follow it and say what it held."""

    wanted: Mapping[str, Content] | None
    inflated_limit: int
    messages_limit: int
    messages: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    topics: dict[str, Topic] = field(default_factory=dict)
    unshared: list[Messages] = field(default_factory=list)  # not yet given to their topics: many at once are faster
    orphans: list[Messages] = field(default_factory=list)  # their channel is named later, or never
    loose: bytearray = field(default_factory=bytearray)  # records outside of any chunk, not looked at yet
    facts: dict[str, str] = field(default_factory=dict)
    stated: dict[int, int] | None = None
    faults: list[str] = field(default_factory=list)
    noted: int = 0
    inflated: int = 0
    chunks: int = 0
    last_chunk_damaged: bool = False
    unknown_loss: bool = False
    in_summary: bool = False
    complete: bool = False

    def note(self, fault: str) -> None:
        """Note a fault of the file; after the first few, faults are only counted."""
        self.noted += 1
        if self.noted <= _FAULTS_LIMIT:
            self.faults.append(fault)


def walk_log(path: Path, wanted: Mapping[str, Content] | None) -> Walk:
    """Everything of a log: its facts, its channels, and the messages of the wanted topics (of others the number only).

    With None, topics whose schema tells what they hold are wanted.
    SessionError if it is no log, is a bomb, or contradicts itself.
    """
    size = path.stat().st_size
    state = Walk(
        wanted, max(_INFLATED_LIMIT, _INFLATION_LIMIT * size), max(_MESSAGES_LIMIT, size // _BYTES_PER_MESSAGE)
    )
    with path.open("rb") as file:
        _walk_file(state, file, size)
    _adopt_orphans(state)
    if state.noted > _FAULTS_LIMIT:
        state.faults.append(f"and {state.noted - _FAULTS_LIMIT} further faults")
    if not any(topic.read for topic in state.topics.values()):
        raise SessionError("; ".join(["it holds no message that can be read", *state.faults]))
    return state


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
        head = file.read(_RECORD_HEAD.size)
        if len(head) < _RECORD_HEAD.size:
            _take_loose(walk)
            walk.note("the log ends without its summary: it was cut off, or its recorder was stopped")
            walk.unknown_loss = True
            return
        opcode, length = _RECORD_HEAD.unpack(head)
        left = size - file.tell() - length
        if opcode == 0 or left < 0 or (opcode == Opcode.FOOTER and left > len(MAGIC)):
            if not _resumed(walk, file, opcode, previous):
                return
            continue
        checksum = zlib.crc32(head, checksum)
        if opcode not in _USED:
            checksum = _passed_over(file, length, checksum)
            continue
        if length > walk.inflated_limit:
            raise SessionError(f"refused: a record of {length // 2**20} MiB, which no session's log holds")
        body = file.read(length)
        if opcode == Opcode.DATA_END:
            _check_data_end(walk, body, before)
        checksum = zlib.crc32(body, checksum)
        _take_record(walk, opcode, head, body)
    if file.read(len(MAGIC)) != MAGIC:
        walk.note("the log's last bytes are missing")


def _resumed(walk: Walk, file: BinaryIO, opcode: int, previous: int) -> bool:
    """Go on behind damage, where a chunk or the summary can be told from its bytes; False where there is none.

    The record before, at `previous`, may have led astray by a wrong length, so it is looked into.
    """
    at = file.tell()
    _take_loose(walk)
    walk.unknown_loss = True
    place = next_place(file, previous + 1)
    if place is None:
        what = "a chunk of messages" if opcode == Opcode.CHUNK else "a record"
        walk.note(f"the log is cut off, or damaged, {at} bytes in: {what} is not all there")
        return False
    walk.note(f"the log is damaged about {at} bytes in: reading goes on {place.position} bytes in, at {place.what}")
    file.seek(place.position)
    return True


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


def _passed_over(file: BinaryIO, length: int, checksum: int) -> int:
    """The checksum after a record of no use here, such as an attachment, read in blocks."""
    while length > 0:
        block = file.read(min(length, _BLOCK))
        if not block:
            break
        checksum = zlib.crc32(block, checksum)
        length -= len(block)
    return checksum


def _adopt_orphans(walk: Walk) -> None:
    """A damaged chunk may have held a channel's name; the log's summary names it again."""
    _share_out(walk)
    walk.unshared, walk.orphans = walk.orphans, []
    _share_out(walk)
    nameless = sum(map(len, walk.orphans))
    if nameless:
        walk.note(f"{nameless} messages are left out: the log does not say what topic they belong to")
        walk.unknown_loss = True


def _parsed(kind: type[_Record], body: bytes) -> _Record:
    record: _Record = kind.read(ReadDataStream(io.BytesIO(body)))  # type: ignore[attr-defined]
    return record


def _check_data_end(walk: Walk, body: bytes, checksum: int) -> None:
    stated = struct.unpack("<I", body[:4])[0] if len(body) >= 4 else 0
    if stated not in (0, checksum) and not walk.faults:
        walk.note("the log's checksum does not fit its bytes: something in it is damaged")


_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


def _take_record(walk: Walk, opcode: int, head: bytes, body: bytes) -> None:
    """One record of the file itself. Those that might be in a chunk are gathered, and taken as one."""
    if opcode in _IN_CHUNKS:
        walk.loose += head + body
        if len(walk.loose) > _BLOCK:
            _take_loose(walk)
        return
    _take_loose(walk)
    walk.in_summary = walk.in_summary or opcode == Opcode.DATA_END
    try:
        if opcode == Opcode.FOOTER:
            walk.complete = True
        elif opcode == Opcode.CHUNK:
            _take_chunk(walk, body)
        elif opcode == Opcode.MESSAGE_INDEX and walk.last_chunk_damaged:
            index = _parsed(MessageIndex, body)
            channel = walk.channels.get(index.channel_id)
            if channel is not None:
                walk.topics.setdefault(channel.topic, Topic()).in_damaged_chunks += len(index.records)
        elif opcode == Opcode.METADATA:
            metadata = _parsed(Metadata, body)
            if metadata.name == "session":
                walk.facts.update(metadata.metadata)
        elif opcode == Opcode.STATISTICS:
            statistics = _parsed(Statistics, body)
            walk.stated = dict(statistics.channel_message_counts)
    except BROKEN as error:
        _note_broken(walk, opcode, error)


def _note_broken(walk: Walk, opcode: int, error: BaseException) -> None:
    name = Opcode(opcode).name.lower().replace("_", " ")
    walk.note(f"a record ({name}) cannot be read: {str(error) or type(error).__name__}")
    walk.unknown_loss = True


def _take_loose(walk: Walk) -> None:
    if walk.loose:
        data = bytes(walk.loose)
        walk.loose.clear()
        _take_records(walk, data)


def _take_records(walk: Walk, data: bytes) -> bool:
    """Read the schemas, channels and messages in a chunk or outside of any; False if they end in mid-record."""
    found, whole = record_starts(data, walk.messages_limit - walk.messages)
    walk.messages += len(found)
    if walk.messages > walk.messages_limit:
        raise SessionError(f"refused: it holds more than {walk.messages_limit} messages, too many for its size")
    starts = np.array(found, dtype=np.int64)
    kinds = np.frombuffer(data, np.uint8)[starts]
    for start in starts[(kinds == int(Opcode.SCHEMA)) | (kinds == int(Opcode.CHANNEL))].tolist():
        opcode, length = _RECORD_HEAD.unpack_from(data, start)
        begin = start + _RECORD_HEAD.size
        try:
            _take_definition(walk, opcode, data[begin : begin + length])
        except BROKEN as error:
            _note_broken(walk, opcode, error)
    messages, too_short = messages_at(data, starts[kinds == int(Opcode.MESSAGE)])
    if too_short:
        walk.note(f"{too_short} messages are left out: they are too short to be any")
        walk.unknown_loss = True
    walk.unshared.append(messages)
    if sum(len(part.data) for part in walk.unshared) > _BLOCK:
        _share_out(walk)
    return whole


def _share_out(walk: Walk) -> None:
    """Add each message to its topic, in the order of the file; only the bytes of wanted topics are kept."""
    messages = joined(walk.unshared)
    walk.unshared.clear()
    shares: dict[str | None, list[IntArray]] = {}
    for channel_id, share in messages.by_channel():
        channel = walk.channels.get(channel_id)
        shares.setdefault(None if channel is None else channel.topic, []).append(share)
    for topic, parts in shares.items():
        which = parts[0] if len(parts) == 1 else np.sort(np.concatenate(parts))
        if topic is None:
            walk.orphans.append(messages.chosen(which))
        else:
            own_topic = walk.topics[topic]
            keep = own_topic.content is not None if walk.wanted is None else topic in walk.wanted
            own_topic.parts.append(messages.chosen(which, keep))


def _take_definition(walk: Walk, opcode: int, body: bytes) -> None:
    """A schema or a channel. The same may be said again; another of the same number may not."""
    if len(body) > _DEFINITION_LIMIT:
        raise ValueError(f"it is {len(body) // 1024} KiB long")
    if opcode == Opcode.CHANNEL:
        named = replace(_parsed(Channel, body), metadata={})
        new = named.id not in walk.channels
        known = walk.channels.setdefault(named.id, named)
        if known != named:
            raise _contradiction(walk, "channel", named.id, known.topic, named.topic)
        if new:
            _add_channel(walk, named)
    else:
        schema = _parsed(Schema, body)
        before = walk.schemas.setdefault(schema.id, schema)
        if before != schema:
            raise _contradiction(walk, "schema", schema.id, before.name, schema.name)


def _add_channel(walk: Walk, channel: Channel) -> None:
    topic = walk.topics.setdefault(channel.topic, Topic())
    topic.channels.append(channel.id)
    schema = walk.schemas.get(channel.schema_id)
    if schema is not None:
        topic.content = topic.content or content_of(channel.message_encoding, schema.name)


def _contradiction(walk: Walk, what: str, number: int, first: str, second: str) -> Exception:
    """Among the messages it ends the reading; in the summary, which only repeats, it is a damaged record."""
    text = f'{what} {number} is defined twice, as "{first}" and as "{second}"'
    if walk.in_summary:
        return ValueError(text)
    return SessionError(f"{text}: it is unknown which messages belong to which topic")


def _take_chunk(walk: Walk, body: bytes) -> None:
    walk.chunks += 1
    walk.last_chunk_damaged = True
    chunk = _parsed(Chunk, body)
    try:
        check_stated_size(chunk)
        _allow(walk, chunk.uncompressed_size)
        data = inflate(chunk)
        if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
            raise ValueError("its checksum does not fit its bytes")
    except DAMAGED as error:
        walk.note(f"chunk {walk.chunks} is damaged and left out: {error}")
        return
    walk.last_chunk_damaged = False
    if not _take_records(walk, data):
        raise ValueError(f"chunk {walk.chunks} ends in mid-record")


def _allow(walk: Walk, stated: int) -> None:
    """Raise SessionError if this many more bytes would make the log a decompression bomb."""
    walk.inflated += stated
    if walk.inflated > walk.inflated_limit:
        raise SessionError(
            f"refused: it would inflate to more than {walk.inflated_limit // 2**20} MiB, which no session's log does"
        )
    if stated > CHUNK_LIMIT:
        raise SessionError(f"refused: a chunk that inflates to {stated // 2**20} MiB, which no recorder writes")
