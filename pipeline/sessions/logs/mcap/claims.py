"""What messages in CDR say in addition to their values: the frame, and which values to disregard.

It is for checks only: nothing is decoded by it and it never fails. Messages of other encodings claim nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from mcap.records import Channel

from pipeline.sessions.growing import Growing, MostlyAlike
from pipeline.sessions.logs.log import BoolArray, Claims, IntArray
from pipeline.sessions.logs.mcap.fields import Fields
from pipeline.sessions.logs.mcap.messages import Messages
from pipeline.sessions.logs.mcap.schemas import SCHEMAS
from pipeline.sessions.logs.mcap.walk import Walk
from pipeline.statistics.arrays import FloatArray

_NUMBERS = {"position": 3, "acceleration": 37}
"""How many float64 stand at the end of the two commonest types, a PointStamped and an Imu."""

_NAME_BYTES, _NAME = 12, 16  # where the length of the frame's name stands, and its first byte
_ORIENTATION, _RATE_COVARIANCE, _FORCE_COVARIANCE = 0, 16, 28  # of the 37 numbers of an Imu
_UNKNOWN = -1.0


class ClaimsSoFar:
    """The claims of a topic's messages while a log is read. Frames are numbered as if all had been read at once."""

    def __init__(self, content: str) -> None:
        self._content = content
        self._frames: dict[str, _Named] = {}
        self._frame = MostlyAlike(np.int64)
        self._length = Growing(np.float64)
        self._force, self._gyroscope = MostlyAlike(np.bool_), MostlyAlike(np.bool_)

    def add(self, walk: Walk, messages: Messages, fields: Fields, which: IntArray) -> None:
        """The claims of those of some decoded messages that could be read, in their order."""
        channel = messages.channel[which]
        fixed = [number for number in np.unique(channel).tolist() if _of_fixed_shape(walk, walk.channels[number])]
        is_fixed = np.isin(channel, fixed)
        frame = np.full(len(which), -1, np.int64)
        length = np.full(len(which), np.nan)
        force, gyroscope = np.zeros(len(which), bool), np.zeros(len(which), bool)
        for own, read in ((np.flatnonzero(is_fixed), _by_places), (np.flatnonzero(~is_fixed), _by_fields)):
            if not len(own):
                continue
            found = read(messages, fields, which[own], self._content)
            frame[own] = self._numbers(found.frames)[found.frame]
            if found.of_imu is not None:
                length[own], force[own], gyroscope[own] = found.of_imu
        self._frame.add(frame)
        if self._content == "acceleration":
            self._length.add(length)
            self._force.add(force)
            self._gyroscope.add(gyroscope)

    def whole(self) -> Claims:
        """The claims of all messages; none where no message names a frame."""
        if not self._frames:
            return Claims()
        in_order = sorted(self._frames, key=lambda name: (self._frames[name].shortest, self._frames[name].number))
        frame = self._frame.whole()
        if [self._frames[name].number for name in in_order] != list(range(len(in_order))):
            place = {name: index for index, name in enumerate(in_order)}
            frame = np.array([*(place[name] for name in self._frames), -1], np.int64)[frame]
        if self._content != "acceleration":
            return Claims(tuple(in_order), frame)
        return Claims(tuple(in_order), frame, self._length.whole(), self._force.whole(), self._gyroscope.whole())

    def _numbers(self, frames: Mapping[str, int]) -> IntArray:
        """The number of each frame of a block, and last −1, for messages that name none."""
        for name, shortest in frames.items():
            known = self._frames.get(name, _Named(len(self._frames), shortest))
            self._frames[name] = _Named(known.number, min(known.shortest, shortest))
        return np.array([*(self._frames[name].number for name in frames), -1], np.int64)


class _Named(NamedTuple):
    """A frame's number by the order in which frames were met, and the bytes of the shortest message that names it."""

    number: int
    shortest: int


class _Found(NamedTuple):
    """The claims of n messages: `frame` (n,) counts into `frames`, the names with the shortest message's bytes.

    Of an IMU also the length of the orientation, and what is disclaimed, force and gyroscope, each (n,).
    """

    frames: Mapping[str, int]
    frame: IntArray
    of_imu: tuple[FloatArray, BoolArray, BoolArray] | None = None


def _by_places(messages: Messages, _: Fields, which: IntArray, content: str) -> _Found:
    """What the two commonest types in CDR say, by where it stands in them."""
    if content == "velocity":
        content = "position"
    names: dict[bytes, int] = {}
    shortest: dict[str, int] = {}
    frame = np.zeros(len(which), np.int64)
    numbers = np.zeros((len(which), _NUMBERS[content]))
    length = messages.length[which]
    for size in np.unique(length).tolist():
        own = np.flatnonzero(length == size)
        rows = messages.rows(which[own])
        frame[own] = _frames(rows, names)
        for name in names:
            shortest.setdefault(name.decode("utf-8", "replace"), size)
        width = 8 * _NUMBERS[content]
        tail = np.ascontiguousarray(rows[:, size - (size - 4) % 8 - width :][:, :width])
        little = rows[:, 1] == 1
        numbers[own] = np.where(little[:, None], tail.view("<f8"), tail.view(">f8"))
    if len(shortest) < len(names):  # different bytes that are no text are one name
        texts = [name.decode("utf-8", "replace") for name in names]
        frame = np.array([list(shortest).index(text) for text in texts], np.int64)[frame]
    if content != "acceleration":
        return _Found(shortest, frame)
    unknown = numbers[:, _ORIENTATION + 4] == _UNKNOWN
    with np.errstate(over="ignore", invalid="ignore"):
        size_of = np.sqrt((numbers[:, :4] ** 2).sum(axis=1))
    return _Found(
        shortest,
        frame,
        (
            np.where(unknown, np.nan, size_of),
            numbers[:, _FORCE_COVARIANCE] == _UNKNOWN,
            numbers[:, _RATE_COVARIANCE] == _UNKNOWN,
        ),
    )


def _of_fixed_shape(walk: Walk, channel: Channel) -> bool:
    """Whether the frame's name stands where it does in the two commonest types in CDR."""
    schema = walk.schemas.get(channel.schema_id)
    return channel.message_encoding == "cdr" and schema is not None and schema.name in SCHEMAS.values()


def _by_fields(_: Messages, fields: Fields, which: IntArray, content: str) -> _Found:
    """What the general decoder has found; of a message without an angular velocity it is to be disregarded."""
    names, frame = dict.fromkeys(fields.parents, 0), fields.parent[which]
    if content != "acceleration":
        return _Found(names, frame)
    values = fields.values[which]
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.sqrt((values[:, 6:10] ** 2).sum(axis=1))
    unknown = np.logical_or(values[:, 10] == _UNKNOWN, length == 0)
    nothing = np.zeros(len(which), bool)
    without_turning = (values[:, 3:6] == 0.0).all(axis=1)
    return _Found(names, frame, (np.where(unknown, np.nan, length), nothing, without_turning))


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
