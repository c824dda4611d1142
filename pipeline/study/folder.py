"""A study's folder: reads and checks its settings, finds its sessions, and refuses paths outside the folder."""

from __future__ import annotations

import os
import re
import unicodedata
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import PipelineError
from pipeline.study.session import PLACEHOLDER, Session
from pipeline.study.settings import Study
from pipeline.study.yaml_text import parse, read_yaml

SETTINGS_FILE = "study.yaml"
PREREGISTERED = "preregistered.yaml"
FIXED_NAMES = (PREREGISTERED,)  # files that a study may have, and that no key of study.yaml names


def load_study(folder: Path, *, to_be_made: bool = False) -> Study:
    """The settings of a study folder. Raises PipelineError, naming the file, the field, the fault and the remedy.

    With `to_be_made` its tables need not exist yet.
    """
    if not folder.is_dir():
        raise PipelineError(f"{folder}: there is no such folder; a study is a folder with a {SETTINGS_FILE} in it")
    path = folder / SETTINGS_FILE
    if not path.is_file():
        raise PipelineError(f"{folder}: holds no {SETTINGS_FILE}; studies/README.md shows what goes into one")
    inside(folder, SETTINGS_FILE, str(folder))
    content = read_yaml(path)
    content.setdefault("title", folder.resolve().name)
    study = parse(Study, content, path)
    for field, name in study.files.items():
        file = inside(folder, name, f"{path}: {field}", must_exist=False)
        if not file.is_file() and not to_be_made:
            made = f"; it is made by: steadyhand simulate {folder}" if study.simulation is not None else ""
            raise PipelineError(f'{path}: {field}: there is no file "{name}" in the study folder{made}')
    if study.sessions is not None:
        inside(folder, study.sessions, f"{path}: sessions", must_exist=False)
    return study


def files_by_fixed_name(folder: Path) -> list[str]:
    """Those that the study has. PipelineError for one that is a link out of its folder."""
    return [name for name in FIXED_NAMES if inside(folder, name, str(folder / name), must_exist=False).is_file()]


def inside(folder: Path, name: str, field: str, must_exist: bool = True) -> Path:
    """The path of a file of the study. Raises PipelineError if `..`, a root or a link makes it outside the folder."""
    root = folder.resolve()
    path = root / name
    try:
        leads_out = Path(name).is_absolute() or ".." in Path(name).parts or not path.resolve().is_relative_to(root)
        exists = path.is_file()
    except (OSError, ValueError, RuntimeError) as error:
        raise PipelineError(f"{field}: {name!r} cannot be a path: {error}") from None
    if leads_out:
        raise PipelineError(f'{field}: "{name}" is outside the study folder; put the file into it')
    if must_exist and not exists:
        raise PipelineError(f'{field}: there is no file "{name}" in the study folder')
    return path


@dataclass(frozen=True)
class SessionFiles:
    """The logs of a study, sorted by id.

    `set_aside` are files that have a log's name and cannot be read, `unused` other files beside the logs, each with the
    reason.
    """

    sessions: list[Session]
    set_aside: list[tuple[Session, str]]
    unused: list[tuple[str, str]]


def find_sessions(folder: Path, study: Study) -> SessionFiles:
    """The logs that match the study's pattern, and the files that are not used.

    Raises PipelineError for two logs with the same id, or a link to a place outside the folder.
    """
    if study.sessions is None:
        return SessionFiles([], [], [])
    root = folder.resolve()
    pieces = PLACEHOLDER.split(Path(study.sessions).as_posix())
    pattern = "".join(
        re.escape(piece) if index % 2 == 0 else f"(?P<{piece}>[^_/]+)" for index, piece in enumerate(pieces)
    )
    fixed = Path(pieces[0]).parent if not pieces[0].endswith("/") else Path(pieces[0])
    sessions: dict[str, Session] = {}
    set_aside: list[tuple[Session, str]] = []
    unused: list[tuple[str, str]] = []
    for path in sorted((root / fixed).rglob("*")):
        relative = unicodedata.normalize("NFC", path.relative_to(root).as_posix())
        match = re.fullmatch(pattern, relative)
        reason = _cannot_be_a_log(path, relative, match is not None, Path(study.sessions).suffix)
        if reason is not None:
            name = relative.encode("utf-8", "backslashreplace").decode()
            if match is None:
                unused.append((name, reason))
            else:
                set_aside.append((Session(name, None, None, path), reason))
        if match is None or reason is not None:
            continue
        inside(folder, path.relative_to(root).as_posix(), f"{folder / SETTINGS_FILE}: sessions")
        named = match.groupdict()
        session = Session(Path(relative).stem, named.get("participant"), named.get("condition"), path)
        if session.id in sessions:
            other = sessions[session.id].path.relative_to(root)
            raise PipelineError(
                f'{folder / SETTINGS_FILE}: sessions: "{other}" and "{path.relative_to(root)}" are both session '
                f"\"{session.id}\"; a session's id is its file's name, rename one"
            )
        sessions[session.id] = session
    return SessionFiles([sessions[key] for key in sorted(sessions)], set_aside, unused)


def _cannot_be_a_log(path: Path, relative: str, matches: bool, suffix: str) -> str | None:
    """Why a file among the sessions is not used; None for a log, and for files that are not meant as logs."""
    if path.is_symlink() and path.is_dir():
        return "a link to a folder is not followed"
    if path.is_dir() and not matches:
        return None
    if not matches:
        near = Path(relative).suffix.casefold() == suffix.casefold()
        return "its name does not fit the pattern of study.yaml" if near else None
    if not (path.is_file() and os.access(path, os.R_OK)):
        return "it is not a file that can be read"
    try:
        relative.encode("utf-8")
    except UnicodeEncodeError:
        return "its name is not UTF-8; rename it"
    return None
