"""The other side: phones and trackers that send as real ones do, an operator who always goes on, and a flood."""

from __future__ import annotations

import asyncio
import json
import math
import socket
import time
from contextlib import suppress
from typing import Any

import numpy as np
import websockets

_MOTION_S, _ORIENTATION_EVERY, _FRAME_S, _TRACKER_S = 0.01, 2, 1 / 60, 1 / 30
_PACES = ((0.11, 0.7), (0.05, 1.1), (0.04, 0.9))  # of x, y, z: how far in m, and Hz
_STILL_S, _BEFORE_S = 3.0, 9.0  # at rest; and before the first task, so that the heading is found
FLOOD_HZ = 20_000


def _place_m(since_s: float) -> list[float]:
    """Where the hand is, x, y, z, `since_s` after it has set off; at rest before."""
    moved = max(since_s, 0.0)
    return [far * (1 - math.cos(2 * math.pi * pace * moved)) for far, pace in _PACES]


def _felt_m_s2(since_s: float) -> list[float]:
    """Specific force of a phone that lies level, its x the tracker's: a browser's z is up, and the tracker's y."""
    moves = since_s >= 0
    turning = [2 * math.pi * pace for _, pace in _PACES]
    x, y, z = (
        far * rate**2 * math.cos(rate * since_s) if moves else 0.0
        for (far, _), rate in zip(_PACES, turning, strict=True)
    )
    return [x, -z, y + 9.80665]


class Rig:
    """One study's phone, tracker and operator, until `ends`, by the monotonic clock; `phase`, from 0 to 1, is its own.

    No two phones are in step: each begins to send at its own part of the time between two readings.
    """

    def __init__(self, announced: dict[str, Any], ends: float, phase: float) -> None:
        self.known, self.ends, self.phase = announced, ends, phase
        self.newest = self.drawn = 0
        self.sets_off = time.time() + _STILL_S
        self.answered: dict[str, float] | None = None

    async def run(self) -> None:
        """Go on until the end."""
        async with self._page("operator") as operator, self._page("phone") as phone:
            hello = {"type": "hello", "page": "phone", "version": 1, "agent": "a load", "wake_lock": True, "id": "load"}
            await phone.send(json.dumps({**hello, "permission": "granted", "secure": True}))
            parts = [self._operate(operator), self._hear(phone), self._move(phone), self._draw(phone), self._track()]
            tasks = [asyncio.create_task(part) for part in parts]
            await asyncio.sleep(max(self.ends - time.monotonic(), 0))
            for task in tasks:
                task.cancel()
            for outcome in await asyncio.gather(*tasks, return_exceptions=True):
                if isinstance(outcome, Exception):
                    raise outcome

    def _page(self, role: str) -> Any:
        where, cookie = f"127.0.0.1:{self.known['port']}", self.known["cookies"][role]
        headers = {"Cookie": cookie}
        return websockets.connect(f"ws://{where}/socket/{role}", origin=f"http://{where}", additional_headers=headers)  # type: ignore[arg-type]

    def _begins(self, every_s: float) -> float:
        """The next time at which it is this rig's turn, of those that come `every_s` seconds."""
        now = time.monotonic()
        return now + (self.phase * every_s - now) % every_s

    async def _operate(self, page: Any) -> None:
        """Begin whatever can be begun."""
        await asyncio.sleep(_BEFORE_S)
        count = 0
        while True:
            message = json.loads(await page.recv())
            if message["type"] == "state" and message["next"]["do"] == "start" and message["phase"] == "ready":
                count += 1
                await page.send(json.dumps({"type": "do", "what": "start", "text": "a load", "id": f"d{count}"}))

    async def _hear(self, page: Any) -> None:
        while True:
            message = json.loads(await page.recv())
            if message["type"] == "show":
                self.newest = message["n"]
            elif message["type"] == "pong":
                self.answered = {**{key: message[key] for key in ("t1", "t2", "t3")}, "t4": time.time() * 1e3}

    async def _move(self, page: Any) -> None:
        began = self._begins(_MOTION_S)
        for number in range(10**9):
            await _until(began + number * _MOTION_S)
            now = time.time() * 1e3
            common = {"seq": number, "t": now}
            if number % _ORIENTATION_EVERY == 0:
                q = [0.0, 0.0, 0.0, 1.0]
                await page.send(json.dumps({"type": "orientation", **common, "q": q, "absolute": False}))
            a = _felt_m_s2(now / 1e3 - self.sets_off)
            await page.send(json.dumps({"type": "motion", **common, "a": a, "l": None, "r": [0.0, 0.0, 0.0], "i": 10}))
            if number % 25 == 0:
                await page.send(json.dumps({"type": "ping", "t1": now, "last": self.answered}))

    async def _draw(self, page: Any) -> None:
        """The newest at each frame of the screen."""
        began = self._begins(_FRAME_S)
        for number in range(10**9):
            await _until(began + number * _FRAME_S)
            if self.newest != self.drawn:
                self.drawn = self.newest
                await page.send(json.dumps({"type": "drawn", "n": self.drawn, "t": time.time() * 1e3}))

    async def _track(self) -> None:
        """Each reading's z is its number in µm, so that the log tells of every one whether it is there."""
        began, random = self._begins(_TRACKER_S), np.random.default_rng(0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for number in range(10**9):
                await _until(began + number * _TRACKER_S)
                now = time.time()
                placed = np.array(_place_m(now - self.sets_off)) + random.normal(0, 2e-3, 3)
                x, y, _ = placed.tolist()
                reading = {"stream": "tracker", "seq": number, "t": now, "position": [x, y + 0.5, number * 1e-6]}
                data = json.dumps({"key": self.known["key"], **reading}).encode()
                sender.sendto(data, ("127.0.0.1", self.known["udp"]))


async def _until(at: float) -> None:
    await asyncio.sleep(max(at - time.monotonic(), 0))


def load(announced: list[dict[str, Any]], seconds: float) -> None:
    """Load every study for so long."""

    async def run() -> None:
        ends = time.monotonic() + seconds
        rigs = [Rig(one, ends, number / len(announced)) for number, one in enumerate(announced)]
        await asyncio.gather(*(rig.run() for rig in rigs))

    asyncio.run(run())


def flood(port: int, seconds: float) -> None:
    """Datagrams that mean nothing, from an address of their own."""
    ends, junk = time.monotonic() + seconds, b"\xff" * 100
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind(("127.0.0.5", 0))
        began, sent = time.monotonic(), 0
        while (now := time.monotonic()) < ends:
            for _ in range(max(int((now - began) * FLOOD_HZ) - sent, 0)):
                sent += 1
                with suppress(OSError):
                    sender.sendto(junk, ("127.0.0.1", port))
            time.sleep(0.001)
