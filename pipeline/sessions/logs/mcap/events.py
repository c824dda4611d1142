"""Events in JSON, one by one."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
from mcap.records import Channel, Schema

from pipeline.sessions.logs.mcap.definition_text import short_name
from pipeline.sessions.logs.mcap.fields import UNFIT
from pipeline.sessions.logs.mcap.well_known import definition_of
from pipeline.sessions.logs.mcap.wire import ROS1, places, wire_of

EVENT_TYPES = ("session_start", "trial_start", "selection", "session_end")
EVENTS_LIMIT = 100_000

_TEXT = "std_msgs/String"
_NUMBER_LIMIT = 2**53
_EVENT_LIMIT = 64 * 1024  # bytes of one event


def event(channel: Channel, schema: Schema | None, payload: bytes, farthest_m: float) -> Mapping[str, object]:
    """The used fields of an event: type, trial, and the target and selected position in metres.

    An event is JSON, by itself or as the text of a std_msgs/String.

    Raises ValueError, or what JSON and its types raise, for anything that is not an event.
    """
    if channel.message_encoding in ("cdr", "ros1") and schema is not None:
        payload = text_message(channel.message_encoding, schema.name, payload)
    elif channel.message_encoding != "json":
        raise ValueError(f'its encoding is "{channel.message_encoding}", not json')
    if len(payload) > _EVENT_LIMIT:
        raise ValueError(f"it is longer than {_EVENT_LIMIT // 1024} KiB, which no event is")
    return checked_event(json.loads(payload), farthest_m)


def checked_event(message: object, farthest_m: float) -> Mapping[str, object]:
    """The used fields of an event that is already a mapping. ValueError, or what its types raise, for anything else."""
    if not isinstance(message, dict) or message.get("type") not in EVENT_TYPES:
        raise ValueError(f"it is not an event: `type` must be one of {', '.join(EVENT_TYPES)}")
    trial = message.get("trial")
    if trial is not None and not (isinstance(trial, int) and abs(trial) < _NUMBER_LIMIT):
        raise ValueError("its trial is not a whole number")
    fields = {"type": message["type"], "trial": trial}
    for key in ("target_x", "target_y", "target_z", "x", "y", "z"):
        if message.get(key) is not None:
            fields[key] = float(message[key])
            if np.isfinite(fields[key]) and abs(fields[key]) > farthest_m:
                raise ValueError(f"{UNFIT}: a figure is out of all range")
    return fields


def text_message(encoding: str, type_name: str, payload: bytes) -> bytes:
    """The text of a std_msgs/String. ValueError for a message of another type."""
    if short_name(type_name) != _TEXT:
        raise ValueError(f"it holds {type_name}, and events need JSON, by itself or in a std_msgs/msg/String")
    wire = ROS1 if encoding == "ros1" else wire_of(payload)
    return places(payload, definition_of(_TEXT), wire).texts["data",].encode()
