"""Files are read again when the file system says that they changed, and only then."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.engine import input_digests as digests
from pipeline.engine.cache import Cache, fault_of, file_digest

LONG_AGO_NS = 1_000_000_000_000_000_000


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the files that were read."""
    names: list[str] = []

    def watched(path: Path) -> str:
        names.append(path.name)
        return file_digest(path)

    monkeypatch.setattr(digests, "file_digest", watched)
    monkeypatch.setattr("pipeline.engine.cache.file_digest", watched)
    return names


@pytest.fixture
def asked(tmp_path: Path) -> Callable[[], dict[str, str]]:
    """Digests of two logs, asked for as a run does."""
    root = tmp_path / "study"
    root.mkdir()
    for name in ("a", "b"):
        (root / name).write_text(f"log {name}")
    return lambda: digests.remembered({name: root / name for name in ("a", "b")}, root, tmp_path / "inputs")


def later(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """The clock goes on."""
    now_ns = time.time_ns() + round(seconds * 1e9)
    monkeypatch.setattr(time, "time_ns", lambda: now_ns)


def test_unchanged_files_are_read_once(
    asked: Callable[[], dict[str, str]], read: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    later(monkeypatch, 10)
    first = asked()
    assert read == ["a", "b"]
    assert asked() == first
    assert read == ["a", "b"]


def test_a_file_that_changed_just_now_is_read_again(asked: Callable[[], dict[str, str]], read: list[str]) -> None:
    asked()
    asked()
    assert read == ["a", "b", "a", "b"]


def test_a_change_that_keeps_size_and_time_is_seen(
    asked: Callable[[], dict[str, str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, read: list[str]
) -> None:
    log = tmp_path / "study" / "a"
    os.utime(log, ns=(LONG_AGO_NS, LONG_AGO_NS))
    later(monkeypatch, 10)
    before = asked()
    log.write_text("gol a")
    os.utime(log, ns=(LONG_AGO_NS, LONG_AGO_NS))
    after = asked()
    assert after["a"] == file_digest(log) != before["a"]
    assert read == ["a", "b", "a"]


@pytest.mark.parametrize("harm", ["", "[]", "{", '{"sha256": "0", "files": {"a": [[1, 2, 3, 4], "0"]}}'])
def test_what_was_remembered_may_be_lost(
    asked: Callable[[], dict[str, str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, harm: str
) -> None:
    later(monkeypatch, 10)
    before = asked()
    (kept,) = (tmp_path / "inputs").iterdir()
    kept.write_text(harm)
    assert asked() == before


def kept_entry(root: Path) -> Path:
    """The folder of an entry of one file."""
    cache = Cache(root)
    with cache.new("fuse") as out:
        (out / "tracks.parquet").write_bytes(b"whole")
        return cache.keep("fuse", "0" * 64, out, {}).folder


def test_a_hit_reads_only_files_that_were_touched(tmp_path: Path, read: list[str]) -> None:
    file, cache = kept_entry(tmp_path) / "tracks.parquet", Cache(tmp_path)
    read.clear()
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
    assert fault_of(folder) == "tracks.parquet is not what was written"


def test_a_write_in_the_same_instant_changes_the_time_a_file_was_sealed_with(tmp_path: Path) -> None:
    sealed_ns = (kept_entry(tmp_path) / "tracks.parquet").stat().st_mtime_ns
    assert sealed_ns % 2_000_000_000 == 0  # any file system's clock can tell it
    assert sealed_ns <= time.time_ns() - 2_000_000_000
