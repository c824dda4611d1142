"""What each record of a log holds: definitions, messages, chunks, facts about the session.

Records are parsed by the `mcap` package. A record that cannot be read is noted and passed over; one that contradicts
another, or would exhaust the memory, ends the reading (SessionError).
"""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import replace
from typing import TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, MessageIndex, Metadata, Schema, Statistics

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.logs.mcap import damage
from pipeline.sessions.logs.mcap.inflate import DAMAGED, check_stated_size, inflate
from pipeline.sessions.logs.mcap.messages import joined, messages_at, record_starts
from pipeline.sessions.logs.mcap.schemas import content_of
from pipeline.sessions.logs.mcap.walk import Topic, Walk

_Record = TypeVar("_Record", bound=McapRecord)

BROKEN = (McapError, struct.error, UnicodeDecodeError, ValueError, EOFError, OverflowError)
"""What reading a damaged record raises."""

RECORD_HEAD = struct.Struct("<BQ")
BLOCK_BYTES = 2**20
DECODED_AT_ONCE = 2**22
"""Bytes of a topic's messages, so many that it is quick."""
HOW_TO_LIFT = (
    "that is mostly a damaged or malicious file; if it is sound, write `log_limits: {unpacked_mib: N}` in study.yaml"
)
_DEFINITION_LIMIT = 2**20  # bytes of a schema or channel
_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


def take_record(walk: Walk, opcode: int, head: bytes, body: bytes) -> None:
    """One record of the file itself.

    Schemas, channels and messages may stand outside of any chunk, one by one. They are gathered and read together, as
    if they were one: many at once are much faster.
    """
    if opcode in _IN_CHUNKS:
        walk.loose += head + body
        if len(walk.loose) > BLOCK_BYTES:
            take_loose(walk)
        return
    take_loose(walk)
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


def take_loose(walk: Walk) -> None:
    if walk.loose:
        data = bytes(walk.loose)
        walk.loose.clear()
        _take_records(walk, data)


def _take_records(walk: Walk, data: bytes) -> bool:
    """Read the schemas, channels and messages in a chunk or outside of any; False if they end in mid-record."""
    starts_found, whole = record_starts(data, walk.messages_limit - walk.messages)
    walk.messages += len(starts_found)
    if walk.messages > walk.messages_limit:
        raise SessionError(
            f"refused: it holds more than {walk.messages_limit} messages, too many for its size; if it is sound, write "
            "`log_limits: {messages: N}` in study.yaml"
        )
    starts = np.array(starts_found, dtype=np.int64)
    kinds = np.frombuffer(data, np.uint8)[starts]
    for start in starts[(kinds == int(Opcode.SCHEMA)) | (kinds == int(Opcode.CHANNEL))].tolist():
        opcode, length = RECORD_HEAD.unpack_from(data, start)
        begin = start + RECORD_HEAD.size
        try:
            _take_definition(walk, opcode, data[begin : begin + length])
        except BROKEN as error:
            _note_broken(walk, opcode, error)
    messages, too_short = messages_at(data, starts[kinds == int(Opcode.MESSAGE)])
    if too_short:
        walk.note(damage.short_messages(too_short))
        walk.unknown_loss = True
    walk.unshared.append(messages)
    if sum(len(part.data) for part in walk.unshared) > BLOCK_BYTES:
        share_out(walk)
    return whole


def share_out(walk: Walk) -> None:
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
            walk.hand_on(topic, DECODED_AT_ONCE)


def _take_definition(walk: Walk, opcode: int, body: bytes) -> None:
    """A schema or a channel. It may be defined again, but only in the same way."""
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
    """The error of two definitions of one number.

    Among the messages it ends the reading, for their topics are unknown. The summary only repeats what stands before,
    so there it is one more damaged record.
    """
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
        walk.note(damage.damaged_chunk(walk.chunks, error))
        return
    walk.last_chunk_damaged = False
    if not _take_records(walk, data):
        raise ValueError(f"chunk {walk.chunks} ends in mid-record")


def _allow(walk: Walk, stated: int) -> None:
    """Raise SessionError if this many more bytes would make the log a decompression bomb."""
    walk.inflated += stated
    if walk.inflated > walk.inflated_limit:
        raise SessionError(
            f"refused: it would inflate to more than {walk.inflated_limit // 2**20} MiB, far more than its own size; "
            f"{HOW_TO_LIFT}"
        )
    if stated > walk.chunk_limit:
        raise SessionError(f"refused: a chunk that would inflate to {stated // 2**20} MiB; {HOW_TO_LIFT}")


def _note_broken(walk: Walk, opcode: int, error: BaseException) -> None:
    walk.note(damage.unreadable_record(opcode, error))
    walk.unknown_loss = True


def _parsed(kind: type[_Record], body: bytes) -> _Record:
    record: _Record = kind.read(ReadDataStream(io.BytesIO(body)))  # type: ignore[attr-defined]
    return record
