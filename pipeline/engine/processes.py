"""Where work is done: in this process, or in processes that may die without taking the others with them."""

from __future__ import annotations

import multiprocessing
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from pipeline.errors import WorkerLostError


class InThisProcess(Executor):
    """An executor that computes when it is asked to."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute now."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - handed on by the future
            future.set_exception(error)
        return future


class Processes(Executor):
    """Up to `count` processes of this machine, each with a thread here that hands it one call at a time.

    Python's own ProcessPoolExecutor is not used because it breaks as a whole when one of its processes dies, and
    does not say which call killed it. Here a process that dies takes one call with it, whose future raises
    WorkerLostError, and another takes its place. A process ends when this one does, however that ends.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._threads = ThreadPoolExecutor(count)
        self._own = threading.local()
        self._started: list[_Process] = []
        self._stopping = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute in the next process that is free; none is started before there is work."""
        return self._threads.submit(self._call, fn, args, kwargs)

    def _call(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        process: _Process | None = getattr(self._own, "process", None)
        if process is None or not process.alive:
            process = self._own.process = _Process()
            self._started.append(process)
        if self._stopping:  # `shutdown` may have gone through the list before this one was in it
            process.stop()
        return process.call(fn, args, kwargs)

    def end_idle(self) -> None:
        """End the processes, which gives their memory back; later calls start others. Only between calls."""
        for process in self._started:
            process.stop()
        self._started.clear()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Stop the processes, also those at work; a call they were at raises WorkerLostError."""
        self._stopping = True
        self._threads.shutdown(wait=False, cancel_futures=True)
        for process in self._started:
            process.stop()
        self._threads.shutdown(wait=wait, cancel_futures=True)


def in_a_process_of_its_own(fn: Callable[..., Any], *args: Any) -> Any:
    """What the call gives; the process, which may start others, ends with it, and gives all its memory back.

    Raises WorkerLostError where it dies.
    """
    process = _Process(may_start_others=True)
    try:
        return process.call(fn, args, {})
    finally:
        process.stop()


class _Process:
    """A process that computes what comes through a pipe. Where the other end closes, it ends."""

    def __init__(self, may_start_others: bool = False) -> None:
        # Spawned, not forked: a fork would copy the locks of this process's threads in whatever state they are.
        context = multiprocessing.get_context("spawn")
        self._here, there = context.Pipe()
        self._process = context.Process(target=_serve, args=(there,), daemon=not may_start_others)
        self._process.start()
        there.close()  # the process alone holds that end now, so that its death shows here as an end of file
        self.alive = True

    def call(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        try:
            self._here.send((fn, args, kwargs))
            error, value = self._here.recv()
        except (EOFError, OSError):
            self.alive = False
            self._process.join()
            code = self._process.exitcode
            raise WorkerLostError(f"signal {-code}" if code is not None and code < 0 else f"exit code {code}") from None
        if error is not None:
            raise error
        return value

    def stop(self) -> None:
        self.alive = False
        self._process.terminate()
        self._process.join(5)
        self._process.kill()


def _serve(pipe: Connection) -> None:
    """Compute until the pipe closes. Ctrl-C is for the process that asked; SIGTERM lets what is open be put away."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    with suppress(EOFError, OSError):
        while True:
            fn, args, kwargs = pipe.recv()
            answer: tuple[Exception | None, Any]
            try:
                answer = (None, fn(*args, **kwargs))
            except Exception as error:  # noqa: BLE001 - handed to the process that asked
                answer = (error, None)
            pipe.send(answer)
