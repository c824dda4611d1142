"""Brings a study's tables up to date: which entries there are, which must be computed, and where."""

from __future__ import annotations

import errno
import json
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future, as_completed
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

from pipeline.cache import Cache, Entry, code_digest, digest_of
from pipeline.digests import remembered
from pipeline.errors import PipelineError, SessionError, WorkerLostError
from pipeline.stage import Outcome, Stage, Work
from pipeline.study import Session, Study, find_sessions, load_study


class Progress(Protocol):
    """Who is told how far things are."""

    def begin(self, stage: str, total: int) -> None:
        """A stage is about to compute so many pieces of work."""

    def advance(self) -> None:
        """One piece is done."""

    def end(self) -> None:
        """The stage is done."""


class InThisProcess(Executor):
    """An executor that computes when asked to."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute now."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - handed on by the future
            future.set_exception(error)
        return future


@dataclass
class Result:
    """A study brought up to date: what each stage gave, by session, and what happened to the sessions.

    `sessions` are those that went through every stage. The entry of a stage of scope "study" stands under an empty
    name. `damaged` has stage, session and fault of each entry that was kept but could not be used any more.
    """

    folder: Path
    study: Study
    sessions: list[Session] = field(default_factory=list)
    entries: dict[str, dict[str, Entry]] = field(default_factory=dict)
    computed: dict[str, int] = field(default_factory=dict)
    set_aside: list[tuple[Session, str]] = field(default_factory=list)
    in_part: list[tuple[Session, str]] = field(default_factory=list)
    unused: list[tuple[str, str]] = field(default_factory=list)
    damaged: list[tuple[str, str, str]] = field(default_factory=list)
    inputs: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def name(self) -> str:
        """The study's name: its folder's."""
        return self.folder.name

    @property
    def exit_code(self) -> int:
        """1 where some session was set aside or read in part."""
        return 1 if self.set_aside or self.in_part else 0

    def entry(self, stage: str) -> Path:
        """The folder of a stage of scope "study"."""
        return self.entries[stage][""].folder


@dataclass(frozen=True)
class Means:
    """Where results are kept, where they are computed, and who is told."""

    cache: Cache
    executor: Executor
    progress: Progress


def bring_up_to_date(folder: Path, stages: Sequence[Stage], means: Means) -> Result:
    """Run the stages over a study; what the cache holds is not computed again.

    Raises PipelineError where nothing can be done: a bad study, or no usable session and no tables.
    """
    began = time.monotonic()
    result, sessions = _before_the_stages(folder, means.cache)
    for stage in stages:
        try:
            if stage.scope == "session":
                result.entries[stage.name] = _run_sessions(stage, result, sessions, means)
                sessions = _still_usable(result, sessions, result.entries[stage.name])
                _require_something(folder, result, sessions)
            else:
                result.entries[stage.name] = {"": _run_study(stage, result, sessions, means)}
        except PipelineError as error:
            raise PipelineError(_with_context(folder, result, str(error))) from None
    result.sessions = sessions
    result.seconds = time.monotonic() - began
    return result


def over_settings(
    result: Result, stage: Stage, settings: Sequence[Study], sessions: Sequence[Session], means: Means
) -> list[list[Entry]]:
    """A stage's entry for each of several settings of a study, by session: a list a session, in the settings' order."""
    began = time.monotonic()
    of_settings = [(_seen(stage, study), replace(result, study=study)) for study in settings]
    works = [_work(seen, one, [session]) for session in sessions for seen, one in of_settings]
    entries = _entries(stage, result, works, means)
    result.seconds += time.monotonic() - began
    return [entries[at : at + len(settings)] for at in range(0, len(entries), len(settings))]


def _before_the_stages(folder: Path, cache: Cache) -> tuple[Result, list[Session]]:
    study = load_study(folder)
    found = find_sessions(folder, study)
    result = Result(folder.resolve(), study, set_aside=found.set_aside, unused=found.unused)
    result.inputs = _input_digests(result.folder, study, found.sessions, cache)
    return result, found.sessions


def current_entries(folder: Path, stages: Sequence[Stage], cache: Cache) -> set[Path]:
    """The folders of the entries that a run over the study would take from the cache; nothing is computed.

    What follows from something that would have to be computed first cannot be known, and is not among them.
    Raises PipelineError where the study is bad.
    """
    result, sessions = _before_the_stages(folder, cache)
    used: set[Path] = set()
    complete = True
    for stage in stages:
        if stage.scope == "study" and not complete:
            break
        parts = [[session] for session in sessions] if stage.scope == "session" else [sessions]
        entries, seen = {}, _seen(stage, result.study)
        for part in parts:
            entry = cache.get(stage.name, _work(seen, result, part)[1])
            if entry is not None:
                entries[part[0].id if stage.scope == "session" else ""] = entry
        used |= {entry.folder for entry in entries.values()}
        complete = complete and len(entries) == len(parts)
        result.entries[stage.name] = entries
        if stage.scope == "session":
            sessions = _still_usable(result, [one for one in sessions if one.id in entries], entries)
    return used


def _with_context(folder: Path, result: Result, message: str) -> str:
    """A stage's message with the study's folder, and the sessions that were set aside before it."""
    lines = [f"{folder}/{line}" if line.startswith("study.yaml") else line for line in message.splitlines()]
    if str(folder) not in lines[0] and str(result.folder) not in lines[0]:
        lines[0] = f"{folder}: {lines[0]}"
    if result.set_aside and "no session can be used" not in message:
        lines += ["sessions set aside before:", *(f"  {session.id}: {why}" for session, why in result.set_aside)]
    return "\n".join(lines)


def _input_digests(root: Path, study: Study, sessions: Sequence[Session], cache: Cache) -> dict[str, str]:
    """SHA-256 of every file of the study that is read, by its path in the study."""
    paths = [root / "study.yaml", *(session.path for session in sessions)]
    for field_name in ("participants", "trials", "questionnaires", "measures", "printed"):
        name = getattr(study, field_name)
        if name is not None:
            paths.append(root / name)
    files = {path.relative_to(root).as_posix(): path for path in paths}
    return remembered(files, root, cache.inputs)


def _declared(study: Study, stage: Stage) -> Study:
    """The study as the stage may see it: settings it did not declare are at their defaults."""
    kept = {name: getattr(study, name) for name in stage.settings}
    return Study.model_construct(**kept)


def _settings(study: Study, stage: Stage) -> Any:
    # Order matters in mappings too: it is the order in which streams and estimators are shown.
    ordered = [list(getattr(study, name)) for name in ("streams", "estimators") if name in stage.settings]
    return json.loads(study.model_dump_json(include=set(stage.settings))), ordered


@dataclass(frozen=True)
class _Seen:
    """What a stage sees of a study's settings, and what they and its code add to a key: the same for every session."""

    stage: Stage
    study: Study
    settings: Any
    code: str


def _seen(stage: Stage, study: Study) -> _Seen:
    return _Seen(stage, _declared(study, stage), _settings(study, stage), code_digest(stage.function.split(":")[0]))


def _work(seen: _Seen, result: Result, sessions: Sequence[Session]) -> tuple[Work, str]:
    """A piece of work without its folder, and the key of its result."""
    stage = seen.stage
    read = {name: _entries_for(result.entries[name], sessions) for name in stage.reads}
    names = [getattr(result.study, field_name) for field_name in stage.files]
    inputs = {name: result.inputs[Path(name).as_posix()] for name in names if name is not None}
    if stage.reads_log:
        path = sessions[0].path.relative_to(result.folder).as_posix()
        inputs[path] = result.inputs[path]
    if stage.names_inputs:
        inputs = dict(result.inputs)
    whole = stage.scope == "study"
    work = Work(
        result.name,
        seen.study,
        result.folder,
        Path(),
        tuple(sessions),
        {name: tuple(entry.folder for entry in found) for name, found in read.items()},
        tuple(result.set_aside) if whole else (),
        tuple(result.in_part) if whole else (),
        tuple(result.unused) if whole else (),
        inputs,
    )
    key = digest_of(
        [
            stage.name,
            seen.code,
            seen.settings,
            result.name,
            [[session.id, session.participant, session.condition] for session in sessions],
            inputs,
            {name: [entry.content for entry in found] for name, found in read.items()},
            [[session.id, reason] for session, reason in (*work.set_aside, *work.in_part)],
            work.unused,
        ]
    )
    return work, key


_Missing = tuple[Session, Work, str]  # with the key of the result


def _entries_for(found: dict[str, Entry], sessions: Sequence[Session]) -> list[Entry]:
    return [found[""]] if "" in found else [found[session.id] for session in sessions if session.id in found]


def _run_sessions(stage: Stage, result: Result, sessions: Sequence[Session], means: Means) -> dict[str, Entry]:
    """The stage's entry for each session, computed where the cache has none."""
    seen = _seen(stage, result.study)
    found = _entries(stage, result, [_work(seen, result, [session]) for session in sessions], means)
    return {session.id: entry for session, entry in zip(sessions, found, strict=True)}


def _entries(stage: Stage, result: Result, works: Sequence[tuple[Work, str]], means: Means) -> list[Entry]:
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
            entry = _keep_unusable(means.cache, stage, key, reason)
        yield key, _at_hand(entry)


def _as_completed(
    stage: Stage, missing: Sequence[_Missing], means: Means, waiting: dict[Future[Entry], _Missing]
) -> Iterator[Future[Entry]]:
    """Submit all, each noted in `waiting`; futures as they are done, those of this process between submissions."""
    at_once = set()
    for one in missing:
        future = means.executor.submit(compute, stage, *one[1:], means.cache.root)
        waiting[future] = one
        if future.done():
            at_once.add(future)
            yield future
    yield from as_completed(waiting.keys() - at_once)


def _at_hand(entry: Entry) -> Entry:
    """An entry that another machine may have computed."""
    if not entry.folder.is_dir():
        raise PipelineError(
            f"{entry.folder}: was computed by a worker and is not here; put --cache on a file system that all share"
        )
    return entry


def _keep_unusable(cache: Cache, stage: Stage, key: str, reason: str) -> Entry:
    """That a session cannot be used, under a key of its own, so that the next run tries again."""
    with cache.new(stage.name) as out:
        return cache.keep(stage.name, digest_of([key, reason]), out, asdict(Outcome(set_aside=reason)))


def _look_up(stage: Stage, key: str, session: str, result: Result, cache: Cache) -> Entry | None:
    """What the cache has. That an entry is damaged is noted: it will be computed again."""
    entry = cache.get(stage.name, key)
    if entry is None:
        fault = cache.fault(stage.name, key)
        if fault is not None:
            result.damaged.append((stage.name, session, fault))
    return entry


def _run_study(stage: Stage, result: Result, sessions: Sequence[Session], means: Means) -> Entry:
    work, key = _work(_seen(stage, result.study), result, sessions)
    entry = _look_up(stage, key, "", result, means.cache)
    result.computed[stage.name] = int(entry is None)
    if entry is None:
        means.progress.begin(stage.name, 1)
        entry = compute(stage, work, key, means.cache.root)
        means.progress.advance()
        means.progress.end()
    return entry


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
                return _keep_unusable(cache, stage, key, reason)
            return cache.keep(stage.name, key, out, asdict(outcome))
    except OSError as error:
        if not _is_full(error):
            raise
        raise PipelineError(
            f"{cache_root}: cannot be written any more: {os.strerror(error.errno or 0)}; make room"
            " (`steadyhand cache prune` may) or name another place with --cache; what was computed is kept, run it"
            " again to go on"
        ) from None


def _is_full(error: Exception) -> bool:
    """A disk without room, or none to write to: no session's fault."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)


def _still_usable(result: Result, sessions: Sequence[Session], entries: dict[str, Entry]) -> list[Session]:
    """The sessions that go on, with participant and condition as the log says; the others are set aside."""
    usable = []
    for session in sessions:
        outcome = Outcome(**entries[session.id].said)
        known = replace(
            session,
            participant=outcome.participant or session.participant,
            condition=outcome.condition or session.condition,
        )
        if outcome.set_aside is not None:
            result.set_aside.append((known, outcome.set_aside))
            continue
        if outcome.in_part is not None:
            result.in_part.append((known, outcome.in_part))
        usable.append(known)
    return usable


def _require_something(folder: Path, result: Result, sessions: Sequence[Session]) -> None:
    """A study without tables needs one usable session."""
    study = result.study
    if sessions or study.trials or study.questionnaires or study.measures:
        return
    if result.set_aside:
        reasons = "\n".join(f"  {session.id}: {reason}" for session, reason in result.set_aside)
        raise PipelineError(f"{folder}: no session can be used:\n{reasons}")
    hint = "".join(f"\n  {name}: {reason}" for name, reason in result.unused)
    if study.simulation is not None:
        hint = f"; its logs are made by: steadyhand simulate {folder}"
    raise PipelineError(f'{folder}: no file matches sessions: "{study.sessions}"{hint}')
