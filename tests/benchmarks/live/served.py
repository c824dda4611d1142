"""The server's process: so many studies in one event loop, each with its own folder and log, as one computer could run.

What it measures: from a sender's `sendto` to the estimate's hand-over to the phone's socket. Both ends stamp by this
machine's clock, so the kernel and everything that waited in the loop are in it.

It prints a line of JSON when pages can be opened, runs until its standard input ends, and prints what it measured.
"""

from __future__ import annotations

import asyncio
import json
import sys
import time
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.live import outgoing, record, setup
from pipeline.live.access import Access
from pipeline.live.adapters import websocket
from pipeline.live.events import Event, Reading, Said, Show
from pipeline.live.journal import Journal
from pipeline.live.loop import Loop
from pipeline.live.messages import Motion
from pipeline.live.outgoing import Outgoing, Shown
from pipeline.study.folder import load_study
from tests.benchmarks.live.study import write_study

_BINS, _BIN_MS = 20_000, 0.01
_PERCENT = (50.0, 99.0, 99.9)
_MEMORY_EVERY_S = 5.0


class Stopwatch:
    """Times between a reading's sending and its estimate's, in bins of 0.01 ms; the last bin is 200 ms and more."""

    def __init__(self) -> None:
        self.counts = np.zeros(_BINS, np.int64)
        self.sent_ms: float | None = None
        self._waiting: dict[int, float] = {}

    def watch(self) -> None:
        """Look over the shoulder of every loop and socket of this process."""
        happens, carry_out, to_json = Loop.happens, Loop._carry_out, outgoing.to_json

        def watched_happens(loop: Loop, event: Event) -> None:
            self.sent_ms = _sent_ms(event)
            happens(loop, event)
            self.sent_ms = None

        def watched_carry_out(loop: Loop, actions: Any) -> None:
            if self.sent_ms is not None:
                self._waiting |= {id(one.message): self.sent_ms for one in actions if isinstance(one, Show)}
            carry_out(loop, actions)

        def watched_to_json(message: Outgoing) -> bytes:
            if isinstance(message, Shown) and (sent := self._waiting.pop(id(message), None)) is not None:
                self.counts[min(max(int((time.time() * 1e3 - sent) / _BIN_MS), 0), _BINS - 1)] += 1
            return to_json(message)

        for where, name, watched in (
            (Loop, "happens", watched_happens),
            (Loop, "_carry_out", watched_carry_out),
            (websocket, "to_json", watched_to_json),
        ):
            setattr(where, name, watched)

    def percentiles_ms(self) -> dict[str, float]:
        """How long it took at the median, for 99 and for 99.9 %, and at most."""
        total = np.cumsum(self.counts)
        if not total[-1]:
            return {}
        found = {f"p{one:g}": float(np.searchsorted(total, total[-1] * one / 100) * _BIN_MS) for one in _PERCENT}
        return {**found, "max": float(np.flatnonzero(self.counts)[-1] * _BIN_MS), "shown": int(total[-1])}


def _sent_ms(event: Event) -> float | None:
    """When what happened was sent, by its sender, if it is a reading."""
    if isinstance(event, Reading):
        return event.sent_ms
    return event.message.t if isinstance(event, Said) and isinstance(event.message, Motion) else None


def memory_mb() -> float:
    """What this process holds in memory."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


async def _remember_memory(into: list[float]) -> None:
    while True:
        into.append(memory_mb())
        await asyncio.sleep(_MEMORY_EVERY_S)


async def _until_input_ends() -> None:
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)


async def _run(prepared: list[Any], announce: list[dict[str, Any]], memory: list[float]) -> float:
    """Serve until the input ends; the share of a core that it took."""
    serving = [asyncio.create_task(record.serve(*one)) for one in prepared]
    remembering = asyncio.create_task(_remember_memory(memory))
    await asyncio.sleep(0.5)
    began, before_s = time.monotonic(), time.process_time()
    print(json.dumps(announce), flush=True)
    await _until_input_ends()
    share = (time.process_time() - before_s) / (time.monotonic() - began)
    for task in (*serving, remembering):
        task.cancel()
    with suppress(asyncio.CancelledError):
        await asyncio.gather(*serving, remembering, return_exceptions=True)
    return share


def main(folder: Path, count: int) -> None:
    """Serve so many studies."""
    stopwatch, memory = Stopwatch(), list[float]()
    stopwatch.watch()
    record.let_others_wait()
    prepared, announce = list[Any](), list[dict[str, Any]]()
    with ExitStack() as stack:
        examiner = stack.enter_context(record.examiners())
        for number in range(count):
            one = folder / f"{number}"
            udp_port = write_study(one)
            study = load_study(one, to_be_made=True)
            made = setup.set_up(study, one)
            setup.warm_up(made)
            journal = Journal(one, study)
            journal.hold()
            stack.callback(journal.release)
            access = Access("http", "127.0.0.1", 0)
            inside = stack.enter_context(closing(record.opened(access, None)))
            access = replace(access, port=inside.inside.getsockname()[1])
            prepared.append((made, one, journal, access, inside, made.empty_plan(), examiner))
            cookies = {role: f"{access.cookie(role)}={token}" for role, token in access.tokens.items()}
            announce.append({"port": access.port, "udp": udp_port, "key": access.sensors, "cookies": cookies})
        stack.enter_context(record.nothing_to_search())
        share = asyncio.run(_run(prepared, announce, memory))
    print(json.dumps({**stopwatch.percentiles_ms(), "memory_mb": memory, "core": share}), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
