"""Events in JSON, one by one."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
from mcap.records import Channel

from pipeline.sessions.logs.mcap.fields import UNFIT

EVENT_TYPES = ("session_start", "trial_start", "selection", "session_end")
EVENTS_LIMIT = 100_000

_NUMBER_LIMIT = 2**53
_EVENT_LIMIT = 64 * 1024  # bytes of one event


def event(channel: Channel, payload: bytes, farthest_m: float) -> Mapping[str, object]:
    """What is used of an event: type, trial, and the target and selected position in metres.

    ValueError, or another that JSON and its types raise, where it is none.
    """
    if channel.message_encoding != "json":
        raise ValueError(f'its encoding is "{channel.message_encoding}", not json')
    if len(payload) > _EVENT_LIMIT:
        raise ValueError(f"it is longer than {_EVENT_LIMIT // 1024} KiB, which no event is")
    said = json.loads(payload)
    if not isinstance(said, dict) or said.get("type") not in EVENT_TYPES:
        raise ValueError(f"it is not an event: `type` must be one of {', '.join(EVENT_TYPES)}")
    trial = said.get("trial")
    if trial is not None and not (isinstance(trial, int) and abs(trial) < _NUMBER_LIMIT):
        raise ValueError("its trial is not a whole number")
    found = {"type": said["type"], "trial": trial}
    for key in ("target_x", "target_y", "target_z", "x", "y", "z"):
        if said.get(key) is not None:
            found[key] = float(said[key])
            if np.isfinite(found[key]) and abs(found[key]) > farthest_m:
                raise ValueError(f"{UNFIT}: a figure is out of all range")
    return found
