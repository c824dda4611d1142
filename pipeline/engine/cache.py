"""The content-addressed cache of everything that is computed.

Theory of operation
===================

An entry is a folder of tables that a stage computed. Its name, the key, is the SHA-256 of everything that may change
what is in it (pipeline.engine.keys): the code of the stage, the settings it declared, the study's files it reads, and
the entries of earlier stages. So "is this up to date?" is "is there a folder of this name?". Nothing is ever
overwritten, nothing ever expires, and any number of studies, versions and runs may share one cache.

    .steadyhand-cache/
    ├── lock                    held while an entry is put in place or removed
    ├── inputs/
    │   └── 51d0….json          digests of the files of one study (pipeline.engine.input_digests)
    ├── new/
    │   ├── fuse-k2x9a7/        a run is writing this, or was killed while it did
    │   └── gone-7dz1p0/        an entry being removed
    └── fuse/
        └── 3f/                 the first two digits, so that no folder gets too long
            └── 3f9c…/          an entry: all 64 digits of its key
                ├── entry.json      size and SHA-256 of each file, the stage's outcome, the digest of both
                └── tracks.parquet

Keys and digests. A key contains the `digest` of each earlier entry, which depends on its content alone, and not its
key. So where an edit changes the key of an early stage but its tables come out the same, all later stages are still
found in the cache.

Whole or not at all. A stage writes into a folder of its own below `new`, and `keep` renames that folder to its place. A
rename within one file system is atomic: no reader ever sees half an entry, even if a run is killed. An entry is removed
in the same way: it is renamed to a place below `new` first. What a killed run leaves below `new` does no harm; `prune`
removes it after a day.

A power cut. Nothing is flushed to the disk before it gets its name: that would take seven times as long as the rest,
for ten thousand sessions a quarter of an hour. What a power cut leaves is noticed as decay is: a file that is too short
by its size, one with other bytes by the digest or, of a table, by the checksums of its pages. The entry is then
computed again.

A cache that several people use. Folders and files get the mode that umask and parent imply. Whoever can write to a
cache can put tables of their own making into it, and whoever reads it trusts them.

The lock. Two runs may compute the same entry. Each writes its own folder; the second finds that the entry exists and
removes its own folder, since the contents are the same. The lock only keeps one run from removing a damaged entry when
another has just replaced it. Readers take no lock.

What `get` trusts. Reading every table to compare digests would take longer than many runs. So `keep` sets the time of
each file to an even second in the past (`_seal`), and `get` considers a table unchanged as long as it has that time and
its size. Whatever writes to the file sets another time, even within one tick of the coarsest clock. A table with
another time (after a copy of the cache, say) is read and compared. So is every other file, such as results.json, and
entry.json is checked against its own digest. `damage` and `verify` read everything.

Decay. Bad sectors of a disk, and writes that were lost in a power cut, change a file and not its time. Tables have
checksums of their own (pipeline.tables.table), which are compared whenever a table is read. Where a stage finds one
wrong, `distrust` sets another time and the run begins again: `get` then reads the whole entry.

A damaged entry is treated as missing: it is computed again, and the user is told.

What must stay true. (1) A key covers everything that may change the entry. Otherwise stale results are taken for
current ones, and the cache cannot notice it. For files that change while they are read, see input_files. (2) A function
that fills a folder writes there only. (3) Files below an entry are never written to. (4) `new` is on the same file
system as the entries.

What may change. Anything about `new`, the lock and `inputs`. A change to what entry.json holds needs another LAYOUT,
which is in every key: entries of the former layout are then never looked for, and `verify` removes them. Where Outcome
gets another field, keys change by themselves, since every stage imports it.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import secrets
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

LAYOUT = 2
"""The version of what entry.json holds; it is part of every key."""
_MANIFEST = "entry.json"
_TABLE = ".parquet"
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
    """A folder of tables, what its stage reported beside them (stage.Outcome), and the digest of both."""

    folder: Path
    outcome: Mapping[str, Any]
    digest: str


class Cache:
    """Entries below one folder, by stage and key. `read_digest` computes a file's digest; tests count its calls."""

    def __init__(self, root: Path, read_digest: Callable[[Path], str] = file_digest) -> None:
        self.root = root
        self._read_digest = read_digest

    @property
    def inputs(self) -> Path:
        """Where the digests of the studies' own files are remembered."""
        return self.root / "inputs"

    def _folder(self, stage: str, key: str) -> Path:
        return self.root / stage / key[:2] / key

    def get(self, stage: str, key: str) -> Entry | None:
        """The entry; None where there is none, or where a file of it is missing or has changed.

        A table that still has the time and size it was kept with is not read.
        """
        folder = self._folder(stage, key)
        try:
            entry = _read(folder, self._read_digest, trust_times=True)
        except _DamagedError:
            return None
        with suppress(OSError):  # the time of the manifest is when the entry was last used, for `prune`
            os.utime(folder / _MANIFEST)
        return entry

    def damage(self, stage: str, key: str) -> str | None:
        """What is wrong with an existing entry, by reading all of it; None if it is whole or does not exist."""
        return damage_in(self._folder(stage, key))

    def entries(self) -> Iterator[Path]:
        """The folders of all entries, whole or damaged: stage/xx/key."""
        for folder in sorted(self.root.glob(f"*/??/{'?' * _KEY_LENGTH}")):
            if folder.is_dir():
                yield folder

    def remnants(self) -> Iterator[Path]:
        """The folders that runs are writing now, and those that killed runs left."""
        with suppress(FileNotFoundError):
            yield from sorted((self.root / _NEW).iterdir())

    def remove(self, folder: Path) -> None:
        """Remove an entry or a remnant. An entry disappears at once, not file by file."""
        with self._locked():
            _discard(folder, self.root / _NEW)

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Keep other runs from putting entries in place or removing them."""
        self.root.mkdir(parents=True, exist_ok=True)
        with _open_lock(self.root / "lock") as file:
            with suppress(OSError):  # some network file systems have no locks; renames are still atomic
                fcntl.flock(file, fcntl.LOCK_EX)
            yield

    @contextmanager
    def new(self, stage: str) -> Iterator[Path]:
        """An empty folder for a stage to fill; it is removed afterwards unless `keep` has taken it into the cache."""
        (self.root / _NEW).mkdir(parents=True, exist_ok=True)
        folder = _fresh_folder(self.root / _NEW, f"{stage}-")
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def keep(self, stage: str, key: str, folder: Path, outcome: Mapping[str, Any]) -> Entry:
        """Take a filled folder into the cache under its key."""
        files = {
            path.relative_to(folder).as_posix(): {"size": path.stat().st_size, "sha256": file_digest(path)}
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
        digest = digest_of([files, dict(outcome)])  # without the time below: the same content has the same digest
        sealed_ns = _seal(folder, files)
        manifest = {
            "layout": LAYOUT,
            "stage": stage,
            "key": key,
            "files": files,
            "outcome": dict(outcome),
            "digest": digest,
            "sealed_ns": sealed_ns,
        }
        (folder / _MANIFEST).write_text(json.dumps(manifest, indent=1), encoding="utf-8")
        final = self._folder(stage, key)
        final.parent.mkdir(parents=True, exist_ok=True)
        with self._locked():
            existing = self.get(stage, key)
            if existing is not None:
                return existing  # another run was first
            _discard(final, self.root / _NEW)
            folder.rename(final)
        return Entry(final, dict(outcome), digest)


def _fresh_folder(parent: Path, prefix: str) -> Path:
    """A new folder with the mode that umask and parent imply; one of `mkdtemp` is its owner's alone.

    An entry keeps the mode of the folder that it was written in, and a lab may share its cache.
    """
    while True:
        folder = parent / f"{prefix}{secrets.token_hex(4)}"
        with suppress(FileExistsError):
            folder.mkdir()
            return folder


def _open_lock(path: Path) -> IO[str]:
    """The lock's file; another user's, that may only be read, can be locked too."""
    try:
        return path.open("a", encoding="utf-8")
    except PermissionError:
        return path.open(encoding="utf-8")


def _seal(folder: Path, files: Iterable[str]) -> int:
    """Set the files' modification times to at least two seconds ago, in ns since 1970; any later write changes them.

    The time is an even number of seconds, because FAT stores times in steps of two seconds.
    """
    sealed_ns = (int(time.time()) // _CLOCK_S - 1) * _CLOCK_S * 1_000_000_000
    for name in files:
        os.utime(folder / name, ns=(sealed_ns, sealed_ns))
    return sealed_ns


class _DamagedError(Exception):
    """Raised with the reason why a folder is not a whole entry."""


def distrust(folder: Path) -> None:
    """Have `get` read all of an entry the next time it is asked for it, since one of its tables cannot be right."""
    for path in folder.rglob(f"*{_TABLE}"):
        with suppress(OSError):
            os.utime(path)


def last_used_s(folder: Path) -> float:
    """When an entry was last used, in seconds since 1970; for a remnant, when it was last changed."""
    manifest = folder / _MANIFEST
    return (manifest if manifest.is_file() else folder).stat().st_mtime


def damage_in(folder: Path) -> str | None:
    """What is wrong with the entry in a folder, by reading all of it; None if it is whole or does not exist."""
    if not folder.is_dir():
        return None
    try:
        _read(folder, file_digest, trust_times=False)
    except _DamagedError as damage:
        return str(damage)
    return None


def _read(folder: Path, read_digest: Callable[[Path], str], trust_times: bool) -> Entry:
    """The entry in a folder; raises _DamagedError where a file is not what was written.

    With `trust_times`, a table that still has the time it was sealed with counts as unchanged and is not read.
    """
    try:
        manifest = json.loads((folder / _MANIFEST).read_text(encoding="utf-8"))
        if manifest.get("layout") != LAYOUT:
            raise _DamagedError(f"{_MANIFEST} is of another version of Steadyhand")
        files, outcome, digest = manifest["files"], manifest["outcome"], manifest["digest"]
        if digest_of([files, outcome]) != digest or manifest["key"] != folder.name:
            raise _DamagedError(f"{_MANIFEST} has changed since it was written")
        for name, written in files.items():
            path = folder / name
            now = path.stat()
            untouched = trust_times and name.endswith(_TABLE) and now.st_mtime_ns == manifest["sealed_ns"]
            if now.st_size != written["size"] or not (untouched or read_digest(path) == written["sha256"]):
                raise _DamagedError(f"{name} has changed since it was written")
    except FileNotFoundError as error:
        raise _DamagedError(f"{Path(error.filename).name} is missing") from None
    except OSError as error:
        raise _DamagedError(f"{Path(error.filename or folder).name} cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise _DamagedError(f"{_MANIFEST} cannot be read") from None
    return Entry(folder, outcome, digest)


def _discard(folder: Path, trash: Path) -> None:
    """Remove a folder: rename it away in one step first, so that nobody sees it half removed."""
    if not folder.exists():
        return
    trash.mkdir(parents=True, exist_ok=True)
    aside = _fresh_folder(trash, "gone-")
    with suppress(FileNotFoundError):
        folder.rename(aside / "it")
    shutil.rmtree(aside, ignore_errors=True)
