"""The questionnaire's lines and marks, by finger and by keys."""

from __future__ import annotations

from tests.browser.chromium import Tab
from tests.browser.live.acts import fingers, key, place, tab_to, text, touch, value
from tests.browser.live.server import until

_INSET_PX = 11.2  # the strip reaches beyond its line by .7 rem on each side, so that the outer marks can be hit


def strip(item: str) -> str:
    """The selector of an item's line and what of it takes a finger."""
    return f".scale:has(#item-{item})"


def at_mark(tab: Tab, item: str, mark: int, steps: int = 20) -> dict[str, float]:
    """The place of a mark."""
    width = value(tab, strip(item), "it.getBoundingClientRect().width")
    return place(tab, strip(item), (_INSET_PX + (width - 2 * _INSET_PX) * mark / steps) / width)


def touch_mark(tab: Tab, item: str, mark: int, steps: int = 20) -> None:
    """A finger sets an item's mark."""
    fingers(tab, "touchStart", at_mark(tab, item, mark, steps))
    fingers(tab, "touchEnd")


def key_mark(tab: Tab, item: str, mark: int) -> None:
    """Keys alone set it: from the left end, mark by mark."""
    tab_to(tab, f"item-{item}")
    key(tab, "Home")
    key(tab, "ArrowRight", mark)


def wait_saved(tab: Tab) -> None:
    """Wait until every answer is on disk."""
    until(lambda: text(tab, "#saving") in ("Saved", "Gespeichert"), "all answers are saved")


def submit_by_touch(tab: Tab) -> None:
    """The button at the end, once everything is saved."""
    wait_saved(tab)
    touch(tab, "#next")


def submit_by_key(tab: Tab) -> None:
    """The same by keys."""
    wait_saved(tab)
    tab_to(tab, "next")
    key(tab, "Enter")
