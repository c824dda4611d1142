"""Runs a study: one clock, events into the core, its actions carried out. The only owner of the state.

Everything happens in one thread, so there is nothing to lock. Files are written in a thread of their own, a batch at a
time and in order; what came of it is an event like any other. Every 0.5 s what was written is put on the disk.
"""

from __future__ import annotations

import asyncio
import time
from collections import Counter, deque
from collections.abc import Callable, Coroutine
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import WorkerLostError
from pipeline.live import checks, run_state, study_run
from pipeline.live.adapters.mouse import MouseHand
from pipeline.live.adapters.newcomers import Newcomers
from pipeline.live.clerk import Clerk, FileAction, agreement
from pipeline.live.events import (
    Accept,
    Action,
    Actions,
    Agreed,
    Closed,
    Dropped,
    Event,
    Examine,
    Examined,
    Joined,
    Left,
    Offered,
    Open,
    Replace,
    Role,
    Said,
    Show,
    Tell,
    Tick,
    WallClock,
    Woke,
    Write,
)
from pipeline.live.messages import Incoming, Mouse
from pipeline.live.outgoing import Outgoing, Shown, Whole
from pipeline.live.plan import Plan
from pipeline.live.setup import Setup
from pipeline.live.watch import Light
from pipeline.tables.columns import S_PER_NS

_TICK_S = 0.005
_FLUSH_NS = 500_000_000
_FILES_S = 0.1
_STOOD_STILL_S = 2.0
_WALL_CLOCK_NS = 10_000_000_000
COUNT_NS = 1_000_000_000
_SET_NS = 100_000_000  # by which a wall clock jumps when it is set; it drifts by 1 ms in 10 s
_MOST_WAITING = 256  # messages of one page: one that does not read is closed


class Clock:
    """Recorder time: the wall clock at start, and what the monotonic clock has counted since."""

    def __init__(
        self,
        wall_ns: Callable[[], int] = time.time_ns,
        steady_ns: Callable[[], int] = time.monotonic_ns,
        awake_or_not_ns: Callable[[], int] | None = None,
    ) -> None:
        self._wall_ns, self._steady_ns = wall_ns, steady_ns
        self._always_ns = awake_or_not_ns or _always_ns
        self._epoch_ns = wall_ns() - steady_ns()
        self._asleep_ns = self._always_ns() - steady_ns()
        self._wall_off_ns = 0

    def __call__(self) -> int:
        """Now, in ns."""
        return self._epoch_ns + self._steady_ns()

    def slept_s(self) -> float:
        """How long the computer has been suspended since this was last asked, where it can tell."""
        asleep = self._always_ns() - self._steady_ns()
        slept, self._asleep_ns = (asleep - self._asleep_ns) * S_PER_NS, asleep
        return slept

    def wall_clock(self) -> WallClock:
        """How the wall clock stands, and whether it was set since this was last asked."""
        now = self()
        off = self._wall_ns() - now
        was_set, self._wall_off_ns = abs(off - self._wall_off_ns) > _SET_NS, off
        return WallClock(off * 1e-6, was_set, now)


def _always_ns() -> int:
    """A clock that counts while the computer is suspended too, which Linux's monotonic one does not."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic_ns() if boot is None else time.clock_gettime_ns(boot)


class Outbox:
    """What waits to be sent to one page. Of states and lights only the newest waits.

    An estimate does not wait behind what the loop does for other phones: `at_once`, set by the page's connection, hands
    it over, unless something waits before it or the page does not read; then it is False, and has done nothing.

    It ends when too much waits (`full`), or when the page has another connection (`replaced`).
    """

    def __init__(self) -> None:
        self._waiting: deque[Outgoing] = deque()
        self._news = asyncio.Event()
        self.full = self.replaced = False
        self.at_once: Callable[[Outgoing], bool] | None = None

    def put(self, message: Outgoing) -> None:
        """One more message."""
        if isinstance(message, Shown) and self._is_sent(message):
            return
        if isinstance(message, Whole):
            kept = (one for one in self._waiting if not (isinstance(one, Whole) and one.type == message.type))
            self._waiting = deque(kept)
        self.full = self.full or len(self._waiting) >= _MOST_WAITING
        if not self.full:
            self._waiting.append(message)
        self._news.set()

    def _is_sent(self, message: Outgoing) -> bool:
        return self.at_once is not None and not self._waiting and not self.replaced and self.at_once(message)

    def replace(self) -> None:
        """Send nothing more."""
        self.replaced = True
        self._waiting.clear()
        self._news.set()

    async def get(self) -> Outgoing | None:
        """The next message, when there is one; None after the last."""
        while not self._waiting:
            if self.replaced:
                return None
            self._news.clear()
            await self._news.wait()
        return self._waiting.popleft()


class Loop:
    """A study that is run. `happens` takes events from adapters; `pages` are the outboxes by client."""

    def __init__(self, setup: Setup, folder: Path, clerk: Clerk, known: Plan, clock: Clock) -> None:
        self.run = run_state.begin(setup, known)
        self.now_ns, self.pages = clock, dict[int, Outbox]()
        self.refused: list[Counter[str]] = []  # of every adapter: what it did not take, by reason
        self.examiner: Executor | None = None  # does the checks; without it a thread does, which readings wait for
        self.newcomers = Newcomers()
        self._ticked_ns, self._wall_ns = clock(), clock()
        self._counted_ns, self._counts = clock(), Counter[str]()
        self._folder, self._clerk = folder, clerk
        self._files: list[Action] = []
        self._urgent = asyncio.Event()
        self._clients = count(1)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="journal")
        self._checks = set[asyncio.Task[None]]()
        self._opened = "", ""
        start = setup.task.path_mm[0] if setup.task.path_mm else setup.targets_mm[0]
        self._mouse = MouseHand(setup.study, dict(setup.streams), start, clock()) if setup.mouse else None

    # --- what adapters call

    def join(self, role: Role) -> tuple[int, Outbox]:
        """A page has connected."""
        client = next(self._clients)
        self.pages[client] = Outbox()
        self.happens(Joined(role, client, self.now_ns()))
        return client, self.pages[client]

    def leave(self, role: Role, client: int) -> None:
        """Its connection is gone."""
        self.pages.pop(client, None)
        self.happens(Left(role, client, self.now_ns()))

    def hear(self, role: Role, client: int, message: Incoming) -> None:
        """A page has sent a message."""
        if isinstance(message, Mouse):
            if self._mouse is not None and client == self.run.phone:
                self._mouse.points_at(message.x, message.y)
            return
        self.happens(Said(role, client, message, self.now_ns()))

    def happens(self, event: Event) -> None:
        """Anything that happens; what follows from it is done before this returns, files excepted."""
        self.run, actions = study_run.step(self.run, event)
        self._carry_out(actions)

    def _carry_out(self, actions: Actions) -> None:
        for action in actions:
            if isinstance(action, Tell | Show):
                page = self.pages.get(action.client)
                if page is not None:
                    page.put(action.message)
            elif isinstance(action, FileAction):
                if isinstance(action, Open):
                    self._opened = action.participant, action.condition
                self._files.append(action)
                if not isinstance(action, Write):
                    self._urgent.set()
            elif isinstance(action, Replace):
                if action.client in self.pages:
                    self.pages[action.client].replace()
            elif isinstance(action, Accept):
                self.newcomers.accept(action.stream, action.source)
            elif isinstance(action, Examine):
                self._beside(self._examine(action))

    def _beside(self, work: Coroutine[Any, Any, None]) -> None:
        """Do something slow, while everything else goes on."""
        task = asyncio.create_task(work)
        self._checks.add(task)
        task.add_done_callback(self._checks.discard)

    # --- what goes on by itself

    async def go(self) -> None:
        """Run until cancelled; what was logged until then is on the disk, cut."""
        ticking = asyncio.create_task(self._tick())
        filing = asyncio.create_task(self._file())
        try:
            await asyncio.gather(ticking, filing)
        finally:
            for task in (ticking, filing, *self._checks):
                task.cancel()
            await asyncio.gather(ticking, filing, return_exceptions=True)
            await asyncio.get_running_loop().run_in_executor(self._thread, self._last)
            self._thread.shutdown()

    def _last(self) -> None:
        self._clerk.perform(self._files, self.now_ns)
        with suppress(OSError):
            self._clerk.journal.flush()
        self._clerk.journal.abandon()

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(_TICK_S)
            now = self.now_ns()
            self._watch_clocks(now)
            self._count_refused(now)
            if self._mouse is not None:
                for reading in self._mouse.readings(now):
                    self.happens(reading)
            self.happens(Tick(now))

    def _watch_clocks(self, now: int) -> None:
        """Notice a computer that was suspended or stood still, and a wall clock that was set."""
        stood_s = max((now - self._ticked_ns) * S_PER_NS, self.now_ns.slept_s())
        self._ticked_ns = now
        if stood_s > _STOOD_STILL_S:
            self.happens(Woke(stood_s, now))
        if now - self._wall_ns >= _WALL_CLOCK_NS or stood_s > _STOOD_STILL_S:
            self._wall_ns = now
            self.happens(self.now_ns.wall_clock())

    def _count_refused(self, now: int) -> None:
        """Say that adapters have dropped more than before, and who is not heard, once a second."""
        if now - self._counted_ns < COUNT_NS:
            return
        offers = self.newcomers.waiting((now - self._counted_ns) * S_PER_NS)
        self._counted_ns = now
        if offers != self.run.offers:
            self.happens(Offered(offers, now))
        counts = sum(self.refused, Counter[str]())
        if counts != self._counts:
            self._counts = counts
            self.happens(Dropped(dict(counts), now))

    async def _file(self) -> None:
        running, flushed = asyncio.get_running_loop(), 0
        while True:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._urgent.wait(), _FILES_S)
            self._urgent.clear()
            batch, self._files = self._files, []
            events = await running.run_in_executor(self._thread, self._clerk.perform, batch, self.now_ns)
            if self.now_ns() - flushed >= _FLUSH_NS:
                flushed = self.now_ns()
                events.append(await running.run_in_executor(self._thread, self._clerk.flush, self.now_ns))
            for event in events:
                self.happens(event)
                if isinstance(event, Closed) and event.file and "set-aside" not in event.file:
                    self._beside(self._check(event.file, *self._opened))

    async def _examine(self, action: Examine) -> None:
        """Check the last readings."""
        try:
            running, study = asyncio.get_running_loop(), self.run.setup.study
            seen, claims = await running.run_in_executor(self.examiner, checks.examined, study, action.request)
        except (ArithmeticError, ValueError, IndexError, np.linalg.LinAlgError, WorkerLostError) as error:  # go on
            seen, claims = (), (Light(checks.CLAIMS, "amber", f"The last readings could not be checked: {error}."),)
        self.happens(Examined(seen, claims, self.now_ns()))

    async def _check(self, file: str, participant: str, condition: str) -> None:
        """Hold what was shown against the replay of the log, while the questionnaire is filled in."""
        study, path = self.run.setup.study, self._folder.resolve() / file
        agreed = await asyncio.to_thread(agreement, study, self._folder, path, participant, condition)
        if agreed is not None:
            self.happens(Agreed(file, *agreed, self.now_ns()))
