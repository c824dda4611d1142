"""A recorder over real sockets, and pages that talk with it."""

from __future__ import annotations

import asyncio
import json
import socket
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import websockets

from pipeline.live import loop, study_run
from pipeline.live.access import Access
from pipeline.live.certificates import Certificates
from pipeline.live.journal import Journal
from pipeline.live.record import opened, serve
from pipeline.live.setup import warm_up
from tests.pipeline.live.studies import STUDY, study_in

Page = Any
SENDERS = (
    "senders: {tracker: {udp_json: {port: PORT}, axes: [x, z, -y], unit: cm}, imu: {udp_json: {port: PORT}, unit: g}}"
)


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    """A port that nobody listens on."""
    with socket.socket(socket.AF_INET, kind) as made:
        made.bind(("127.0.0.1", 0))
        return int(made.getsockname()[1])


@dataclass
class Running:
    """A study that is served."""

    access: Access
    folder: Path
    udp_port: int

    def headers(self, role: str) -> dict[str, Any]:
        """Those of a page that was let in."""
        name, token = self.access.cookie(role), self.access.tokens[role]  # type: ignore[arg-type,index]
        return {"Cookie": f"{name}={token}"}

    def page(self, role: str, **changes: Any) -> Any:
        """A page's socket."""
        given = {"additional_headers": self.headers(role), "origin": self.access.origin, **changes}
        return websockets.connect(f"ws://127.0.0.1:{self.access.port}/socket/{role}", **given)

    async def asks(
        self, method: str, path: str, body: bytes = b"", **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """A request and its answer: status, headers, body."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.access.port)
        sent = {
            "Host": f"127.0.0.1:{self.access.port}",
            "Content-Length": str(len(body)),
            "Connection": "close",
            **headers,
        }
        lines = [f"{method} {path} HTTP/1.1", *(f"{name}: {value}" for name, value in sent.items()), "", ""]
        writer.write("\r\n".join(lines).encode() + body)
        answer = await reader.read()
        writer.close()
        head, _, content = answer.partition(b"\r\n\r\n")
        first, *rest = head.decode().split("\r\n")
        return int(first.split()[1]), {n.lower(): v for n, _, v in (line.partition(": ") for line in rest)}, content


def served(
    folder: Path,
    play: Callable[[Running], Awaitable[None]],
    text: str = STUDY,
    access: Access | None = None,
    certificates: Certificates | None = None,
) -> None:
    """Serve a study while `play` is played; on this computer alone unless `access` says otherwise.

    Lights, and what is refused, are told ten times as often as to people, so that nothing waits for them.
    """
    udp_port = free_port(socket.SOCK_DGRAM)
    access = access or Access("http", "127.0.0.1", free_port())
    port = access.port
    study, setup = study_in(folder, text.replace("PORT", str(udp_port)))
    journal = Journal(folder, study)
    journal.hold()
    warm_up(setup)

    async def run() -> None:
        with closing(opened(access, certificates)) as doors:
            serving = asyncio.create_task(serve(setup, folder, journal, access, doors, setup.empty_plan()))
            try:
                await _answers(port)
                await asyncio.wait_for(play(Running(access, folder, udp_port)), 60)
            finally:
                serving.cancel()
                with suppress(asyncio.CancelledError):
                    await serving

    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(study_run, "LIGHTS_NS", 20_000_000)
            patch.setattr(loop, "COUNT_NS", 100_000_000)
            asyncio.run(run())
    finally:
        journal.release()


async def _answers(port: int) -> None:
    """Wait until the server answers."""
    while True:
        try:
            _, writer = await asyncio.open_connection("127.0.0.1", port)
        except OSError:
            await asyncio.sleep(0.002)
            continue
        writer.close()
        return


async def says(page: Page, /, **message: object) -> None:
    await page.send(json.dumps(message))


async def hears(page: Page, kind: str, /, **fields: object) -> dict[str, Any]:
    """The next message of a type and with these fields."""
    while True:
        message: dict[str, Any] = json.loads(await page.recv())
        if message["type"] == kind and all(message.get(name) == value for name, value in fields.items()):
            return message


async def agreed(operator: Page) -> dict[str, Any]:
    """What the operator is told, after a task, of what was shown and its replay."""
    state = await hears(operator, "state", phase="questionnaire")
    while not state["agreement"]:
        state = await hears(operator, "state")
    agreement: dict[str, Any] = state["agreement"]
    return agreement


def at_once(study: str, countdown_s: float = 0.0) -> str:
    """A study whose tasks begin soon, and where one press may follow another at once: nobody's finger presses twice."""
    return study.replace("countdown_s: 1", f"countdown_s: {countdown_s}\n  selection: {{confirm_ms: 0}}")


async def press_through(phone: Page, drawn: int) -> None:
    """Draw whatever comes, and press once a trial, when so many estimates of it are drawn, until the task is done."""
    of_trial, state = Counter[int](), ""
    while state != "done":
        message = json.loads(await phone.recv())
        if message["type"] == "state":
            state = message["state"]
        if message["type"] == "show":
            await says(phone, type="drawn", n=message["n"], t=0)
            if state == "running":
                of_trial[message["trial"]] += 1
                if of_trial[message["trial"]] == drawn:
                    await says(phone, type="select", n=message["n"], t=1)
