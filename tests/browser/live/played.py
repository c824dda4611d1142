"""A task played through the phone's page: the stand-in shows where the mouse is, a little beside it and late."""

from __future__ import annotations

import math
from itertools import count
from typing import Any

from tests.browser.chromium import Tab
from tests.browser.live.acts import sized, touch, wait_for
from tests.browser.live.participant import Participant
from tests.browser.live.samples import Message, running, show, welcome
from tests.browser.live.server import LiveServer

_ERRORS_MM = ((3.0, -2.0), (-4.0, 1.0))


def _echo() -> Any:
    numbers, target = count(1), count(1)

    def answer(server: LiveServer, role: str, message: Message) -> None:
        if message["type"] == "hello":
            server.say(role, **welcome(mouse=True))
            server.say(role, **running())
        elif message["type"] == "mouse":
            n = next(numbers)
            server.say(role, **show(n, message["x"] + math.sin(n), message["y"] + math.cos(n)))
        elif message["type"] == "select":
            after = next(target)
            state = running("done") if after == 2 else running(target=after) | {"trial": after + 1}
            server.say(role, **state)

    return answer


def a_task_is_played_by_mouse(tab: Tab, server: LiveServer) -> None:
    """Every target is found by what the phone shows alone, and each selection names the estimate that was seen."""
    server.answer = _echo()
    sized(tab, 1440, 900)
    tab.open(f"{server.address}/phone")
    wait_for(tab, "#start")
    touch(tab, "#start")
    player = Participant(tab, _ERRORS_MM)
    player.play()
    assert [press.trial for press in player.presses] == [1, 2]
    for press, error in zip(player.presses, _ERRORS_MM, strict=True):
        aimed = (press.target_mm[0] + error[0], press.target_mm[1] + error[1])
        assert math.dist(press.seen_mm, aimed) < 6


CASES = (a_task_is_played_by_mouse,)
