"""Puts a run together: folder, core, server and senders, and takes it apart again."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import uvicorn

from pipeline.errors import PipelineError
from pipeline.live import setup
from pipeline.live.access import Access
from pipeline.live.adapters import osc, udp
from pipeline.live.clerk import Clerk
from pipeline.live.journal import Journal, known_plan
from pipeline.live.loop import Clock, Loop
from pipeline.live.messages import FRAME_BYTES
from pipeline.live.plan import Plan
from pipeline.live.server import app
from pipeline.live.setup import Setup
from pipeline.study.settings import Study


@dataclass(frozen=True)
class Serving:
    """How a study is served. `goes_on`: even if study.yaml has changed since the first session."""

    host: str = "127.0.0.1"
    port: int = 8443
    demo: bool = False
    goes_on: bool = False


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens. Raises PipelineError where it cannot."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    made = socket.socket(family, socket.SOCK_STREAM)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((host, port))
    except OSError as error:
        made.close()
        raise PipelineError(
            f"{host}:{port} cannot be listened on: {error.strerror or error}; choose another with --port"
        ) from None
    return made


async def serve(made: Setup, folder: Path, journal: Journal, access: Access, on: socket.socket, known: Plan) -> None:
    """Run the study until the server is stopped."""
    loop = Loop(made, folder, Clerk(journal, check=None), known, Clock())
    receivers = await _listen_for_senders(made, loop, access)
    config = uvicorn.Config(
        app(loop, access),
        ws="websockets-sansio",
        ws_max_size=FRAME_BYTES,
        ws_per_message_deflate=False,
        log_level="warning",
        access_log=False,
        server_header=False,
        date_header=False,
        lifespan="off",
        timeout_graceful_shutdown=1,
    )
    going = asyncio.create_task(loop.go())
    try:
        serving = asyncio.create_task(uvicorn.Server(config).serve(sockets=[on]))
        await asyncio.wait((going, serving), return_when=asyncio.FIRST_COMPLETED)
        if going.done():
            serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
    finally:
        for receiver in receivers:
            receiver.close()
        if not going.done():
            going.cancel()
        with suppress(asyncio.CancelledError):
            await going


async def _listen_for_senders(made: Setup, loop: Loop, access: Access) -> list[asyncio.DatagramTransport]:
    found: list[asyncio.DatagramTransport] = []
    receivers: dict[int, udp.Limited] = {}
    for sender in made.recording.senders.values():
        if sender.udp_json is not None:
            streams = udp.expected(made, sender.udp_json.port)
            receivers[sender.udp_json.port] = udp.Receiver(streams, access.sensors, loop.happens, loop.now_ns)
        if sender.osc is not None:
            addresses = osc.expected(made, sender.osc.port)
            receivers[sender.osc.port] = osc.Receiver(addresses, loop.happens, loop.now_ns)
    for port, receiver in sorted(receivers.items()):
        try:
            found.append(await udp.listen(access.host, port, receiver))
        except OSError as error:
            raise PipelineError(
                f"port {port} of recording: senders cannot be listened on: {error.strerror or error}; choose another"
            ) from None
    return found


def record(
    folder: Path, study: Study, options: Serving, ready: Callable[[Setup, Access], None], warming: Callable[[], None]
) -> None:
    """Serve a study until Ctrl-C. `ready` is called with the addresses once pages can be opened."""
    simulated = "simulated by Steadyhand: a demo, the pointer was the hand" if options.demo else ""
    made = setup.set_up(study, folder, mouse=options.demo, simulated=simulated)
    journal = Journal(folder, study)
    journal.hold()
    try:
        known = known_plan(made.empty_plan(), journal, made.digest, options.goes_on)
        access = Access("http", options.host, options.port)
        made = replace(made, links=tuple((role, access.address(role)) for role in ("phone", "questionnaire")))
        with listening(options.host, options.port) as on:
            warming()
            setup.warm_up(made)
            ready(made, access)
            with suppress(KeyboardInterrupt):
                asyncio.run(serve(made, folder, journal, access, on, known))
    finally:
        journal.release()
