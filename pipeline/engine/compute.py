"""Runs a stage's function and keeps the result in the cache; called in whatever process the executor chooses."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path

from pipeline.engine.cache import Cache, Entry, digest_of
from pipeline.engine.processes import Processes
from pipeline.engine.stage import Outcome, Stage, Work
from pipeline.errors import RUN_AGAIN, PipelineError, SessionError

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
    one session; such an outcome is kept under a key of its own, so that the next run tries again. Raises PipelineError
    where the cache cannot be written.
    """
    cache = Cache(cache_root)
    try:
        with cache.new(stage.name) as out:
            try:
                outcome = _run(stage, replace(work, out=out))
            except SessionError as error:
                outcome = Outcome(set_aside=str(error))
            except PipelineError:
                raise
            except Exception as error:
                if stage.scope != "session" or _cannot_write(error):
                    raise
                return keep_unusable(cache, stage, key, _internal_error(stage, error))
            return cache.keep(stage.name, key, out, asdict(outcome))
    except OSError as error:
        if not _cannot_write(error):
            raise
        raise PipelineError(
            f"{cache_root}: cannot be written: {os.strerror(error.errno or 0)}; free some space (perhaps with"
            f" `steadyhand cache prune`) or choose another folder with --cache. {RUN_AGAIN}"
        ) from None


def _run(stage: Stage, work: Work) -> Outcome:
    module, name = stage.function.split(":")
    outcome: Outcome = getattr(import_module(module), name)(work)
    return outcome


def _internal_error(stage: Stage, error: Exception) -> str:
    return f'internal error in stage "{stage.name}"; please report it: {type(error).__name__}: {error}'


def keep_unusable(cache: Cache, stage: Stage, key: str, reason: str) -> Entry:
    """Keep the reason why a session cannot be used, under a key of its own, so that the next run tries again."""
    with cache.new(stage.name) as out:
        return cache.keep(stage.name, digest_of([key, reason]), out, asdict(Outcome(set_aside=reason)))


def _cannot_write(error: Exception) -> bool:
    """Whether the disk is full or read-only; then no session is at fault, and the run cannot go on."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
