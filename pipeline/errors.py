"""What Steadyhand says when it cannot go on, and the one helper for naming what was meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path


class PipelineError(Exception):
    """A message for the user: the study, the file, the field, what was found and the remedy. No traceback."""

    exit_code = 2


class SessionError(PipelineError):
    """One session cannot be used; the others go on. Its text is the reason in the exclusions.

    `people` are ids of participants that its text quotes from the log.
    """

    def __init__(self, text: str, people: tuple[str, ...] = ()) -> None:
        super().__init__(text)
        self.people = people


class WorkerLostError(Exception):
    """The process that computed something died of it, or was killed; its text says by what."""


class DamagedTableError(PipelineError):
    """A table that was kept is not what was written: a disk or a copy of the cache is at fault."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)  # the one argument, so that the error can be handed from process to process
        self.path = path

    def __str__(self) -> str:
        return f"{self.path}: is damaged; run `steadyhand cache verify`, which removes it, and the command again"


RUN_AGAIN = "Finished work is cached: run the command again to continue"
"""The remedy wherever a run stops before its end."""


def did_you_mean(found: str, known: Iterable[str]) -> str:
    """`; did you mean "x"?` for the likeliest of the known words, else what there is to choose from."""
    words = list(known)
    close = difflib.get_close_matches(found, words, n=1, cutoff=0.5)
    if close:
        return f'; did you mean "{close[0]}"?'
    return f"; known: {', '.join(words)}" if words else ""
