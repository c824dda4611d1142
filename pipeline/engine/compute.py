"""Runs a stage's function and keeps the result in the cache; called in whatever process the executor chooses."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import TypeGuard

from pipeline.engine.cache import Cache, Entry, digest_of, distrust
from pipeline.engine.input_files import CHANGED, InputChangedError, InputFiles
from pipeline.engine.processes import Processes
from pipeline.engine.stage import Outcome, Stage, Work
from pipeline.errors import RUN_AGAIN, DamagedTableError, PipelineError, SessionError

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What a full disk answers, and one on which the user may have no more."""
Piece = tuple[Work, str]
"""A piece of work, and the key of its result."""


def compute_all(stage: Stage, pieces: Sequence[Piece], cache_root: Path) -> list[Entry]:
    """Compute several pieces of work one after the other, in one process."""
    return [compute(stage, work, key, cache_root) for work, key in pieces]


def compute_with_helpers(stage: Stage, work: Work, key: str, cache_root: Path, processes: Processes) -> Entry:
    """Compute a piece of work in this process, with all but one of the processes for its jobs: this one works too."""
    with processes.all_but_one() as executor:
        return compute(stage, replace(work, executor=executor), key, cache_root)


def compute_with_own_helpers(stage: Stage, work: Work, key: str, cache_root: Path, count: int) -> Entry:
    """The same, with `count` processes that are started for this piece of work alone."""
    with Processes(count) as processes:
        return compute_with_helpers(stage, work, key, cache_root, processes)


def compute(stage: Stage, work: Work, key: str, cache_root: Path) -> Entry:
    """Run a stage's function and keep its result in the cache.

    A session that cannot be used is an outcome, not an error, so the other sessions go on. So is an internal error in
    one session, and a log that changed while it was read; such an outcome is kept under a key of its own, so that the
    next run tries again. Raises PipelineError where the cache cannot be written, InputChangedError where a stage of the
    whole study read a file that changed, and DamagedTableError where an entry that it read is damaged.
    """
    cache, files = Cache(cache_root), InputFiles(stage, work)
    try:
        with cache.new(stage.name) as out:
            outcome, error = _outcome(stage, replace(work, out=out))
            changed = files.changed()  # before the error, which half a file may have caused
            if changed is not None and stage.scope == "session":
                return keep_unusable(cache, stage, key, CHANGED)
            if changed is not None:
                raise InputChangedError(f"{changed}: {CHANGED}")
            if isinstance(error, DamagedTableError):
                distrust(error.path.parent)
            if error is None:
                return cache.keep(stage.name, key, out, asdict(outcome))
            if isinstance(error, PipelineError) or stage.scope != "session" or _cannot_write(error, work):
                raise error
            reason = _unreadable(error) if _is_of_a_log(error, work) else _internal_error(stage, error)
            for folder in (work.folder, cache_root):  # the reason is part of the results, which name no folder
                reason = reason.replace(f"{folder}/", "")
            return keep_unusable(cache, stage, key, _under(work, reason))
    except OSError as error:
        if not _cannot_write(error, work):
            raise
        space = "free some space (perhaps with `steadyhand cache prune`) or " if error.errno in _FULL else ""
        raise PipelineError(
            f"{cache_root}: cannot be written: {os.strerror(error.errno or 0)}; {space}choose another folder with"
            f" --cache. {RUN_AGAIN}"
        ) from None


def _outcome(stage: Stage, work: Work) -> tuple[Outcome, Exception | None]:
    """What the stage's function reports, or the error that it raised."""
    import pandas as pd

    module, name = stage.function.split(":")
    try:
        # The names of columns are text too: Arrow's, which pandas would choose, takes a fifth of a small study's time.
        with pd.option_context("mode.string_storage", "python"):
            outcome: Outcome = getattr(import_module(module), name)(work)
        return replace(outcome, in_part=outcome.in_part and _under(work, outcome.in_part)), None
    except SessionError as error:
        return Outcome(set_aside=_under(work, str(error), error.people)), None
    except Exception as error:  # noqa: BLE001 - raised by the caller
        return Outcome(), error


def _under(work: Work, text: str, people: Sequence[str] = ()) -> str:
    """A text under the study's pseudonyms, where it has any."""
    return text if work.pseudonyms is None else work.pseudonyms.in_text(text, people)


def _internal_error(stage: Stage, error: Exception) -> str:
    return f'internal error in stage "{stage.name}"; please report it: {type(error).__name__}: {error}'


def keep_unusable(cache: Cache, stage: Stage, key: str, reason: str) -> Entry:
    """Keep the reason why a session cannot be used, under a key of its own, so that the next run tries again."""
    with cache.new(stage.name) as out:
        return cache.keep(stage.name, digest_of([key, reason]), out, asdict(Outcome(set_aside=reason)))


def _cannot_write(error: Exception, work: Work) -> TypeGuard[OSError]:
    """Whether the disk is full or read-only, or fails; then no session is at fault, and the run cannot go on."""
    if not isinstance(error, OSError) or _is_of_a_log(error, work):
        return False
    return error.errno in (*_FULL, errno.EROFS, errno.EIO)


def _is_of_a_log(error: Exception, work: Work) -> TypeGuard[OSError]:
    """Whether a file of the study's logs cannot be read."""
    if not isinstance(error, OSError) or not isinstance(error.filename, str | bytes):
        return False
    return any(Path(os.fsdecode(error.filename)) in session.files for session in work.sessions)


def _unreadable(error: OSError) -> str:
    return f"cannot be read: {error.strerror}"
