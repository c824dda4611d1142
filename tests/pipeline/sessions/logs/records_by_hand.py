"""Records of a log as bytes, put together by hand: such as no writer would write."""

from __future__ import annotations

import struct

import lz4.frame
import zstandard


def chunk(records: bytes, data: bytes, compression: bytes, stated: int | None = None) -> bytes:
    head = struct.pack("<QQQI", 0, 0, len(records) if stated is None else stated, 0)
    head += struct.pack("<I", len(compression)) + compression + struct.pack("<Q", len(data))
    return struct.pack("<BQ", 6, len(head) + len(data)) + head + data


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def channel_record(topic: bytes, encoding: bytes, schema: int = 0) -> bytes:
    body = struct.pack("<HH", 1, schema) + text(topic) + text(encoding) + struct.pack("<I", 0)
    return struct.pack("<BQ", 4, len(body)) + body


def message_record(payload: bytes) -> bytes:
    return struct.pack("<BQHIQQ", 5, 22 + len(payload), 1, 0, 0, 0) + payload


def zeros(compression: str, size: int) -> bytes:
    if compression == "lz4":
        return bytes(lz4.frame.compress(b"\0" * size, store_size=False))
    return zstandard.ZstdCompressor(write_content_size=False).compress(b"\0" * size)
