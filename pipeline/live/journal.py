"""The only file that writes: logs while they are recorded, the answers, and the study's tables.

A log is `….mcap.part` until its end is written, and whatever `flush` has returned from is on the disk and can be
read, end or no end. Nothing is ever overwritten or deleted: what does not count is moved to `set-aside/`, under a
name of its own. One recorder holds a folder; a lock says which.
"""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from pipeline.errors import PipelineError, SessionError
from pipeline.live import plan
from pipeline.live.plan import FoundLog, Plan, Record
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Wanted
from pipeline.sessions.logs.mcap import LogWriter, Message
from pipeline.study.folder import inside
from pipeline.study.session_files import find_sessions
from pipeline.study.settings import Study

PART = ".part"
SET_ASIDE = "set-aside"
_OWN_FOLDER = ".recorder"
_ANSWERS, _LOCK = "answers.jsonl", "lock"


class Journal:
    """Writes one study's files. Errors of the disk come out as OSError, for the loop to tell."""

    def __init__(self, folder: Path, study: Study) -> None:
        assert study.sessions is not None  # noqa: S101 - checked by `required`
        self.folder, self.study = folder, study
        self.data = inside(folder, study.sessions, "sessions", must_exist=False).parent
        self.own = self.data / _OWN_FOLDER
        self._log: tuple[Path, BinaryIO, LogWriter] | None = None
        self.written_ns: int | None = None

    # --- the folder

    def hold(self) -> None:
        """Take the folder. PipelineError where another recorder that is alive holds it, or nothing can be written."""
        lock = self.own / _LOCK
        with suppress(OSError, ValueError):
            other = int(lock.read_text(encoding="ascii"))
            if other != os.getpid() and _is_alive(other):
                raise PipelineError(f"{self.folder}: another recorder (process {other}) holds this study; end it first")
        try:
            self.own.mkdir(parents=True, exist_ok=True)
            lock.write_text(str(os.getpid()), encoding="ascii")
        except OSError as error:
            raise PipelineError(
                f"{self.own}: cannot be written to: {error.strerror or error}; make the study's folder writable, or"
                " copy study.yaml to one that is"
            ) from None

    def release(self) -> None:
        """Give the folder back."""
        self.abandon()
        (self.own / _LOCK).unlink(missing_ok=True)

    def free_bytes(self) -> int:
        """How much room is left."""
        return shutil.disk_usage(self.data).free

    # --- logs

    def path(self, participant: str, condition: str) -> Path:
        """Where the log of a participant's task belongs."""
        assert self.study.sessions is not None  # noqa: S101
        name = self.study.sessions.format(participant=participant, condition=condition)
        return inside(self.folder, name, "sessions", must_exist=False)

    def open(self, participant: str, condition: str, facts: Mapping[str, str]) -> None:
        """Begin a log. OSError where one is there already: nothing is overwritten.

        What a full disk may have left of an attempt that was set aside goes where it belongs.
        """
        path = self.path(participant, condition)
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            raise FileExistsError(f"{path.name} is there already")
        part = path.with_name(path.name + PART)
        if part.exists():
            self._rename(part, set_aside=True)
        file = part.open("xb")
        self._log = part, file, LogWriter(file, facts)
        self.flush()

    def write(self, messages: Iterable[Message]) -> None:
        """Add messages to the open log."""
        if self._log is not None:
            for message in messages:
                self._log[2].add(message)

    def flush(self) -> None:
        """Put everything written so far onto the disk."""
        if self._log is not None:
            part, file, writer = self._log
            writer.flush()
            to_disk(file)
            if not part.exists():
                raise FileNotFoundError(f"{part.name} is not there any more")
            self.written_ns = time.monotonic_ns()

    @property
    def log_bytes(self) -> int | None:
        """How long the open log is; None without one."""
        return None if self._log is None else self._log[1].tell()

    def close(self, *, set_aside: bool) -> Path | None:
        """End the open log and give it its final name, or one among those set aside. None where none is open."""
        if self._log is None:
            return None
        part, file, writer = self._log
        writer.finish()
        to_disk(file)
        file.close()
        self._log = None
        return self._rename(part, set_aside)

    def abandon(self) -> None:
        """Leave an open log as it is, cut."""
        if self._log is not None:
            with suppress(OSError, ValueError):
                self._log[1].close()
            self._log = None

    def resolve(self, participant: str, condition: str, *, set_aside: bool) -> Path:
        """Give a cut log its final name, or set it, or a whole one, aside."""
        path = self.path(participant, condition)
        part = path.with_name(path.name + PART)
        return self._rename(part if part.exists() else path, set_aside)

    def _rename(self, source: Path, set_aside: bool) -> Path:
        final = source.with_name(source.name.removesuffix(PART))
        if set_aside:
            folder = self.data / SET_ASIDE
            folder.mkdir(exist_ok=True)
            number = 1
            while (target := folder / f"{final.stem}.{number}{final.suffix}").exists():
                number += 1
        else:
            target = final
            if target.exists() and target != source:
                raise FileExistsError(f"{target.name} is there already")
        source.rename(target)
        _sync_folder(target.parent)
        return target

    def found_logs(self) -> list[FoundLog]:
        """The logs in the folder, whole and cut."""
        found = []
        for session in find_sessions(self.folder, self.study).sessions:
            if session.participant is not None and session.condition is not None:
                found.append(self._found(session.path, session.participant, session.condition, True))
        for part in sorted(self.data.glob(f"*{PART}")):
            facts = self._facts(part)
            if facts is None:  # cut before anything was in it
                self._rename(part, set_aside=True)
            elif self.path(facts["participant"], facts["condition"]).name == part.name.removesuffix(PART):
                found.append(self._found(part, facts["participant"], facts["condition"], False))
        return found

    def _facts(self, part: Path) -> Mapping[str, str] | None:
        try:
            facts = _read(part, [Wanted(self.study.events.topic, "events")] if self.study.events else []).facts
        except SessionError:
            return None
        return facts if {"participant", "condition"} <= set(facts) else None

    def _found(self, path: Path, participant: str, condition: str, whole: bool) -> FoundLog:
        assert self.study.events is not None  # noqa: S101 - checked by `required`
        topics = [Wanted(self.study.events.topic, "events")]
        topics += [Wanted(stream.topic, "anything") for stream in self.study.sensor_streams.values()]
        try:
            log = _read(path, topics)
        except SessionError:
            return FoundLog(participant, condition, whole, 0, 0.0)
        events = log.topics[self.study.events.topic].events if self.study.events.topic in log.topics else ()
        trials = sum(event["type"] == "selection" for event in events)
        arrivals = [int(one.arrival_ns[place]) for one in log.topics.values() if one.read for place in (0, -1)]
        seconds = (max(arrivals) - min(arrivals)) / 1e9 if arrivals else 0.0
        return FoundLog(participant, condition, whole, trials, seconds, log.facts.get("study_digest", ""))

    # --- answers and tables

    def save(self, records: Sequence[Record]) -> None:
        """Append records to the file of answers; they are on the disk when this returns."""
        with (self.own / _ANSWERS).open("ab") as file:
            for record in records:
                file.write(json.dumps(record, ensure_ascii=False, allow_nan=False).encode() + b"\n")
            to_disk(file)

    def records(self) -> list[Record]:
        """All records so far. A last line that was cut, or one that is no record, is passed over."""
        try:
            lines = (self.own / _ANSWERS).read_bytes().split(b"\n")
        except FileNotFoundError:
            return []
        found: list[Record] = []
        for line in lines:
            with suppress(ValueError):
                record = json.loads(line)
                if isinstance(record, dict):
                    found.append(record)
        return found

    def planned_orders(self) -> list[tuple[str, list[str]]]:
        """The participants and orders of the study's own table, in the table's order."""
        return [
            (row["participant"].strip(), [part.strip() for part in row["sequence"].split("-")])
            for row in self._rows(self.study.participants)
            if row.get("participant") and row.get("sequence")
        ]

    def tables(self, participants: Iterable[Mapping[str, str]], ratings: Iterable[Mapping[str, str]]) -> None:
        """Write participants.csv and questionnaires.csv anew; what else stands in them stays."""
        new = list(participants)
        if self.study.participants is not None and new:
            self._write(self.study.participants, _merged(self._rows(self.study.participants), new, ("participant",)))
        rated = list(ratings)
        if self.study.questionnaires is not None and rated:
            people, asked = ({row[column] for row in rated} for column in ("participant", "questionnaire"))
            others = [  # an answer of an attempt that was set aside is not there any more
                row
                for row in self._rows(self.study.questionnaires)
                if not (row.get("participant") in people and row.get("questionnaire") in asked)
            ]
            self._write(self.study.questionnaires, [*others, *rated])

    def _rows(self, name: str | None) -> list[dict[str, str]]:
        if name is None:
            return []
        try:
            text = inside(self.folder, name, "study.yaml", must_exist=False).read_text(encoding="utf-8-sig")
        except FileNotFoundError:
            return []
        return list(csv.DictReader(io.StringIO(text)))

    def _write(self, name: str, rows: Sequence[Mapping[str, str]]) -> None:
        path = inside(self.folder, name, "study.yaml", must_exist=False)
        path.parent.mkdir(parents=True, exist_ok=True)
        columns = list(dict.fromkeys(column for row in rows for column in row))
        beside = path.with_name(path.name + ".new")
        with beside.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
        _sync_folder(path.parent)


def known_plan(empty: Plan, journal: Journal, digest: str, goes_on: bool) -> Plan:
    """Where the study stands. Raises PipelineError if study.yaml has changed since a session was recorded."""
    logs = journal.found_logs()
    changed = [log for log in logs if log.digest not in ("", digest)]
    if changed and not goes_on:
        first = changed[0]
        raise PipelineError(
            f"{journal.folder / 'study.yaml'}: has changed since {first.participant} in {first.condition} was recorded;"
            " change it back, or add --continue to record the others with what it says now"
        )
    known = plan.planned(empty, journal.planned_orders())
    for record in journal.records():
        known = plan.after(known, record)
    return plan.with_logs(known, logs)


def _merged(
    there: Sequence[Mapping[str, str]], new: Sequence[Mapping[str, str]], key: tuple[str, ...]
) -> list[dict[str, str]]:
    """The rows of a table with new ones in the place of those with the same key; other columns stay."""
    rows = {tuple(row.get(column, "") for column in key): dict(row) for row in there}
    for row in new:
        rows.setdefault(tuple(row[column] for column in key), {}).update(row)
    return list(rows.values())


def _read(path: Path, wanted: list[Wanted]) -> Any:
    from pipeline.sessions.logs import mcap

    return mcap.read(path, wanted) if path.suffix == PART else read_log(path, wanted)


def to_disk(file: BinaryIO) -> None:
    """Return once the disk has what was written."""
    file.flush()
    os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """Make a new name last; Windows has no such call, and needs none."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _is_alive(process: int) -> bool:
    if os.name == "nt":  # there a signal of 0 would end the process
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
