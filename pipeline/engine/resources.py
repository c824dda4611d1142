"""What a run needs besides the study: a cache, an executor, and where to show progress."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

from pipeline.engine.cache import Cache
from pipeline.engine.progress import Progress


@dataclass(frozen=True)
class Resources:
    """Where results are kept, where they are computed, and where progress is shown.

    With `archive_sessions` sessions or more, a stage of the whole study is computed in a process of its own, which
    frees its memory. Pieces of one session are computed in groups, as long as there are at least `fewest_groups` groups
    for the processes to share. Neither changes a result; tests set them low.
    """

    cache: Cache
    executor: Executor
    progress: Progress
    archive_sessions: int = 1000
    fewest_groups: int = 64
