"""A stand-in for the live study's server: it serves the real pages, and says on their sockets what a test wants."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import uvicorn
import yaml
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketDisconnected

from tests.conftest import CLONE

PAGES = CLONE / "pipeline" / "live" / "pages"
KEY = "k7QmExample"
_KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Cache-Control": "no-store",
}
Message = dict[str, Any]
Answerer = Callable[["LiveServer", str, Message], None]


class LiveServer:
    """The sockets' other end. What the pages said stands in `received`, by role."""

    def __init__(self, answer: Answerer) -> None:
        self.answer = answer
        self.received: dict[str, list[Message]] = {"operator": [], "phone": [], "questionnaire": []}
        self.refuses: set[str] = set()
        self.unreachable: set[str] = set()
        self.is_deaf = False
        self.address = ""
        self._open: dict[str, list[WebSocket]] = {role: [] for role in self.received}
        self._loop = asyncio.new_event_loop()

    def say(self, role: str, **message: Any) -> None:
        """Send to every open page of a role."""
        for one in tuple(self._open[role]):
            # A page may just have gone.
            with suppress(WebSocketDisconnect, WebSocketDisconnected):
                asyncio.run_coroutine_threadsafe(one.send_text(json.dumps(message)), self._loop).result(5)

    def cut(self, role: str, code: int = 1012) -> None:
        """Close the sockets of a role."""
        for one in tuple(self._open[role]):
            asyncio.run_coroutine_threadsafe(one.close(code), self._loop).result(5)

    def said(self, role: str, kind: str) -> list[Message]:
        """What the pages of a role have said, of one type."""
        return [message for message in tuple(self.received[role]) if message["type"] == kind]

    def wait(self, role: str, kind: str, count: int = 1) -> list[Message]:
        """The same, once there are so many. AssertionError where they do not come."""
        until(lambda: len(self.said(role, kind)) >= count, f"{role} says {kind} {count} times")
        return self.said(role, kind)

    def forget(self) -> None:
        """Forget what was said so far."""
        for messages in self.received.values():
            messages.clear()

    async def connection(self, opened: WebSocket) -> None:
        """One page's connection, from its first message to its last."""
        role = opened.path_params["role"]
        if role in self.unreachable:
            return await opened.close()
        await opened.accept()
        if role in self.refuses:
            return await opened.close(4403)
        self._open[role].append(opened)
        try:
            while True:
                message = json.loads(await opened.receive_text())
                self.received[role].append(message)
                if message["type"] == "ping" and self.is_deaf:
                    continue
                if message["type"] == "ping":
                    now = time.time_ns() / 1e6
                    await opened.send_text(json.dumps({"type": "pong", "t1": message["t1"], "t2": now, "t3": now}))
                else:
                    await asyncio.to_thread(self.answer, self, role, message)
        except (WebSocketDisconnect, WebSocketDisconnected):
            pass
        finally:
            self._open[role].remove(opened)

    def app(self) -> Starlette:
        """The pages and the sockets."""
        return Starlette(
            routes=[
                Route("/ca.json", lambda _: JSONResponse({"fingerprint": ":".join(["A7"] * 32)})),
                Route("/{page:str}", _page),
                Route("/pages/{path:path}", _file),
                Route("/qr/{role}.svg", lambda _: Response(_SQUARE, media_type="image/svg+xml")),
                Route("/join", _join, methods=["POST"]),
                WebSocketRoute("/socket/{role}", self.connection),
            ]
        )

    def run(self, server: uvicorn.Server, listener: socket.socket) -> None:
        """The server's thread."""
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(server.serve([listener]))


_SQUARE = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M1 1h3v3h-3zM5 5h3v3h-3z"/></svg>'


def until(holds: Callable[[], bool], what: str, patience_s: float = 15.0) -> None:
    """Wait for something; AssertionError, naming it, where it does not come."""
    deadline = time.monotonic() + patience_s
    while not holds():
        assert time.monotonic() < deadline, f"did not happen: {what}"
        time.sleep(0.02)


def _page(request: Request) -> Response:
    return _whole(f"{request.path_params['page']}.html")


def _file(request: Request) -> Response:
    path = request.path_params["path"]
    if path.endswith(".json"):
        texts = PAGES / path.replace(".json", ".yaml")
        if not texts.is_file():
            return Response(status_code=404)
        return JSONResponse(yaml.safe_load(texts.read_text(encoding="utf-8")), headers=_HEADERS)
    return _whole(path)


def _whole(name: str) -> Response:
    path = PAGES / name
    if not path.is_file():
        return Response(status_code=404)
    return Response(path.read_bytes(), media_type=_KINDS[path.suffix], headers=_HEADERS)


async def _join(request: Request) -> Response:
    if (await request.json()).get("k") != KEY:
        return JSONResponse({"why": "unknown"}, status_code=403)
    return JSONResponse({"role": "phone", "go": "/phone"})


@contextmanager
def live_server(answer: Answerer) -> Iterator[LiveServer]:
    """A running stand-in on a free port of this machine."""
    served = LiveServer(answer)
    listener = socket.create_server(("127.0.0.1", 0))
    served.address = f"http://127.0.0.1:{listener.getsockname()[1]}"
    server = uvicorn.Server(uvicorn.Config(served.app(), log_level="error", ws="websockets-sansio"))
    thread = threading.Thread(target=served.run, args=(server, listener), daemon=True)
    thread.start()
    try:
        until(lambda: server.started, "the server starts")
        yield served
    finally:
        server.should_exit = True
        thread.join(10)
