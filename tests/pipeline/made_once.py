"""What many tests read and none changes: made by whichever worker asks first, and read by all."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Iterator[Path]:
    """A folder that `make` fills; the body of a session's fixture. Fails at the end if a test has changed a file.

    Workers of one run share the folder above their own; whoever comes while it is being filled waits.
    """
    base = factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, whole = shared / name, shared / f"{name}.json"
    with (shared / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not whole.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            make(folder)
            whole.write_text(json.dumps(_files(folder)))
    yield folder
    assert _files(folder) == json.loads(whole.read_text()), f"a test changed {folder}, which others read"


def _files(folder: Path) -> dict[str, list[int]]:
    """Size and time of the last change of every file."""
    found = {path.relative_to(folder).as_posix(): path.stat() for path in sorted(folder.rglob("*")) if path.is_file()}
    return {name: [stat.st_size, stat.st_mtime_ns] for name, stat in found.items()}
