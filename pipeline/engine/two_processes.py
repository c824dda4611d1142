"""Many small jobs in two processes: another one takes them from the last on, this one from the first."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any


@dataclass(frozen=True)
class Job:
    """A function of the module that it is found in, which writes files, and its arguments."""

    function: Callable[..., None]
    arguments: tuple[Any, ...]

    def do(self) -> None:
        """Call it."""
        self.function(*self.arguments)


@contextmanager
def another_process(worth_it: bool, *modules: str) -> Iterator[Executor | None]:
    """A second process, which imports what the jobs need while this one prepares them; None where it is not worth it.

    Ctrl-C is for this process alone.
    """
    if not worth_it or (os.cpu_count() or 1) < 2:
        yield None
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(1, context, signal.signal, (signal.SIGINT, signal.SIG_IGN))
    try:
        pool.submit(_get_ready, modules)
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _get_ready(modules: Sequence[str]) -> None:
    for name in modules:
        import_module(name)


def carry_out(jobs: Sequence[Job], pool: Executor | None) -> None:
    """Do all of them; what they write must not depend on which process does them. The last is begun early."""
    waiting = [None if pool is None else pool.submit(job.do) for job in reversed(jobs)]
    for job, future in zip(jobs, reversed(waiting), strict=True):
        if future is None or future.cancel():
            job.do()
            continue
        try:
            future.result()
        except BrokenExecutor:  # that process died: what it had not done is done here
            job.do()
