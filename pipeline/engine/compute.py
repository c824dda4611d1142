"""A stage's function run into the cache, in whatever process the executor has."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path

from pipeline.engine.cache import Cache, Entry, digest_of
from pipeline.engine.stage import Outcome, Stage, Work
from pipeline.errors import PipelineError, SessionError

Piece = tuple[Work, str]
"""A piece of work, and the key of its result."""


def compute_all(stage: Stage, pieces: Sequence[Piece], cache_root: Path) -> list[Entry]:
    """Several pieces of work one after the other, in one process."""
    return [compute(stage, work, key, cache_root) for work, key in pieces]


def compute(stage: Stage, work: Work, key: str, cache_root: Path) -> Entry:
    """Run a stage's function into the cache. Runs in whatever process the executor has.

    A session that cannot be used is an outcome, not an error: the others go on. So is a fault of ours that one
    session alone brings out; such an outcome is kept under a key of its own and tried again in the next run.
    """
    cache = Cache(cache_root)
    module, name = stage.function.split(":")
    try:
        with cache.new(stage.name) as out:
            try:
                outcome = getattr(import_module(module), name)(replace(work, out=out))
            except SessionError as error:
                outcome = Outcome(set_aside=str(error))
            except PipelineError:
                raise
            except Exception as error:
                if stage.scope != "session" or _is_full(error):
                    raise
                fault = f"{type(error).__name__}: {error}"
                reason = f"a fault of Steadyhand's own in {stage.name}, please report it: {fault}"
                return keep_unusable(cache, stage, key, reason)
            return cache.keep(stage.name, key, out, asdict(outcome))
    except OSError as error:
        if not _is_full(error):
            raise
        raise PipelineError(
            f"{cache_root}: cannot be written any more: {os.strerror(error.errno or 0)}; make room"
            " (`steadyhand cache prune` may) or name another place with --cache; what was computed is kept, run it"
            " again to go on"
        ) from None


def keep_unusable(cache: Cache, stage: Stage, key: str, reason: str) -> Entry:
    """That a session cannot be used, under a key of its own, so that the next run tries again."""
    with cache.new(stage.name) as out:
        return cache.keep(stage.name, digest_of([key, reason]), out, asdict(Outcome(set_aside=reason)))


def _is_full(error: Exception) -> bool:
    """A disk without room, or none to write to: no session's fault."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
