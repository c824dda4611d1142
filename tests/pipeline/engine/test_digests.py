"""Files are read again when the file system says that they changed, and only then."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import pytest

from pipeline.engine.cache import Cache, damage_in, file_digest
from pipeline.engine.input_digests import file_digests

LONG_AGO_NS = 1_000_000_000_000_000_000


class Reading:
    """Digests of a study's two logs, asked for as a run does some seconds after now; `read` names what it read."""

    def __init__(self, root: Path) -> None:
        self.study, self.memory = root / "study", root / "inputs"
        self.seconds_from_now = 10.0
        self.read: list[str] = []
        self.study.mkdir()
        for name in ("a", "b"):
            (self.study / name).write_text(f"log {name}")

    def read_digest(self, path: Path) -> str:
        self.read.append(path.name)
        return file_digest(path)

    def __call__(self) -> dict[str, str]:
        def now_ns() -> int:
            return time.time_ns() + round(self.seconds_from_now * 1e9)

        files = {name: self.study / name for name in ("a", "b")}
        return file_digests(files, self.study, self.memory, self.read_digest, now_ns)


@pytest.fixture
def reading(tmp_path: Path) -> Reading:
    return Reading(tmp_path)


def test_unchanged_files_are_read_once(reading: Reading) -> None:
    first = reading()
    assert reading.read == ["a", "b"]
    assert reading() == first
    assert reading.read == ["a", "b"]


def test_a_file_that_changed_just_now_is_read_again(reading: Reading) -> None:
    reading.seconds_from_now = 0
    reading()
    reading()
    assert reading.read == ["a", "b", "a", "b"]


def test_a_change_that_keeps_size_and_time_is_seen(reading: Reading) -> None:
    log = reading.study / "a"
    os.utime(log, ns=(LONG_AGO_NS, LONG_AGO_NS))
    before = reading()
    log.write_text("gol a")
    os.utime(log, ns=(LONG_AGO_NS, LONG_AGO_NS))
    after = reading()
    assert after["a"] == file_digest(log) != before["a"]
    assert reading.read == ["a", "b", "a"]


@pytest.mark.parametrize("harm", ["", "[]", "{", '{"sha256": "0", "files": {"a": [[1, 2, 3, 4], "0"]}}'])
def test_what_was_remembered_may_be_lost(reading: Reading, harm: str) -> None:
    before = reading()
    (kept,) = reading.memory.iterdir()
    kept.write_text(harm)
    assert reading() == before


def kept_entry(root: Path) -> Path:
    """The folder of an entry of one file."""
    cache = Cache(root)
    with cache.new("fuse") as out:
        (out / "tracks.parquet").write_bytes(b"whole")
        return cache.keep("fuse", "0" * 64, out, {}).folder


def test_a_hit_reads_only_files_that_were_touched(tmp_path: Path) -> None:
    read: list[str] = []

    def read_digest(path: Path) -> str:
        read.append(path.name)
        return file_digest(path)

    file, cache = kept_entry(tmp_path) / "tracks.parquet", Cache(tmp_path, read_digest)
    assert cache.get("fuse", "0" * 64) is not None
    assert read == []
    file.touch()
    assert cache.get("fuse", "0" * 64) is not None
    assert read == ["tracks.parquet"]
    file.write_bytes(b"wrong")  # of the same size, and at once
    assert cache.get("fuse", "0" * 64) is None


def test_decay_that_no_time_tells_of_is_found_by_verify(tmp_path: Path) -> None:
    folder = kept_entry(tmp_path)
    file = folder / "tracks.parquet"
    sealed = file.stat()
    file.write_bytes(b"wrong")
    os.utime(file, ns=(sealed.st_atime_ns, sealed.st_mtime_ns))
    assert damage_in(folder) == "tracks.parquet has changed since it was written"


def test_a_write_in_the_same_instant_changes_the_time_a_file_was_sealed_with(tmp_path: Path) -> None:
    sealed_ns = (kept_entry(tmp_path) / "tracks.parquet").stat().st_mtime_ns
    assert sealed_ns % 2_000_000_000 == 0  # any file system's clock can tell it
    assert sealed_ns <= time.time_ns() - 2_000_000_000


def test_an_entry_of_another_version_is_neither_used_nor_taken_for_decay(tmp_path: Path) -> None:
    folder = kept_entry(tmp_path)
    manifest = folder / "entry.json"
    manifest.write_text(json.dumps({**json.loads(manifest.read_text()), "layout": 1}))
    assert Cache(tmp_path).get("fuse", "0" * 64) is None
    assert damage_in(folder) == "entry.json is of another version of Steadyhand"
