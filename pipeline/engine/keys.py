"""A piece of work, and the key of its result, which covers everything that may change the result and nothing else."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline.engine.cache import LAYOUT, Entry, digest_of
from pipeline.engine.code_digest import code_digest
from pipeline.engine.result import Result
from pipeline.engine.stage import Stage, Work
from pipeline.study.pseudonyms import Pseudonyms
from pipeline.study.session import Session
from pipeline.study.settings import Study
from pipeline.study.table_parts import of_table


@dataclass(frozen=True)
class Declared:
    """A stage, the settings of a study that it declared, and a digest of these settings and of its code.

    It is the same for every session, so it is computed once.
    """

    stage: Stage
    study: Study
    digest: str


def declared_by(stage: Stage, study: Study) -> Declared:
    """The study as the stage may see it: settings that the stage did not declare are at their defaults."""
    visible = Study.model_construct(**{name: getattr(study, name) for name in stage.settings})
    digest = digest_of([LAYOUT, stage.name, code_digest(stage.module), _settings(study, stage)])
    return Declared(stage, visible, digest)


def work_and_key(declared: Declared, result: Result, sessions: Sequence[Session]) -> tuple[Work, str]:
    """A piece of work without its folder, and the key of its result."""
    stage = declared.stage
    read = {name: _entries_for(result.entries[name], sessions) for name in stage.reads}
    whole = stage.scope == "study"
    work = Work(
        result.name,
        declared.study,
        result.folder,
        Path(),
        tuple(sessions),
        {name: tuple(entry.folder for entry in entries) for name, entries in read.items()},
        tuple(result.set_aside) if whole else (),
        tuple(result.in_part) if whole else (),
        tuple(result.unused) if whole else (),
        _inputs(stage, result, sessions),
        _pseudonyms(stage, result, sessions),
    )
    key = digest_of(
        [
            declared.digest,
            result.name,
            [[session.id, session.participant, session.condition] for session in sessions],
            work.inputs,
            # By content, not by key: if an earlier stage gives the same tables after a change, later ones need not run.
            {name: [entry.digest for entry in entries] for name, entries in read.items()},
            [[session.id, reason] for session, reason in (*work.set_aside, *work.in_part)],
            work.unused,
            None if work.pseudonyms is None else asdict(work.pseudonyms),
        ]
    )
    return work, key


def _inputs(stage: Stage, result: Result, sessions: Sequence[Session]) -> dict[str, str]:
    """SHA-256 of the study's own files that the stage reads, by their paths in the study."""
    if stage.names_inputs:
        return result.named_inputs
    names = [getattr(result.study, field_name) for field_name in stage.files]
    paths = [path for name in names if name is not None for path in of_table(name, result.inputs)]
    paths += [name for name in stage.fixed_files if name in result.inputs]
    if stage.reads_log:
        paths += [file.relative_to(result.folder).as_posix() for file in sessions[0].files]
    return {path: result.inputs[path] for path in paths}


def _pseudonyms(stage: Stage, result: Result, sessions: Sequence[Session]) -> Pseudonyms | None:
    """Those that a stage needs for the study's own files that it reads."""
    if result.pseudonyms is None or not (stage.reads_log or stage.files):
        return None
    return result.pseudonyms.of_session(sessions[0], result.folder) if stage.reads_log else result.pseudonyms


def _settings(study: Study, stage: Stage) -> Any:
    # Order matters in mappings too: it is the order in which streams and estimators are shown.
    ordered = [list(getattr(study, name)) for name in ("streams", "estimators") if name in stage.settings]
    return json.loads(study.model_dump_json(include=set(stage.settings))), ordered


def _entries_for(entries: dict[str, Entry], sessions: Sequence[Session]) -> list[Entry]:
    return [entries[""]] if "" in entries else [entries[session.id] for session in sessions if session.id in entries]
