"""The result of a run: the entries of each stage, and what happened to the sessions."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from pipeline.engine.cache import Entry
from pipeline.study.pseudonyms import Pseudonyms
from pipeline.study.session import Session
from pipeline.study.settings import Study


class Damaged(NamedTuple):
    """A cached entry that was found damaged; `session` is empty for one of the whole study."""

    stage: str
    session: str
    damage: str


@dataclass
class Result:
    """A study brought up to date: the entries of each stage by session id, and what happened to the sessions.

    `sessions` are those that went through every stage. The entry of a stage of scope "study" has the session id "".
    `computed` counts, by stage, the pieces that the cache did not have. `set_aside`, `in_part` and `unused` (files)
    give the reason for each; `inputs` holds the SHA-256 of each of the study's files. `pseudonyms` are those under
    which the study was opened; None where it is shown as it is.
    """

    folder: Path
    study: Study
    sessions: list[Session] = field(default_factory=list)
    entries: dict[str, dict[str, Entry]] = field(default_factory=dict)
    computed: dict[str, int] = field(default_factory=dict)
    set_aside: list[tuple[Session, str]] = field(default_factory=list)
    in_part: list[tuple[Session, str]] = field(default_factory=list)
    unused: list[tuple[str, str]] = field(default_factory=list)
    damaged: list[Damaged] = field(default_factory=list)
    inputs: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    pseudonyms: Pseudonyms | None = None

    @property
    def name(self) -> str:
        """The study's name, which is its folder's."""
        return self.folder.name

    @property
    def named_inputs(self) -> dict[str, str]:
        """`inputs` by the names under which they are shown."""
        names = {} if self.pseudonyms is None else self.pseudonyms.files
        return {names.get(path, path): digest for path, digest in self.inputs.items()}

    @property
    def exit_code(self) -> int:
        """1 where some session was set aside or read in part."""
        return 1 if self.set_aside or self.in_part else 0

    def entry(self, stage: str) -> Path:
        """The folder of the entry of a stage of scope "study"."""
        return self.entries[stage][""].folder
