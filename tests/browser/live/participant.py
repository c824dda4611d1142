"""A participant for the real phone's page: sees what its socket brings, moves the mouse, presses."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from tests.browser.chromium import Tab
from tests.browser.live.acts import is_seen, mouse, value
from tests.browser.live.server import until

Message = dict[str, Any]
Place = tuple[float, float]
_NEAR_MM = 4.0


class Wire:
    """What came and went on a page's sockets. `came_text` is every byte that the server sent the page on them."""

    def __init__(self, tab: Tab) -> None:
        self._tab, self._read = tab, 0
        self.came_text: list[str] = []

    def new(self) -> list[tuple[bool, Message]]:
        """What is new, each with whether it came; in order."""
        self._tab.evaluate("0")  # takes in what the browser has said
        events, self._read = self._tab.events[self._read :], len(self._tab.events)
        new = []
        for event in events:
            came = event.get("method") == "Network.webSocketFrameReceived"
            if came or event.get("method") == "Network.webSocketFrameSent":
                payload = event["params"]["response"]["payloadData"]
                if came:
                    self.came_text.append(payload)
                new.append((came, json.loads(payload)))
        return new


@dataclass(frozen=True)
class Press:
    """A selection: the task, the target's place, and the estimate that was on the screen, in mm."""

    task: str
    trial: int
    target_mm: Place
    seen_mm: Place


class Participant:
    """Aims `errors_mm[trial]` beside each target, and presses when the picture says that it is there."""

    def __init__(self, tab: Tab, errors_mm: Sequence[Place]) -> None:
        self.tab, self.errors_mm, self.wire = tab, errors_mm, Wire(tab)
        self.task: Message = {}
        self.state: Message = {"state": "waiting"}
        self.shown: dict[int, Place] = {}
        self.drawn = 0
        self.presses: list[Press] = []

    def hear(self) -> None:
        """Take in what is new. A selection counts when the page has sent it, in a trial."""
        for came, message in self.wire.new():
            kind = message["type"]
            if came and kind == "welcome":
                self.task = message
            elif came and kind == "state":
                self.state = message
            elif came and kind == "show":
                self.shown[message["n"]] = (message["x"], message["y"])
            elif not came and kind == "drawn":
                self.drawn = message["n"]
            elif not came and kind == "select" and self.state["state"] == "running":
                trial, target = self.state["trial"], self.task["targets_mm"][self.state["target"]]
                self.presses.append(Press(self.task["task"], trial, tuple(target), self.shown[message["n"]]))

    def act(self) -> None:
        """Move to where the target is, and press there."""
        self.hear()
        if self.state["state"] not in ("practice", "running") or not is_seen(self.tab, "#picture"):
            return
        target, error = self.task["targets_mm"][self.state["target"]], self.errors_mm[self.state["target"]]
        goal = (target[0] + error[0], target[1] + error[1])
        x, y = self._on_screen(goal)
        mouse(self.tab, "mouseMoved", x, y)
        seen = self.shown.get(self.drawn)
        if seen is not None and math.dist(seen, goal) < _NEAR_MM:
            for kind in ("mousePressed", "mouseReleased"):
                mouse(self.tab, kind, x, y)
            until(self._goes_on(), "the selection is taken")

    def _goes_on(self) -> Callable[[], bool]:
        before = self.state

        def is_other() -> bool:
            self.hear()
            return self.state is not before

        return is_other

    def play(self, reload_before: int = 0) -> None:
        """Until the task is done. The page is loaded anew before the trial of that number."""
        pending = [reload_before] if reload_before else []

        def is_done() -> bool:
            if [self.state.get("trial")] == pending and self.state["state"] == "running":
                pending.clear()
                self.drawn = 0
                self.tab.reload()
            self.act()
            return bool(self.state["state"] in ("done", "finished"))

        until(is_done, "the task is done", patience_s=120)

    def _on_screen(self, goal: Place) -> Place:
        width, height = value(self.tab, "#stage", "[it.clientWidth, it.clientHeight]")
        (left, right), (low, high) = self.task["canvas_x_mm"], self.task["canvas_y_mm"]
        return width * (goal[0] - left) / (right - left), height * (high - goal[1]) / (high - low)
