"""Executors: this process, or several processes, one of which may die without affecting the others."""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, SpawnContext
from typing import Any

from pipeline.errors import WorkerLostError

# Spawned, not forked: a fork would copy the locks of this process's threads in whatever state they are.
SPAWN = multiprocessing.get_context("spawn")


def starting_with(modules: Sequence[str]) -> ForkServerContext | SpawnContext:
    """How processes start that have `modules` imported: forked from one process that has, which does nothing else.

    So however many there are, libraries are imported once, a second of work. That process has no threads but one of
    Arrow's allocator, which halts it for a fork. Spawned where the system's own libraries bear no fork, as on macOS.
    """
    if sys.platform != "linux":
        return SPAWN
    forked = multiprocessing.get_context("forkserver")
    forked.set_forkserver_preload(list(modules))
    return forked


class InThisProcess(Executor):
    """An executor that computes in this process, at once."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute now."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - handed on by the future
            future.set_exception(error)
        return future


class Processes(Executor):
    """Up to `count` processes of this machine. Each computes one call at a time, while a thread waits for it here.

    Python's own ProcessPoolExecutor is not used because it breaks as a whole when one of its processes dies, and
    does not say which call killed it. Here only the future of the call that was running raises WorkerLostError, and
    another process replaces the dead one. All processes end when this process ends, for whatever reason. `context`
    says how they start.
    """

    def __init__(self, count: int, context: ForkServerContext | SpawnContext = SPAWN) -> None:
        self.count = count
        self._context = context
        self._threads = ThreadPoolExecutor(count)
        self._started: list[_Process] = []
        self._idle: list[_Process] = []
        self._stopping = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute in the next process that is free; none is started before there is work."""
        return self._threads.submit(self.call, fn, args, kwargs)

    def call(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        """Compute in an idle process or a new one, and wait for the result."""
        try:
            process = self._idle.pop()  # the one used last, so that no more processes start than are needed at once
        except IndexError:
            process = _Process(self._context)
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
        """An executor over these processes except one, for a caller that works itself; None if there is only one."""
        if self.count == 1:
            yield None
            return
        with _SomeProcesses(self, self.count - 1) as fewer:
            yield fewer

    def end_idle(self) -> None:
        """End the processes, which frees their memory; later calls start new ones. Must not be called during a call."""
        for process in self._started:
            process.stop()
        self._started.clear()
        self._idle.clear()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Stop the processes, also busy ones; the calls that they were computing raise WorkerLostError."""
        self._stopping = True
        self._threads.shutdown(wait=False, cancel_futures=True)
        for process in self._started:
            process.stop()
        self._threads.shutdown(wait=wait, cancel_futures=True)


class _SomeProcesses(Executor):
    """An executor over some of the processes of another."""

    def __init__(self, processes: Processes, count: int) -> None:
        self._processes = processes
        self._threads = ThreadPoolExecutor(count)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute in one of them."""
        return self._threads.submit(self._processes.call, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for the calls; the processes themselves are not stopped."""
        self._threads.shutdown(wait=wait, cancel_futures=cancel_futures)


def call_in_own_process(fn: Callable[..., Any], *args: Any) -> Any:
    """The call's result, computed in a new process, which may start others and ends afterwards, freeing its memory.

    Raises WorkerLostError where the process dies.
    """
    process = _Process(SPAWN, may_start_others=True)
    try:
        return process.call(fn, args, {})
    finally:
        process.stop()


class _Process:
    """A process that computes the calls it receives through a pipe, and ends when the other end of the pipe closes."""

    def __init__(self, context: ForkServerContext | SpawnContext, may_start_others: bool = False) -> None:
        self._here, there = context.Pipe()
        self._process = context.Process(target=_serve, args=(there,), daemon=not may_start_others)
        self._process.start()
        there.close()  # only the process has that end open now, so if it dies, this end reads an end of file
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
    """Compute until the pipe closes. The parent process handles Ctrl-C; SIGTERM exits with clean-up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    with suppress(EOFError, OSError):
        while True:
            fn, args, kwargs = pipe.recv()
            answer: tuple[Exception | None, Any]
            try:
                answer = (None, fn(*args, **kwargs))
            except Exception as error:  # noqa: BLE001 - handed to the parent process
                answer = (error, None)
            pipe.send(answer)
