"""Many small jobs in two processes: another one takes them from the last on, this one from the first."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

_WORTH_A_PROCESS = 14  # fewer are done before another process has started


@dataclass(frozen=True)
class Job:
    """A function of the module that it is found in, which writes files, and its arguments."""

    function: Callable[..., None]
    arguments: tuple[Any, ...]

    def do(self) -> None:
        """Call it."""
        self.function(*self.arguments)


def carry_out(jobs: Sequence[Job]) -> None:
    """Do all of them; what they write must not depend on which process does them. The last is begun early."""
    if len(jobs) < _WORTH_A_PROCESS or (os.cpu_count() or 1) < 2:
        for job in jobs:
            job.do()
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(1, context, signal.signal, (signal.SIGINT, signal.SIG_IGN))
    try:
        waiting = [pool.submit(job.do) for job in reversed(jobs)]
        for job, future in zip(jobs, reversed(waiting), strict=True):
            if future.cancel():
                job.do()
                continue
            try:
                future.result()
            except BrokenExecutor:  # that process died: what it had not done is done here
                job.do()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
