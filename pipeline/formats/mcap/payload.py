"""Messages decoded one by one by the stock ROS 2 decoder and JSON; what does not fit is lost and counted."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping

import numpy as np
from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

from pipeline.formats.log import Content, Readings
from pipeline.formats.mcap.container import BROKEN, Walk

SCHEMAS: Mapping[str, str] = {
    "position": "geometry_msgs/msg/PointStamped",
    "acceleration": "sensor_msgs/msg/Imu",
}
EVENT_TYPES = ("session_start", "trial_start", "selection", "session_end")

_TIME_LIMIT_NS = 2**62
_NUMBER_LIMIT = 2**53
_PLAUSIBLE = {"position": 1e4, "acceleration": 1e5}  # m; m/s², rad/s: beyond it the bytes are something else


def decode(walk: Walk, topic: str, content: Content) -> Readings:
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
        except (*BROKEN, AttributeError, TypeError, LookupError, OverflowError, RecursionError) as error:
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


def _lost(walk: Walk, topic: str, undecodable: int) -> int | None:
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
            (event[key],) = _plausible([float(event[key])], "position")
    return None, [], event


_DECODERS: Mapping[str, _Decoder] = {
    "position": _position,
    "acceleration": _acceleration,
    "events": _event,
    "anything": _counted,
}
