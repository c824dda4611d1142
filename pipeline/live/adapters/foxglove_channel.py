"""A channel that a server of Foxglove's protocol advertises: how its messages are decoded, by the decoders of logs."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from typing import Any

from mcap.records import Channel, Schema

from pipeline.live.adapters.feeds import Feed, figures_of, orientation, three
from pipeline.live.messages import Datagram
from pipeline.sessions.logs.log import Source
from pipeline.sessions.logs.mcap.fields import Decoder
from pipeline.sessions.logs.mcap.payload import decoder_of

SAID = 200
"""Characters of what a server says."""
_SCHEMAS = {"json": "jsonschema", "cdr": "ros2msg", "ros1": "ros1msg"}  # else named as the encoding is
_BINARY = ("protobuf", "flatbuffer")


def figures(feed: Feed, values: list[float]) -> Datagram:
    """What was decoded (3,) or (11,) as a datagram would hold it."""
    if feed.content == "position":
        return figures_of(feed.stream, three(values), None)
    turned = None if values[10] == -1 else orientation(values[6:10])  # −1: the sensor has none (sensor_msgs/Imu)
    return figures_of(feed.stream, None, (three(values), three(values[3:])), turned)


def decoder(channel: Mapping[str, Any], feed: Feed) -> Decoder | str:
    """The decoder of a channel that was advertised, or why there is none."""
    encoding = str(channel["encoding"])
    written = str(channel.get("schemaEncoding") or _SCHEMAS.get(encoding, encoding))
    text = str(channel.get("schema") or "")
    try:
        data = base64.b64decode(text, validate=True) if written in _BINARY else text.encode()
    except (binascii.Error, ValueError):
        return "its schema is not in base64"
    schema = Schema(1, data, written, str(channel["schemaName"]))
    found = decoder_of(Channel(1, feed.stream, encoding, {}, 1), schema, feed.content, Source(unstamped=feed.unstamped))
    return reason(found) if isinstance(found, str) else found


def reason(error: Exception | str) -> str:
    """Why a message cannot be read; what a study of logs could do about it is left out."""
    return (str(error) or type(error).__name__).partition("; ")[0][:SAID]
