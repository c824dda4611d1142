"""MCAP logs, profile ros2: reading what is readable of a damaged one, and writing.

The container is walked record by record, not by its index: so a log without its end gives every whole chunk, a
message outside the chunks is not lost, and no length in the file is believed before it is checked. Records are
parsed by the `mcap` package and payloads by its ROS 2 decoder.
"""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, TypeVar

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, MessageIndex, Metadata, Schema, Statistics
from mcap_ros2.decoder import DecoderFactory

from pipeline.errors import SessionError
from pipeline.formats.log import Content, FloatArray, Log, Readings, Wanted

_Record = TypeVar("_Record", bound=McapRecord)

MAGIC = b"\x89MCAP0\r\n"
SCHEMAS: Mapping[str, str] = {
    "position": "geometry_msgs/msg/PointStamped",
    "acceleration": "sensor_msgs/msg/Imu",
}
EVENT_TYPES = ("session_start", "trial_start", "selection", "session_end")

_INFLATED_LIMIT = 64 * 2**20  # bytes a log may always inflate to; beyond it, so many times its own size
_INFLATION_LIMIT = 64
_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_MESSAGES_LIMIT = 500_000  # a log may always hold; beyond it, one for so many bytes of its size
_BYTES_PER_MESSAGE = 16
_TIME_LIMIT_NS = 2**62
_NUMBER_LIMIT = 2**53
_BLOCK = 2**20
_PLAUSIBLE = {"position": 1e4, "acceleration": 1e5}  # m; m/s², rad/s: beyond it the bytes are something else


@dataclass
class _Topic:
    """What is gathered of one topic while the file is walked."""

    messages: list[tuple[int, int, int, bytes]] = field(default_factory=list)  # log, publish time, channel, payload
    in_damaged_chunks: int = 0


@dataclass
class _Walk:
    """What is known so far. A damaged chunk's message indexes follow it and say what it held."""

    wanted: Mapping[str, Content]
    inflated_limit: int
    messages_limit: int
    messages: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    topics: dict[str, _Topic] = field(default_factory=dict)
    orphans: list[tuple[int, int, int, bytes]] = field(default_factory=list)  # their channel is named later, or never
    facts: dict[str, str] = field(default_factory=dict)
    stated: dict[int, int] | None = None
    faults: list[str] = field(default_factory=list)
    inflated: int = 0
    chunks: int = 0
    last_chunk_damaged: bool = False
    unknown_loss: bool = False
    complete: bool = False


def read(path: Path, wanted: Iterable[Wanted]) -> Log:
    """The wanted topics of a log, decoded; SessionError if it is none, is a bomb, or contradicts itself.

    With nothing wanted, every topic is counted and none decoded.
    """
    asked = {want.topic: want.content for want in wanted}
    size = path.stat().st_size
    walk = _Walk(asked, max(_INFLATED_LIMIT, _INFLATION_LIMIT * size), max(_MESSAGES_LIMIT, size // _BYTES_PER_MESSAGE))
    with path.open("rb") as file:
        _walk_file(walk, file, size)
    _adopt_orphans(walk)
    if not any(topic.messages for topic in walk.topics.values()):
        raise SessionError("; ".join(["it holds no message that can be read", *walk.faults]))
    topics = {}
    content: Content
    for topic, content in (asked or dict.fromkeys(walk.topics, "anything")).items():
        if topic in walk.topics:
            topics[topic] = _decode(walk, topic, content)
    return Log(walk.facts, topics, tuple(walk.faults))


def _walk_file(walk: _Walk, file: BinaryIO, size: int) -> None:
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


def _adopt_orphans(walk: _Walk) -> None:
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


def _check_data_end(walk: _Walk, body: bytes, checksum: int) -> None:
    stated = struct.unpack("<I", body[:4])[0] if len(body) >= 4 else 0
    if stated not in (0, checksum) and not walk.faults:
        walk.faults.append("the log's checksum does not fit its bytes: something in it is damaged")


_BROKEN = (McapError, struct.error, UnicodeDecodeError, ValueError, EOFError)


def _take_record(walk: _Walk, opcode: int, body: bytes) -> None:
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
                walk.topics.setdefault(channel.topic, _Topic()).in_damaged_chunks += len(index.records)
        elif opcode == Opcode.METADATA:
            metadata = _parsed(Metadata, body)
            if metadata.name == "session":
                walk.facts.update(metadata.metadata)
        elif opcode == Opcode.STATISTICS:
            statistics = _parsed(Statistics, body)
            walk.stated = dict(statistics.channel_message_counts)
        else:
            _take_message_record(walk, opcode, body)
    except _BROKEN as error:
        if isinstance(error, SessionError):
            raise
        name = Opcode(opcode).name.lower().replace("_", " ") if opcode in set(Opcode) else f"kind {opcode}"
        walk.faults.append(f"a record ({name}) cannot be read: {str(error) or type(error).__name__}")
        walk.unknown_loss = True


def _take_message_record(walk: _Walk, opcode: int, body: bytes) -> None:
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
        walk.topics.setdefault(named.topic, _Topic())
    elif opcode == Opcode.SCHEMA:
        schema = _parsed(Schema, body)
        before = walk.schemas.setdefault(schema.id, schema)
        if (before.name, before.encoding, before.data) != (schema.name, schema.encoding, schema.data):
            raise SessionError(f'schema {schema.id} is defined twice, as "{before.name}" and as "{schema.name}"')


def _take_chunk(walk: _Walk, body: bytes) -> None:
    walk.chunks += 1
    walk.last_chunk_damaged = False
    chunk = _parsed(Chunk, body)
    try:
        data = _inflate(walk, chunk)
        if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
            raise ValueError("its checksum does not fit its bytes")
    except (ValueError, zstandard.ZstdError, RuntimeError, EOFError) as error:
        if isinstance(error, SessionError):
            raise
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


def _inflate(walk: _Walk, chunk: Chunk) -> bytes:
    """The chunk's bytes, never more than it states nor more than a log may hold."""
    stated = chunk.uncompressed_size
    walk.inflated += stated
    if walk.inflated > walk.inflated_limit:
        raise SessionError(
            f"refused: it would inflate to more than {walk.inflated_limit // 2**20} MiB, which no session's log does"
        )
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


def _decode(walk: _Walk, topic: str, content: Content) -> Readings:
    """A topic's messages, decoded one by one by the stock decoder; what does not fit is lost and said."""
    gathered = walk.topics[topic]
    decode = _DECODERS[content]
    factory = DecoderFactory()
    stamps, arrivals, rows = [], [], []
    events: list[Mapping[str, object]] = []
    failures: dict[str, int] = {}
    for log_time, publish_time, channel_id, payload in gathered.messages:
        channel = walk.channels[channel_id]
        try:
            stamp, row, event = decode(factory, channel, walk.schemas.get(channel.schema_id), payload)
            if log_time > _TIME_LIMIT_NS or publish_time > _TIME_LIMIT_NS:
                raise ValueError("its time is out of all range")
        except (*_BROKEN, AttributeError, TypeError, LookupError, OverflowError, RecursionError) as error:
            reason = str(error) or type(error).__name__
            failures[reason] = failures.get(reason, 0) + 1
            continue
        stamps.append(publish_time if stamp is None else stamp)
        arrivals.append(log_time)
        rows.append(row)
        if event is not None:
            events.append(event)
    notes = [f"{count} messages cannot be read: {reason}" for reason, count in sorted(failures.items())[:3]]
    width = {"position": 3, "acceleration": 10}.get(content, 0)
    return Readings(
        np.array(stamps, dtype=np.int64),
        np.array(arrivals, dtype=np.int64),
        np.array(rows, dtype=np.float64).reshape(len(rows), width),
        tuple(events),
        _lost(walk, topic, sum(failures.values())),
        tuple(notes),
    )


def _lost(walk: _Walk, topic: str, undecodable: int) -> int | None:
    """How many messages the log says it held and that are not there; None where it does not say."""
    gathered = walk.topics[topic]
    if walk.stated is not None:
        stated = sum(walk.stated.get(key, 0) for key, channel in walk.channels.items() if channel.topic == topic)
        return max(stated - len(gathered.messages), gathered.in_damaged_chunks) + undecodable
    if walk.unknown_loss:
        return None
    return gathered.in_damaged_chunks + undecodable


Decoded = tuple[int | None, list[float], Mapping[str, object] | None]
_Decoder = Callable[[DecoderFactory, Channel, Schema | None, bytes], Decoded]


def _counted(factory: DecoderFactory, channel: Channel, schema: Schema | None, payload: bytes) -> Decoded:
    return None, [], None


def _ros(factory: DecoderFactory, channel: Channel, schema: Schema | None, payload: bytes, content: str) -> object:
    """A CDR message by the stock decoder, once its type and length are what they must be."""
    needed = SCHEMAS[content]
    if schema is None or schema.name != needed:
        found = "no schema" if schema is None else schema.name
        raise ValueError(f"it holds {found}, and a stream of kind {content} needs {needed}")
    if channel.message_encoding != "cdr":
        raise ValueError(f'its encoding is "{channel.message_encoding}", not cdr')
    numbers = 3 if content == "position" else 37
    if len(payload) < 16 or payload[0] != 0 or payload[1] not in (0, 1):
        raise ValueError("the bytes do not fit the schema")
    (name_length,) = struct.unpack_from("<I" if payload[1] else ">I", payload, 12)
    expected = 4 + -(-(12 + name_length) // 8) * 8 + 8 * numbers
    if not expected <= len(payload) < expected + 8:
        raise ValueError("the bytes do not fit the schema")
    decoder = factory.decoder_for(channel.message_encoding, schema)
    if decoder is None:
        raise ValueError(f'its schema is written as "{schema.encoding}", not ros2msg')
    return decoder(payload)


def _position(factory: DecoderFactory, channel: Channel, schema: Schema | None, payload: bytes) -> Decoded:
    message = _ros(factory, channel, schema, payload, "position")
    point = message.point  # type: ignore[attr-defined]
    return _stamp(message), _plausible([point.x, point.y, point.z], "position"), None


def _acceleration(factory: DecoderFactory, channel: Channel, schema: Schema | None, payload: bytes) -> Decoded:
    message = _ros(factory, channel, schema, payload, "acceleration")
    force, rate, turn = message.linear_acceleration, message.angular_velocity, message.orientation  # type: ignore[attr-defined]
    motion = _plausible([force.x, force.y, force.z, rate.x, rate.y, rate.z], "acceleration")
    quaternion = [turn.x, turn.y, turn.z, turn.w]
    length = sum(part * part for part in quaternion)
    known = message.orientation_covariance[0] != -1 and 0.8 < length < 1.25  # type: ignore[attr-defined]
    return _stamp(message), motion + (quaternion if known else [np.nan] * 4), None


def _stamp(message: object) -> int:
    stamp = message.header.stamp  # type: ignore[attr-defined]
    if not 0 <= stamp.nanosec < 1_000_000_000:
        raise ValueError("the bytes do not fit the schema")
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _plausible(values: list[float], content: str) -> list[float]:
    """As they are; NaN and infinity too, which are the study's business and not the format's."""
    if any(abs(value) > _PLAUSIBLE[content] and np.isfinite(value) for value in values):
        raise ValueError("the bytes do not fit the schema: a figure is out of all range")
    return values


def _event(factory: DecoderFactory, channel: Channel, schema: Schema | None, payload: bytes) -> Decoded:
    if channel.message_encoding != "json":
        raise ValueError(f'its encoding is "{channel.message_encoding}", not json')
    event = json.loads(payload)
    if not isinstance(event, dict) or event.get("type") not in EVENT_TYPES:
        raise ValueError(f"it is no event: `type` must be one of {', '.join(EVENT_TYPES)}")
    trial = event.get("trial")
    if trial is not None and not (isinstance(trial, int) and abs(trial) < _NUMBER_LIMIT):
        raise ValueError("its trial is not a whole number")
    for key in ("target_x", "target_y", "target_z", "x", "y", "z"):
        if event.get(key) is not None:
            event[key] = float(event[key])
    return None, [], event


_DECODERS: Mapping[str, _Decoder] = {
    "position": _position,
    "acceleration": _acceleration,
    "events": _event,
    "anything": _counted,
}


# Writing ---------------------------------------------------------------------------------------------------------

_HEADER = """std_msgs/Header header
{body}
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_THREE = "=" * 80 + "\nMSG: {name}\nfloat64 x\nfloat64 y\nfloat64 z\n"
_POINT_STAMPED = _HEADER.format(body="geometry_msgs/Point point") + _THREE.format(name="geometry_msgs/Point")
_IMU = (
    _HEADER.format(
        body="geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"
    )
    + _THREE.format(name="geometry_msgs/Quaternion")
    + "float64 w\n"
    + _THREE.format(name="geometry_msgs/Vector3")
)
_EVENT_SCHEMA = {
    "title": "steadyhand.Event",
    "type": "object",
    "properties": {
        "type": {"type": "string"},
        "trial": {"type": "integer"},
        **{key: {"type": "number"} for key in ("target_x", "target_y", "target_z", "x", "y", "z")},
    },
    "required": ["type"],
}
_CHUNK_BYTES = 64 * 1024  # so that a crash loses seconds, not the session


@dataclass(frozen=True)
class Message:
    """One message to write: `values` as in `Readings.values`, or an event."""

    topic: str
    content: Content
    stamp_ns: int
    arrival_ns: int
    values: FloatArray | None = None
    event: Mapping[str, object] | None = None


def write(path: Path, facts: Mapping[str, str], messages: Iterable[Message]) -> None:
    """Write a log; it appears under its name only once it is whole."""
    from mcap.writer import CompressionType, Writer

    partial = path.with_name(path.name + ".partial")
    with partial.open("wb") as file:
        writer = Writer(file, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="steadyhand")
        writer.add_metadata("session", dict(facts))
        schemas = {
            "position": writer.register_schema(SCHEMAS["position"], "ros2msg", _POINT_STAMPED.encode()),
            "acceleration": writer.register_schema(SCHEMAS["acceleration"], "ros2msg", _IMU.encode()),
            "events": writer.register_schema("steadyhand.Event", "jsonschema", json.dumps(_EVENT_SCHEMA).encode()),
        }
        channels: dict[str, int] = {}
        encode = _Encoder()
        for sequence, message in enumerate(messages):
            if message.topic not in channels:
                encoding = "json" if message.content == "events" else "cdr"
                channels[message.topic] = writer.register_channel(message.topic, encoding, schemas[message.content])
            writer.add_message(channels[message.topic], message.arrival_ns, encode(message), message.stamp_ns, sequence)
        writer.finish()  # type: ignore[no-untyped-call]
    partial.replace(path)


class _Encoder:
    """Messages to bytes, by the stock ROS 2 encoder and by JSON."""

    def __init__(self) -> None:
        from mcap_ros2._dynamic import serialize_dynamic

        self._position = serialize_dynamic(SCHEMAS["position"], _POINT_STAMPED)[SCHEMAS["position"]]
        self._imu = serialize_dynamic(SCHEMAS["acceleration"], _IMU)[SCHEMAS["acceleration"]]

    def __call__(self, message: Message) -> bytes:
        if message.event is not None:
            return json.dumps(message.event, allow_nan=False).encode()
        assert message.values is not None  # noqa: S101
        header = {"stamp": dict(zip(("sec", "nanosec"), divmod(message.stamp_ns, 1_000_000_000), strict=True))}
        values = [float(value) for value in message.values]
        if message.content == "position":
            return bytes(self._position({"header": {**header, "frame_id": "tracker"}, "point": _xyz(values)}))
        known = bool(np.isfinite(values[6:]).all())
        return bytes(
            self._imu(
                {
                    "header": {**header, "frame_id": "phone"},
                    "orientation": {
                        **_xyz(values[6:9] if known else [0.0] * 3),
                        "w": values[9] if known else 1.0,
                    },
                    "orientation_covariance": [0.0 if known else -1.0] + [0.0] * 8,
                    "angular_velocity": _xyz(values[3:6]),
                    "angular_velocity_covariance": [0.0] * 9,
                    "linear_acceleration": _xyz(values[0:3]),
                    "linear_acceleration_covariance": [0.0] * 9,
                }
            )
        )


def _xyz(values: list[float]) -> dict[str, float]:
    return dict(zip("xyz", values, strict=True))


def in_order(messages: Iterable[Message]) -> Iterator[Message]:
    """Messages by arrival, as a recorder would have met them."""
    return iter(sorted(messages, key=lambda message: message.arrival_ns))
