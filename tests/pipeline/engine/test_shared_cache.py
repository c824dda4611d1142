"""A cache that two people of a lab use: their files' modes, and what the one can do with the other's entries."""

from __future__ import annotations

import os
import stat
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from pipeline.engine.cache import Cache

KEY = "ab" + 62 * "0"
ALICE, BOB, LAB = 65_001, 65_002, 65_010  # nobody has them


@pytest.fixture
def umask() -> Iterator[Callable[[int], int]]:
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


def fill(root: Path, key: str = KEY, text: str = "a table") -> None:
    cache = Cache(root)
    with cache.new("fuse") as folder:
        (folder / "tables").mkdir()
        (folder / "tables" / "tracks.parquet").write_text(text, encoding="utf-8")
        cache.keep("fuse", key, folder, {})


def modes(root: Path) -> dict[str, int]:
    return {path.relative_to(root).as_posix(): stat.S_IMODE(path.stat().st_mode) for path in root.rglob("*")}


@pytest.mark.parametrize(
    ("mask", "of_folders", "of_files"), [(0o022, 0o755, 0o644), (0o002, 0o775, 0o664), (0o077, 0o700, 0o600)]
)
def test_modes_are_those_that_the_umask_implies(
    tmp_path: Path, umask: Callable[[int], int], mask: int, of_folders: int, of_files: int
) -> None:
    umask(mask)
    fill(tmp_path / "cache")
    for name, mode in modes(tmp_path / "cache").items():
        assert mode == (of_files if (tmp_path / "cache" / name).is_file() else of_folders), name


def test_a_folder_of_a_group_hands_its_group_on(tmp_path: Path, umask: Callable[[int], int]) -> None:
    umask(0o002)
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache").chmod(0o2775)
    fill(tmp_path / "cache")
    for path in (tmp_path / "cache").rglob("*"):
        assert path.is_file() or path.stat().st_mode & stat.S_ISGID, path


def as_user(user: int, do: Callable[[], None]) -> bool:
    """Do something as another user of the group LAB, in a process of its own; whether it came to its end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of a fork beside threads, which the child does not use
        child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setgid(LAB)
            os.setuid(user)
            os.umask(0o002)
            do()
        except BaseException:  # noqa: BLE001 - the child must end here
            traceback.print_exc(file=sys.stderr)
            os._exit(1)
        os._exit(0)
    return os.waitpid(child, 0)[1] == 0


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become two other users")
def test_two_users_use_each_others_entries(tmp_path: Path) -> None:
    for folder in (tmp_path, *tmp_path.parents):
        if folder.stat().st_uid == os.geteuid() and len(folder.parts) > 2:
            folder.chmod(folder.stat().st_mode | 0o011)  # the way to the cache
    root = tmp_path / "cache"
    root.mkdir()
    os.chown(root, ALICE, LAB)
    root.chmod(0o2770)
    other_key = "cd" + KEY[2:]
    assert as_user(ALICE, lambda: fill(root))

    def bob_reads_and_adds() -> None:
        entry = Cache(root).get("fuse", KEY)
        assert entry is not None
        assert (entry.folder / "tables" / "tracks.parquet").read_text(encoding="utf-8") == "a table"
        fill(root)  # the same entry once more
        fill(root, other_key, "another table")

    def alice_reads_and_removes() -> None:
        entry = Cache(root).get("fuse", other_key)
        assert entry is not None
        Cache(root).remove(entry.folder)
        assert Cache(root).get("fuse", other_key) is None

    assert as_user(BOB, bob_reads_and_adds)
    assert as_user(ALICE, alice_reads_and_removes)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become two other users")
def test_a_cache_that_may_only_be_read_is_read(tmp_path: Path) -> None:
    for folder in (tmp_path, *tmp_path.parents):
        if folder.stat().st_uid == os.geteuid() and len(folder.parts) > 2:
            folder.chmod(folder.stat().st_mode | 0o011)
    root = tmp_path / "cache"
    fill(root)

    def bob_reads() -> None:
        assert Cache(root).get("fuse", KEY) is not None

    assert as_user(BOB, bob_reads)
