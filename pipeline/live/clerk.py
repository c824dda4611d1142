"""Carries out what the core wants done with files, in order, and says what came of it; here files may block."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from pipeline.live.events import Action, Agreed, Close, Closed, Disk, Event, Open, Resolve, Save, Saved, Tables, Write
from pipeline.live.journal import Journal
from pipeline.study.session import Session
from pipeline.study.settings import Study

FileAction = Open | Write | Close | Resolve | Save | Tables


def agreement(study: Study, folder: Path, log: Path, participant: str, condition: str) -> tuple[float, int] | None:
    """How far what was shown is from the replay of a log, in mm, and of how many estimates; as a report computes it.

    None where nothing was shown, or the log cannot be read.
    """
    from pipeline.engine.stage import Work
    from pipeline.errors import SessionError
    from pipeline.sessions import assess, ingest, recording

    session = Session(log.stem, participant, condition, log)
    with tempfile.TemporaryDirectory(prefix="steadyhand-") as out:
        work = Work("", study, folder, Path(out), (session,))
        try:
            ingest.run(work, with_checks=False)
        except SessionError:
            return None
        rows = assess.agreement(work, recording.load(study, Path(out)))
    if not rows or "max_mm" not in rows[0]:
        return None
    return float(rows[0]["max_mm"]), int(rows[0]["n"])


Check = Callable[[Study, Path, Path, str, str], tuple[float, int] | None]


class Clerk:
    """Does file actions on a journal. `check` holds a log that has just been closed against what was shown."""

    def __init__(self, journal: Journal, check: Check | None = agreement) -> None:
        self.journal, self._check = journal, check
        self._open = "", ""

    def perform(self, actions: Iterable[Action], now_ns: Callable[[], int]) -> list[Event]:
        """Do them; a fault of the disk is an event too, and what could not be done is not said to be."""
        found: list[Event] = []
        messages = []
        saves = []
        for action in actions:
            try:
                if isinstance(action, Write):
                    messages.append(action.message)
                    continue
                if isinstance(action, Save):
                    saves.append(action)
                    continue
                self.journal.write(messages)
                messages.clear()
                found += self._saved(saves, now_ns)
                saves.clear()
                found += self._do(action, now_ns)
            except (OSError, ValueError) as fault:
                found.append(self.disk(now_ns(), fault))
        try:
            self.journal.write(messages)
            found += self._saved(saves, now_ns)
        except (OSError, ValueError) as fault:
            found.append(self.disk(now_ns(), fault))
        return found

    def flush(self, now_ns: Callable[[], int]) -> Disk:
        """Put everything on the disk, and say how it stands."""
        try:
            self.journal.flush()
        except OSError as fault:
            return self.disk(now_ns(), fault)
        return self.disk(now_ns())

    def disk(self, at_ns: int, fault: Exception | None = None) -> Disk:
        """How the disk stands."""
        if fault is not None:
            reason = getattr(fault, "strerror", None) or fault
            return Disk(
                at_ns, 0, None, None, f"{reason}. What is on the disk is kept; make room or choose another folder."
            )
        written = at_ns if self.journal.log_bytes is not None else None
        return Disk(at_ns, self.journal.free_bytes(), self.journal.log_bytes, written)

    def _saved(self, saves: list[Save], now_ns: Callable[[], int]) -> list[Event]:
        if not saves:
            return []
        self.journal.save([save.record for save in saves])
        at = now_ns()
        return [Saved(save.token, at) for save in saves if save.token]

    def _do(self, action: Action, now_ns: Callable[[], int]) -> list[Event]:
        if isinstance(action, Open):
            self._open = action.participant, action.condition
            self.journal.open(action.participant, action.condition, action.facts)
        elif isinstance(action, Tables):
            self.journal.tables(action.participants, action.ratings)
        elif isinstance(action, Resolve):
            path = self.journal.resolve(action.participant, action.condition, set_aside=action.set_aside)
            return [Closed(self._name(path), now_ns())]
        elif isinstance(action, Close):
            return self._close(action, now_ns)
        return []

    def _close(self, action: Close, now_ns: Callable[[], int]) -> list[Event]:
        try:
            path = self.journal.close(set_aside=action.set_aside)
        except OSError as fault:  # the log stays, cut; the study goes on where it can
            self.journal.abandon()
            return [self.disk(now_ns(), fault), Closed("", now_ns())]
        if path is None:
            return [Closed("", now_ns())]
        closed = Closed(self._name(path), now_ns())
        if action.set_aside or self._check is None:
            return [closed]
        agreed = self._check(self.journal.study, self.journal.folder, path, *self._open)
        return [closed] if agreed is None else [closed, Agreed(closed.file, *agreed, now_ns())]

    def _name(self, path: Path) -> str:
        return path.relative_to(self.journal.folder.resolve()).as_posix()
