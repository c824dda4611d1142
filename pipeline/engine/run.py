"""Runs the stages one after the other over a study, or only looks up what the cache has."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from pipeline.engine.anonymous import anonymised
from pipeline.engine.cache import Cache, Entry, file_digest
from pipeline.engine.entries import entries_of, entry_of_study
from pipeline.engine.input_files import CHANGED, InputChangedError
from pipeline.engine.keys import declared_by, work_and_key
from pipeline.engine.resources import Resources
from pipeline.engine.result import Damaged, Result
from pipeline.engine.stage import Stage
from pipeline.engine.usable_sessions import open_study, require_data, usable_after
from pipeline.errors import DamagedTableError, PipelineError
from pipeline.study.session import Session
from pipeline.study.settings import Study
from pipeline.words.phrases import one_line


def bring_up_to_date(folder: Path, stages: Sequence[Stage], resources: Resources, *, anonymise: bool = False) -> Result:
    """Run the stages over a study; what the cache holds is not computed again. `anonymise` has pseudonyms for ids.

    Where a table or study.yaml changes while it is read, the run begins once more. It does so too where a stage finds
    an entry damaged, since that must be computed first. What was finished is in the cache. Raises PipelineError for a
    study that cannot be read, one without tables and without a usable session, and one whose files change again.
    """
    began = time.monotonic()
    computed: dict[str, int] = {}
    damaged: list[Damaged] = []
    times_changed = times_damaged = 0
    while True:
        try:
            result = _run_stages(folder, stages, resources, computed, damaged, anonymise)
        except InputChangedError:
            times_changed += 1
            if times_changed > 1:
                raise
        except DamagedTableError:
            times_damaged += 1
            if times_damaged > len(stages):  # each stage may find damage in those before it
                raise
        else:
            result.seconds = time.monotonic() - began
            return result


def _run_stages(
    folder: Path,
    stages: Sequence[Stage],
    resources: Resources,
    computed: dict[str, int],
    damaged: list[Damaged],
    anonymise: bool,
) -> Result:
    """Add to what earlier attempts have `computed` and found `damaged`."""
    result, sessions = open_study(folder, resources.cache)
    result.computed, result.damaged = computed, damaged
    if anonymise:
        result, sessions = _under_pseudonyms(stages, result, sessions, resources)
    for stage in stages:
        try:
            if stage.scope == "session":
                result.entries[stage.name] = _run_sessions(stage, result, sessions, resources)
                sessions = usable_after(result, sessions, result.entries[stage.name])
                require_data(folder, result, sessions)
            else:
                work, key = work_and_key(declared_by(stage, result.study), result, sessions)
                result.entries[stage.name] = {"": entry_of_study(stage, result, work, key, resources)}
        except (InputChangedError, DamagedTableError):
            raise
        except PipelineError as error:
            raise PipelineError(_with_context(folder, result, str(error))) from None
    result.sessions = sessions
    return result


def _under_pseudonyms(
    stages: Sequence[Stage], result: Result, sessions: Sequence[Session], resources: Resources
) -> tuple[Result, list[Session]]:
    """The study under pseudonyms. Its logs are read as they are first, for they may say of whom they are."""
    as_it_is = replace(result, set_aside=[], in_part=[])
    reads_logs = next(stage for stage in stages if stage.reads_log)
    usable = usable_after(as_it_is, sessions, _run_sessions(reads_logs, as_it_is, sessions, resources))
    return anonymised(result, sessions, [*usable, *(session for session, _ in as_it_is.set_aside)])


def _run_sessions(stage: Stage, result: Result, sessions: Sequence[Session], resources: Resources) -> dict[str, Entry]:
    """The stage's entry for each session, computed where the cache has none; of a log that changed, once more."""
    entries = _entries_of_sessions(stage, result, sessions, resources)
    changed = [session for session in sessions if entries[session.id].outcome["set_aside"] == CHANGED]
    if changed:
        for session in changed:
            for file in session.files:
                with suppress(OSError):  # one that has gone meanwhile is set aside as one that changed
                    result.inputs[file.relative_to(result.folder).as_posix()] = file_digest(file)
        entries |= _entries_of_sessions(stage, result, changed, resources)
    return entries


def _entries_of_sessions(
    stage: Stage, result: Result, sessions: Sequence[Session], resources: Resources
) -> dict[str, Entry]:
    declared = declared_by(stage, result.study)
    pieces = (work_and_key(declared, result, [session]) for session in sessions)
    entries = entries_of(stage, result, pieces, resources)
    return {session.id: entry for session, entry in zip(sessions, entries, strict=True)}


def run_variants(
    result: Result, stage: Stage, variants: Sequence[Study], sessions: Sequence[Session], resources: Resources
) -> list[list[Entry]]:
    """A stage's entries with several settings of one study: a list for each session, in the order of the variants."""
    began = time.monotonic()
    declared = [(declared_by(stage, study), replace(result, study=study)) for study in variants]
    # Session by session, so that the variants of one session may share a process that has loaded its recording.
    pieces = (work_and_key(of_stage, variant, [session]) for session in sessions for of_stage, variant in declared)
    entries = entries_of(stage, result, pieces, resources)
    result.seconds += time.monotonic() - began
    return [entries[at : at + len(variants)] for at in range(0, len(entries), len(variants))]


def current_entries(folder: Path, stages: Sequence[Stage], cache: Cache) -> set[Path]:
    """The folders of the entries that a run over the study would take from the cache; nothing is computed.

    An entry that depends on something still to be computed has no known key and is not included. Raises PipelineError
    where the study cannot be read.
    """
    result, sessions = open_study(folder, cache)
    used: set[Path] = set()
    complete = True
    for stage in stages:
        if stage.scope == "study" and not complete:
            break
        entries = _cached(stage, result, sessions, cache)
        used |= {entry.folder for entry in entries.values()}
        complete = complete and len(entries) == (len(sessions) if stage.scope == "session" else 1)
        result.entries[stage.name] = entries
        if stage.scope == "session":
            sessions = usable_after(result, [session for session in sessions if session.id in entries], entries)
    return used


def _cached(stage: Stage, result: Result, sessions: Sequence[Session], cache: Cache) -> dict[str, Entry]:
    """The stage's entries that the cache has, by session id; "" for an entry of the whole study."""
    declared = declared_by(stage, result.study)
    parts = {session.id: [session] for session in sessions} if stage.scope == "session" else {"": sessions}
    looked_up = {name: cache.get(stage.name, work_and_key(declared, result, part)[1]) for name, part in parts.items()}
    return {name: entry for name, entry in looked_up.items() if entry is not None}


def _with_context(folder: Path, result: Result, message: str) -> str:
    """A stage's message with the study's folder, and the sessions that were set aside before it."""
    lines = [f"{folder}/{line}" if line.startswith("study.yaml") else line for line in message.splitlines()]
    if str(folder) not in lines[0] and str(result.folder) not in lines[0]:
        lines[0] = f"{folder}: {lines[0]}"
    if result.set_aside and "no session can be used" not in message:
        lines += [
            "sessions set aside before:",
            *(one_line(f"  {session.id}: {why}") for session, why in result.set_aside),
        ]
    return "\n".join(lines)
