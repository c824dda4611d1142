"""Every page in its states at three widths, in light and in dark: what overflows, complains, or shuts people out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from tests.browser.chromium import Tab
from tests.browser.complaints import complaint
from tests.browser.live.acts import sized, wait_for
from tests.browser.live.samples import TLX, form, lights, offering, own_form, ready, running, show, state, welcome
from tests.browser.live.server import LiveServer, until

SIZES = {390: 844, 854: 480, 1440: 900}
_CHECKS = (Path(__file__).parent.parent / "checks.js").read_text(encoding="utf-8")
# The phone's stage does not scroll, so what does not fit on it is lost.
_CUT_OFF = """
[...document.querySelectorAll("#stage p, #stage button")].filter((it) => it.checkVisibility()).flatMap((it, _, all) => {
  const box = it.getBoundingClientRect();
  const name = it.id || it.tagName;
  const cut = box.top < 0 || box.left < 0 || box.bottom > innerHeight || box.right > innerWidth;
  const over = all.filter((other) => {
    const its = other.getBoundingClientRect();
    return it !== other && its.left < box.right && box.left < its.right && its.top < box.bottom && box.top < its.bottom;
  });
  return [...(cut ? [`${name} is cut off`] : []), ...over.map((other) => `${name} lies over ${other.id}`)];
})"""
Scene = Callable[[Tab, LiveServer], None]


def _joining(tab: Tab, server: LiveServer) -> None:
    tab.open(f"{server.address}/join")
    until(lambda: "scan" in tab.evaluate("document.getElementById('status').textContent"), "the words are there")


def _authority(tab: Tab, server: LiveServer) -> None:
    tab.open(f"{server.address}/ca")
    until(lambda: ":" in tab.evaluate("document.getElementById('fingerprint').textContent"), "the fingerprint is there")


def _phone_checks(tab: Tab, server: LiveServer) -> None:
    _phone_stands(tab, server)
    server.say("phone", type="state", state="checks")
    until(lambda: "still" in tab.evaluate("document.getElementById('message').textContent"), "it says what to do")


def _started(tab: Tab, server: LiveServer) -> None:
    """A phone that was begun by touch before; whatever page is open, only one of ours may say so."""
    tab.open(f"{server.address}/join")
    tab.evaluate("sessionStorage.setItem('started', 'granted')")


def _phone_begins(tab: Tab, server: LiveServer) -> None:
    tab.open(f"{server.address}/phone")
    tab.evaluate("sessionStorage.clear()")
    tab.open(f"{server.address}/phone")
    wait_for(tab, "#start")


def _phone_runs(tab: Tab, server: LiveServer) -> None:
    _phone_stands(tab, server)
    server.say("phone", **running())
    server.say("phone", **show(1))
    server.wait("phone", "drawn")


def _phone_stands(tab: Tab, server: LiveServer) -> None:
    _started(tab, server)
    tab.open(f"{server.address}/phone")
    server.wait("phone", "hello")
    server.say("phone", **welcome())
    server.say("phone", **running("done"))
    wait_for(tab, "#message")


def _phone_lacks(tab: Tab, server: LiveServer) -> None:
    script = "Object.defineProperty(navigator, 'wakeLock', {value: undefined})"
    added = tab.call("Page.addScriptToEvaluateOnNewDocument", source=script)["identifier"]
    tab.open(f"{server.address}/phone")
    server.wait("phone", "hello")
    server.say("phone", **welcome())
    wait_for(tab, "#problems")
    tab.call("Page.removeScriptToEvaluateOnNewDocument", identifier=added)


def _phone_is_measured(tab: Tab, server: LiveServer) -> None:
    _started(tab, server)
    tab.open(f"{server.address}/phone")
    server.wait("phone", "hello")
    server.say("phone", **welcome(window="true_size"))
    wait_for(tab, "#calibration")


def _questionnaire(content: dict[str, object] | None) -> Scene:
    def scene(tab: Tab, server: LiveServer) -> None:
        tab.open(f"{server.address}/questionnaire?lang=de")
        server.wait("questionnaire", "hello")
        if content is not None:
            server.say("questionnaire", **content)
            wait_for(tab, "#form")

    return scene


def _operator(content: dict[str, object]) -> Scene:
    def scene(tab: Tab, server: LiveServer) -> None:
        tab.open(f"{server.address}/operator")
        server.wait("operator", "hello")
        server.say("operator", **content)
        server.say("operator", **lights("red"))
        wait_for(tab, "#light-list li")

    return scene


def _operator_asks(tab: Tab, server: LiveServer) -> None:
    _operator(ready("red"))(tab, server)
    tab.evaluate("document.getElementById('big').click()")
    wait_for(tab, "#reason")


SCENES: dict[str, Scene] = {
    "join": _joining,
    "the way to trust": _authority,
    "phone, checks": _phone_checks,
    "phone, begin": _phone_begins,
    "phone, a task": _phone_runs,
    "phone, words": _phone_stands,
    "phone, something is missing": _phone_lacks,
    "phone, how large": _phone_is_measured,
    "questionnaire, nothing yet": _questionnaire(None),
    "questionnaire, NASA-TLX": _questionnaire(form(mental=0, physical=20)),
    "questionnaire, pairs": _questionnaire(form(True, **dict.fromkeys(TLX, 3))),
    "questionnaire, a lab's own": _questionnaire(own_form()),
    "operator, running": _operator(state()),
    "operator, a sender without a key": _operator(offering()),
    "operator, looking on": _operator(state(read_only=True)),
    "operator, a reason": _operator_asks,
}


def faults(scene: Scene, tab: Tab, server: LiveServer, checker: str | None) -> Iterator[str]:
    """What is wrong with a page in one state, at every size and in both schemes."""
    for width, height in SIZES.items():
        for scheme in ("light", "dark"):
            sized(tab, width, height, scheme)
            server.forget()
            scene(tab, server)
            yield from (f"{width} px, {scheme}: {fault}" for fault in _of_page(tab, server, checker))


def _of_page(tab: Tab, server: LiveServer, checker: str | None) -> Iterator[str]:
    yield from filter(None, (complaint(event, (server.address,)) for event in tab.events))
    # By the protocol, since the page's own policy lets no script in that is not its own.
    tab.evaluate(f"{_CHECKS};0")
    yield from tab.evaluate("overflowFaults()")
    yield from tab.evaluate(_CUT_OFF)
    if checker is not None:
        tab.evaluate(f"{checker};0")
        yield from tab.evaluate("accessibilityFaults()")
