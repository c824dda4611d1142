"""ROS messages: which decoder a channel takes.

The two commonest types in CDR have one of their own (`cdr`), and the stock decoder, which follows the log's definition,
for what that declines. All others, and ROS 1, are read by `by_places`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any

import numpy as np
from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

from pipeline.sessions.logs.log import IntArray, Source
from pipeline.sessions.logs.mcap import by_places, cdr, well_known
from pipeline.sessions.logs.mcap.definition import check_definition
from pipeline.sessions.logs.mcap.definition_text import parse, short_name
from pipeline.sessions.logs.mcap.fields import UNDECODABLE, UNFIT, Decoder, Fields, Reading, check_stamp
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.places import Places
from pipeline.sessions.logs.mcap.schemas import SCHEMAS
from pipeline.sessions.logs.mcap.wire import ROS1, Wire, places, wire_of

_PLAIN_CDR = (0, 1)  # big-endian, little-endian
_DEFINITIONS_CACHED = 16


def decoder(channel: Channel, schema: Schema | None, content: str, source: Source) -> Decoder:
    """The decoder of a channel. Raises one of `UNDECODABLE` if the schema is of another type or cannot be followed."""
    if schema is None:
        shape = "position" if content == "velocity" else content
        raise ValueError(f"it holds no schema, and a stream of kind {content} needs {SCHEMAS[shape]}")
    text = _text_of(schema)
    if schema.encoding == "ros1msg" or channel.message_encoding == "ros1":
        return _by_definition(schema.name, text, content, source, lambda _: ROS1)

    @cache
    def general() -> Decoder:
        return _by_definition(schema.name, text, content, source, wire_of)

    shape = "position" if content == "velocity" else content
    special = source.fields or source.child is not None or source.parent is not None
    if special or _full_name(schema.name) != SCHEMAS[shape]:
        return general()
    return _of_fixed_shape(channel, schema.name, text, shape, general)


def _by_definition(
    name: str, text: bytes, content: str, source: Source, wire_of_payload: Callable[[bytes], Wire]
) -> Decoder:
    definition = parse(name, text)

    def walk_through(payload: bytes) -> Places:
        return places(payload, definition, wire_of_payload(payload))

    return by_places.decoder(definition.leaves(), name, content, source, walk_through)


def _text_of(schema: Schema) -> bytes:
    """The definition that a log gives; one that never changed where the log gives none, or in another language."""
    written_as = ("ros2msg", "ros1msg")
    if short_name(schema.name) in well_known.NAMES and (not schema.data or schema.encoding not in written_as):
        return well_known.text_of(schema.name, ros1=schema.encoding == "ros1msg")
    if schema.encoding not in written_as:
        raise ValueError(f'its schema is written as "{schema.encoding}", not ros2msg')
    return schema.data


def _full_name(name: str) -> str:
    """`package/msg/Name`, also of `package/Name`."""
    return short_name(name).replace("/", "/msg/")


def _of_fixed_shape(channel: Channel, name: str, text: bytes, content: str, general: Callable[[], Decoder]) -> Decoder:
    """The decoder of the two types whose figures stand together at the end: faster than any other.

    What is written in another representation than plain CDR is left to the general decoder.
    """
    decode = _stock(channel.message_encoding, name, text)

    def one(payload: bytes) -> Reading:
        if len(payload) > 1 and payload[0] == 0 and payload[1] not in _PLAIN_CDR:
            return general().one(payload)
        _check_length(payload, cdr.NUMBERS[content])
        message = decode(payload)
        stamp = message.header.stamp
        seconds, nanoseconds = int(stamp.sec), int(stamp.nanosec)
        check_stamp(seconds, nanoseconds)
        return Reading(seconds, nanoseconds, [float(value) for value in _used_values(message, content)])

    def many(messages: Messages, which: IntArray, fields: Fields) -> None:
        for length in set(messages.length[which].tolist()):
            _decode_equally_long(messages, which[messages.length[which] == length], fields)

    def _decode_equally_long(messages: Messages, which: IntArray, fields: Fields) -> None:
        """Fill in those that fit the layout, if the stock decoder reads a message of it in the same way."""
        rows = messages.rows(which)
        fast = cdr.fields(rows, content)
        for flag in _PLAIN_CDR:
            fits = np.flatnonzero(fast.fits & (rows[:, 1:2] == flag).any(axis=1))
            if not len(fits):
                continue
            try:
                alike = cdr.laid_out_alike(rows[fits[0]], content, one)
            except UNDECODABLE:
                continue
            if alike:
                fields.take(which[fits], fast, fits)

    return Decoder(one, many)


@lru_cache(maxsize=_DEFINITIONS_CACHED)
def _stock(encoding: str, name: str, definition: bytes) -> Callable[[bytes], Any]:
    """The stock decoder of a definition, cached because the logs of a study share a few of them."""
    schema = Schema(data=definition, encoding="ros2msg", id=1, name=name)
    check_definition(schema)
    decode = DecoderFactory().decoder_for(encoding, schema)
    assert decode is not None  # noqa: S101
    return decode


def _check_length(payload: bytes, numbers: int) -> None:
    if len(payload) < 16 or payload[0] != 0 or payload[1] not in (0, 1):
        raise ValueError(UNFIT)
    (name_length,) = struct.unpack_from("<I" if payload[1] else ">I", payload, 12)
    expected = 4 + -(-(12 + name_length) // 8) * 8 + 8 * numbers
    if not expected <= len(payload) < expected + 8:
        raise ValueError(UNFIT)


def _used_values(message: object, content: str) -> list[float]:
    """The values of `cdr.COLUMNS`, in that order."""
    if content == "position":
        point = message.point  # type: ignore[attr-defined]
        return [point.x, point.y, point.z]
    force, rate, turn = message.linear_acceleration, message.angular_velocity, message.orientation  # type: ignore[attr-defined]
    covariance = message.orientation_covariance[0]  # type: ignore[attr-defined]
    return [force.x, force.y, force.z, rate.x, rate.y, rate.z, turn.x, turn.y, turn.z, turn.w, covariance]
