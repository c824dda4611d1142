"""The phone's page when something ends: a connection, a sign-in, the sensors, the page itself."""

from __future__ import annotations

import time

from tests.browser.chromium import Tab
from tests.browser.live.acts import (
    text,
    touch,
    value,
    wait_for,
)
from tests.browser.live.phone_page import opened, shown
from tests.browser.live.server import LiveServer, until

_DENIED_WITHOUT_TAP = """
DeviceMotionEvent.requestPermission = async () => {
  if (!navigator.userActivation.isActive) throw new DOMException("no tap", "NotAllowedError");
  return "granted";
};"""
_COUNTS_LOCKS = """
globalThis.locks = 0;
const request = WakeLock.prototype.request;
WakeLock.prototype.request = function (...words) { globalThis.locks += 1; return request.apply(this, words); };"""


def a_page_that_is_open_elsewhere_stops(tab: Tab, server: LiveServer) -> None:
    """It does not connect again: the two would take each other's place without end."""
    opened(tab, server)
    server.forget()
    server.cut("phone", 4409)
    until(lambda: "another tab" in text(tab, "#message"), "it says so")
    time.sleep(1.0)
    assert server.said("phone", "hello") == []


def silence_greys_the_picture(tab: Tab, server: LiveServer) -> None:
    """Without news for 0.3 s: wait, and no selection; with news it goes on."""
    opened(tab, server)
    shown(server, 1)
    assert not value(tab, "#select", "it.disabled")
    until(lambda: text(tab, "#message") == "Please wait", "it says wait")
    assert value(tab, "#stage", "it.classList.contains('stale')")
    assert value(tab, "#select", "it.disabled")
    shown(server, 2)
    assert text(tab, "#message") == ""
    assert not value(tab, "#stage", "it.classList.contains('stale')")


def a_reload_goes_on_without_a_tap(tab: Tab, server: LiveServer) -> None:
    """Back by itself, with its motion, and nothing is sent twice."""
    opened(tab, server)
    shown(server, 3)
    touch(tab, "#select")
    server.wait("phone", "select")
    tab.open(f"{server.address}/phone")
    server.wait("phone", "hello", 2)
    shown(server, 4)
    assert len(server.said("phone", "select")) == 1
    assert len({hello["id"] for hello in server.said("phone", "hello")}) == 1
    server.received["phone"] = []
    server.wait("phone", "motion", 5)


def a_reload_that_needs_a_tap_asks_for_it(tab: Tab, server: LiveServer) -> None:
    """A browser that gives motion only within a tap."""
    opened(tab, server, script=_DENIED_WITHOUT_TAP)
    tab.open(f"{server.address}/phone")
    wait_for(tab, "#start")
    touch(tab, "#start")
    assert server.wait("phone", "hello", 2)[1]["permission"] == "granted"


def a_break_is_mended(tab: Tab, server: LiveServer) -> None:
    """After a lost connection the page comes back by itself, and says meanwhile what is the matter."""
    opened(tab, server)
    shown(server, 1)
    server.cut("phone")
    until(lambda: "was lost" in text(tab, "#message"), "it says so")
    assert value(tab, "#select", "it.disabled")
    server.wait("phone", "hello", 2)
    shown(server, 2)
    assert text(tab, "#message") == ""


def a_dead_connection_is_given_up(tab: Tab, server: LiveServer) -> None:
    """A phone that slept may hold a connection that nobody answers: it connects anew."""
    opened(tab, server)
    shown(server, 1)
    server.is_deaf = True
    server.wait("phone", "hello", 2)
    server.is_deaf = False
    shown(server, 2)


def a_page_that_cannot_connect_says_why(tab: Tab, server: LiveServer) -> None:
    """The page has loaded, its socket is refused: a certificate that is not trusted yet, or a firewall."""
    server.unreachable.add("phone")
    tab.open(f"{server.address}/phone")
    wait_for(tab, "#start")
    touch(tab, "#start")
    until(lambda: "certificate" in text(tab, "#message"), "it says why")
    server.unreachable.clear()
    server.wait("phone", "hello")


def a_page_that_is_not_signed_in_stops(tab: Tab, server: LiveServer) -> None:
    """It says what to do, and does not try for ever."""
    opened(tab, server)
    server.refuses.add("phone")
    server.cut("phone")
    until(lambda: "scan the code" in text(tab, "#message"), "it says so")
    time.sleep(1.2)
    assert len(server.said("phone", "hello")) == 1


def a_phone_that_slept_says_so(tab: Tab, server: LiveServer) -> None:
    """Hidden and seen again: both are told, and the wake lock is asked for anew."""
    opened(tab, server, script=_COUNTS_LOCKS)
    before = tab.evaluate("locks")
    for seen in ("hidden", "visible"):
        tab.evaluate(
            f"Object.defineProperty(document, 'visibilityState', {{value: '{seen}', configurable: true}});"
            "document.dispatchEvent(new Event('visibilitychange'))"
        )
    assert [message["visible"] for message in server.wait("phone", "visible", 2)] == [False, True]
    until(lambda: tab.evaluate("locks") == before + 1, "the lock is asked for again")


CASES = (
    a_page_that_is_open_elsewhere_stops,
    silence_greys_the_picture,
    a_reload_goes_on_without_a_tap,
    a_reload_that_needs_a_tap_asks_for_it,
    a_break_is_mended,
    a_dead_connection_is_given_up,
    a_page_that_cannot_connect_says_why,
    a_page_that_is_not_signed_in_stops,
    a_phone_that_slept_says_so,
)
