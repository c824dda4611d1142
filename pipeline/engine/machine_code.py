"""Where compiled code is kept if the installation is read-only: with the study's cache, for this user alone.

Else each process of each run would compile for itself, a minute of work. Whoever can write machine code that another
loads can run anything as them, so in a cache that a lab shares everybody has a folder of their own.
"""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path

_PIPELINE = Path(__file__).parents[1]
_USERS_FOLDER = "NUMBA_CACHE_DIR"


def keep_machine_code_in(cache_root: Path) -> None:
    """Name the folder to Numba, in this process and those that it starts; must be called before Numba is imported.

    Nothing is done where the user has named one, where code can be kept beside the sources, and where the folder would
    be somebody else's.
    """
    if _USERS_FOLDER in os.environ or os.access(_PIPELINE, os.W_OK):
        return
    folder = cache_root / "compiled" / f"user-{os.getuid()}"
    with suppress(OSError):
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        if _is_mine_alone(folder):
            os.environ[_USERS_FOLDER] = str(folder)


def _is_mine_alone(folder: Path) -> bool:
    state = folder.lstat()
    others_may_write = state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not others_may_write
