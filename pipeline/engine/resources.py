"""What a run needs beside the study: a cache, an executor, and somebody who is told."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Protocol

from pipeline.engine.cache import Cache


class Progress(Protocol):
    """Who is told how far things are."""

    def begin(self, stage: str, total: int) -> None:
        """A stage is about to compute so many pieces of work."""

    def advance(self) -> None:
        """One piece is done."""

    def end(self) -> None:
        """The stage is done."""


@dataclass(frozen=True)
class Means:
    """Where results are kept, where they are computed, and who is told."""

    cache: Cache
    executor: Executor
    progress: Progress
