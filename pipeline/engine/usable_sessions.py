"""Which sessions a study has, and which of them can still be used after a stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.engine.cache import Cache, Entry, file_digest
from pipeline.engine.input_digests import file_digests, stamp
from pipeline.engine.input_files import CHANGED, InputChangedError
from pipeline.engine.result import Result
from pipeline.engine.stage import Outcome
from pipeline.errors import PipelineError
from pipeline.study.folder import SETTINGS_FILE, files_by_fixed_name, load_study
from pipeline.study.session import Session
from pipeline.study.session_files import find_sessions
from pipeline.study.settings import Study
from pipeline.study.table_parts import files_of
from pipeline.words.phrases import one_line


def open_study(folder: Path, cache: Cache) -> tuple[Result, list[Session]]:
    """A study before its first stage, and its sessions with participant and condition as their file names say.

    Raises PipelineError where the study cannot be read, InputChangedError where study.yaml changes meanwhile.
    """
    settings_file = folder / SETTINGS_FILE
    before = (stamp(settings_file), file_digest(settings_file)) if settings_file.is_file() else None
    study = load_study(folder)
    listed = find_sessions(folder, study)
    result = Result(folder.resolve(), study, set_aside=listed.set_aside, unused=listed.unused)
    result.inputs = _input_digests(result.folder, study, listed.sessions, cache)
    # Else these settings and the digest may be of different contents.
    if (stamp(settings_file), result.inputs[SETTINGS_FILE]) != before:
        raise InputChangedError(f"{settings_file}: {CHANGED}")
    return result, listed.sessions


def _input_digests(root: Path, study: Study, sessions: Sequence[Session], cache: Cache) -> dict[str, str]:
    """SHA-256 of every file of the study that is read, by its path in the study."""
    paths = [root / SETTINGS_FILE, *(file for session in sessions for file in session.files)]
    paths += [path for name in study.files.values() for path in files_of(root, name)]
    paths += [root / name for name in files_by_fixed_name(root)]
    files = {path.relative_to(root).as_posix(): path for path in paths}
    return file_digests(files, root, cache.inputs)


def usable_after(result: Result, sessions: Sequence[Session], entries: dict[str, Entry]) -> list[Session]:
    """The sessions that can be used after a stage, with participant and condition as the log says.

    Sessions that are set aside or read in part are noted in `result`. `entries` are the stage's, by session id.
    """
    usable = []
    for session in sessions:
        outcome = Outcome(**entries[session.id].outcome)
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


def require_data(folder: Path, result: Result, sessions: Sequence[Session]) -> None:
    """Raise PipelineError where a study has neither tables nor a session that can be used."""
    study = result.study
    if sessions or study.trials or study.questionnaires or study.measures:
        return
    if result.set_aside:
        reasons = "\n".join(one_line(f"  {session.id}: {reason}") for session, reason in result.set_aside)
        raise PipelineError(f"{folder}: no session can be used:\n{reasons}")
    hint = "".join(f"\n  {one_line(name)}: {reason}" for name, reason in result.unused)
    if study.simulation is not None:
        hint = f"; write its simulated logs with: steadyhand simulate {folder}"
    raise PipelineError(f'{folder}: no file matches sessions: "{study.sessions}"{hint}')
