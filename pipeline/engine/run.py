"""The stages one after the other over a study: brought up to date, or only looked up."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.engine.cache import Cache, Entry
from pipeline.engine.entries import entries_of, entry_of_study
from pipeline.engine.keys import seen_by, work_and_key
from pipeline.engine.resources import Means
from pipeline.engine.result import Result
from pipeline.engine.stage import Stage
from pipeline.engine.usable_sessions import found_in, require_something, still_usable
from pipeline.errors import PipelineError
from pipeline.study.session import Session
from pipeline.study.settings import Study


def bring_up_to_date(folder: Path, stages: Sequence[Stage], means: Means) -> Result:
    """Run the stages over a study; what the cache holds is not computed again.

    Raises PipelineError where nothing can be done: a bad study, or no usable session and no tables.
    """
    began = time.monotonic()
    result, sessions = found_in(folder, means.cache)
    for stage in stages:
        try:
            if stage.scope == "session":
                result.entries[stage.name] = _run_sessions(stage, result, sessions, means)
                sessions = still_usable(result, sessions, result.entries[stage.name])
                require_something(folder, result, sessions)
            else:
                work, key = work_and_key(seen_by(stage, result.study), result, sessions)
                result.entries[stage.name] = {"": entry_of_study(stage, result, work, key, means)}
        except PipelineError as error:
            raise PipelineError(_with_context(folder, result, str(error))) from None
    result.sessions = sessions
    result.seconds = time.monotonic() - began
    return result


def _run_sessions(stage: Stage, result: Result, sessions: Sequence[Session], means: Means) -> dict[str, Entry]:
    """The stage's entry for each session, computed where the cache has none."""
    seen = seen_by(stage, result.study)
    found = entries_of(stage, result, (work_and_key(seen, result, [session]) for session in sessions), means)
    return {session.id: entry for session, entry in zip(sessions, found, strict=True)}


def over_settings(
    result: Result, stage: Stage, settings: Sequence[Study], sessions: Sequence[Session], means: Means
) -> list[list[Entry]]:
    """A stage's entry for each of several settings of a study, by session: a list a session, in the settings' order."""
    began = time.monotonic()
    of_settings = [(seen_by(stage, study), replace(result, study=study)) for study in settings]
    works = (work_and_key(seen, one, [session]) for session in sessions for seen, one in of_settings)
    entries = entries_of(stage, result, works, means)
    result.seconds += time.monotonic() - began
    return [entries[at : at + len(settings)] for at in range(0, len(entries), len(settings))]


def current_entries(folder: Path, stages: Sequence[Stage], cache: Cache) -> set[Path]:
    """The folders of the entries that a run over the study would take from the cache; nothing is computed.

    What follows from something that would have to be computed first cannot be known, and is not among them.
    Raises PipelineError where the study is bad.
    """
    result, sessions = found_in(folder, cache)
    used: set[Path] = set()
    complete = True
    for stage in stages:
        if stage.scope == "study" and not complete:
            break
        parts = [[session] for session in sessions] if stage.scope == "session" else [sessions]
        entries, seen = {}, seen_by(stage, result.study)
        for part in parts:
            entry = cache.get(stage.name, work_and_key(seen, result, part)[1])
            if entry is not None:
                entries[part[0].id if stage.scope == "session" else ""] = entry
        used |= {entry.folder for entry in entries.values()}
        complete = complete and len(entries) == len(parts)
        result.entries[stage.name] = entries
        if stage.scope == "session":
            sessions = still_usable(result, [one for one in sessions if one.id in entries], entries)
    return used


def _with_context(folder: Path, result: Result, message: str) -> str:
    """A stage's message with the study's folder, and the sessions that were set aside before it."""
    lines = [f"{folder}/{line}" if line.startswith("study.yaml") else line for line in message.splitlines()]
    if str(folder) not in lines[0] and str(result.folder) not in lines[0]:
        lines[0] = f"{folder}: {lines[0]}"
    if result.set_aside and "no session can be used" not in message:
        lines += ["sessions set aside before:", *(f"  {session.id}: {why}" for session, why in result.set_aside)]
    return "\n".join(lines)
