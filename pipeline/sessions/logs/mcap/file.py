"""A log's file as it is read: unpacked, if it was packed as a whole."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import zstandard

from pipeline.errors import SessionError
from pipeline.sessions.logs.mcap.inflate import ZSTD_MARK
from pipeline.sessions.logs.mcap.records import HOW_TO_LIFT
from pipeline.sessions.logs.mcap.walk import Walk

_LFS_MARK = b"version https://git-lfs.github.com/spec/"
_BLOCK = 2**20


@contextmanager
def unpacked(path: Path, walk: Walk) -> Iterator[tuple[BinaryIO, int]]:
    """The file and its size; one packed by zstd (`rosbag2 --compression-mode file`) is unpacked to a temporary file.

    SessionError for a Git LFS pointer, and for one that would unpack to more than the limit of `walk`. What is missing
    at the end of a packed file is noted.
    """
    with path.open("rb") as file:
        head = file.read(len(_LFS_MARK))
        file.seek(0)
        if head == _LFS_MARK:
            raise SessionError("it is a Git LFS pointer, not the log itself; run: git lfs pull")
        if not head.startswith(ZSTD_MARK):
            yield file, path.stat().st_size
            return
        with tempfile.TemporaryFile() as whole:
            size = _unpack(file, whole, walk)
            whole.seek(0)
            yield whole, size


def _unpack(file: BinaryIO, whole: BinaryIO, walk: Walk) -> int:
    size = 0
    try:
        reader = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)
        while block := reader.read(_BLOCK):
            size += len(block)
            if size > walk.inflated_limit:
                limit = walk.inflated_limit // 2**20
                raise SessionError(f"refused: it would unpack to more than {limit} MiB; {HOW_TO_LIFT}")
            whole.write(block)
    except zstandard.ZstdError as error:
        walk.note(f"the file is packed with zstd and damaged {size} bytes in: {error}")
        walk.unknown_loss = True
    return size
