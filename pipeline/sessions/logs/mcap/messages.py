"""Messages as arrays: where each lies in a run of records, without one Python object per message."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.sessions.logs.log import IntArray

_LENGTH = struct.Struct("<xQ")  # after the opcode
RECORD_HEAD_BYTES = 9
_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("size", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)


@dataclass(frozen=True)
class Messages:
    """Messages in the order of the file, arrays of shape (n,), times in ns as logged (unsigned, so not yet believed).

    Payload i is the `length[i]` bytes of `data` from `start[i]`.
    """

    log_time: npt.NDArray[np.uint64]
    publish_time: npt.NDArray[np.uint64]
    channel: npt.NDArray[np.uint16]
    start: IntArray
    length: IntArray
    data: bytes

    def __len__(self) -> int:
        return len(self.channel)

    def payload(self, index: int) -> bytes:
        """The bytes of one message."""
        return self.data[self.start[index] : self.start[index] + self.length[index]]

    def payloads(self, which: IntArray) -> list[bytes]:
        """The bytes of some messages."""
        begin = self.start[which]
        end = begin + self.length[which]
        return [self.data[first:last] for first, last in zip(begin.tolist(), end.tolist(), strict=True)]

    def rows(self, which: IntArray) -> npt.NDArray[np.uint8]:
        """The payloads of messages that are equally long, shape (len(which), length)."""
        length = int(self.length[which[0]])
        if length == 0:
            return np.zeros((len(which), 0), np.uint8)
        every = np.ndarray((len(self.data) - length + 1,), f"V{length}", self.data, strides=(1,))
        return every[self.start[which]].view(np.uint8).reshape(len(which), length)

    def by_channel(self) -> list[tuple[int, IntArray]]:
        """Each channel's number and the indices of its messages, sorted once however many channels there are."""
        if not len(self):
            return []
        order: IntArray = np.argsort(self.channel, kind="stable")
        numbers, begins = np.unique(self.channel[order], return_index=True)
        return list(zip(numbers.tolist(), np.split(order, begins[1:]), strict=True))

    def chosen(self, which: IntArray, payloads: bool = True) -> Messages:
        """Some of the messages with a copy of their own bytes, so that the rest can be freed; or without any bytes."""
        length = self.length[which] if payloads else np.zeros(len(which), np.int64)
        if len(length) and np.all(length == length[0]):
            data = self.rows(which).tobytes() if length[0] else b""
        else:
            data = b"".join(self.payloads(which))
        start = np.cumsum(length) - length
        return Messages(self.log_time[which], self.publish_time[which], self.channel[which], start, length, data)


def joined(parts: Sequence[Messages]) -> Messages:
    """All messages in one, in their order."""

    def column(name: str, kind: type) -> npt.NDArray[Any]:
        return np.concatenate([np.zeros(0, kind), *(getattr(part, name) for part in parts)])

    if len(parts) == 1:
        return parts[0]
    sizes = [len(part.data) for part in parts]
    begins = np.cumsum([0, *sizes])[: len(parts)]
    return Messages(
        column("log_time", np.uint64),
        column("publish_time", np.uint64),
        column("channel", np.uint16),
        column("start", np.int64) + np.repeat(begins, [len(part) for part in parts]),
        column("length", np.int64),
        b"".join([part.data for part in parts]),
    )


def record_starts(data: bytes, limit: int) -> tuple[list[int], bool]:
    """Where the records in `data` begin, at most `limit` + 1 of them, and whether the last ends where the data do."""
    starts: list[int] = []
    at, end = 0, len(data)
    last = end - RECORD_HEAD_BYTES
    length_at, begins = _LENGTH.unpack_from, starts.append
    for _ in range(limit + 1):
        if at > last:
            break
        begins(at)
        at += 9 + length_at(data, at)[0]  # RECORD_HEAD_BYTES, which looking up takes a tenth of the loop
    if at > end:
        starts.pop()
    return starts, at == end


def messages_at(data: bytes, starts: IntArray) -> tuple[Messages, int]:
    """The messages whose records begin at `starts`, and how many of those records are too short to be one."""
    if len(data) < _HEAD.itemsize:
        return joined([]), len(starts)
    within = starts[starts <= len(data) - _HEAD.itemsize]
    every = np.ndarray((len(data) - _HEAD.itemsize + 1,), _HEAD, data, strides=(1,))
    head = every[within]
    length = head["size"].astype(np.int64) - (_HEAD.itemsize - RECORD_HEAD_BYTES)
    whole = length >= 0
    head, length, begin = head[whole], length[whole], within[whole] + _HEAD.itemsize
    messages = Messages(head["log_time"], head["publish_time"], head["channel"], begin, length, data)
    return messages, len(starts) - len(messages)
