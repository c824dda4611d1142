"""ROS 2 messages in CDR: many at once, or one by one by the stock decoder, which follows the log's definition."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

from pipeline.sessions.logs.log import IntArray
from pipeline.sessions.logs.mcap import cdr
from pipeline.sessions.logs.mcap.definition import check_definition
from pipeline.sessions.logs.mcap.fields import UNDECODABLE, UNFIT, Decoder, Fields, Reading, check_stamp
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.schemas import SCHEMAS

_DEFINITIONS_CACHED = 16


def decoder(channel: Channel, schema: Schema | None, content: str) -> Decoder:
    """The decoder of a channel. Raises one of `UNDECODABLE` if the schema is of another type or cannot be followed."""
    needed = SCHEMAS[content]
    if schema is None or schema.name != needed:
        holds = "no schema" if schema is None else schema.name
        raise ValueError(f"it holds {holds}, and a stream of kind {content} needs {needed}")
    if schema.encoding != "ros2msg":
        raise ValueError(f'its schema is written as "{schema.encoding}", not ros2msg')
    decode = _stock(channel.message_encoding, schema.name, schema.data)

    def one(payload: bytes) -> Reading:
        _check_length(payload, cdr.NUMBERS[content])
        message = decode(payload)
        stamp = message.header.stamp
        seconds, nanoseconds = int(stamp.sec), int(stamp.nanosec)
        check_stamp(seconds, nanoseconds)
        return seconds, nanoseconds, [float(value) for value in _used_values(message, content)]

    def many(messages: Messages, which: IntArray, fields: Fields) -> None:
        for length in set(messages.length[which].tolist()):
            _decode_equally_long(messages, which[messages.length[which] == length], fields)

    def _decode_equally_long(messages: Messages, which: IntArray, fields: Fields) -> None:
        """Fill in those that fit the layout, if the stock decoder reads a message of it in the same way."""
        rows = messages.rows(which)
        fast = cdr.fields(rows, content)
        for flag in (0, 1):
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
