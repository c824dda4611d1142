"""Small jobs of one stage that may be done side by side, such as drawing a report's figures."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future, wait
from types import TracebackType
from typing import Any

from pipeline.engine.processes import InThisProcess
from pipeline.errors import WorkerLostError


class Jobs:
    """Jobs that an executor does in the background; at the end of the `with` block all of them are done.

    A job is a module's function with arguments that can be pickled, and writes a file of its own. So it does not matter
    which process does it or when. The executor begins with the first job. At the end of the block this process helps,
    beginning with the last, and repeats jobs whose process died. Without an executor, each job is done in this process
    when it is added.
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
            # After an error the folder that the jobs write into is about to be removed: none must still be writing.
            for future, _ in self._added:
                future.cancel()
            wait([future for future, _ in self._added])

    def _finish(self) -> None:
        for future, do_here in reversed(self._added):
            if future.cancel():  # no process has begun it
                do_here()
        for future, do_here in self._added:
            if future.cancelled():
                continue
            try:
                future.result()
            except WorkerLostError:
                do_here()
