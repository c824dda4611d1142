"""Finds a study's logs by the pattern of their names.

A session is one file, or several: a folder that the pattern names, such as a bag of ROS 2; the files of a folder, where
the name of the file itself has no placeholder; or all files that differ only in what "*" stands for.
"""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.errors import PipelineError
from pipeline.study.folder import SETTINGS_FILE, inside
from pipeline.study.session import ANY, PLACEHOLDER, Session, expression
from pipeline.study.settings import Study

PACKED = (".zst", ".zstd")
"""What stands behind the suffix of a file that is packed as a whole."""


@dataclass(frozen=True)
class SessionFiles:
    """The logs of a study, sorted by id.

    `set_aside` are files that have a log's name and cannot be read, `unused` other files beside the logs, each with the
    reason.
    """

    sessions: list[Session]
    set_aside: list[tuple[Session, str]]
    unused: list[tuple[str, str]]


def begins_in(pattern: str) -> Path:
    """The folder, within the study, in which all logs of a pattern are."""
    before = PLACEHOLDER.split(Path(pattern).as_posix())[0]
    return Path(before) if before.endswith("/") else Path(before).parent


def find_sessions(folder: Path, study: Study) -> SessionFiles:
    """The logs that match the study's pattern, and the files that are not used.

    Raises PipelineError for two logs with the same id, or a link to a place outside the folder.
    """
    if study.sessions is None:
        return SessionFiles([], [], [])
    root, pattern = folder.resolve(), _Pattern.of(study.sessions)
    sessions: dict[str, Session] = {}
    set_aside: list[tuple[Session, str]] = []
    unused: list[tuple[str, str]] = []
    for path in sorted((root / pattern.begins_in).rglob("*")):
        relative = unicodedata.normalize("NFC", path.relative_to(root).as_posix())
        match = pattern.names.fullmatch(relative)
        reason = _cannot_be_a_log(path, relative, match is not None, pattern)
        if reason is not None:
            name = relative.encode("utf-8", "backslashreplace").decode()
            if match is None:
                unused.append((name, reason))
            else:
                set_aside.append((Session(name, None, None, path), reason))
        if match is None or reason is not None:
            continue
        for file in (path, *(() if path.is_file() else _files_of(path))):
            inside(folder, file.relative_to(root).as_posix(), f"{folder / SETTINGS_FILE}: sessions", must_exist=False)
        session = pattern.session(path, relative, match)
        other = sessions.get(session.id)
        if other is not None and not (pattern.joins_files and other.path == session.path):
            raise PipelineError(
                f'{folder / SETTINGS_FILE}: sessions: "{other.path.relative_to(root)}" and "{path.relative_to(root)}" '
                f"are both session \"{session.id}\"; a session's id is its file's name, rename one"
            )
        parts = tuple(dict.fromkeys((*other.parts, *session.parts))) if other is not None else session.parts
        sessions[session.id] = replace(session, parts=parts)
    return SessionFiles([sessions[key] for key in sorted(sessions)], set_aside, unused)


@dataclass(frozen=True)
class _Pattern:
    """A pattern of sessions: what names match it, where their folder begins, and how files make a session."""

    names: re.Pattern[str]
    begins_in: Path
    suffix: str
    depth: int
    is_folder: bool
    joins_files: bool
    id_is_file_name: bool

    @staticmethod
    def of(text: str) -> _Pattern:
        whole = Path(text)
        pieces = PLACEHOLDER.split(whole.as_posix())
        own, in_file = pieces[1::2], PLACEHOLDER.findall(whole.name)
        is_folder = not whole.suffix and ANY not in whole.name
        joins = ANY in whole.name or not in_file
        return _Pattern(
            expression(whole.as_posix()),
            begins_in(text),
            whole.suffix,
            len(whole.parts),
            is_folder,
            joins,
            set(own) == set(in_file) and ANY not in whole.name,
        )

    def session(self, path: Path, relative: str, match: re.Match[str]) -> Session:
        """The session that a file or folder is, or is a part of."""
        named = match.groupdict()
        whole = Path(relative)
        name = whole.name if self.is_folder else whole.with_suffix("").stem if _is_packed(whole) else whole.stem
        key = name if self.id_is_file_name else "_".join(named.values())
        found = Session(key, named.get("participant"), named.get("condition"), path)
        if self.is_folder:
            return replace(found, parts=tuple(_files_of(path)))
        if not self.joins_files:
            return found
        # Where only folders are named by placeholders, all files of one kind in such a folder are one session.
        beside = (path,) if ANY in match.re.pattern or PLACEHOLDER.search(path.name) else _files_of(path.parent)
        alike = tuple(file for file in beside if file.suffix.casefold() == path.suffix.casefold())
        return replace(found, path=path.parent, parts=alike)


def _files_of(folder: Path) -> Iterator[Path]:
    """The files of a session's folder, but for hidden ones."""
    return (path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith("."))


def _is_packed(path: Path) -> bool:
    return path.suffix.casefold() in PACKED


def _cannot_be_a_log(path: Path, relative: str, matches: bool, pattern: _Pattern) -> str | None:
    """Why a file among the sessions is not used; None for a log, and for files that are not meant as logs."""
    if path.is_symlink() and path.is_dir():
        return "a link to a folder is not followed"
    if not matches:
        return "its name does not fit the pattern of study.yaml" if _is_near(path, relative, pattern) else None
    if pattern.is_folder and not path.is_dir():
        return "it is a file, and the pattern of study.yaml names a folder; give the file's ending in the pattern"
    if pattern.is_folder and not any(_files_of(path)):
        return "the folder holds no file"
    if not pattern.is_folder and not (path.is_file() and os.access(path, os.R_OK)):
        return "it is not a file that can be read"
    return _not_utf8(relative)


def _not_utf8(relative: str) -> str | None:
    try:
        relative.encode("utf-8")
    except UnicodeEncodeError:
        return "its name is not UTF-8; rename it"
    return None


def _is_near(path: Path, relative: str, pattern: _Pattern) -> bool:
    """Whether something that does not match the pattern looks as if it should."""
    if pattern.is_folder:
        return len(Path(relative).parts) == pattern.depth and path.is_dir() and any(_files_of(path))
    return path.is_file() and path.suffix.casefold() == pattern.suffix.casefold()
