"""The entries of pieces of work: from the cache, or computed by an executor where the cache has none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any

from pipeline.engine.cache import Cache, Entry
from pipeline.engine.compute import (
    Piece,
    compute,
    compute_all,
    compute_with_helpers,
    compute_with_own_helpers,
    keep_unusable,
)
from pipeline.engine.processes import InThisProcess, Processes, call_in_own_process
from pipeline.engine.resources import Resources
from pipeline.engine.result import Damaged, Result
from pipeline.engine.stage import Stage, Work
from pipeline.errors import RUN_AGAIN, DamagedTableError, PipelineError, WorkerLostError

_AHEAD = 256  # groups handed to the executor ahead of time: more than a cluster has processes, so that none waits
_LARGEST_GROUP = 8  # pieces of one session computed together, so that its recording is loaded once


def entries_of(stage: Stage, result: Result, pieces: Iterable[Piece], resources: Resources) -> list[Entry]:
    """The entry of each piece of work, in their order; each key that the cache has no entry for is computed once.

    `pieces` is consumed one by one, and only pieces that must be computed are kept in memory.
    """
    entries: dict[str, Entry] = {}
    missing: dict[str, Piece] = {}
    keys = []
    for work, key in pieces:
        keys.append(key)
        if key in entries or key in missing:
            continue
        entry = _look_up(stage, key, work.session.id, result, resources.cache)
        if entry is None:
            missing[key] = work, key
        else:
            entries[key] = entry
    result.computed[stage.name] = result.computed.get(stage.name, 0) + len(missing)
    if missing:
        resources.cache.root.mkdir(parents=True, exist_ok=True)  # a worker on another machine checks that it exists
        resources.progress.begin(stage.label or stage.name, len(missing), stage.unit)
        for key, entry in _computed(stage, list(missing.values()), resources):
            entries[key] = entry
            resources.progress.advance()
        resources.progress.end()
    return [entries[key] for key in keys]


def entry_of_study(stage: Stage, result: Result, work: Work, key: str, resources: Resources) -> Entry:
    """The entry of a stage of scope "study", computed where the cache has none."""
    entry = _look_up(stage, key, "", result, resources.cache)
    result.computed[stage.name] = result.computed.get(stage.name, 0) + int(entry is None)
    if entry is None:
        resources.progress.begin(stage.label or stage.name, 1)
        entry = _compute_study(stage, work, key, resources)
        resources.progress.advance()
        resources.progress.end()
    return entry


def _compute_study(stage: Stage, work: Work, key: str, resources: Resources) -> Entry:
    """Compute in this process, with the run's executor for the stage's small jobs; an archive in a separate process.

    Joining the tables of an archive takes memory that Python hardly returns to the system; when a process ends, it
    returns all of it.
    """
    cache_root, executor = resources.cache.root, resources.executor
    apart = len(work.sessions) >= resources.archive_sessions and not isinstance(executor, InThisProcess)
    if not isinstance(executor, Processes):
        # Also with Dask a stage does its jobs itself. They write files into a folder of the cache; what a worker on
        # another machine writes there may be seen here late, and sending it tables costs more than drawing them.
        return (
            _compute_in_own_process(compute, stage, work, key, cache_root)
            if apart
            else compute(stage, work, key, cache_root)
        )
    if not apart:
        return compute_with_helpers(stage, work, key, cache_root, executor)
    # The separate process cannot use the processes of this run, so it starts its own. Those of the run end before that,
    # so that no more processes run at once than the user allowed.
    executor.end_idle()
    return _compute_in_own_process(compute_with_own_helpers, stage, work, key, cache_root, executor.count)


def _compute_in_own_process(function: Callable[..., Entry], stage: Stage, *arguments: Any) -> Entry:
    try:
        entry: Entry = call_in_own_process(function, stage, *arguments)
    except WorkerLostError as error:
        raise PipelineError(
            f'the process computing stage "{stage.name}" died ({error}), possibly out of memory. {RUN_AGAIN}'
        ) from None
    return entry


def _look_up(stage: Stage, key: str, session: str, result: Result, cache: Cache) -> Entry | None:
    """The cache's entry; None if there is none. A damaged one is noted in `result` and treated as missing."""
    entry = cache.get(stage.name, key)
    if entry is None:
        damage = cache.damage(stage.name, key)
        if damage is not None:
            result.damaged.append(Damaged(stage.name, session, damage))
    return entry


def _computed(stage: Stage, missing: Sequence[Piece], resources: Resources) -> Iterator[tuple[str, Entry]]:
    """Keys and entries, in the order in which they are finished.

    A piece whose process died is tried once more after the others, by itself: another piece of its group may have
    killed the process, or the machine may have been short of memory at that moment. If the process dies again, the
    session is set aside, and tried again in the next run. DamagedTableError is raised after all else is computed:
    one more attempt then finds all damaged entries.
    """
    lost: list[Piece] = []
    damaged: DamagedTableError | None = None
    waiting: dict[Future[list[Entry]], list[Piece]] = {}
    try:
        for done in _as_completed(stage, _groups(missing, resources.fewest_groups), resources, waiting):
            try:
                for (_, key), entry in zip(waiting[done], done.result(), strict=True):
                    yield key, _require_visible(entry)
            except WorkerLostError:
                lost += waiting[done]
            except DamagedTableError as error:
                damaged = error
    finally:
        for future in waiting:
            future.cancel()
    for work, key in lost:
        yield key, _require_visible(_retry(stage, work, key, resources))
    if damaged is not None:
        raise damaged


def _retry(stage: Stage, work: Work, key: str, resources: Resources) -> Entry:
    kept = resources.cache.get(stage.name, key)  # its process may have died after this piece was finished
    if kept is not None:
        return kept
    try:
        entry: Entry = resources.executor.submit(compute, stage, work, key, resources.cache.root).result()
    except WorkerLostError as error:
        reason = f'the process computing stage "{stage.name}" died twice ({error}), possibly out of memory'
        return keep_unusable(resources.cache, stage, key, reason)
    return entry


def _groups(missing: Sequence[Piece], fewest: int) -> Iterator[list[Piece]]:
    """Pieces to be computed together: a few of one session, as far as that leaves `fewest` groups to share out."""
    size = min(max(len(missing) // fewest, 1), _LARGEST_GROUP)
    group: list[Piece] = []
    for piece in missing:
        if group and (len(group) == size or piece[0].session.id != group[0][0].session.id):
            yield group
            group = []
        group.append(piece)
    yield group


def _as_completed(
    stage: Stage, groups: Iterable[list[Piece]], resources: Resources, waiting: dict[Future[list[Entry]], list[Piece]]
) -> Iterator[Future[list[Entry]]]:
    """Submit all groups, some at a time; yield futures as they finish. A future is in `waiting` until it was taken.

    Nothing is kept of a finished future: with ten thousand sessions, they would use most of this process's memory.
    """
    for group in groups:
        future = resources.executor.submit(compute_all, stage, group, resources.cache.root)
        waiting[future] = group
        if len(waiting) >= _AHEAD or future.done():
            yield from _done(waiting)
    while waiting:
        yield from _done(waiting)


def _done(waiting: dict[Future[list[Entry]], list[Piece]]) -> Iterator[Future[list[Entry]]]:
    """Wait for at least one future to finish; yield those that have, and remove each from `waiting` afterwards."""
    for future in wait(waiting, return_when=FIRST_COMPLETED).done:
        yield future
        waiting.pop(future)


def _require_visible(entry: Entry) -> Entry:
    """The entry; PipelineError if its folder cannot be seen here, because another machine has computed it."""
    if not entry.folder.is_dir():
        raise PipelineError(
            f"{entry.folder}: a worker computed this, but it cannot be seen here; put --cache on a file system that all"
            " workers share"
        )
    return entry
