"""The phone's page in a task, and what it has drawn and heard."""

from __future__ import annotations

from typing import Any

from tests.browser.chromium import Tab
from tests.browser.live.acts import (
    fake_sensors,
    sized,
    text,
    touch,
    wait_for,
)
from tests.browser.live.samples import Message, running, show, welcome
from tests.browser.live.server import LiveServer, until


def greets(task: Message) -> Any:
    def answer(server: LiveServer, role: str, message: Message) -> None:
        if message["type"] == "hello":
            server.say(role, **task)
            server.say(role, **running())

    return answer


def opened(tab: Tab, server: LiveServer, *, sensors: bool = True, script: str = "", **task: Any) -> None:
    """The page, begun by touch, in a task."""
    server.answer = greets(welcome(**task))
    sized(tab, 854, 480)
    if sensors:
        fake_sensors(tab)
    if script:
        tab.call("Page.addScriptToEvaluateOnNewDocument", source=script)
    tab.open(f"{server.address}/phone")
    wait_for(tab, "#start")
    touch(tab, "#start")
    server.wait("phone", "hello")
    until(lambda: "Target 1" in text(tab, "#badge"), "the task is known")


def shown(server: LiveServer, n: int, x: float = -550.0) -> Message:
    server.say("phone", **show(n, x))
    until(lambda: any(drawn["n"] == n for drawn in server.said("phone", "drawn")), f"{n} is drawn")
    return server.said("phone", "drawn")[-1]


def has_come(server: LiveServer) -> None:
    """What was said so far is in the page: two pings later, so is the answer to the first, which came after it."""
    server.wait("phone", "ping", len(server.said("phone", "ping")) + 2)
