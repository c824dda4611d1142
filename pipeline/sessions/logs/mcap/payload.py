"""Decodes a topic's messages by the encoding of each channel: many at once, unusual ones by the stock decoder.

A message that cannot be decoded is counted as lost, with the reason in the notes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module

import numpy as np
from mcap.records import Channel, Schema

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import Claims, Content, IntArray, Readings
from pipeline.sessions.logs.mcap.claims import claimed
from pipeline.sessions.logs.mcap.events import EVENTS_LIMIT, event
from pipeline.sessions.logs.mcap.fields import UNDECODABLE, UNFIT, Decoder, Fields
from pipeline.sessions.logs.mcap.messages import Messages, joined
from pipeline.sessions.logs.mcap.schemas import SAMPLED
from pipeline.sessions.logs.mcap.walk import Walk
from pipeline.statistics.arrays import FloatArray

_DECODERS: Mapping[str, str] = {
    "cdr": "pipeline.sessions.logs.mcap.ros2",
    "protobuf": "pipeline.sessions.logs.mcap.protobuf",
    "json": "pipeline.sessions.logs.mcap.json_payload",
}
"""The module that reads an encoding, loaded when a log has it."""

_TIME_LIMIT_NS = 2**62
_PLAUSIBLE = {"position": 1e4, "acceleration": 1e5}  # m; m/s², rad/s: beyond it the bytes are something else
_TYPES_LIMIT = 64  # types of one topic, because following each schema takes time
_REASON_LIMIT = 300  # characters: names in a log may be long
_NOTES = 3  # reasons named one by one; messages with others are counted together

Failures = dict[int, str]
"""Why a message cannot be read, by its index."""


def decode(walk: Walk, topic: str, content: Content) -> Readings:
    """A topic's messages, decoded as `content`; those that cannot be are counted as lost, and the notes say why."""
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
    is_readable = np.ones(len(messages), bool)
    is_readable[list(failures)] = False
    readable = np.flatnonzero(is_readable)
    claims = claimed(walk, messages, readable, content) if content in SAMPLED else Claims()
    return Readings(
        stamp[readable],
        messages.log_time[readable].astype(np.int64),
        values[readable],
        tuple(events[index] for index in readable.tolist()) if content == "events" else (),
        _lost(walk, topic, len(failures)),
        _notes(failures),
        content in SAMPLED,
        claims,
    )


def counted(walk: Walk, topic: str) -> Readings:
    """A topic's messages, counted. Notes say which a study could not decode, where the schema says what they hold."""
    every = decode(walk, topic, "anything")
    content = walk.topics[topic].content
    if content is None:
        return every
    try:
        notes = decode(walk, topic, content).notes
    except SessionError as error:
        notes = (str(error),)
    undecodable = tuple(f"counted, but a study would lose them: {note}" for note in notes if note not in every.notes)
    return replace(every, notes=(*every.notes, *undecodable), sampled=content in SAMPLED)


def _notes(failures: Failures) -> tuple[str, ...]:
    reasons = sorted(Counter(failures.values()).items())
    notes = [f"{count} messages cannot be read: {reason}" for reason, count in reasons[:_NOTES]]
    if len(reasons) > _NOTES:
        notes.append(f"{sum(count for _, count in reasons[_NOTES:])} messages cannot be read, for other reasons")
    return tuple(notes)


def _lost(walk: Walk, topic: str, undecodable: int) -> int | None:
    """How many messages the log states that it holds and does not; None where it does not state that."""
    collected = walk.topics[topic]
    if walk.stated is not None:
        stated = sum(walk.stated.get(channel, 0) for channel in collected.channels)
        return max(stated - collected.read, collected.in_damaged_chunks) + undecodable
    if walk.unknown_loss:
        return None
    return collected.in_damaged_chunks + undecodable


def _measured(walk: Walk, messages: Messages, content: str, failures: Failures) -> tuple[IntArray, FloatArray]:
    """Stamps (ns) and values of positions or accelerations."""
    fields = Fields.none_of(len(messages), content)
    decoders: dict[tuple[str, int], Decoder | str] = {}
    for channel_id, own in messages.by_channel():
        channel = walk.channels[channel_id]
        key = channel.message_encoding, channel.schema_id
        if key not in decoders and len(decoders) == _TYPES_LIMIT:
            failures.update(dict.fromkeys(own.tolist(), f"its topic holds more than {_TYPES_LIMIT} types of messages"))
            continue
        if key not in decoders:
            decoders[key] = _decoder(channel, walk.schemas.get(channel.schema_id), content)
        decoder = decoders[key]
        if isinstance(decoder, str):
            failures.update(dict.fromkeys(own.tolist(), decoder))
            continue
        decoder.many(messages, own, fields)
        for index in own[~fields.fits[own]].tolist():
            try:
                fields.seconds[index], fields.nanoseconds[index], fields.values[index] = decoder.one(
                    messages.payload(index)
                )
            except UNDECODABLE as error:
                failures[index] = _reason(error)
    return _plausible(fields, content, failures)


def _decoder(channel: Channel, schema: Schema | None, content: str) -> Decoder | str:
    """The channel's decoder, by its encoding, or why there is none."""
    module = _DECODERS.get(channel.message_encoding)
    if module is None:
        return f'its encoding is "{channel.message_encoding}", not one of {", ".join(_DECODERS)}'
    try:
        decoder: Decoder = import_module(module).decoder(channel, schema, content)
    except UNDECODABLE as error:
        return _reason(error)
    return decoder


def _reason(error: Exception) -> str:
    text = str(error) or type(error).__name__
    return text if len(text) <= _REASON_LIMIT else f"{text[:_REASON_LIMIT]} …"


def _plausible(fields: Fields, content: str, failures: Failures) -> tuple[IntArray, FloatArray]:
    """Stamps and values, where values beyond all range fail; NaN and infinity stay for the checks of the study.

    An orientation is NaN where the log says that it is unknown, or its length is not 1.
    """
    motion = fields.values[:, : 3 if content == "position" else 6]
    too_far = ((np.abs(motion) > _PLAUSIBLE[content]) & np.isfinite(motion)).any(axis=1)
    no_stamp = (fields.nanoseconds < 0) | (fields.nanoseconds >= 1_000_000_000)
    for unfit, reason in ((no_stamp, UNFIT), (too_far, f"{UNFIT}: a figure is out of all range")):
        for index in np.flatnonzero(unfit).tolist():
            failures.setdefault(index, reason)
    stamp = fields.seconds * 1_000_000_000 + fields.nanoseconds
    if content == "position":
        return stamp, motion
    turn = fields.values[:, 6:10]
    with np.errstate(over="ignore", invalid="ignore"):
        length = (turn**2).sum(axis=1)
    known = (fields.values[:, 10] != -1) & (length > 0.8) & (length < 1.25)
    return stamp, np.hstack([motion, np.where(known[:, np.newaxis], turn, np.nan)])


def _events(walk: Walk, messages: Messages, failures: Failures) -> dict[int, Mapping[str, object]]:
    if len(messages) > EVENTS_LIMIT:
        raise SessionError(f"refused: it holds {len(messages)} events, which no session does")
    events = {}
    for index in range(len(messages)):
        try:
            channel = walk.channels[int(messages.channel[index])]
            events[index] = event(channel, messages.payload(index), _PLAUSIBLE["position"])
        except UNDECODABLE as error:
            failures[index] = _reason(error)
    return events
