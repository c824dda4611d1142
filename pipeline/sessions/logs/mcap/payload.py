"""Decodes messages by the encoding of each channel: many at once, unusual ones one by one."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

import numpy as np
from mcap.records import Channel, Schema

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import IntArray, Source
from pipeline.sessions.logs.mcap.events import EVENTS_LIMIT, event
from pipeline.sessions.logs.mcap.fields import UNDECODABLE, UNFIT, Decoder, Fields
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.pick import OtherFrameError
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

_PLAUSIBLE = {
    "position": 1e4,
    "velocity": 1e4,
    "acceleration": 1e5,
}  # m; m/s; m/s², rad/s: beyond it the bytes are something else
_TYPES_LIMIT = 64  # types of one topic, because following each schema takes time
_REASON_LIMIT = 300  # characters: names in a log may be long

Failures = dict[int, str]
"""Why a message cannot be read, by its index."""

Decoders = dict[tuple[str, int], Decoder | str]
"""The decoder of each encoding and schema, or why there is none."""


def decoded(
    walk: Walk, messages: Messages, content: str, source: Source, decoders: Decoders, failures: Failures
) -> Fields:
    """What the messages hold; those that cannot be decoded are noted in `failures`. New `decoders` are added."""
    fields = Fields.none_of(len(messages), content)
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
    return shortened(str(error) or type(error).__name__)


def shortened(text: str) -> str:
    """A reason that is not too long to be shown."""
    return text if len(text) <= _REASON_LIMIT else f"{text[:_REASON_LIMIT]} …"


def plausible(fields: Fields, content: str, source: Source, failures: Failures) -> tuple[IntArray, FloatArray]:
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


def events_of(walk: Walk, messages: Messages, failures: Failures) -> dict[int, Mapping[str, object]]:
    """The events of messages, by index. SessionError for more than any session has."""
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
