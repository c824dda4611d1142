"""A study's tables for a notebook: brought up to date as a command does, read when they are asked for."""

from __future__ import annotations

import multiprocessing
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from pipeline.analysis.person_means import person_means
from pipeline.engine import threads
from pipeline.engine.executors import PROCESS, executor_of
from pipeline.engine.folders import cache_in
from pipeline.engine.messages import damage_messages, session_messages
from pipeline.engine.progress import show_progress
from pipeline.engine.resources import Resources
from pipeline.engine.result import Result
from pipeline.engine.run import bring_up_to_date
from pipeline.errors import PipelineError, did_you_mean
from pipeline.stages import COMPARE, MODULES_OF_SESSIONS
from pipeline.study.session import Session
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.tables.catalogue import TABLES

STAGE_OF: Mapping[str, str] = {name: table.stage for name, table in TABLES.items() if table.stage}
"""The tables of a study by the stage that has them whole."""
_OF_SESSIONS = tuple(stage.name for stage in COMPARE if stage.scope == "session")

_MAIN = "MainProcess"  # what multiprocessing calls the process that was not started by another


@dataclass(frozen=True)
class Tables(Mapping[str, pd.DataFrame]):
    """A study's tables by name: `tables.comparisons`, or `tables["comparisons"]`. docs/tables.md lists their columns.

    A table of the whole study is read once and kept. What is of each session (positions, imu, tracks, …) is read anew
    each time it is asked for, of all sessions; `in_session` gives it of one.
    """

    study: Study
    sessions: tuple[Session, ...]
    _folders: Mapping[str, Sequence[Path]] = field(repr=False)
    _kept: dict[str, pd.DataFrame] = field(default_factory=dict, repr=False, compare=False)

    def __getitem__(self, name: str) -> pd.DataFrame:
        if name not in self._folders:
            raise KeyError(f'there is no table "{name}"{did_you_mean(name, self._folders)}')
        if name in self._kept:
            return self._kept[name]
        for folder in self._folders[name]:
            if not folder.is_dir():
                raise PipelineError(f"{folder}: has gone from the cache since the study was loaded; load it again")
        table = tables.read(name, self._folders[name])
        if STAGE_OF[name] not in _OF_SESSIONS:
            self._kept[name] = table
        return table

    def __getattr__(self, name: str) -> pd.DataFrame:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._folders)

    def __len__(self) -> int:
        return len(self._folders)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._folders]

    def __repr__(self) -> str:
        return f"<{len(self)} tables of {len(self.sessions)} sessions: {', '.join(self)}>"

    def in_session(self, session: str) -> Tables:
        """The tables of one session: those that are of each session. Raises KeyError where there is no such session."""
        ids = [one.id for one in self.sessions]
        if session not in ids:
            raise KeyError(f'there is no session "{session}"{did_you_mean(session, ids)}')
        at = ids.index(session)
        folders = {name: [where[at]] for name, where in self._folders.items() if STAGE_OF[name] in _OF_SESSIONS}
        return Tables(self.study, (self.sessions[at],), folders)

    def participant_means(self, measure: str) -> pd.DataFrame:
        """One row per participant and one column per condition, in the study's order; what `figures.paired` draws."""
        known = list(dict.fromkeys(self["measures"]["measure"]))
        if measure not in known:
            raise KeyError(f'there is no measure "{measure}"{did_you_mean(measure, known)}')
        return person_means(self.study, self["measures"], measure)


def load(folder: Path, cache: Path | None = None, jobs: int = 1, executor: str = PROCESS) -> Tables:
    """A study brought up to date. Sessions set aside and entries of the cache that were damaged are warnings.

    Raises PipelineError where nothing can be done.
    """
    if jobs > 1 and multiprocessing.current_process().name != _MAIN:
        raise PipelineError(
            "a script that loads with several jobs is run by each; put it under: if __name__ == '__main__'"
        )
    threads.limit_to_one_thread()
    with executor_of(jobs, executor, modules=MODULES_OF_SESSIONS) as opened, show_progress() as progress:
        result = bring_up_to_date(folder, COMPARE, Resources(cache_in(cache), opened, progress))
    for line in (*damage_messages(result), *session_messages(result)):
        warnings.warn(line, stacklevel=3)
    return _tables(result)


def _tables(result: Result) -> Tables:
    folders = {
        name: [result.entries[stage][key].folder for key in _keys(result, stage)] for name, stage in STAGE_OF.items()
    }
    return Tables(result.study, tuple(result.sessions), folders)


def _keys(result: Result, stage: str) -> list[str]:
    """By what a stage's entries are known: the sessions that went through every stage, or nothing for the study."""
    return [session.id for session in result.sessions] if stage in _OF_SESSIONS else [""]
