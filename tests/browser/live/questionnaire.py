"""The questionnaire's page: by touch and by keys, saved before it goes on, continued after a reload."""

from __future__ import annotations

import time
from typing import Any

from tests.browser.chromium import Tab
from tests.browser.live.acts import fingers, focused, is_seen, key, sized, tab_to, text, touch, value, wait_for
from tests.browser.live.marks import at_mark, strip, touch_mark, wait_saved
from tests.browser.live.samples import HOSTILE, TLX, Message, form, own_form
from tests.browser.live.server import LiveServer, until


def _saves(server: LiveServer, role: str, message: Message) -> None:
    if message["type"] in ("answer", "submit"):
        server.say(role, type="saved", id=message["id"])
    if message["type"] == "submit":
        server.say(role, type="state", state="thanks")


def _opened(tab: Tab, server: LiveServer, content: Message, width: int = 390) -> None:
    server.answer = _saves
    sized(tab, width, 844)
    server.forget()
    tab.open(f"{server.address}/questionnaire")
    server.wait("questionnaire", "hello")
    server.say("questionnaire", **content)
    wait_for(tab, "#form")


def _answers(server: LiveServer) -> dict[str, Any]:
    return {answer["item"]: answer["value"] for answer in server.said("questionnaire", "answer")}


def six_scales_by_touch(tab: Tab, server: LiveServer) -> None:
    """On the smallest screen each mark can be hit; nothing is set before; every answer is saved when it is given."""
    _opened(tab, server, form())
    for item in TLX:
        assert value(tab, strip(item), "it.classList.contains('unanswered')")
        assert value(tab, strip(item), "it.querySelectorAll('line').length") == 22  # 21 marks on a line
    wanted = dict(zip(TLX, (0, 20, 10, 7, 13, 19), strict=True))
    for count, (item, mark) in enumerate(wanted.items(), 1):
        touch_mark(tab, item, mark)
        server.wait("questionnaire", "answer", count)
    assert _answers(server) == wanted
    assert len({answer["id"] for answer in server.said("questionnaire", "answer")}) == 6
    wait_saved(tab)
    touch(tab, "#next")
    server.wait("questionnaire", "submit")
    until(lambda: "Thank you" in text(tab, "#words"), "the thanks")
    assert not is_seen(tab, "#form")


def six_scales_and_fifteen_pairs_by_keys(tab: Tab, server: LiveServer) -> None:
    """Without a pointer: tab, arrows, space, enter; and back again."""
    _opened(tab, server, form(with_pairs=True), width=1440)
    for item in TLX:
        tab_to(tab, f"item-{item}")
        key(tab, {"mental": "Home", "physical": "End"}.get(item, "ArrowRight"))
    until(lambda: len(_answers(server)) == 6, "six answers")
    wait_saved(tab)
    assert _answers(server) == dict.fromkeys(TLX, 11) | {"mental": 0, "physical": 20}
    tab_to(tab, "next")
    key(tab, "Enter")
    wait_for(tab, ".pair")
    pairs = tab.evaluate("[...document.querySelectorAll('.pair input')].filter(i => i.id).map(i => i.id)")
    assert len(pairs) == 15
    for count, pair in enumerate(pairs):
        tab_to(tab, pair)
        key(tab, "ArrowRight" if count % 2 else " ")
    until(lambda: len(_answers(server)) == 21, "fifteen pairs")
    assert [_answers(server)[pair.removeprefix("item-")] for pair in pairs] == [count % 2 for count in range(15)]
    tab_to(tab, "back")
    key(tab, "Enter")
    wait_for(tab, "#item-mental")
    assert value(tab, "#item-mental", "it.value") == "0"
    assert focused(tab) == "title"
    wait_saved(tab)
    for what in (".pair", "#words"):
        tab_to(tab, "next")
        key(tab, "Enter")
        wait_for(tab, what)
    server.wait("questionnaire", "submit")


def an_unanswered_middle_can_be_given(tab: Tab, server: LiveServer) -> None:
    """The middle mark is an answer like any other, by space as by touch, though the control already stands there."""
    _opened(tab, server, form())
    touch_mark(tab, "mental", 10)
    assert server.wait("questionnaire", "answer")[0]["value"] == 10
    value(tab, "#item-physical", "it.focus()")
    key(tab, " ")
    assert server.wait("questionnaire", "answer", 2)[1]["value"] == 10


def what_is_missing_is_named(tab: Tab, server: LiveServer) -> None:
    """The page does not go on without all answers, and leads to the first that is missing."""
    _opened(tab, server, form(mental=3, temporal=3, performance=3, effort=3))
    touch(tab, "#next")
    until(lambda: is_seen(tab, "#missing"), "it says so")
    assert text(tab, "#missing") == "Still without an answer: Physical demand, Frustration."
    assert focused(tab) == "item-physical"
    assert server.said("questionnaire", "submit") == []


def a_reload_continues(tab: Tab, server: LiveServer) -> None:
    """What was answered is there, and what was not is not."""
    _opened(tab, server, form())
    for mark, item in enumerate(TLX[:3]):
        touch_mark(tab, item, mark + 4)
        server.wait("questionnaire", "answer", mark + 1)
    given = _answers(server)
    _opened(tab, server, form(**given))
    shown = [value(tab, strip(item), "it.classList.contains('unanswered')") for item in TLX]
    assert shown == [False, False, False, True, True, True]
    assert value(tab, "#item-temporal", "it.value") == "6"


def it_waits_for_the_disk(tab: Tab, server: LiveServer) -> None:
    """The page goes on when the last answer is saved, and not before."""
    _opened(tab, server, form(True, **dict.fromkeys(TLX[:5], 3)))
    server.answer = lambda *_: None
    touch_mark(tab, "frustration", 5)
    given = server.wait("questionnaire", "answer")[0]
    touch(tab, "#next")
    time.sleep(0.3)
    assert text(tab, "#saving") == "Saving …"
    assert is_seen(tab, "#item-frustration")
    server.say("questionnaire", type="saved", id=given["id"])
    wait_for(tab, ".pair")


def a_break_loses_no_answer(tab: Tab, server: LiveServer) -> None:
    """What was given while the connection was away goes out when it is back, under its first id."""
    _opened(tab, server, form())
    server.answer = lambda *_: None
    touch_mark(tab, "mental", 5)
    first = server.wait("questionnaire", "answer")[0]
    server.cut("questionnaire")
    touch_mark(tab, "physical", 6)
    server.wait("questionnaire", "hello", 2)
    server.answer = _saves
    server.say("questionnaire", **form(mental=5))
    until(lambda: _answers(server) == {"mental": 5, "physical": 6}, "both are there")
    until(lambda: text(tab, "#saving") == "Saved", "both are saved")
    assert {answer["id"] for answer in server.said("questionnaire", "answer") if answer["item"] == "mental"} == {
        first["id"]
    }
    assert value(tab, "#item-physical", "it.value") == "6"


def another_participants_form_is_empty(tab: Tab, server: LiveServer) -> None:
    """The same questionnaire of the same task, for somebody else."""
    _opened(tab, server, form())
    touch_mark(tab, "mental", 5)
    until(lambda: text(tab, "#saving") == "Saved", "it is saved")
    server.say("questionnaire", **form())
    until(lambda: bool(value(tab, strip("mental"), "it.classList.contains('unanswered')")), "it is empty")


def a_refusal_is_shown(tab: Tab, server: LiveServer) -> None:
    """With the computer's reason, as text."""
    _opened(tab, server, form())
    server.answer = lambda *_: None
    touch_mark(tab, "mental", 5)
    given = server.wait("questionnaire", "answer")[0]
    server.say("questionnaire", type="refused", id=given["id"], why=HOSTILE)
    until(lambda: text(tab, "#missing") == f"This was not saved: {HOSTILE}", "the reason")


def a_finger_is_followed(tab: Tab, server: LiveServer) -> None:
    """Only where it lets go counts; one that scrolls the page answers nothing."""
    _opened(tab, server, form())
    begin, end = at_mark(tab, "mental", 2), at_mark(tab, "mental", 15)
    fingers(tab, "touchStart", begin)
    for step in range(1, 6):
        fingers(tab, "touchMove", {"x": begin["x"] + (end["x"] - begin["x"]) * step / 5, "y": begin["y"]})
    fingers(tab, "touchEnd")
    assert [answer["value"] for answer in server.wait("questionnaire", "answer")] == [15]
    begin = at_mark(tab, "temporal", 8)
    fingers(tab, "touchStart", begin)
    for step in range(1, 9):
        fingers(tab, "touchMove", {"x": begin["x"], "y": begin["y"] - 30 * step})
    fingers(tab, "touchEnd")
    time.sleep(0.2)
    assert len(server.said("questionnaire", "answer")) == 1
    assert value(tab, strip("temporal"), "it.classList.contains('unanswered')")


def a_labs_own_questionnaire(tab: Tab, server: LiveServer) -> None:
    """Its words are text and nothing else; it has as many marks as it says."""
    _opened(tab, server, own_form())
    assert text(tab, "#title") == HOSTILE
    assert text(tab, "#task") == "Task 1 · Questionnaire 2 of 2"
    assert tab.evaluate("document.querySelectorAll('main img, main b').length") == 0
    touch_mark(tab, "arm", 4, 4)
    assert _answers_of(server.wait("questionnaire", "answer")) == [("comfort", "arm", 4)]


def _answers_of(said: list[Message]) -> list[tuple[str, str, int]]:
    return [(one["questionnaire"], one["item"], one["value"]) for one in said]


def in_german(tab: Tab, server: LiveServer) -> None:
    """Every word of the page, and the language that it says it is in."""
    server.answer = _saves
    tab.open(f"{server.address}/questionnaire?lang=de")
    server.wait("questionnaire", "hello")
    server.say("questionnaire", **form())
    wait_for(tab, "#form")
    assert tab.evaluate("document.documentElement.lang") == "de"
    assert text(tab, "#task") == "Aufgabe 1"
    assert text(tab, "h2") == "Geistige Anforderung"
    tab.open(f"{server.address}/questionnaire?lang=xx")
    until(lambda: text(tab, "#title") == "Questionnaire", "English, where there is no such language")
    assert tab.evaluate("document.documentElement.lang") == "en"


CASES = (
    six_scales_by_touch,
    six_scales_and_fifteen_pairs_by_keys,
    an_unanswered_middle_can_be_given,
    what_is_missing_is_named,
    a_reload_continues,
    it_waits_for_the_disk,
    a_break_loses_no_answer,
    another_participants_form_is_empty,
    a_refusal_is_shown,
    a_finger_is_followed,
    a_labs_own_questionnaire,
    in_german,
)
