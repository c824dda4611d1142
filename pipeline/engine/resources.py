"""What a run needs beside the study: a cache, an executor, and someone who is told how far it is."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

from pipeline.engine.cache import Cache
from pipeline.engine.progress import Progress


@dataclass(frozen=True)
class Resources:
    """Where results are kept, where they are computed, and who is told.

    From `archive_sessions` sessions on, a stage of the whole study is computed in a process of its own. Pieces of one
    session are computed in groups, as far as that leaves `fewest_groups` groups for the processes to share. Neither
    changes a result; tests set them low.
    """

    cache: Cache
    executor: Executor
    progress: Progress
    archive_sessions: int = 1000
    fewest_groups: int = 64
