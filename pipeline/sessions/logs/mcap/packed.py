"""Messages that were packed one by one, as `rosbag2 --compression-mode message` writes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import zstandard

from pipeline.sessions.logs.mcap.fields import PAYLOAD_LIMIT
from pipeline.sessions.logs.mcap.inflate import DAMAGED, ZSTD_MARK
from pipeline.sessions.logs.mcap.messages import Messages


def inflated(messages: Messages, failures: dict[int, str]) -> Messages:
    """The messages, those unpacked that were packed one by one.

    No message in CDR or JSON begins with zstd's mark. Why one cannot be unpacked is noted in `failures`.
    """
    long_enough = np.flatnonzero(messages.length >= len(ZSTD_MARK))
    if not len(long_enough):
        return messages
    data = np.frombuffer(messages.data, np.uint8)
    begins = messages.start[long_enough]
    packed = np.ones(len(begins), bool)
    for index, byte in enumerate(ZSTD_MARK):
        packed &= data[begins + index] == byte
    if not packed.any():
        return messages
    payloads = messages.payloads(np.arange(len(messages)))
    for index in long_enough[packed].tolist():
        try:
            payloads[index] = _unpacked(payloads[index])
        except DAMAGED as error:
            failures[index] = f"it is packed with zstd and cannot be unpacked: {error}"
    length = np.array([len(payload) for payload in payloads], np.int64)
    start = np.cumsum(length) - length
    return replace(messages, start=start, length=length, data=b"".join(payloads))


def _unpacked(payload: bytes) -> bytes:
    data: bytes = zstandard.ZstdDecompressor().stream_reader(payload).read(PAYLOAD_LIMIT + 1)
    if len(data) > PAYLOAD_LIMIT:
        raise ValueError(f"it is longer than {PAYLOAD_LIMIT // 1024} KiB, which no sensor's message is")
    return data
