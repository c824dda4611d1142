"""Puts a run together: folder, core, server and senders, and takes it apart again."""

from __future__ import annotations

import asyncio
import gc
import os
import socket
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import uvicorn
from starlette.applications import Starlette

from pipeline.engine.processes import Processes
from pipeline.errors import PipelineError
from pipeline.live import senders, setup
from pipeline.live.access import LOOPBACK, Access
from pipeline.live.certificates import Certificates, for_address, given, usual_folder
from pipeline.live.clerk import Clerk
from pipeline.live.journal import Journal, known_plan
from pipeline.live.loop import Clock, Loop
from pipeline.live.messages import FRAME_BYTES
from pipeline.live.plan import Plan
from pipeline.live.server import app
from pipeline.live.setup import Setup
from pipeline.study.settings import Study

SOMEWHERE = "203.0.113.1"  # an address for examples (RFC 5737): only the way to it is looked up


@dataclass(frozen=True)
class Serving:
    """How a study is served. `goes_on`: even if study.yaml has changed since the first session.

    In a network (`lan`) at `host`, or where that is None at the address that this computer has there; `plain` without
    TLS, for phones that only show what is displayed.
    """

    host: str | None = None
    port: int = 8443
    demo: bool = False
    goes_on: bool = False
    lan: bool = False
    plain: bool = False
    operator_lan: bool = False
    certificate: Path | None = None
    key: Path | None = None


def lan_address() -> str:
    """The address of this computer in its network; nothing is sent. Raises PipelineError where it has none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        try:
            made.connect((SOMEWHERE, 9))
            found = str(made.getsockname()[0])
        except OSError:
            found = LOOPBACK[0]
    if found in LOOPBACK:
        raise PipelineError(
            "--lan: this computer has no address in a network; connect it, name one by --host, or leave out --lan and"
            " connect the phone by a USB cable (docs/live.md)"
        )
    return found


def secured(options: Serving, folder: Path, now: datetime) -> tuple[Access, Certificates | None]:
    """Where the pages are and by which certificates. Raises PipelineError where that cannot be.

    `folder` keeps this computer's own certificates.
    """
    if (options.certificate is None) != (options.key is None):
        raise PipelineError("--cert and --key belong together; give both")
    if not options.lan:
        host = options.host or LOOPBACK[0]
        if host not in LOOPBACK:
            raise PipelineError(f"--host {host}: pages are served on this computer alone unless --lan is given; add it")
        if options.certificate is not None or options.operator_lan or options.plain:
            raise PipelineError("--cert, --key, --plain and --operator-lan are for a network: add --lan")
        return Access("http", host, options.port), None
    host = options.host or lan_address()
    if host in LOOPBACK or host in ("0.0.0.0", "::"):  # noqa: S104 - refused
        raise PipelineError(f"--host {host}: with --lan, name one address of this computer in the network")
    if options.plain:
        if options.certificate is not None or options.operator_lan:
            raise PipelineError("--plain serves without TLS: leave out --cert, --key and --operator-lan, or --plain")
        return Access("http", host, options.port), None
    if options.certificate is not None and options.key is not None:
        certificates = given(options.certificate, options.key, now)
    else:
        certificates = for_address(host, folder, now)
    return Access("https", host, options.port, options.operator_lan), certificates


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens. Raises PipelineError where it cannot.

    It says that it speaks TCP: only then does asyncio send at once what a page is told, and does not let it wait until
    the page has acknowledged what came before: 40 ms later from Linux, and more from others (RFC 896, RFC 1122).
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    made = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((host, port))
    except OSError as error:
        made.close()
        raise PipelineError(
            f"{host}:{port} cannot be listened on: {error.strerror or error}; choose another with --port"
        ) from None
    return made


_SWITCH_S = 0.0005  # instead of 5 ms
_NICE = 10


def let_others_wait() -> None:
    """Hand over to the loop's thread soon: checks and a replay run beside it, and no reading is to wait for them."""
    sys.setswitchinterval(_SWITCH_S)


@contextmanager
def examiners() -> Iterator[Executor]:
    """What does the checks: a process that lets others go first.

    In a thread readings would wait for all that NumPy does there in one go, 20 ms and more.
    """
    with Processes(1) as examiner:
        if hasattr(os, "nice"):
            examiner.submit(os.nice, _NICE)
        yield examiner


@contextmanager
def nothing_to_search() -> Iterator[None]:
    """Hardly anything in memory is garbage by now. Searched for it, as happens now and then, the loop stops for 70 ms.

    That is long enough for a port under a flood to overflow. What is made from here on is searched as always. What the
    caller has taken out of the search already stays out of it: it cannot be told from what is taken out here.
    """
    had_its_own = gc.get_freeze_count() > 0
    gc.freeze()
    try:
        yield
    finally:
        if not had_its_own:
            gc.unfreeze()


@dataclass(frozen=True)
class Doors:
    """The sockets that pages are served at, `inside` on this computer alone, `outside` by `certificates`."""

    inside: socket.socket
    outside: socket.socket | None = None
    certificates: Certificates | None = None

    def close(self) -> None:
        """Listen no more."""
        self.inside.close()
        if self.outside is not None:
            self.outside.close()


def opened(access: Access, certificates: Certificates | None) -> Doors:
    """The sockets of a run. Raises PipelineError where one cannot be listened on."""
    if not access.in_network:
        return Doors(listening(access.host, access.port))
    inside = listening(LOOPBACK[0], access.port)
    try:
        return Doors(inside, listening(access.host, access.port), certificates)
    except PipelineError:
        inside.close()
        raise


async def serve(
    made: Setup,
    folder: Path,
    journal: Journal,
    access: Access,
    doors: Doors,
    known: Plan,
    examiner: Executor | None = None,
) -> None:
    """Run the study until the server is stopped; `examiner` does the checks of what comes in, or a thread does."""
    loop = Loop(made, folder, Clerk(journal, check=None), known, Clock())
    loop.examiner = examiner
    receivers = await senders.opened(made, loop, access, folder)
    application = app(loop, access, doors.certificates)
    servers = [(uvicorn.Server(_config(application)), doors.inside)]
    if doors.outside is not None:
        servers.append((uvicorn.Server(_config(application, doors.certificates)), doors.outside))
    going = asyncio.create_task(loop.go())
    serving = [asyncio.create_task(server.serve(sockets=[on])) for server, on in servers]
    try:
        await asyncio.wait((going, *serving), return_when=asyncio.FIRST_COMPLETED)
        for server, _ in servers:
            server.should_exit = True
        await asyncio.gather(*serving, return_exceptions=True)
    finally:
        for task in serving:
            task.cancel()
        await asyncio.gather(*serving, return_exceptions=True)
        for receiver in receivers:
            receiver.close()
        if not going.done():
            going.cancel()
        with suppress(asyncio.CancelledError):
            await going


def _config(application: Starlette, certificates: Certificates | None = None) -> uvicorn.Config:
    return uvicorn.Config(
        application,
        ws="websockets-sansio",
        ws_max_size=FRAME_BYTES,
        ws_per_message_deflate=False,
        log_level="warning",
        access_log=False,
        server_header=False,
        date_header=False,
        proxy_headers=False,  # nobody is between us and the pages, so nobody may say who asks
        lifespan="off",
        timeout_graceful_shutdown=1,
        ssl_certfile=None if certificates is None else certificates.certificate,
        ssl_keyfile=None if certificates is None else certificates.key,
    )


def record(
    folder: Path,
    study: Study,
    options: Serving,
    ready: Callable[[Setup, Access, Certificates | None], None],
    warming: Callable[[], None],
) -> None:
    """Serve a study until Ctrl-C. `ready` is called with the addresses once pages can be opened."""
    access, certificates = secured(options, usual_folder(), datetime.now(UTC))
    simulated = "simulated by Steadyhand: a demo, the pointer was the hand" if options.demo else ""
    made = setup.set_up(study, folder, mouse=options.demo, simulated=simulated)
    senders.check(made, str(folder / "study.yaml"))
    journal = Journal(folder, study)
    journal.hold()
    try:
        known = known_plan(made.empty_plan(), journal, made.digest, options.goes_on)
        access = replace(access, language=made.recording.language)
        links = [(role, access.address(role)) for role in ("phone", "questionnaire")]
        if certificates is not None and certificates.authority is not None:
            links.append(("ca", f"{access.origin}/ca"))
        made = replace(made, links=tuple(links))
        with closing(opened(access, certificates)) as doors:
            warming()
            setup.warm_up(made)
            ready(made, access, certificates)
            let_others_wait()
            with examiners() as examiner, nothing_to_search(), suppress(KeyboardInterrupt):
                asyncio.run(serve(made, folder, journal, access, doors, known, examiner))
    finally:
        journal.release()
