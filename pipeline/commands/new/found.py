"""What a folder holds: its tables and logs, guessed one by one and put together."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from pipeline.commands.new.questions import Questions
from pipeline.commands.new.session_logs import logs_among, sessions_of
from pipeline.commands.new.split_tables import joined
from pipeline.engine.progress import show_progress
from pipeline.errors import PipelineError
from pipeline.sessions.guessed_streams import StreamsGuess, guess_streams
from pipeline.sessions.logs import READERS
from pipeline.study.guessing.file_names import NamePattern, guess_pattern
from pipeline.study.guessing.headers import LENGTHS
from pipeline.study.guessing.kind import TableGuess, guess_kind
from pipeline.study.guessing.lengths import in_units, with_units
from pipeline.study.guessing.written import SUFFIXES, NotUsed, Written, tables_in
from pipeline.study.session_files import PACKED

_LOGS_READ = 3  # of all: noise and latency are the medians over them
_DEPTH_MAX = 3
_KINDS = ("participants", "trials", "questionnaires", "measures")


@dataclass(frozen=True)
class Stated:
    """What the user said on the command line. `columns` are headers, each with the column that it means."""

    title: str | None = None
    conditions: tuple[str, ...] = ()
    columns: Mapping[str, str] = field(default_factory=dict)
    unit: str | None = None
    px_per_mm: float | None = None
    gravity: str | None = None


@dataclass(frozen=True)
class Found:
    """The tables of a folder by their kind, its logs with the pattern of their names, and files that are not used."""

    tables: Mapping[str, TableGuess]
    logs: tuple[Path, ...]
    names: NamePattern | None
    streams: StreamsGuess | None
    not_used: tuple[tuple[str, str], ...]


def look(folder: Path, stated: Stated, questions: Questions) -> Found:
    """What the folder holds. Raises PipelineError where there is nothing that a study could use."""
    files = list(_files(folder, _DEPTH_MAX))
    texts = {path: tables_in(path, _people(stated)) for path in files if path.suffix.lower() in SUFFIXES}
    recorded = logs_among(files, texts, _people(stated))
    logs = tuple(sessions_of(recorded, files))
    streams = _streams(logs) if logs else None
    names = _names(folder, logs, stated.conditions or (streams.condition_facts if streams is not None else ()))
    known = stated.conditions or (names.conditions if names is not None else ())
    written = [
        replace(one, name=path.relative_to(folder).as_posix()) if isinstance(one, Written) else one
        for path, tables_of in texts.items()
        if path not in recorded
        for one in tables_of
    ]
    whole = joined([one for one in written if isinstance(one, Written)], known)
    unreadable = [one for one in written if isinstance(one, NotUsed)]
    tables, not_used = _kinds([*whole, *unreadable], known, stated, questions)
    if not logs and not tables:
        said = "".join(f"\n  {name}: {reason}" for name, reason in _named(folder, not_used))
        raise PipelineError(
            f"{folder}: holds no logs ({', '.join(READERS)}) and no tables that a study can use{said}\nAn empty study"
            f" with tables to fill in: steadyhand new {folder} --template peephole (or tlx, fitts, between)"
        )
    return Found(tables, logs, names, streams, tuple(_named(folder, not_used)))


def _files(folder: Path, depth: int) -> Iterator[Path]:
    """The files in a folder and those below it, in the order of their names; hidden ones left out."""
    for entry in sorted(os.scandir(folder), key=lambda one: one.name):
        if entry.name.startswith((".", "~$")):
            continue
        if entry.is_dir(follow_symlinks=False):
            if depth > 0:
                yield from _files(Path(entry.path), depth - 1)
        elif entry.is_file(follow_symlinks=False):
            yield Path(entry.path)


def _streams(logs: Sequence[Path]) -> StreamsGuess | None:
    with show_progress() as progress:
        found = guess_streams(_some(logs), partial(progress.begin, "looking at logs", unit="logs"), progress.advance)
        progress.end()
    return found


def _some(logs: Sequence[Path]) -> list[Path]:
    """A few logs from the first to the last."""
    last = len(logs) - 1
    places = sorted({round(last * step / max(1, _LOGS_READ - 1)) for step in range(_LOGS_READ)})
    return [logs[place] for place in places]


def _names(folder: Path, logs: Sequence[Path], conditions: Sequence[str]) -> NamePattern | None:
    if not logs:
        return None
    ending = (
        ""
        if logs[0].is_dir()
        else "".join(logs[0].suffixes[-2:] if logs[0].suffix in PACKED else logs[0].suffixes[-1:])
    )
    return guess_pattern([path.relative_to(folder).as_posix() for path in logs], conditions, ending)


def _people(stated: Stated) -> tuple[str, ...]:
    return tuple(name for name, column in stated.columns.items() if column == "participant")


def _kinds(
    written: Iterable[Written | NotUsed], conditions: Sequence[str], stated: Stated, questions: Questions
) -> tuple[dict[str, TableGuess], list[NotUsed]]:
    """Each table with its kind, one of a kind; those with a column of conditions first, as the others need them."""
    tables: dict[str, TableGuess] = {}
    not_used: list[NotUsed] = []
    pending = [one for one in written if isinstance(one, Written)]
    not_used += [one for one in written if isinstance(one, NotUsed)]
    for again in (False, True):
        for one in list(pending):
            guess = guess_kind(one, tuple(conditions) or _conditions(tables.values()), stated.columns)
            if isinstance(guess, TableGuess) and (again or guess.kind != "participants"):
                pending.remove(one)
                if guess.kind in tables:
                    _refuse_one_each(tables[guess.kind], guess)
                    other = tables[guess.kind].written.path.name
                    not_used.append(
                        NotUsed(one.path, f"{other} is read as the {guess.kind}, and a study has one table")
                    )
                else:
                    tables[guess.kind] = _with_units(guess, stated, questions)
            elif isinstance(guess, NotUsed) and again:
                not_used.append(guess)
    return {kind: tables[kind] for kind in _KINDS if kind in tables}, not_used


def _refuse_one_each(table: TableGuess, other: TableGuess) -> None:
    """Raise PipelineError for two tables with the same columns: people have one each, and a study one for all."""
    if table.written.header == other.written.header:
        raise PipelineError(
            f"{table.written.name} and {other.written.name} have the same columns: a study has one table of"
            f" {table.kind} for everybody. Name such files alike, as P01_{table.kind}.csv and P02_{table.kind}.csv,"
            " and they are read as one; or join them, with a column for what tells them apart"
        )


def _with_units(table: TableGuess, stated: Stated, questions: Questions) -> TableGuess:
    """A table of trials whose lengths and times have units: as they say, as was stated, or as their values suggest."""
    if table.kind != "trials":
        return table
    lengths, times = in_units(table)
    if lengths.stated:
        unit = lengths.unit
    else:
        unit = stated.unit or questions.choose(
            f"In which unit are the positions in {table.written.path.name}?",
            lengths.unit,
            "--unit",
            LENGTHS,
        )
    return with_units(table, unit, times.unit)


def _conditions(tables: Iterable[TableGuess]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(condition for table in tables for condition in table.conditions))


def _named(folder: Path, not_used: Iterable[NotUsed]) -> Iterator[tuple[str, str]]:
    return ((one.path.relative_to(folder).as_posix(), one.reason) for one in not_used)
