"""Where work is done: in this process, or in processes that may die without taking the others with them."""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
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
    """Up to `count` processes of this machine. Each computes one call at a time, for which a thread waits here.

    Python's own ProcessPoolExecutor is not used because it breaks as a whole when one of its processes dies, and
    does not say which call killed it. Here a process that dies takes one call with it, whose future raises
    WorkerLostError, and another takes its place. A process ends when this one does, however that ends.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._threads = ThreadPoolExecutor(count)
        self._started: list[_Process] = []
        self._idle: list[_Process] = []
        self._stopping = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute in the next process that is free; none is started before there is work."""
        return self._threads.submit(self.call, fn, args, kwargs)

    def call(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        """Compute in some process, and wait for it."""
        try:
            process = self._idle.pop()  # the last one used, so that few calls at once need few processes
        except IndexError:
            process = _Process()
            self._started.append(process)
        if self._stopping:  # `shutdown` may have gone through the list before this one was in it
            process.stop()
        try:
            return process.call(fn, args, kwargs)
        finally:
            if process.alive:
                self._idle.append(process)

    @contextmanager
    def all_but_one(self) -> Iterator[Executor | None]:
        """An executor over these processes that leaves one out, for a caller that is at work itself; None of one."""
        if self.count == 1:
            yield None
            return
        with _Fewer(self, self.count - 1) as fewer:
            yield fewer

    def end_idle(self) -> None:
        """End the processes, which gives their memory back; later calls start others. Only between calls."""
        for process in self._started:
            process.stop()
        self._started.clear()
        self._idle.clear()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Stop the processes, also those at work; a call they were at raises WorkerLostError."""
        self._stopping = True
        self._threads.shutdown(wait=False, cancel_futures=True)
        for process in self._started:
            process.stop()
        self._threads.shutdown(wait=wait, cancel_futures=True)


class _Fewer(Executor):
    """Some of the processes of an executor."""

    def __init__(self, processes: Processes, count: int) -> None:
        self._processes = processes
        self._threads = ThreadPoolExecutor(count)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute in one of them."""
        return self._threads.submit(self._processes.call, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for calls; the processes go on."""
        self._threads.shutdown(wait=wait, cancel_futures=cancel_futures)


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
