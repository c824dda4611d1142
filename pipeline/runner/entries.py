"""The entries of pieces of work: from the cache, or computed over an executor where it has none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait

from pipeline.cache import Cache, Entry
from pipeline.errors import PipelineError, WorkerLostError
from pipeline.runner.compute import compute, keep_unusable
from pipeline.runner.means import Means
from pipeline.runner.result import Result
from pipeline.stage import Stage, Work
from pipeline.study import Session

_Missing = tuple[Session, Work, str]  # with the key of the result
_AHEAD = 256  # pieces of work handed to the executor before they are needed: more than a cluster has processes


def entries_of(stage: Stage, result: Result, works: Sequence[tuple[Work, str]], means: Means) -> list[Entry]:
    """The entry of each piece of work with its key, each key computed once, where the cache has none."""
    found: dict[str, Entry] = {}
    missing: dict[str, _Missing] = {}
    for work, key in works:
        if key in found or key in missing:
            continue
        entry = _look_up(stage, key, work.session.id, result, means.cache)
        if entry is None:
            missing[key] = (work.session, work, key)
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
    return [found[key] for _, key in works]


def entry_of_study(stage: Stage, result: Result, work: Work, key: str, means: Means) -> Entry:
    """The entry of a stage of scope "study", computed in this process where the cache has none."""
    entry = _look_up(stage, key, "", result, means.cache)
    result.computed[stage.name] = int(entry is None)
    if entry is None:
        means.progress.begin(stage.name, 1)
        entry = compute(stage, work, key, means.cache.root)
        means.progress.advance()
        means.progress.end()
    return entry


def _look_up(stage: Stage, key: str, session: str, result: Result, cache: Cache) -> Entry | None:
    """What the cache has. That an entry is damaged is noted: it will be computed again."""
    entry = cache.get(stage.name, key)
    if entry is None:
        fault = cache.fault(stage.name, key)
        if fault is not None:
            result.damaged.append((stage.name, session, fault))
    return entry


def _computed(stage: Stage, missing: Sequence[_Missing], means: Means) -> Iterator[tuple[str, Entry]]:
    """Entries by their keys, as they are done.

    A session whose worker died is tried once more after the others, by itself: it may have been another's doing, or
    the machine's. If it is lost again, it is set aside, and tried again in the next run.
    """
    lost: list[_Missing] = []
    waiting: dict[Future[Entry], _Missing] = {}
    try:
        for done in _as_completed(stage, missing, means, waiting):
            try:
                yield waiting[done][2], _at_hand(done.result())
            except WorkerLostError:
                lost.append(waiting[done])
    finally:
        for future in waiting:
            future.cancel()
    for _, work, key in lost:
        try:
            entry = means.executor.submit(compute, stage, work, key, means.cache.root).result()
        except WorkerLostError as error:
            reason = f"the process that computed {stage.name} died twice ({error}); its memory may not have sufficed"
            entry = keep_unusable(means.cache, stage, key, reason)
        yield key, _at_hand(entry)


def _as_completed(
    stage: Stage, missing: Sequence[_Missing], means: Means, waiting: dict[Future[Entry], _Missing]
) -> Iterator[Future[Entry]]:
    """Submit all, some at a time, each in `waiting` until it is taken; futures as they are done.

    Of a future that is done nothing is kept: of ten thousand sessions they would be most of what this process holds.
    """
    for one in missing:
        future = means.executor.submit(compute, stage, *one[1:], means.cache.root)
        waiting[future] = one
        if len(waiting) >= _AHEAD or future.done():
            yield from _done(waiting)
    while waiting:
        yield from _done(waiting)


def _done(waiting: dict[Future[Entry], _Missing]) -> Iterator[Future[Entry]]:
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
