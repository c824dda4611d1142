"""Digests of a study's own files, remembered as long as the file system says that a file has not changed."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from pipeline.engine.cache import digest_of, file_digest

_SETTLED_NS = 2_000_000_000  # coarser than any file system's clock: a later change shows in the times
Stamp = list[int]
"""Size, time of modification and of the last change (ns), and inode of a file."""
_Known = dict[str, tuple[Stamp, str]]


def file_digests(
    files: Mapping[str, Path],
    study: Path,
    memory: Path,
    read_digest: Callable[[Path], str] = file_digest,
    now_ns: Callable[[], int] = time.time_ns,
) -> dict[str, str]:
    """SHA-256 of each file, by its name in `files`. Only files that changed since the last call are read.

    A file counts as unchanged if its size, modification time, change time and inode are the same. One that changed
    within the last two seconds is read again the next time, because another change might get the same time (git treats
    its index in the same way). The digests of a study's files are remembered in the folder `memory`.
    """
    kept = memory / f"{digest_of(str(study))}.json"
    before = _read(kept)
    now: _Known = {}
    digests = {}
    for name, path in files.items():
        current = stamp(path)
        known = before.get(name)
        digests[name] = known[1] if known is not None and known[0] == current else read_digest(path)
        if max(current[1:3]) < now_ns() - _SETTLED_NS:
            now[name] = (current, digests[name])
    if now != before:
        _write(now, kept)
    return digests


def stamp(path: Path) -> Stamp:
    """What the file system says of a file; it changes with every change of the file."""
    state = path.stat()
    return [state.st_size, state.st_mtime_ns, state.st_ctime_ns, state.st_ino]


def _read(kept: Path) -> _Known:
    """The remembered digests; none where the file is missing or damaged."""
    try:
        content = json.loads(kept.read_text(encoding="utf-8"))
        if digest_of(content["files"]) != content["sha256"]:
            return {}
        return {name: (list(known), str(digest)) for name, (known, digest) in content["files"].items()}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _write(known: _Known, kept: Path) -> None:
    """Write the whole file or none of it. If it cannot be written, the study's files are read again the next time."""
    partial = kept.with_name(f"{kept.name}.{os.getpid()}")
    with suppress(OSError):
        kept.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.write_text(json.dumps({"sha256": digest_of(known), "files": known}), encoding="utf-8")
            partial.replace(kept)
        finally:
            partial.unlink(missing_ok=True)
