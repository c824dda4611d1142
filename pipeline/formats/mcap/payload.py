"""Messages decoded: CDR as whole arrays, the stock ROS 2 decoder for what is laid out otherwise, JSON one by one.

What does not fit is lost and counted.
"""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Callable, Mapping

import numpy as np
from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

from pipeline.errors import SessionError
from pipeline.formats.log import Content, FloatArray, IntArray, Readings
from pipeline.formats.mcap import cdr
from pipeline.formats.mcap.container import BROKEN, Walk
from pipeline.formats.mcap.definition import check_definition
from pipeline.formats.mcap.messages import Messages, joined

SCHEMAS: Mapping[str, str] = {
    "position": "geometry_msgs/msg/PointStamped",
    "acceleration": "sensor_msgs/msg/Imu",
}
EVENT_TYPES = ("session_start", "trial_start", "selection", "session_end")

_UNDECODABLE = (*BROKEN, AttributeError, TypeError, LookupError, OverflowError, RuntimeError)
_UNFIT = "the bytes do not fit the schema"
_TIME_LIMIT_NS = 2**62
_NUMBER_LIMIT = 2**53
_PLAUSIBLE = {"position": 1e4, "acceleration": 1e5}  # m; m/s², rad/s: beyond it the bytes are something else
_EVENT_LIMIT = 64 * 1024  # bytes of one event
_EVENTS_LIMIT = 100_000
_NOTES = 3  # reasons told apart; the rest are counted together

Failures = dict[int, str]
"""Why a message cannot be read, by its index."""


def decode(walk: Walk, topic: str, content: Content) -> Readings:
    """A topic's messages, as its content; what does not fit is lost and said."""
    messages = joined(walk.topics[topic].parts)
    failures: Failures = {}
    stamp = np.minimum(messages.publish_time, _TIME_LIMIT_NS).astype(np.int64)
    values = np.zeros((len(messages), 0))
    events: dict[int, Mapping[str, object]] = {}
    if content == "events":
        events = _events(walk, messages, failures)
    elif content != "anything":
        stamp, values = _measured(walk, messages, content, failures)
    for index in np.flatnonzero(np.maximum(messages.log_time, messages.publish_time) > _TIME_LIMIT_NS).tolist():
        failures.setdefault(index, "its time is out of all range")
    kept = np.setdiff1d(np.arange(len(messages)), list(failures)).astype(np.int64)
    return Readings(
        stamp[kept],
        messages.log_time[kept].astype(np.int64),
        values[kept],
        tuple(events[index] for index in kept.tolist()) if content == "events" else (),
        _lost(walk, topic, len(failures)),
        _notes(failures),
    )


def _notes(failures: Failures) -> tuple[str, ...]:
    reasons = sorted(Counter(failures.values()).items())
    notes = [f"{count} messages cannot be read: {reason}" for reason, count in reasons[:_NOTES]]
    if len(reasons) > _NOTES:
        notes.append(f"{sum(count for _, count in reasons[_NOTES:])} messages cannot be read, for other reasons")
    return tuple(notes)


def _lost(walk: Walk, topic: str, undecodable: int) -> int | None:
    """How many messages the log says it held and that are not there; None where it does not say."""
    gathered = walk.topics[topic]
    if walk.stated is not None:
        stated = sum(walk.stated.get(key, 0) for key, channel in walk.channels.items() if channel.topic == topic)
        return max(stated - gathered.read, gathered.in_damaged_chunks) + undecodable
    if walk.unknown_loss:
        return None
    return gathered.in_damaged_chunks + undecodable


def _measured(walk: Walk, messages: Messages, content: str, failures: Failures) -> tuple[IntArray, FloatArray]:
    """Stamps (ns) and values of positions or accelerations."""
    found = cdr.Fields(
        np.zeros(len(messages), np.int64),
        np.zeros(len(messages), np.int64),
        np.zeros((len(messages), len(cdr.COLUMNS[content]))),
        np.zeros(len(messages), bool),
    )
    factory = DecoderFactory()
    for channel_id in np.unique(messages.channel).tolist():
        own: IntArray = np.flatnonzero(messages.channel == channel_id)
        channel = walk.channels[channel_id]
        try:
            stock = _stock_decoder(factory, channel, walk.schemas.get(channel.schema_id), content)
        except _UNDECODABLE as error:
            failures.update(dict.fromkeys(own.tolist(), str(error) or type(error).__name__))
            continue
        for length in np.unique(messages.length[own]):
            _decode_equally_long(messages, own[messages.length[own] == length], content, stock, found)
        for index in own[~found.fits[own]].tolist():
            try:
                found.seconds[index], found.nanoseconds[index], found.values[index] = stock(messages.payload(index))
            except _UNDECODABLE as error:
                failures[index] = str(error) or type(error).__name__
    return _judged(found, content, failures)


def _decode_equally_long(
    messages: Messages, which: IntArray, content: str, stock: _StockDecoder, found: cdr.Fields
) -> None:
    """Fill in those that fit the layout, if it is what the stock decoder makes of the log's schema."""
    rows = messages.rows(which)
    fast = cdr.fields(rows, content)
    for flag in (0, 1):
        fits = np.flatnonzero(fast.fits & (rows[:, 1:2] == flag).any(axis=1))
        if not len(fits):
            continue
        try:
            alike = cdr.laid_out_alike(rows[fits[0]], content, stock)
        except _UNDECODABLE:
            continue
        if alike:
            at = which[fits]
            found.seconds[at], found.nanoseconds[at] = fast.seconds[fits], fast.nanoseconds[fits]
            found.values[at], found.fits[at] = fast.values[fits], True


def _judged(found: cdr.Fields, content: str, failures: Failures) -> tuple[IntArray, FloatArray]:
    """Stamps and values; NaN and infinity stay, which are the study's business and not the format's."""
    motion = found.values[:, : 3 if content == "position" else 6]
    too_far = ((np.abs(motion) > _PLAUSIBLE[content]) & np.isfinite(motion)).any(axis=1)
    no_stamp = (found.nanoseconds < 0) | (found.nanoseconds >= 1_000_000_000)
    for unfit, reason in ((no_stamp, _UNFIT), (too_far, f"{_UNFIT}: a figure is out of all range")):
        for index in np.flatnonzero(unfit).tolist():
            failures.setdefault(index, reason)
    stamp = found.seconds * 1_000_000_000 + found.nanoseconds
    if content == "position":
        return stamp, motion
    turn = found.values[:, 6:10]
    with np.errstate(over="ignore", invalid="ignore"):
        length = (turn**2).sum(axis=1)
    known = (found.values[:, 10] != -1) & (length > 0.8) & (length < 1.25)
    return stamp, np.hstack([motion, np.where(known[:, np.newaxis], turn, np.nan)])


_StockDecoder = Callable[[bytes], tuple[int, int, list[float]]]


def _stock_decoder(factory: DecoderFactory, channel: Channel, schema: Schema | None, content: str) -> _StockDecoder:
    """A channel's stock decoder, with its messages' length checked: seconds, nanoseconds, and the kept figures."""
    needed = SCHEMAS[content]
    if schema is None or schema.name != needed:
        found = "no schema" if schema is None else schema.name
        raise ValueError(f"it holds {found}, and a stream of kind {content} needs {needed}")
    if channel.message_encoding != "cdr":
        raise ValueError(f'its encoding is "{channel.message_encoding}", not cdr')
    if schema.encoding != "ros2msg":
        raise ValueError(f'its schema is written as "{schema.encoding}", not ros2msg')
    check_definition(schema)
    decoder = factory.decoder_for(channel.message_encoding, schema)
    assert decoder is not None  # noqa: S101

    def decode_one(payload: bytes) -> tuple[int, int, list[float]]:
        _check_length(payload, cdr.NUMBERS[content])
        message = decoder(payload)
        stamp = message.header.stamp
        seconds, nanoseconds = int(stamp.sec), int(stamp.nanosec)
        if not (-(2**31) <= seconds < 2**32 and 0 <= nanoseconds < 2**32):
            raise ValueError(_UNFIT)
        return seconds, nanoseconds, [float(value) for value in _kept(message, content)]

    return decode_one


def _check_length(payload: bytes, numbers: int) -> None:
    if len(payload) < 16 or payload[0] != 0 or payload[1] not in (0, 1):
        raise ValueError(_UNFIT)
    (name_length,) = struct.unpack_from("<I" if payload[1] else ">I", payload, 12)
    expected = 4 + -(-(12 + name_length) // 8) * 8 + 8 * numbers
    if not expected <= len(payload) < expected + 8:
        raise ValueError(_UNFIT)


def _kept(message: object, content: str) -> list[float]:
    """The figures of `cdr.COLUMNS`, in that order."""
    if content == "position":
        point = message.point  # type: ignore[attr-defined]
        return [point.x, point.y, point.z]
    force, rate, turn = message.linear_acceleration, message.angular_velocity, message.orientation  # type: ignore[attr-defined]
    covariance = message.orientation_covariance[0]  # type: ignore[attr-defined]
    return [force.x, force.y, force.z, rate.x, rate.y, rate.z, turn.x, turn.y, turn.z, turn.w, covariance]


def _events(walk: Walk, messages: Messages, failures: Failures) -> dict[int, Mapping[str, object]]:
    if len(messages) > _EVENTS_LIMIT:
        raise SessionError(f"refused: it holds {len(messages)} events, which no session does")
    events = {}
    for index in range(len(messages)):
        try:
            events[index] = _event(walk.channels[int(messages.channel[index])], messages.payload(index))
        except _UNDECODABLE as error:
            failures[index] = str(error) or type(error).__name__
    return events


def _event(channel: Channel, payload: bytes) -> Mapping[str, object]:
    """What is used of an event: type, trial, and the target and selected position in metres."""
    if channel.message_encoding != "json":
        raise ValueError(f'its encoding is "{channel.message_encoding}", not json')
    if len(payload) > _EVENT_LIMIT:
        raise ValueError(f"it is longer than {_EVENT_LIMIT // 1024} KiB, which no event is")
    event = json.loads(payload)
    if not isinstance(event, dict) or event.get("type") not in EVENT_TYPES:
        raise ValueError(f"it is no event: `type` must be one of {', '.join(EVENT_TYPES)}")
    trial = event.get("trial")
    if trial is not None and not (isinstance(trial, int) and abs(trial) < _NUMBER_LIMIT):
        raise ValueError("its trial is not a whole number")
    found = {"type": event["type"], "trial": trial}
    for key in ("target_x", "target_y", "target_z", "x", "y", "z"):
        if event.get(key) is not None:
            found[key] = float(event[key])
            if np.isfinite(found[key]) and abs(found[key]) > _PLAUSIBLE["position"]:
                raise ValueError(f"{_UNFIT}: a figure is out of all range")
    return found
