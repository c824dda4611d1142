"""Other names for participants, so that what is written of a study can be handed on.

Participants become P01, P02 … in the order of their ids. So rows keep their order, and every number is the same as
under the ids. Sessions and log files, whose names hold ids, are named after participant and condition.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePosixPath

import pandas as pd

from pipeline.errors import PipelineError
from pipeline.study.session import Session
from pipeline.study.session_files import PACKED, begins_in
from pipeline.study.settings import Exclusion

SOMEONE_ELSE = "someone else"
"""Who stands in a log and is no participant of the study."""
_TELLING = 3  # fewer letters, or digits alone, are found in too many words and numbers


@dataclass(frozen=True)
class Pseudonyms:
    """The name that stands for each participant, each session, and each file of a log by its path in the study."""

    participants: Mapping[str, str] = field(default_factory=dict)
    sessions: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    def of_session(self, session: Session, root: Path) -> Pseudonyms:
        """Those that the log of a session, which has its new name already, may hold.

        A worker is handed no more, and the key of what it computes does not change with other people.
        """
        files = {path: self.files[path] for path in (_within(file, root) for file in session.files)}
        people = {given: name for given, name in self.participants.items() if name == session.participant}
        return Pseudonyms(people, {given: name for given, name in self.sessions.items() if name == session.id}, files)

    def in_table(self, table: pd.DataFrame, path: Path) -> None:
        """Replace the ids in the columns participant and session of one of the study's own tables.

        Raises PipelineError for a participant without a pseudonym: the table is not the one that they were made for.
        """
        if "participant" in table:
            unknown = set(table["participant"]) - self.participants.keys() - {""}
            if unknown:
                raise PipelineError(f"{path}: changed while it was read; run the command again")
            table["participant"] = table["participant"].map({"": "", **self.participants})
        if "session" in table:
            table["session"] = table["session"].map(lambda given: self.sessions.get(given, given))

    def in_text(self, text: str, others: Iterable[str] = ()) -> str:
        """A text with the names of files, sessions and people replaced as far as they can be told from other words.

        `others` are people who stand in it and are no participants. Ids of one or two letters, and numbers, are
        replaced in quotes only.
        """
        quoted = {f'"{other}"': f'"{SOMEONE_ELSE}"' for other in others if other not in self.participants}
        text = _replaced(text, quoted)
        return self._pattern.sub(lambda found: self._words[found.group()], text) if self._words else text

    @cached_property
    def _words(self) -> dict[str, str]:
        words = {f'"{given}"': f'"{name}"' for given, name in self.participants.items()}
        words |= {given: name for given, name in self.participants.items() if _is_telling(given)}
        words |= self.sessions
        words |= {PurePosixPath(path).name: PurePosixPath(name).name for path, name in self.files.items()}
        return words | dict(self.files)

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        longest_first = sorted(self._words, key=len, reverse=True)
        return re.compile(rf"(?<![^\W_])(?:{'|'.join(map(re.escape, longest_first))})(?![^\W_])")


def pseudonyms_of(
    sessions: Iterable[Session], others: Iterable[tuple[str | None, str | None, str | None]], pattern: str, root: Path
) -> Pseudonyms:
    """Pseudonyms for a study's logs, `sessions`, and for what its tables name: participant, condition, session.

    `pattern` is that of its logs, `root` its folder. A session of several participants, such as "1" or "morning", tells
    of no one and keeps its name.
    """
    logs = sorted(sessions, key=lambda session: session.id)
    named = [(log.participant, log.condition, log.id) for log in logs]
    rows = [*named, *dict.fromkeys(others)]
    ids = sorted({participant for participant, _, _ in rows if participant})
    digits = max(2, len(str(len(ids))))
    people = {given: f"P{number:0{digits}d}" for number, given in enumerate(ids, 1)}
    owners: dict[str, set[str]] = {}
    cells: dict[str, str] = {}
    for participant, condition, session in rows:
        if session:
            owners.setdefault(session, set()).update({participant} if participant else ())
            cell = "_".join(part for part in (people.get(participant or ""), condition) if part)
            cells[session] = max(cells.get(session, ""), cell, key=len)  # a row may lack the condition
    logged = {log.id for log in logs}
    renamed = _numbered({each: cells[each] for each in cells if each in logged or len(owners[each]) == 1})
    folder = begins_in(pattern)
    files = {
        _within(file, root): (folder / f"{renamed[log.id]}{part}{_suffix(file)}").as_posix()
        for log in logs
        for part, file in zip(_parts(log), log.files, strict=True)
    }
    return Pseudonyms(people, renamed, files)


def exclusions_under(names: Pseudonyms, exclusions: Iterable[Exclusion]) -> tuple[Exclusion, ...]:
    """Exclusions under pseudonyms, their reasons too."""
    return tuple(
        one.model_copy(
            update={
                "participant": one.participant and names.participants.get(one.participant, SOMEONE_ELSE),
                "session": one.session and names.sessions.get(one.session, one.session),
                "reason": names.in_text(one.reason),
            }
        )
        for one in exclusions
    )


def _numbered(cells: Mapping[str, str]) -> dict[str, str]:
    """A name for each session: its cell, with a number where several are of one cell."""
    of_cell: dict[str, list[str]] = {}
    for session in sorted(cells):
        of_cell.setdefault(cells[session] or "unknown", []).append(session)
    return {
        session: cell if len(members) == 1 else f"{cell}_{number}"
        for cell, members in of_cell.items()
        for number, session in enumerate(members, 1)
    }


def _parts(log: Session) -> list[str]:
    """What follows the session's name in those of its files: nothing where it is one file."""
    return [f"/{number}" for number, _ in enumerate(log.parts, 1)] if log.parts else [""]


def _suffix(file: Path) -> str:
    return "".join(file.suffixes[-2:]) if file.suffix.casefold() in PACKED else file.suffix


def _within(file: Path, root: Path) -> str:
    return file.relative_to(root).as_posix()


def _is_telling(given: str) -> bool:
    return len(given) >= _TELLING and any(letter.isalpha() for letter in given)


def _replaced(text: str, words: Mapping[str, str]) -> str:
    for given, name in words.items():
        text = text.replace(given, name)
    return text
