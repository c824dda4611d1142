"""Connections to senders that are asked for readings, and what is heard from them."""

from __future__ import annotations

import asyncio
import os
import platform
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractAsyncContextManager, contextmanager
from functools import cache
from typing import Any

import pytest

from pipeline.live.adapters import foxglove, rosbridge
from pipeline.live.adapters.client import Client
from pipeline.live.adapters.feeds import Feed
from pipeline.live.adapters.talk import Talk
from pipeline.live.events import Link, Reading
from pipeline.live.units import units
from pipeline.study.recording import Foxglove, Lsl, Rosbridge, Sender
from tests.pipeline.live.servers import POSITION

SUBPROTOCOLS = ("foxglove.sdk.v1",)


def talk(port: int, kind: str = "rosbridge") -> Talk:
    feed = Feed("tracker", "position", units(Sender(lsl=Lsl(name="Hand"), unit="m")))
    url = f"ws://127.0.0.1:{port}"
    if kind == "foxglove":
        return foxglove.Talk(feed, Foxglove(url=url, topic=POSITION))
    return rosbridge.Talk(feed, Rosbridge(url=url, topic=POSITION, type="geometry_msgs/PointStamped"))


def heard(
    of: Talk, until: Callable[[list[Any]], bool], beside: AbstractAsyncContextManager[Any]
) -> tuple[list[Any], Counter[str]]:
    """What a client says until something is so; the servers `beside` are there before it first asks."""
    found: list[Any] = []

    async def listen() -> Counter[str]:
        async with beside:
            asked = Client(of, found.append, time.time_ns)
            asking = asyncio.create_task(asked.run())
            try:
                async with asyncio.timeout(20):
                    while not until(found):
                        await asyncio.sleep(0.001)
            finally:
                asking.cancel()
                await asyncio.gather(asking, return_exceptions=True)
        return asked.refused

    refused = asyncio.run(listen())
    return found, refused


def problems(found: Sequence[Any]) -> list[str]:
    return [one.problem for one in found if isinstance(one, Link)]


def readings(found: Sequence[Any]) -> list[Reading]:
    return [one for one in found if isinstance(one, Reading)]


# --- Lab Streaming Layer


@cache
def loaded_lsl() -> Any:
    """pylsl, which finds no outlet of another process, and measures a clock in 0.2 s instead of 0.6 s.

    To be asked for before anything else is done with it. Skips where it cannot be loaded: it needs glibc 2.35.
    """
    try:
        import pylsl
    except (ImportError, OSError, RuntimeError) as error:
        pytest.skip(f"LSL cannot be loaded here ({platform.libc_ver()}): {error}")
    probing = "[tuning]\nTimeProbeInterval = 0.008\n"  # s between the eight questions after the time, else 0.064
    pylsl.set_config_content(f"[lab]\nSessionID = steadyhand {os.getpid()}\n{probing}")
    return pylsl


@contextmanager
def outlet(name: str, channels: int, values: Sequence[float], rate_hz: float) -> Iterator[None]:
    """An outlet that sends the same steadily."""
    pylsl = loaded_lsl()
    made = pylsl.StreamOutlet(pylsl.StreamInfo(name, "Test", channels, rate_hz, "double64", f"{name}-{time.time_ns()}"))
    if not any(one.name() == name for one in pylsl.resolve_byprop("name", name, 1, timeout=3.0)):
        pytest.skip("no LSL stream of this computer's own can be found here: its network passes no multicast")
    stop = threading.Event()

    def push() -> None:
        while not stop.wait(1 / rate_hz):
            made.push_sample(list(values))

    sending = threading.Thread(target=push)
    sending.start()
    try:
        yield
    finally:
        stop.set()
        sending.join()
