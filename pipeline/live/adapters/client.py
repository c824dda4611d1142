"""A WebSocket server that is asked for a stream: connected to, and again when it is gone. What is said is `Talk`."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.typing import Subprotocol

from pipeline.live.adapters.client_faults import why
from pipeline.live.adapters.feeds import READINGS_PER_SECOND
from pipeline.live.adapters.talk import Heard, Talk
from pipeline.live.events import Link, Reading
from pipeline.live.limits import Flow, admit

BACK_OFF_S = (0.25, 0.5, 1.0, 2.0)
NOTHING_YET_S = 3.0
_OPENING_S, _PING_S = 5.0, 2.0


class Client:
    """The connection. What is wrong with it is said by `Link`, once; `refused` counts what was not taken, by reason."""

    def __init__(self, talk: Talk, happens: Callable[[Link | Reading], None], now_ns: Callable[[], int]) -> None:
        self._talk, self._happens, self._now_ns = talk, happens, now_ns
        self._problem: str | None = None
        self._failures = 0
        self.refused: Counter[str] = Counter()

    async def run(self) -> None:
        """Connect, and listen until cancelled."""
        talk = self._talk
        while True:
            try:
                async with connect(
                    talk.url,
                    subprotocols=[Subprotocol(one) for one in talk.subprotocols] or None,
                    max_size=talk.longest,
                    compression=None,
                    open_timeout=_OPENING_S,
                    ping_interval=_PING_S,
                    ping_timeout=_PING_S,
                    proxy=None,  # a tracker's server is in the laboratory
                ) as socket:
                    await self._listen(socket)
            except (OSError, InvalidHandshake, InvalidURI, ConnectionClosed) as error:
                self._say(f"{why(error, talk.longest)} Trying again.")
            await asyncio.sleep(BACK_OFF_S[min(self._failures, len(BACK_OFF_S) - 1)])
            self._failures += 1

    async def _listen(self, socket: ClientConnection) -> None:
        """Until the connection is lost, which raises ConnectionClosed."""
        flow = Flow(READINGS_PER_SECOND, self._now_ns())
        begun = self._talk.begin(socket.subprotocol)
        waits = begun.problem is None
        await self._act(socket, begun)
        while True:
            try:
                frame = await asyncio.wait_for(socket.recv(), NOTHING_YET_S if waits else None)
            except TimeoutError:
                waits = False
                self._say(self._talk.nothing_yet())
                continue
            now = self._now_ns()
            flow, admitted = admit(flow, READINGS_PER_SECOND, now)
            if not admitted:
                self.refused[f"{self._talk.feed.stream}: too many frames"] += 1
                continue
            heard = self._talk.take(frame, now)
            if heard.readings:
                self._failures = 0
                self._say("")
            waits = waits and not heard.readings and heard.problem is None
            await self._act(socket, heard)

    async def _act(self, socket: ClientConnection, heard: Heard) -> None:
        for reading in heard.readings:
            self._happens(reading)
        if heard.refused:
            self.refused[f"{self._talk.feed.stream}: {heard.refused}"] += 1
        if heard.problem is not None:
            self._say(heard.problem)
        for answer in heard.answers:
            await socket.send(answer)

    def _say(self, problem: str) -> None:
        if problem != self._problem:
            self._problem = problem
            said = f"{self._talk.feed.stream}: {self._talk.url} {problem}" if problem else ""
            self._happens(Link(self._talk.feed.stream, said, self._now_ns()))
