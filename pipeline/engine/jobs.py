"""Small jobs of one stage that may be done side by side, such as drawing a report's figures."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future, wait
from types import TracebackType
from typing import Any

from pipeline.engine.processes import InThisProcess
from pipeline.errors import WorkerLostError


class Jobs:
    """Jobs that an executor does meanwhile; at the end of the `with` block all of them are done.

    A job is a function of a module, with arguments that can be pickled, that writes a file of its own. So it does not
    matter which process does it or when. The executor begins with the first; at the end of the block this process
    helps, beginning with the last, and does once more what a process was at that died. Without an executor each job
    is done here, when it is added.
    """

    def __init__(self, executor: Executor | None = None) -> None:
        self._executor = executor or InThisProcess()
        self._added: list[tuple[Future[None], Callable[[], None]]] = []

    def add(self, function: Callable[..., None], *arguments: Any) -> None:
        """Hand a job over."""
        self._added.append((self._executor.submit(function, *arguments), lambda: function(*arguments)))

    def __enter__(self) -> Jobs:
        return self

    def __exit__(self, kind: type[BaseException] | None, _error: object, _traceback: TracebackType | None) -> None:
        """Wait for the jobs, and raise the error of the first that failed."""
        try:
            if kind is None:
                self._finish()
        finally:
            # Whoever failed, the folder that the jobs write into is about to go: none must still be writing then.
            for future, _ in self._added:
                future.cancel()
            wait([future for future, _ in self._added])

    def _finish(self) -> None:
        for future, do_here in reversed(self._added):
            if future.cancel():  # nobody has begun it
                do_here()
        for future, do_here in self._added:
            if future.cancelled():
                continue
            try:
                future.result()
            except WorkerLostError:
                do_here()
