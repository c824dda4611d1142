"""The entries of pieces of work: from the cache, or computed over an executor where it has none."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path

from pipeline.engine.cache import Cache, Entry
from pipeline.engine.compute import Piece, compute, compute_all, keep_unusable
from pipeline.engine.processes import InThisProcess, in_a_process_of_its_own
from pipeline.engine.resources import Means
from pipeline.engine.result import Result
from pipeline.engine.stage import Stage, Work
from pipeline.errors import PipelineError, WorkerLostError

_AHEAD = 256  # groups of pieces handed to the executor before they are needed: more than a cluster has processes
_TOGETHER = 8  # pieces of one session in a group, whose recording is then loaded once
_ARCHIVE = 1000  # sessions
_ENOUGH = 64  # groups to go round, before any is larger than one piece


def entries_of(stage: Stage, result: Result, works: Iterable[Piece], means: Means) -> list[Entry]:
    """The entry of each piece of work with its key, each key computed once, where the cache has none.

    Of the pieces only those that are to be computed are kept meanwhile.
    """
    found: dict[str, Entry] = {}
    missing: dict[str, Piece] = {}
    keys = []
    for work, key in works:
        keys.append(key)
        if key in found or key in missing:
            continue
        entry = _look_up(stage, key, work.session.id, result, means.cache)
        if entry is None:
            missing[key] = work, key
        else:
            found[key] = entry
    result.computed[stage.name] = len(missing)
    if missing:
        means.cache.root.mkdir(parents=True, exist_ok=True)  # a worker elsewhere looks whether it is there
        means.progress.begin(stage.name, len(missing))
        for key, entry in _computed(stage, list(missing.values()), means):
            found[key] = entry
            means.progress.advance()
        means.progress.end()
    return [found[key] for key in keys]


def entry_of_study(stage: Stage, result: Result, work: Work, key: str, means: Means) -> Entry:
    """The entry of a stage of scope "study", computed here where the cache has none.

    Of an archive in a process of its own: all its tables are joined then, and this process need not go on holding
    what that leaves.
    """
    entry = _look_up(stage, key, "", result, means.cache)
    result.computed[stage.name] = int(entry is None)
    if entry is None:
        means.progress.begin(stage.name, 1)
        if len(work.sessions) < _ARCHIVE or isinstance(means.executor, InThisProcess):
            entry = compute(stage, work, key, means.cache.root)
        else:
            entry = _apart(stage, work, key, means.cache.root)
        means.progress.advance()
        means.progress.end()
    return entry


def _apart(stage: Stage, work: Work, key: str, cache_root: Path) -> Entry:
    try:
        found: Entry = in_a_process_of_its_own(compute, stage, work, key, cache_root)
    except WorkerLostError as error:
        raise PipelineError(
            f"the process that computed {stage.name} died ({error}); its memory may not have sufficed; what was"
            " computed before is kept, run it again to go on"
        ) from None
    return found


def _look_up(stage: Stage, key: str, session: str, result: Result, cache: Cache) -> Entry | None:
    """What the cache has. That an entry is damaged is noted: it will be computed again."""
    entry = cache.get(stage.name, key)
    if entry is None:
        fault = cache.fault(stage.name, key)
        if fault is not None:
            result.damaged.append((stage.name, session, fault))
    return entry


def _computed(stage: Stage, missing: Sequence[Piece], means: Means) -> Iterator[tuple[str, Entry]]:
    """Entries by their keys, as they are done.

    A piece whose worker died is tried once more after the others, by itself: it may have been another's doing, or the
    machine's. If it is lost again, its session is set aside, and tried again in the next run.
    """
    lost: list[Piece] = []
    waiting: dict[Future[list[Entry]], list[Piece]] = {}
    try:
        for done in _as_completed(stage, _groups(missing), means, waiting):
            try:
                for (_, key), entry in zip(waiting[done], done.result(), strict=True):
                    yield key, _at_hand(entry)
            except WorkerLostError:
                lost += waiting[done]
    finally:
        for future in waiting:
            future.cancel()
    for work, key in lost:
        found = means.cache.get(stage.name, key)  # one of its group may have killed the worker after this was done
        try:
            entry = found or means.executor.submit(compute, stage, work, key, means.cache.root).result()
        except WorkerLostError as error:
            reason = f"the process that computed {stage.name} died twice ({error}); its memory may not have sufficed"
            entry = keep_unusable(means.cache, stage, key, reason)
        yield key, _at_hand(entry)


def _groups(missing: Sequence[Piece]) -> Iterator[list[Piece]]:
    """What is computed in one go: a few pieces of one session, once there are many."""
    size = min(max(len(missing) // _ENOUGH, 1), _TOGETHER)
    group: list[Piece] = []
    for piece in missing:
        if group and (len(group) == size or piece[0].session.id != group[0][0].session.id):
            yield group
            group = []
        group.append(piece)
    yield group


def _as_completed(
    stage: Stage, groups: Iterable[list[Piece]], means: Means, waiting: dict[Future[list[Entry]], list[Piece]]
) -> Iterator[Future[list[Entry]]]:
    """Submit all, some at a time, each in `waiting` until it is taken; futures as they are done.

    Of a future that is done nothing is kept: of ten thousand sessions they would be most of what this process holds.
    """
    for group in groups:
        future = means.executor.submit(compute_all, stage, group, means.cache.root)
        waiting[future] = group
        if len(waiting) >= _AHEAD or future.done():
            yield from _done(waiting)
    while waiting:
        yield from _done(waiting)


def _done(waiting: dict[Future[list[Entry]], list[Piece]]) -> Iterator[Future[list[Entry]]]:
    """Those that are done, at least one; each is out of `waiting` once it has been taken."""
    for future in wait(waiting, return_when=FIRST_COMPLETED).done:
        yield future
        waiting.pop(future)


def _at_hand(entry: Entry) -> Entry:
    """An entry that another machine may have computed."""
    if not entry.folder.is_dir():
        raise PipelineError(
            f"{entry.folder}: was computed by a worker and is not here; put --cache on a file system that all share"
        )
    return entry
