"""What messages in CDR say in addition to their values: the frame, and which values to disregard.

It is for checks only: nothing is decoded by it and it never fails. Messages of other encodings claim nothing.
"""

from __future__ import annotations

import numpy as np
from mcap.records import Channel

from pipeline.sessions.logs.log import Claims, IntArray
from pipeline.sessions.logs.mcap.fields import Fields
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.schemas import SCHEMAS
from pipeline.sessions.logs.mcap.walk import Walk

_NUMBERS = {"position": 3, "acceleration": 37}
"""How many float64 stand at the end of the two commonest types, a PointStamped and an Imu."""

_NAME_BYTES, _NAME = 12, 16  # where the length of the frame's name stands, and its first byte
_ORIENTATION, _RATE_COVARIANCE, _FORCE_COVARIANCE = 0, 16, 28  # of the 37 numbers of an Imu
_UNKNOWN = -1.0


def claimed(walk: Walk, messages: Messages, fields: Fields, which: IntArray, content: str) -> Claims:
    """The claims of some decoded messages, in their order."""
    encoded = {number for number, channel in walk.channels.items() if _of_fixed_shape(walk, channel)}
    if not len(which) or not set(np.unique(messages.channel[which]).tolist()) <= encoded:
        return _by_fields(fields, which, content) if fields.parents else Claims()
    if content == "velocity":
        content = "position"
    names: dict[bytes, int] = {}
    frame = np.zeros(len(which), np.int64)
    numbers = np.zeros((len(which), _NUMBERS[content]))
    length = messages.length[which]
    for size in np.unique(length).tolist():
        own = np.flatnonzero(length == size)
        rows = messages.rows(which[own])
        frame[own] = _frames(rows, names)
        width = 8 * _NUMBERS[content]
        tail = np.ascontiguousarray(rows[:, size - (size - 4) % 8 - width :][:, :width])
        little = rows[:, 1] == 1
        numbers[own] = np.where(little[:, None], tail.view("<f8"), tail.view(">f8"))
    texts = tuple(name.decode("utf-8", "replace") for name in names)
    if content != "acceleration":
        return Claims(texts, frame)
    unknown = numbers[:, _ORIENTATION + 4] == _UNKNOWN
    with np.errstate(over="ignore", invalid="ignore"):
        size_of = np.sqrt((numbers[:, :4] ** 2).sum(axis=1))
    return Claims(
        texts,
        frame,
        np.where(unknown, np.nan, size_of),
        numbers[:, _FORCE_COVARIANCE] == _UNKNOWN,
        numbers[:, _RATE_COVARIANCE] == _UNKNOWN,
    )


def _of_fixed_shape(walk: Walk, channel: Channel) -> bool:
    """Whether the frame's name stands where it does in the two commonest types in CDR."""
    schema = walk.schemas.get(channel.schema_id)
    return channel.message_encoding == "cdr" and schema is not None and schema.name in SCHEMAS.values()


def _by_fields(fields: Fields, which: IntArray, content: str) -> Claims:
    """What the general decoder has found; of a message without an angular velocity it is to be disregarded."""
    names, frame = tuple(fields.parents), fields.parent[which]
    if content != "acceleration":
        return Claims(names, frame)
    values = fields.values[which]
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.sqrt((values[:, 6:10] ** 2).sum(axis=1))
    unknown = np.logical_or(values[:, 10] == _UNKNOWN, length == 0)
    nothing = np.zeros(len(which), bool)
    without_turning = (values[:, 3:6] == 0.0).all(axis=1)
    return Claims(names, frame, np.where(unknown, np.nan, length), nothing, without_turning)


def _frames(rows: np.ndarray[tuple[int, int], np.dtype[np.uint8]], names: dict[bytes, int]) -> IntArray:
    """The number of each message's frame; names that are new are added."""
    head = rows[:, _NAME_BYTES:]
    changes = np.concatenate([[True], np.any(head[1:, :4] != head[:-1, :4], axis=1)])
    width = int.from_bytes(head[0, :4].tobytes(), "little" if rows[0, 1] == 1 else "big")
    text = rows[:, _NAME : _NAME + width]
    if not changes[1:].any() and len(text) and (text == text[0]).all():
        return np.full(len(rows), names.setdefault(text[0].tobytes().rstrip(b"\0"), len(names)))
    numbers = np.zeros(len(rows), np.int64)
    for index, row in enumerate(rows):
        size = int.from_bytes(row[_NAME_BYTES:_NAME].tobytes(), "little" if row[1] == 1 else "big")
        numbers[index] = names.setdefault(row[_NAME : _NAME + size].tobytes().rstrip(b"\0"), len(names))
    return numbers
