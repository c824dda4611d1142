"""Decodes a topic's messages by the encoding of each channel: many at once, unusual ones one by one.

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
from pipeline.sessions.logs.log import USUAL, Claims, Content, IntArray, Readings, Source
from pipeline.sessions.logs.mcap.claims import claimed
from pipeline.sessions.logs.mcap.events import EVENTS_LIMIT, event
from pipeline.sessions.logs.mcap.fields import UNDECODABLE, UNFIT, Decoder, Fields
from pipeline.sessions.logs.mcap.messages import Messages, joined
from pipeline.sessions.logs.mcap.packed import inflated
from pipeline.sessions.logs.mcap.pick import OtherFrameError
from pipeline.sessions.logs.mcap.schemas import SAMPLED
from pipeline.sessions.logs.mcap.walk import Walk
from pipeline.statistics.arrays import FloatArray

_DECODERS: Mapping[str, str] = {
    "cdr": "pipeline.sessions.logs.mcap.ros2",
    "protobuf": "pipeline.sessions.logs.mcap.protobuf",
    "json": "pipeline.sessions.logs.mcap.json_payload",
    "ros1": "pipeline.sessions.logs.mcap.ros2",
    "flatbuffer": "pipeline.sessions.logs.mcap.flatbuffer",
}
"""The module that reads an encoding, loaded when a log has it."""

_TIME_LIMIT_NS = 2**62
_PLAUSIBLE = {
    "position": 1e4,
    "velocity": 1e4,
    "acceleration": 1e5,
}  # m; m/s; m/s², rad/s: beyond it the bytes are something else
_TYPES_LIMIT = 64  # types of one topic, because following each schema takes time
_REASON_LIMIT = 300  # characters: names in a log may be long
_FRAMES_NAMED = 12
_NOTES = 3  # reasons named one by one; messages with others are counted together

Failures = dict[int, str]
"""Why a message cannot be read, by its index."""


def decode(walk: Walk, topic: str, content: Content, source: Source = USUAL) -> Readings:
    """A topic's messages, decoded as `content`; those that cannot be are counted as lost, and the notes say why."""
    failures: Failures = {}
    messages = inflated(joined(walk.topics[topic].parts), failures)
    stamp = np.minimum(messages.publish_time, _TIME_LIMIT_NS).astype(np.int64)
    values = np.zeros((len(messages), 0))
    events: dict[int, Mapping[str, object]] = {}
    fields = None
    if content == "events":
        events = _events(walk, messages, failures)
    elif content != "anything":
        fields = _decoded(walk, messages, content, source, failures)
        stamp, values = _plausible(fields, content, source, failures)
    for index in np.flatnonzero(np.maximum(messages.log_time, messages.publish_time) > _TIME_LIMIT_NS).tolist():
        failures.setdefault(index, "its time is out of all range")
    is_readable = np.ones(len(messages), bool)
    is_readable[list(failures)] = False
    if fields is not None:
        is_readable &= ~fields.of_other_frame
    readable = np.flatnonzero(is_readable)
    return Readings(
        stamp[readable],
        messages.log_time[readable].astype(np.int64),
        values[readable],
        tuple(events[index] for index in readable.tolist()) if content == "events" else (),
        _lost(walk, topic, len(failures)),
        (*_notes(failures), *(_no_such_frame(fields, source) if fields is not None and not len(readable) else ())),
        content in SAMPLED,
        Claims() if fields is None else claimed(walk, messages, fields, readable, content),
    )


def _no_such_frame(fields: Fields, source: Source) -> tuple[str, ...]:
    """A note where all messages are sound and none is of the wanted frame."""
    if not fields.of_other_frame.any():
        return ()
    wanted = " and ".join(
        f'{key} "{name}"' for key, name in (("child", source.child), ("parent", source.parent)) if name is not None
    )
    return (f"none of its messages is of {wanted}",)


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


def _decoded(walk: Walk, messages: Messages, content: str, source: Source, failures: Failures) -> Fields:
    """What the messages hold; those that cannot be decoded are noted in `failures`."""
    fields = Fields.none_of(len(messages), content)
    decoders: dict[tuple[str, int], Decoder | str] = {}
    for channel_id, own in messages.by_channel():
        channel = walk.channels[channel_id]
        key = channel.message_encoding, channel.schema_id
        if key not in decoders and len(decoders) == _TYPES_LIMIT:
            failures.update(dict.fromkeys(own.tolist(), f"its topic holds more than {_TYPES_LIMIT} types of messages"))
            continue
        if key not in decoders:
            decoders[key] = decoder_of(channel, walk.schemas.get(channel.schema_id), content, source)
        decoder = decoders[key]
        if isinstance(decoder, str):
            failures.update(dict.fromkeys(own.tolist(), decoder))
            continue
        decoder.many(messages, own, fields)
        for index in own[~(fields.fits | fields.of_other_frame)[own]].tolist():
            if index in failures:
                continue
            try:
                fields.take_one(index, decoder.one(messages.payload(index)))
            except OtherFrameError:
                fields.of_other_frame[index] = True
            except UNDECODABLE as error:
                failures[index] = _reason(error)
    if source.child is None and len(fields.children) > 1:
        names = ", ".join(f'"{name}"' for name in list(fields.children)[:_FRAMES_NAMED])
        reason = f"its topic holds the frames {names}; say in study.yaml which one is meant by `child:`"
        failures.update(dict.fromkeys(range(len(messages)), _shortened(reason)))
    return fields


def decoder_of(channel: Channel, schema: Schema | None, content: str, source: Source) -> Decoder | str:
    """The channel's decoder, by its encoding, or why there is none."""
    module = _DECODERS.get(channel.message_encoding)
    if module is None:
        return f'its encoding is "{channel.message_encoding}", not one of {", ".join(_DECODERS)}'
    try:
        decoder: Decoder = import_module(module).decoder(channel, schema, content, source)
    except UNDECODABLE as error:
        return _reason(error)
    return decoder


def _reason(error: Exception) -> str:
    return _shortened(str(error) or type(error).__name__)


def _shortened(text: str) -> str:
    return text if len(text) <= _REASON_LIMIT else f"{text[:_REASON_LIMIT]} …"


def _plausible(fields: Fields, content: str, source: Source, failures: Failures) -> tuple[IntArray, FloatArray]:
    """Stamps and values, where values beyond all range fail; NaN and infinity stay for the checks of the study.

    An orientation is NaN where the log says that it is unknown, or its length is not 1.
    """
    motion = fields.values[:, : 6 if content == "acceleration" else 3]
    scale = np.repeat([source.scale, source.turning_scale], 3)[: motion.shape[1]]
    with np.errstate(invalid="ignore", over="ignore"):  # damaged bytes may be any float
        too_far = ((np.abs(motion * scale) > _PLAUSIBLE[content]) & np.isfinite(motion)).any(axis=1)
    no_stamp = (fields.nanoseconds < 0) | (fields.nanoseconds >= 1_000_000_000)
    for unfit, reason in ((no_stamp, UNFIT), (too_far, f"{UNFIT}: a figure is out of all range")):
        for index in np.flatnonzero(unfit).tolist():
            failures.setdefault(index, reason)
    stamp = fields.seconds * 1_000_000_000 + fields.nanoseconds
    if content != "acceleration":
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
        if index in failures:
            continue
        try:
            channel = walk.channels[int(messages.channel[index])]
            events[index] = event(
                channel, walk.schemas.get(channel.schema_id), messages.payload(index), _PLAUSIBLE["position"]
            )
        except UNDECODABLE as error:
            failures[index] = _reason(error)
    return events
