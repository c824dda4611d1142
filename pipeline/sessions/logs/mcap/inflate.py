"""Unpacks a chunk, never to more bytes than it states and than a log may hold."""

from __future__ import annotations

import lz4.frame
import zstandard
from mcap.records import Chunk

DAMAGED = (ValueError, zstandard.ZstdError, RuntimeError, EOFError)
"""What inflating a damaged chunk raises."""

CHUNK_LIMIT = 128 * 2**20
ZSTD_MARK = b"\x28\xb5\x2f\xfd"


def inflate(chunk: Chunk) -> bytes:
    """The chunk's bytes. Raises one of `DAMAGED` if it cannot be unpacked or holds more or less than it states."""
    stated = chunk.uncompressed_size
    if chunk.compression == "":
        data = bytes(chunk.data)
    elif chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(stated + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=stated + 1)
    else:
        raise ValueError(f'its compression "{chunk.compression}" is not one of zstd, lz4')
    if len(data) > stated:
        raise ValueError(f"a chunk that states {stated} bytes inflates to more")
    if len(data) < stated:
        raise ValueError(f"it states {stated} bytes and holds {len(data)}")
    return data


def check_stated_size(chunk: Chunk) -> None:
    """Raise one of `DAMAGED` where the compressed bytes state a smaller size than the chunk does."""
    own_size = None
    if chunk.compression == "zstd":
        size = zstandard.frame_content_size(chunk.data)
        own_size = None if size < 0 else size
    elif chunk.compression == "lz4":
        own_size = lz4.frame.get_frame_info(chunk.data)["content_size"] or None
    elif chunk.compression == "":
        own_size = len(chunk.data)
    if own_size is not None and own_size < chunk.uncompressed_size:
        raise ValueError(f"it states {chunk.uncompressed_size} bytes and holds {own_size}")
