"""What a person does at a page: look, touch, click, press keys; and the phone's sensors, faked by the browser."""

from __future__ import annotations

import json
from typing import Any

from tests.browser.chromium import Tab
from tests.browser.live.server import until

_KEYS = {"Tab": 9, "Enter": 13, " ": 32, "End": 35, "Home": 36, "ArrowLeft": 37, "ArrowRight": 39, "n": 78}
_TEXTS = {"Enter": "\r", " ": " ", "n": "n"}


def value(tab: Tab, selector: str, expression: str) -> Any:
    """`expression` of the element, which it calls `it`."""
    return tab.evaluate(f"(it => {expression})(document.querySelector({json.dumps(selector)}))")


def text(tab: Tab, selector: str) -> str:
    """The words of an element."""
    return str(value(tab, selector, "it.textContent.trim()"))


def is_seen(tab: Tab, selector: str) -> bool:
    """Whether there is such an element on the page and not hidden."""
    return bool(value(tab, selector, "Boolean(it && it.checkVisibility())"))


def wait_for(tab: Tab, selector: str) -> None:
    """Wait until an element is seen."""
    until(lambda: is_seen(tab, selector), f"{selector} is seen")


def place(tab: Tab, selector: str, across: float = 0.5) -> dict[str, float]:
    """A point of an element, after it was scrolled into view."""
    box = "(b => ({x: b.left + across * b.width, y: b.top + b.height / 2}))(it.getBoundingClientRect())"
    scrolled = f"(it.scrollIntoView({{block: 'center', behavior: 'instant'}}), {box})"
    point: dict[str, float] = value(tab, selector, scrolled.replace("across", str(across)))
    return point


def touch(tab: Tab, selector: str, across: float = 0.5) -> None:
    """A finger taps an element, `across` of the way from its left to its right."""
    point = place(tab, selector, across)
    fingers(tab, "touchStart", point)
    fingers(tab, "touchEnd")


def fingers(tab: Tab, kind: str, *points: dict[str, float]) -> None:
    """A finger comes down, moves, or goes."""
    tab.call("Input.dispatchTouchEvent", type=kind, touchPoints=list(points))


def mouse(tab: Tab, kind: str, x: float, y: float) -> None:
    """The mouse: mouseMoved, mousePressed, mouseReleased."""
    tab.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)


def key(tab: Tab, name: str, times: int = 1) -> None:
    """A key goes down and up."""
    for _ in range(times):
        common = {
            "key": name,
            "windowsVirtualKeyCode": _KEYS[name],
            "code": {" ": "Space", "n": "KeyN"}.get(name, name),
        }
        tab.call("Input.dispatchKeyEvent", type="keyDown", text=_TEXTS.get(name, ""), **common)
        tab.call("Input.dispatchKeyEvent", type="keyUp", **common)


def tab_to(tab: Tab, name: str) -> None:
    """The Tab key, until the element with this id has the focus."""
    for _ in range(80):
        if focused(tab) == name:
            return
        key(tab, "Tab")
    raise AssertionError(f"{name} is not reached by the Tab key")


def write(tab: Tab, words: str) -> None:
    """Text is typed where the focus is."""
    tab.call("Input.insertText", text=words)


def focused(tab: Tab) -> str:
    """The id of the element with the focus."""
    return str(tab.evaluate("document.activeElement?.id ?? ''"))


def fake_sensors(tab: Tab, up: float = 9.8) -> None:
    """A phone held upright that turns, from the next page on; `up` is negative where the browser flips signs."""
    for kind in ("accelerometer", "linear-acceleration"):
        _override(tab, kind, {"xyz": {"x": 0.1, "y": up, "z": 0.3}})
    _override(tab, "gyroscope", {"xyz": {"x": 0.5, "y": 0.25, "z": -0.12}})
    _override(tab, "relative-orientation", {"quaternion": {"x": 0.1, "y": 0.2, "z": 0.3, "w": 0.927}})


def _override(tab: Tab, kind: str, reading: dict[str, Any]) -> None:
    tab.call("Emulation.setSensorOverrideEnabled", enabled=True, type=kind)
    tab.call("Emulation.setSensorOverrideReadings", type=kind, reading=reading)


def sized(tab: Tab, width: int, height: int, scheme: str = "light") -> None:
    """The screen of the next page, with touch where it is small."""
    tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    is_mobile = width < 1000
    tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=is_mobile)
    tab.call("Emulation.setTouchEmulationEnabled", enabled=is_mobile)
