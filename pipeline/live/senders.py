"""The senders of a run: ports that are listened on, servers and outlets that are asked."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from itertools import product
from pathlib import Path
from typing import Any, Protocol

from pipeline.errors import PipelineError
from pipeline.live import cameras
from pipeline.live.access import LOOPBACK, Access
from pipeline.live.adapters import apps, foxglove, lsl, lsl_outlets, osc, rosbridge, udp
from pipeline.live.adapters.client import Client
from pipeline.live.adapters.feeds import feed
from pipeline.live.events import Link
from pipeline.live.loop import Loop
from pipeline.live.setup import Setup


class Open(Protocol):
    """A sender that is listened to."""

    def close(self) -> None:
        """Listen no more."""


def check(setup: Setup, where: str) -> None:
    """Raise PipelineError, beginning with `where`, for a sender that can never feed its stream."""
    for name, sender in setup.recording.senders.items():
        content = setup.streams[name].content
        if sender.rosbridge is not None:
            rosbridge.check(name, content, sender.rosbridge, where)
        if sender.app is not None:
            apps.check(name, content, sender.app, where)
        if sender.lsl is not None:
            lsl_outlets.check(name, content, sender.lsl, where)
    cameras.check(setup, where)


async def opened(setup: Setup, loop: Loop, access: Access, folder: Path) -> list[Open]:
    """All of them. Raises PipelineError where a port cannot be listened on, or a camera cannot be opened."""
    found: list[Open] = [*_asked(setup, loop)]
    receivers: dict[int, udp.Limited] = {}
    for sender in setup.recording.senders.values():
        if sender.udp_json is not None:
            streams = udp.expected(setup, sender.udp_json.port)
            receivers[sender.udp_json.port] = udp.Receiver(
                streams, access.sensors, loop.newcomers, loop.happens, loop.now_ns
            )
        if sender.osc is not None:
            addresses = osc.expected(setup, sender.osc.port)
            receivers[sender.osc.port] = osc.Receiver(addresses, loop.newcomers, loop.happens, loop.now_ns)
        if sender.app is not None:
            receivers[sender.app.port] = apps.Receiver(
                *apps.expected(setup, sender.app.port), loop.newcomers, loop.happens, loop.now_ns
            )
    for webcam in cameras.webcams(setup, folder, loop.happens, loop.now_ns):
        await webcam.begin()
        loop.refused.append(webcam.refused)
        found.append(webcam)
    loop.refused += [receiver.refused for receiver in receivers.values()]
    hosts = (LOOPBACK[0], access.host) if access.in_network else (access.host,)
    for (port, receiver), host in product(sorted(receivers.items()), hosts):
        try:
            found.append(await udp.listen(host, port, receiver))
        except OSError as error:
            raise PipelineError(
                f"port {port} of recording: senders cannot be listened on: {error.strerror or error}; choose another"
            ) from None
    return found


def _asked(setup: Setup, loop: Loop) -> list[Open]:
    """Those that this program asks for readings; they begin at once, and go on until they are closed."""
    found: list[Open] = []
    for name, sender in setup.recording.senders.items():
        if sender.rosbridge is not None or sender.foxglove is not None:
            of = feed(setup, name)
            talk = (
                rosbridge.Talk(of, sender.rosbridge)
                if sender.rosbridge is not None
                else foxglove.Talk(of, sender.foxglove)  # type: ignore[arg-type]
            )
            client = Client(talk, loop.happens, loop.now_ns)
            loop.refused.append(client.refused)
            found.append(_Running(name, client.run(), loop))
        if sender.lsl is not None:
            outlet = lsl.Outlet(feed(setup, name), sender.lsl, loop.happens, loop.now_ns)
            loop.refused.append(outlet.refused)
            outlet.listen()
            found.append(outlet)
    return found


class _Running:
    """A connection as a task. A fault of its own ends neither the study nor passes in silence."""

    def __init__(self, stream: str, work: Coroutine[Any, Any, None], loop: Loop) -> None:
        self._stream, self._loop = stream, loop
        self._task = asyncio.create_task(work)
        self._task.add_done_callback(self._ended)

    def _ended(self, task: asyncio.Task[None]) -> None:
        error = None if task.cancelled() else task.exception()
        if error is not None:
            problem = f"{self._stream}: internal error in its sender ({error!r}); please report it, and start anew."
            self._loop.happens(Link(self._stream, problem, self._loop.now_ns()))

    def close(self) -> None:
        """Listen no more."""
        self._task.cancel()
