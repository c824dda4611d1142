"""The operator's page: its one big button, reasons, notes, lights, by mouse and by keys; and the way in by a key."""

from __future__ import annotations

import json
import time

from tests.browser.chromium import Tab
from tests.browser.live.acts import focused, is_seen, key, mouse, place, sized, tab_to, text, value, wait_for, write
from tests.browser.live.samples import HOSTILE, Message, lights, offering, ready, state
from tests.browser.live.server import KEY, LiveServer, until


def _opened(tab: Tab, server: LiveServer, content: Message) -> None:
    sized(tab, 1440, 900)
    tab.open(f"{server.address}/operator")
    server.wait("operator", "hello")
    _shows(tab, server, content)


def _shows(tab: Tab, server: LiveServer, content: Message) -> None:
    server.say("operator", **content)
    until(lambda: text(tab, "#study") == content["study"], "the state is shown")


def _click(tab: Tab, selector: str) -> None:
    point = place(tab, selector)
    for kind in ("mousePressed", "mouseReleased"):
        mouse(tab, kind, point["x"], point["y"])


def _asked(server: LiveServer, count: int) -> tuple[str, str]:
    last = server.wait("operator", "do", count)[-1]
    return last["what"], last["text"]


def the_state_is_shown(tab: Tab, server: LiveServer) -> None:
    """Who is where, what is next, that the log replays; words from a study are text and nothing else."""
    _opened(tab, server, state())
    assert text(tab, "#who") == "P01, Task 2"
    assert text(tab, "#phase") == "Running."
    assert text(tab, "#clock").startswith("Trial 3, 1")
    assert text(tab, "#big") == "Abort Task 2 of P01"
    assert "1.2·10⁻¹² mm apart over 5012" in text(tab, "#agreement")
    rows = tab.evaluate("[...document.querySelectorAll('#participants tbody tr')].map(r => r.innerText)")
    assert len(rows) == 12
    assert "2 of 6" in rows[0]
    assert "left" in rows[1]
    assert HOSTILE in text(tab, "#problems")
    assert tab.evaluate("document.querySelectorAll('main b, header b').length") == 0


def one_big_button_begins(tab: Tab, server: LiveServer) -> None:
    """What it says is asked for; a refusal is shown as text, and may be overruled with a reason."""
    _opened(tab, server, ready("green"))
    assert text(tab, "#big") == "Start Task 1 of P01"
    _click(tab, "#big")
    assert _asked(server, 1) == ("start", "")
    refused = {"type": "refused", "id": server.said("operator", "do")[0]["id"], "why": HOSTILE}
    server.say("operator", **refused, reason_overrules=False)
    until(lambda: text(tab, "#answer") == f"Not done: {HOSTILE}", "the reason")
    assert not is_seen(tab, "#reason")
    _click(tab, "#big")
    assert _asked(server, 2) == ("start", "")
    server.say("operator", **{**refused, "id": server.said("operator", "do")[1]["id"]}, reason_overrules=True)
    wait_for(tab, "#reason")
    assert text(tab, "#reason-why") == HOSTILE
    write(tab, "It is only a trial run.")
    key(tab, "Enter")
    assert _asked(server, 3) == ("start", "It is only a trial run.")


def a_red_check_wants_a_reason(tab: Tab, server: LiveServer) -> None:
    """By keys alone: the question comes up, an empty reason is not taken, a typed one goes out, Escape asks nothing."""
    _opened(tab, server, ready("red"))
    tab_to(tab, "big")
    key(tab, "Enter")
    wait_for(tab, "#reason")
    assert focused(tab) == "reason-text"
    key(tab, "Enter")
    until(lambda: is_seen(tab, "#reason-missing"), "it wants a reason")
    write(tab, "The floor shakes.")
    key(tab, "Enter")
    assert _asked(server, 1) == ("start", "The floor shakes.")
    assert not is_seen(tab, "#reason")
    _click(tab, "button[data-do=skip]")
    wait_for(tab, "#reason")
    _click(tab, "#reason-cancel")
    time.sleep(0.2)
    assert len(server.said("operator", "do")) == 1


def a_questionnaire_is_not_left_by_a_slip(tab: Tab, server: LiveServer) -> None:
    """Going on without its answers wants a reason too; a stream may bear any name."""
    going = {"do": "next", "label": "Go on without the questionnaire of P01, Task 1", "others": ["note"]}
    _opened(tab, server, state(phase="questionnaire", next=going))
    named = lights()
    named["lights"]["constructor"] = {"light": "green", "text": "30 Hz"}
    server.say("operator", **named)
    until(lambda: "constructor" in text(tab, "#light-list"), "the light is shown")
    _click(tab, "#big")
    wait_for(tab, "#reason")
    write(tab, "No time.")
    key(tab, "Enter")
    assert _asked(server, 1) == ("next", "No time.")


def a_sender_is_accepted_by_one_press(tab: Tab, server: LiveServer) -> None:
    """It is named as text, its button keeps the focus when the list comes anew, and it goes where there is another."""
    _opened(tab, server, offering())
    assert text(tab, "#offer-list p") == f"192.168.1.7 sends /hand {HOSTILE}, 30 Hz: use as tracker?"
    tab.evaluate("document.querySelector('#offer-list button').focus()")
    offered = offering()
    offered["offers"][0]["rate_hz"] = 31
    _shows(tab, server, offered)
    until(lambda: "31 Hz" in text(tab, "#offer-list p"), "the rate is new")
    assert tab.evaluate("document.activeElement.textContent") == "Use as tracker"
    key(tab, "Enter")
    assert _asked(server, 1) == ("accept", "tracker 192.168.1.7")
    server.say("operator", type="done", id=server.said("operator", "do")[0]["id"])
    until(lambda: text(tab, "#answer") == "This sender is used until the end of this run.", "it says so")
    _shows(tab, server, offering("192.168.1.6"))
    until(lambda: "tracker comes from 192.168.1.6" in text(tab, "#offer-list p"), "it is not used")
    assert not is_seen(tab, "#offer-list button")
    _shows(tab, server, state())
    until(lambda: not is_seen(tab, "#offers"), "nobody sends any more")


def a_note_with_a_key(tab: Tab, server: LiveServer) -> None:
    """N, the note, Enter; and that it was taken is said."""
    _opened(tab, server, state())
    key(tab, "n")
    assert focused(tab) == "note-text"
    write(tab, "Laughs, n times")
    key(tab, "Enter")
    assert _asked(server, 1) == ("note", "Laughs, n times")
    server.say("operator", type="done", id=server.said("operator", "do")[0]["id"])
    until(lambda: text(tab, "#answer") == "Noted.", "it says so")
    assert value(tab, "#note-text", "it.value") == ""


def a_second_page_only_looks_on(tab: Tab, server: LiveServer) -> None:
    """All is shown, nothing can be done, but taking over."""
    _opened(tab, server, state(read_only=True))
    buttons = "[...document.querySelectorAll('#now button')].every(b => b.disabled)"
    assert tab.evaluate(buttons)
    _click(tab, "#read-only button")
    assert _asked(server, 1) == ("take_over", "")
    _shows(tab, server, state())
    until(lambda: not is_seen(tab, "#read-only"), "it may act")
    assert not value(tab, "#big", "it.disabled")


def lights_differ_in_more_than_colour(tab: Tab, server: LiveServer) -> None:
    """A sign, a word for those who hear the page, a sentence; what gets worse is said once."""
    _opened(tab, server, state())
    server.say("operator", **lights())
    until(lambda: "Known to 6 ms." in text(tab, "#changed"), "the amber one is said")
    lamps = tab.evaluate("[...document.querySelectorAll('#light-list .lamp')].map(l => [l.textContent, l.ariaLabel])")
    assert lamps == [["✓", "good"], ["✓", "good"], ["!", "look"], ["–", "nothing known"]]
    server.say("operator", **lights("red"))
    until(lambda: text(tab, "#changed") == "Phone: act. Scan the code with the phone.", "the red one is said")
    server.say("operator", **lights("green"))
    until(lambda: text(tab, "#changed") == "", "it is not said any more once it is no longer so")
    assert text(tab, "#drawn-hz") == "59.8 Hz"
    assert text(tab, "#round-trip") == "–"
    assert value(tab, "#traces", "it.getContext('2d').getImageData(0, 0, it.width, it.height).data.some(Boolean)")


def a_break_is_shown(tab: Tab, server: LiveServer) -> None:
    """Nothing can be asked for meanwhile."""
    _opened(tab, server, state())
    server.cut("operator")
    until(lambda: "was lost" in text(tab, "#connection"), "it says so")
    assert value(tab, "#big", "it.disabled")
    server.wait("operator", "hello", 2)
    _shows(tab, server, state())
    assert not is_seen(tab, "#connection")


def the_key_leaves_the_address(tab: Tab, server: LiveServer) -> None:
    """The operator's and the phone's; a wrong one is said."""
    tab.open(f"{server.address}/operator#k={KEY}")
    server.wait("operator", "hello")
    assert tab.evaluate("location.hash") == ""
    tab.open(f"{server.address}/join#k={KEY}")
    until(lambda: tab.evaluate("location.pathname + location.hash") == "/phone", "the phone's page opens")
    for address, words in ((f"{server.address}/join#k=wrong", "not valid any more"), ("/join", "not complete")):
        tab.evaluate(f"location.href = {json.dumps('/pages/icon.svg')}")
        tab.open(address if address.startswith("http") else server.address + address)
        until(lambda words=words: words in text(tab, "#status"), words)  # type: ignore[misc]
        assert tab.evaluate("location.hash") == ""


def a_sheet_for_paper(tab: Tab, server: LiveServer) -> None:
    """In print there are the orders alone, blind where the operator is."""
    _opened(tab, server, state())
    tab.call("Emulation.setEmulatedMedia", media="print")
    assert is_seen(tab, "#sheet")
    assert not is_seen(tab, "main")
    rows = tab.evaluate("[...document.querySelectorAll('#sheet-table tbody tr')].map(r => r.innerText)")
    assert rows[0].split() == ["P01", "a", "b", "c"]


CASES = (
    the_state_is_shown,
    one_big_button_begins,
    a_red_check_wants_a_reason,
    a_questionnaire_is_not_left_by_a_slip,
    a_sender_is_accepted_by_one_press,
    a_note_with_a_key,
    a_second_page_only_looks_on,
    lights_differ_in_more_than_colour,
    a_break_is_shown,
    the_key_leaves_the_address,
    a_sheet_for_paper,
)
