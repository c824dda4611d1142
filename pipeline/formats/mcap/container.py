"""The container, walked record by record and not by its index: so a log without its end gives every whole chunk, a
message outside the chunks is not lost, and no length in the file is believed before it is checked.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, MessageIndex, Metadata, Schema, Statistics

from pipeline.errors import SessionError
from pipeline.formats.log import Content

_Record = TypeVar("_Record", bound=McapRecord)

MAGIC = b"\x89MCAP0\r\n"

BROKEN = (McapError, struct.error, UnicodeDecodeError, ValueError, EOFError)
"""What reading a damaged record raises."""

_INFLATED_LIMIT = 64 * 2**20  # bytes a log may always inflate to; beyond it, so many times its own size
_INFLATION_LIMIT = 64
_CHUNK_LIMIT = 128 * 2**20
_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_MESSAGES_LIMIT = 500_000  # a log may always hold; beyond it, one for so many bytes of its size
_BYTES_PER_MESSAGE = 16
_BLOCK = 2**20


@dataclass
class Topic:
    """What is gathered of one topic while the file is walked."""

    messages: list[tuple[int, int, int, bytes]] = field(default_factory=list)  # log, publish time, channel, payload
    in_damaged_chunks: int = 0


@dataclass
class Walk:
    """What is known so far. A damaged chunk's message indexes follow it and say what it held."""

    wanted: Mapping[str, Content]
    inflated_limit: int
    messages_limit: int
    messages: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    topics: dict[str, Topic] = field(default_factory=dict)
    orphans: list[tuple[int, int, int, bytes]] = field(default_factory=list)  # their channel is named later, or never
    facts: dict[str, str] = field(default_factory=dict)
    stated: dict[int, int] | None = None
    faults: list[str] = field(default_factory=list)
    inflated: int = 0
    chunks: int = 0
    last_chunk_damaged: bool = False
    unknown_loss: bool = False
    complete: bool = False


def walk_log(path: Path, wanted: Mapping[str, Content]) -> Walk:
    """Everything of a log: its facts, its channels, and the messages of the wanted topics (of others the number only).

    SessionError if it is no log, is a bomb, or contradicts itself.
    """
    size = path.stat().st_size
    state = Walk(
        wanted, max(_INFLATED_LIMIT, _INFLATION_LIMIT * size), max(_MESSAGES_LIMIT, size // _BYTES_PER_MESSAGE)
    )
    with path.open("rb") as file:
        _walk_file(state, file, size)
    _adopt_orphans(state)
    if not any(topic.messages for topic in state.topics.values()):
        raise SessionError("; ".join(["it holds no message that can be read", *state.faults]))
    return state


def _walk_file(walk: Walk, file: BinaryIO, size: int) -> None:
    start = file.read(len(MAGIC))
    if not start:
        raise SessionError("the file is empty")
    if start != MAGIC:
        raise SessionError("not an MCAP file: it does not begin with the MCAP mark")
    checksum = zlib.crc32(start)
    while not walk.complete:
        before = checksum
        head = file.read(_RECORD_HEAD.size)
        if len(head) < _RECORD_HEAD.size:
            walk.faults.append("the log ends without its summary: it was cut off, or its recorder was stopped")
            walk.unknown_loss = True
            return
        opcode, length = _RECORD_HEAD.unpack(head)
        if length > size - file.tell():
            what = "a chunk of messages" if opcode == Opcode.CHUNK else "a record"
            walk.faults.append(f"the log is cut off, or damaged, {file.tell()} bytes in: {what} is not all there")
            walk.unknown_loss = True
            return
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
        _take_record(walk, opcode, body)
    if file.read(len(MAGIC)) != MAGIC:
        walk.faults.append("the log's last bytes are missing")


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
    for message in walk.orphans:
        channel = walk.channels.get(message[2])
        if channel is not None:
            walk.topics[channel.topic].messages.append(message)
    nameless = sum(message[2] not in walk.channels for message in walk.orphans)
    if nameless:
        walk.faults.append(f"{nameless} messages are left out: the log does not say what topic they belong to")
        walk.unknown_loss = True


def _parsed(kind: type[_Record], body: bytes) -> _Record:
    record: _Record = kind.read(ReadDataStream(io.BytesIO(body)))  # type: ignore[attr-defined]
    return record


def _check_data_end(walk: Walk, body: bytes, checksum: int) -> None:
    stated = struct.unpack("<I", body[:4])[0] if len(body) >= 4 else 0
    if stated not in (0, checksum) and not walk.faults:
        walk.faults.append("the log's checksum does not fit its bytes: something in it is damaged")


def _take_record(walk: Walk, opcode: int, body: bytes) -> None:
    """One record of the file itself; anything unknown or of no use here is passed over."""
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
        else:
            _take_message_record(walk, opcode, body)
    except BROKEN as error:
        name = Opcode(opcode).name.lower().replace("_", " ") if opcode in set(Opcode) else f"kind {opcode}"
        walk.faults.append(f"a record ({name}) cannot be read: {str(error) or type(error).__name__}")
        walk.unknown_loss = True


def _take_message_record(walk: Walk, opcode: int, body: bytes) -> None:
    """A schema, channel or message, inside a chunk or outside."""
    if opcode == Opcode.MESSAGE:
        channel_id, _, log_time, publish_time = _MESSAGE_HEAD.unpack_from(body)
        channel = walk.channels.get(channel_id)
        walk.messages += 1
        if walk.messages > walk.messages_limit:
            raise SessionError(f"refused: it holds more than {walk.messages_limit} messages, too many for its size")
        payload = body[_MESSAGE_HEAD.size :]
        if channel is None:
            walk.orphans.append((log_time, publish_time, channel_id, payload))
        else:
            kept = payload if channel.topic in walk.wanted else b""
            walk.topics[channel.topic].messages.append((log_time, publish_time, channel_id, kept))
    elif opcode == Opcode.CHANNEL:
        named = _parsed(Channel, body)
        known = walk.channels.setdefault(named.id, named)
        if (known.topic, known.schema_id, known.message_encoding) != (
            named.topic,
            named.schema_id,
            named.message_encoding,
        ):
            raise SessionError(
                f'channel {named.id} is defined twice, as "{known.topic}" and as "{named.topic}": which '
                "messages belong to which cannot be told"
            )
        walk.topics.setdefault(named.topic, Topic())
    elif opcode == Opcode.SCHEMA:
        schema = _parsed(Schema, body)
        before = walk.schemas.setdefault(schema.id, schema)
        if (before.name, before.encoding, before.data) != (schema.name, schema.encoding, schema.data):
            raise SessionError(f'schema {schema.id} is defined twice, as "{before.name}" and as "{schema.name}"')


def _take_chunk(walk: Walk, body: bytes) -> None:
    walk.chunks += 1
    walk.last_chunk_damaged = False
    chunk = _parsed(Chunk, body)
    try:
        data = _inflate(walk, chunk)
        if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
            raise ValueError("its checksum does not fit its bytes")
    except (ValueError, zstandard.ZstdError, RuntimeError, EOFError) as error:
        walk.last_chunk_damaged = True
        walk.faults.append(f"chunk {walk.chunks} is damaged and left out: {error}")
        return
    position = 0
    while position < len(data):
        if position + _RECORD_HEAD.size > len(data):
            raise ValueError(f"chunk {walk.chunks} ends in mid-record")
        opcode, length = _RECORD_HEAD.unpack_from(data, position)
        position += _RECORD_HEAD.size
        if position + length > len(data):
            raise ValueError(f"chunk {walk.chunks} ends in mid-record")
        _take_message_record(walk, opcode, data[position : position + length])
        position += length


def _inflate(walk: Walk, chunk: Chunk) -> bytes:
    """The chunk's bytes, never more than it states nor more than a log may hold."""
    stated = chunk.uncompressed_size
    walk.inflated += stated
    if walk.inflated > walk.inflated_limit:
        raise SessionError(
            f"refused: it would inflate to more than {walk.inflated_limit // 2**20} MiB, which no session's log does"
        )
    if stated > _CHUNK_LIMIT:
        raise SessionError(f"refused: a chunk that inflates to {stated // 2**20} MiB, which no recorder writes")
    if chunk.compression == "":
        data = bytes(chunk.data)
    elif chunk.compression == "zstd":
        reader = zstandard.ZstdDecompressor().stream_reader(chunk.data)
        data = reader.read(stated + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=stated + 1)
    else:
        raise ValueError(f'its compression "{chunk.compression}" is not one of zstd, lz4')
    if len(data) > stated:
        raise SessionError(f"refused: a chunk that states {stated} bytes inflates to more")
    if len(data) < stated:
        raise ValueError(f"it states {stated} bytes and holds {len(data)}")
    return data
