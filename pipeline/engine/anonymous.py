"""Opens a study under pseudonyms: from here on no stage sees an id of a participant, but where it reads a file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from pipeline.engine.result import Result
from pipeline.errors import PipelineError
from pipeline.study.pseudonyms import Pseudonyms, exclusions_under, pseudonyms_of
from pipeline.study.session import Session
from pipeline.study.session_files import begins_in
from pipeline.study.settings import Exclusion, Study
from pipeline.study.table_file import read_table, table_file
from pipeline.study.table_parts import parts_of

_OF_PEOPLE = ("participants", "trials", "questionnaires", "measures")
_COLUMNS = ("participant", "condition", "session")
_Row = tuple[str | None, str | None, str | None]


def anonymised(result: Result, sessions: Sequence[Session], read: Sequence[Session]) -> tuple[Result, list[Session]]:
    """A study and its sessions, as they were opened, under pseudonyms.

    `read` are the sessions after their logs were read, which may be the first to say of whom they are. Raises
    PipelineError where an exclusion names nobody of the study.
    """
    study = result.study
    rows = list(_rows_of_tables(study, result.folder))
    names = pseudonyms_of(read, rows, study.sessions or "", result.folder)
    names = replace(names, files={**names.files, **_files_of_tables(study, result.folder)})
    _require_known(study.exclusions, names, rows)
    known = {session.id: session for session in read}
    folder = begins_in(study.sessions or "")
    unreadable = [
        (replace(session, id=_numbered(folder, "unreadable", number, session.id)), reason)
        for number, (session, reason) in enumerate(result.set_aside, 1)
    ]
    unused = [
        (_numbered(folder, "other", number, name), reason) for number, (name, reason) in enumerate(result.unused, 1)
    ]
    result.damaged[:] = [one._replace(session=names.sessions.get(one.session, one.session)) for one in result.damaged]
    opened = replace(
        result,
        study=_study(study, names),
        set_aside=unreadable,
        unused=unused,
        pseudonyms=names,
    )
    return opened, [_session(known[session.id], names) for session in sessions]


def _study(study: Study, names: Pseudonyms) -> Study:
    """The settings with pseudonyms in exclusions and in the study's own texts."""
    pictures = (
        one.model_copy(update={"alt": names.in_text(one.alt), "caption": names.in_text(one.caption)})
        for one in study.pictures
    )
    texts = {key: names.in_text(getattr(study, key)) for key in ("title", "notes")}
    changed = {**texts, "exclusions": exclusions_under(names, study.exclusions), "pictures": tuple(pictures)}
    return study.model_copy(update={key: value for key, value in changed.items() if value != getattr(study, key)})


def _session(session: Session, names: Pseudonyms) -> Session:
    participant = None if session.participant is None else names.participants[session.participant]
    return replace(session, id=names.sessions[session.id], participant=participant)


def _numbered(folder: Path, what: str, number: int, name: str) -> str:
    """What a file that is not used is called: its own name may hold an id."""
    return (folder / f"{what}_{number}{PurePosixPath(name).suffix}").as_posix()


def _rows_of_tables(study: Study, folder: Path) -> Iterator[_Row]:
    """Participant, condition and session of each row of the study's own tables."""
    for name in _OF_PEOPLE:
        file = table_file(study, folder, name)
        if file is not None:
            table, _ = read_table(file, ("participant",))
            columns = [table[key] if key in table else [None] * len(table) for key in _COLUMNS]
            yield from zip(*columns, strict=True)


def _files_of_tables(study: Study, folder: Path) -> dict[str, str]:
    """Other names for the files of a table that is split: the ids are in their names."""
    return {
        part.name: (begins_in(pattern) / f"{table}_{number}{part.path.suffix}").as_posix()
        for table in _OF_PEOPLE
        for pattern in [getattr(study, table) or ""]
        for number, part in enumerate(parts_of(folder, pattern), 1)
    }


def _require_known(exclusions: Sequence[Exclusion], names: Pseudonyms, rows: Sequence[_Row]) -> None:
    """Raise PipelineError for an exclusion of somebody unknown, without the id: it is likely an id misspelt."""
    sessions = names.sessions.keys() | {session for _, _, session in rows}
    for place, one in enumerate(exclusions, 1):
        for what, wanted, known in (
            ("participant", one.participant, names.participants.keys()),
            ("session", one.session, sessions),
        ):
            if wanted is not None and wanted not in known:
                raise PipelineError(
                    f"study.yaml: exclusions: entry {place} names a {what} that is not in the data; correct it, or"
                    " run the command without --anonymise, which says what is there"
                )
