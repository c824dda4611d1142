"""What a stage is: the contract between the engine, which knows no stage, and the stages, which know no engine."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pipeline.study.pseudonyms import Pseudonyms
from pipeline.study.session import Session
from pipeline.study.settings import Study


@dataclass(frozen=True)
class Stage:
    """A stage: what it reads and which settings may change its output; it is given nothing else.

    `function` is "module:function", imported only when there is something to compute. A stage of scope "session" runs
    once per session, one of scope "study" once. `reads` names earlier stages, `settings` keys of study.yaml, `files`
    keys of study.yaml that name a file, `fixed_files` files under a fixed name that a study may have. `label` and
    `unit` are shown as progress: what is being done, and what its steps are.
    """

    name: str
    scope: Literal["session", "study"]
    function: str
    reads: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    fixed_files: tuple[str, ...] = ()
    reads_log: bool = False
    names_inputs: bool = False  # its output lists every file of the study that was read
    label: str = ""
    unit: str = "sessions"

    @property
    def module(self) -> str:
        """The module of its function."""
        return self.function.split(":")[0]


@dataclass(frozen=True)
class Outcome:
    """What a stage reports besides its tables.

    `set_aside` is the reason why the session cannot be used, `in_part` why it was read only in part; None otherwise.
    `participant` and `condition` are what the log says, where the file's name does not.
    """

    set_aside: str | None = None
    in_part: str | None = None
    participant: str | None = None
    condition: str | None = None


@dataclass(frozen=True)
class Work:
    """One piece of work. `study` holds the declared settings only, `entries` the folders of the stages read.

    For a stage of scope "study", `entries` holds one folder per session, in the order of `sessions`, for each session
    stage read, and one folder for each study stage read. `unused` are files among the sessions that are not logs, with
    the reason. The result is written into the folder `out`.

    `pseudonyms` are handed to stages that read the study's own files, whose ids they replace at once; all else that a
    stage is given is under them already.

    `executor` may take small jobs of a stage of scope "study" (pipeline.engine.jobs); None if they are to be done in
    this process. No result may depend on it, so it is in no key.
    """

    study_name: str
    study: Study
    folder: Path
    out: Path
    sessions: tuple[Session, ...] = ()
    entries: Mapping[str, tuple[Path, ...]] = field(default_factory=dict)
    set_aside: tuple[tuple[Session, str], ...] = ()
    in_part: tuple[tuple[Session, str], ...] = ()
    unused: tuple[tuple[str, str], ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)
    pseudonyms: Pseudonyms | None = None
    executor: Executor | None = None

    @property
    def session(self) -> Session:
        """The one session of a stage of scope "session"."""
        (session,) = self.sessions
        return session

    def entry(self, stage: str) -> Path:
        """The one folder of an earlier stage."""
        (folder,) = self.entries[stage]
        return folder
