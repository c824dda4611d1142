"""A page's WebSocket: frames in, within all limits; messages out, never faster than they are read."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from pipeline.live.events import Role
from pipeline.live.limits import Flow, admit
from pipeline.live.loop import Loop, Outbox
from pipeline.live.messages import MessageError, parse
from pipeline.live.outgoing import Outgoing, to_json

_PER_SECOND = 300.0
MOST_SOCKETS = 16
FORBIDDEN, TOO_MUCH, REPLACED, CROWDED = 4403, 4408, 4409, 4429


async def serve(socket: WebSocket, role: Role, loop: Loop, refused: Counter[str]) -> None:
    """Serve a page that may connect, until it goes; what it sends and is not taken is counted in `refused`."""
    await socket.accept()
    if len(loop.pages) >= MOST_SOCKETS:
        await socket.close(CROWDED)
        return
    client, outbox = loop.join(role)
    sending = asyncio.create_task(send_waiting(socket, outbox))
    receiving = asyncio.create_task(_receive(socket, role, client, loop, refused))
    try:
        await asyncio.wait((sending, receiving), return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in (sending, receiving):
            task.cancel()
        await asyncio.gather(sending, receiving, return_exceptions=True)
        loop.leave(role, client)
        with suppress(RuntimeError, WebSocketDisconnect):  # it has gone already
            await socket.close(REPLACED if outbox.replaced else TOO_MUCH)


async def send_waiting(socket: WebSocket, outbox: Outbox) -> None:
    """Send what waits in the outbox until it is ended or full; while nothing waits, a message may be sent at once."""
    under_way = False

    def at_once(message: Outgoing) -> bool:
        return not under_way and _sent_at_once(socket.send_text(to_json(message).decode()))

    outbox.at_once = at_once
    while not outbox.full:
        message = await outbox.get()
        if message is None:
            return
        under_way = True
        await socket.send_text(to_json(message).decode())
        under_way = False


def _sent_at_once(sending: Coroutine[Any, Any, None]) -> bool:
    """Send without waiting; False where that cannot be, and nothing was sent.

    The server waits, if at all, before it writes anything: until a page that does not read has read. So a message that
    has to wait can be taken back.
    """
    try:
        sending.send(None)
    except StopIteration:
        return True
    except (WebSocketDisconnect, RuntimeError):  # it has gone: `send_waiting` finds out in its own time
        return False
    sending.close()
    return False


async def _receive(socket: WebSocket, role: Role, client: int, loop: Loop, refused: Counter[str]) -> None:
    flow = Flow(_PER_SECOND, loop.now_ns())
    while not flow.is_flood:
        try:
            frame = await socket.receive_text()
        except (WebSocketDisconnect, KeyError):  # KeyError: a frame of bytes
            return
        flow, admitted = admit(flow, _PER_SECOND, loop.now_ns())
        if not admitted:
            refused[f"{role}: too many frames"] += 1
            continue
        try:
            loop.hear(role, client, parse(role, frame))
        except MessageError:
            refused[f"{role}: not understood"] += 1
