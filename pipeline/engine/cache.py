"""The content-addressed cache: an entry is a folder named by everything that may change what is in it."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_MANIFEST = "entry.json"
_NEW = "new"
_KEY_LENGTH = 64
_CLOCK_S = 2  # the coarsest clock of a file system


def digest_of(value: object) -> str:
    """SHA-256 of a value as JSON with sorted keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, ensure_ascii=True).encode()).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class Entry:
    """A folder of results, what its stage said beside them, and a digest of both."""

    folder: Path
    said: Mapping[str, Any]
    content: str


class Cache:
    """Entries under one folder, by stage and key. An entry appears whole or not at all."""

    def __init__(self, root: Path) -> None:
        self.root = root

    @property
    def inputs(self) -> Path:
        """Where the digests of the studies' own files are remembered."""
        return self.root / "inputs"

    def _folder(self, stage: str, key: str) -> Path:
        return self.root / stage / key[:2] / key

    def get(self, stage: str, key: str) -> Entry | None:
        """The entry, or None if there is none or a file of it is missing or not what was written.

        A file whose size and time are those it was kept with is not read; `fault` and `verify` read all of them.
        """
        folder = self._folder(stage, key)
        try:
            entry = _read(folder, whole=False)
        except _DamagedError:
            return None
        with suppress(OSError):  # when it was last of use, for `prune`
            os.utime(folder / _MANIFEST)
        return entry

    def fault(self, stage: str, key: str) -> str | None:
        """What is wrong with an entry that is there; None where there is none, or nothing is wrong."""
        return fault_of(self._folder(stage, key))

    def entries(self) -> Iterator[Path]:
        """The folders of all entries, whole or damaged: stage/xx/key."""
        for folder in sorted(self.root.glob(f"*/??/{'?' * _KEY_LENGTH}")):
            if folder.is_dir():
                yield folder

    def remnants(self) -> Iterator[Path]:
        """What runs that were killed left behind, and what runs at work are writing now."""
        with suppress(FileNotFoundError):
            yield from sorted((self.root / _NEW).iterdir())

    def remove(self, folder: Path) -> None:
        """Remove an entry or a remnant. An entry goes at once, not file by file."""
        with self._alone():
            _discard(folder, self.root / _NEW)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Two runs must not take away what the other has just put in place."""
        self.root.mkdir(parents=True, exist_ok=True)
        with (self.root / "lock").open("a") as file:
            with suppress(OSError):  # some network file systems have no locks; renames are whole even so
                fcntl.flock(file, fcntl.LOCK_EX)
            yield

    @contextmanager
    def new(self, stage: str) -> Iterator[Path]:
        """A folder to fill; it is removed unless `keep` takes it over."""
        (self.root / _NEW).mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f"{stage}-", dir=self.root / _NEW))
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def keep(self, stage: str, key: str, folder: Path, said: Mapping[str, Any]) -> Entry:
        """Take a filled folder into the cache under its key."""
        files = {
            path.relative_to(folder).as_posix(): {"size": path.stat().st_size, "sha256": file_digest(path)}
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
        content = digest_of([files, dict(said)])
        sealed_ns = _seal(folder, files)
        manifest = {
            "stage": stage,
            "key": key,
            "files": files,
            "said": dict(said),
            "content": content,
            "sealed_ns": sealed_ns,
        }
        (folder / _MANIFEST).write_text(json.dumps(manifest, indent=1), encoding="utf-8")
        final = self._folder(stage, key)
        final.parent.mkdir(parents=True, exist_ok=True)
        with self._alone():
            there = self.get(stage, key)
            if there is not None:
                return there  # another run was first
            _discard(final, self.root / _NEW)
            folder.rename(final)
        return Entry(final, dict(said), content)


def _seal(folder: Path, files: Iterable[str]) -> int:
    """Set the files' time of modification so far back that whatever writes to one later changes it; that time.

    A whole, even number of seconds, which every file system keeps as it is.
    """
    sealed_ns = (int(time.time()) // _CLOCK_S - 1) * _CLOCK_S * 1_000_000_000
    for name in files:
        os.utime(folder / name, ns=(sealed_ns, sealed_ns))
    return sealed_ns


class _DamagedError(Exception):
    """Why a folder is not a whole entry."""


def last_used_s(folder: Path) -> float:
    """When an entry was last of use, in seconds since 1970; of a folder that is none, when it was last changed."""
    manifest = folder / _MANIFEST
    return (manifest if manifest.is_file() else folder).stat().st_mtime


def fault_of(folder: Path) -> str | None:
    """What is wrong with the entry in a folder; None where nothing is, or there is none."""
    if not folder.is_dir():
        return None
    try:
        _read(folder, whole=True)
    except _DamagedError as damage:
        return str(damage)
    return None


def _read(folder: Path, whole: bool) -> Entry:
    """The entry in a folder, each file of it compared with the digest of what was written. Raises _DamagedError.

    Unless all are to be read, a file that still bears the time it was sealed with counts as what was written.
    """
    try:
        manifest = json.loads((folder / _MANIFEST).read_text(encoding="utf-8"))
        files, said, content = manifest["files"], manifest["said"], manifest["content"]
        if digest_of([files, said]) != content or manifest["key"] != folder.name:
            raise _DamagedError(f"{_MANIFEST} is not what was written")
        for name, stated in files.items():
            path = folder / name
            found = path.stat()
            untouched = not whole and found.st_mtime_ns == manifest.get("sealed_ns")
            if found.st_size != stated["size"] or not (untouched or file_digest(path) == stated["sha256"]):
                raise _DamagedError(f"{name} is not what was written")
    except FileNotFoundError as error:
        raise _DamagedError(f"{Path(error.filename).name} is missing") from None
    except OSError as error:
        raise _DamagedError(f"{Path(error.filename or folder).name} cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise _DamagedError(f"{_MANIFEST} cannot be read") from None
    return Entry(folder, said, content)


def _discard(folder: Path, trash: Path) -> None:
    """Take a folder out of its place in one step, then remove it."""
    if not folder.exists():
        return
    trash.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(prefix="gone-", dir=trash))
    with suppress(FileNotFoundError):
        folder.rename(aside / "it")
    shutil.rmtree(aside, ignore_errors=True)
