"""A piece of work, and the key of its result: everything that may change it, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.engine.cache import Entry, digest_of
from pipeline.engine.code_digest import code_digest
from pipeline.engine.result import Result
from pipeline.engine.stage import Stage, Work
from pipeline.study.session import Session
from pipeline.study.settings import Study


@dataclass(frozen=True)
class Seen:
    """What a stage sees of a study's settings, and a digest of them and its code: the same in every session's key."""

    stage: Stage
    study: Study
    digest: str


def seen_by(stage: Stage, study: Study) -> Seen:
    """The study as the stage may see it."""
    digest = digest_of([stage.name, code_digest(stage.module), _settings(study, stage)])
    return Seen(stage, _declared(study, stage), digest)


def work_and_key(seen: Seen, result: Result, sessions: Sequence[Session]) -> tuple[Work, str]:
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
            seen.digest,
            result.name,
            [[session.id, session.participant, session.condition] for session in sessions],
            inputs,
            {name: [entry.content for entry in found] for name, found in read.items()},
            [[session.id, reason] for session, reason in (*work.set_aside, *work.in_part)],
            work.unused,
        ]
    )
    return work, key


def _declared(study: Study, stage: Stage) -> Study:
    """The study as the stage may see it: settings it did not declare are at their defaults."""
    kept = {name: getattr(study, name) for name in stage.settings}
    return Study.model_construct(**kept)


def _settings(study: Study, stage: Stage) -> Any:
    # Order matters in mappings too: it is the order in which streams and estimators are shown.
    ordered = [list(getattr(study, name)) for name in ("streams", "estimators") if name in stage.settings]
    return json.loads(study.model_dump_json(include=set(stage.settings))), ordered


def _entries_for(found: dict[str, Entry], sessions: Sequence[Session]) -> list[Entry]:
    return [found[""]] if "" in found else [found[session.id] for session in sessions if session.id in found]
