"""The phone's page: what it sends, draws and says, with a good browser and with those that lack something."""

from __future__ import annotations

import json
import time
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from tests.browser.chromium import Tab
from tests.browser.live.acts import (
    fake_sensors,
    fingers,
    is_seen,
    key,
    mouse,
    place,
    sized,
    text,
    touch,
    value,
    wait_for,
)
from tests.browser.live.phone_page import has_come, opened, shown
from tests.browser.live.samples import running, show
from tests.browser.live.server import LiveServer, until

_NO_WAKE_LOCK = "Object.defineProperty(navigator, 'wakeLock', {value: undefined})"
_DENIED = "DeviceMotionEvent.requestPermission = async () => 'denied'"


def readings_go_out_as_the_browser_gives_them(tab: Tab, server: LiveServer) -> None:
    """Motion in m/s² and °/s with its signs, orientation as a quaternion, a hello that says what this phone can."""
    opened(tab, server)
    hello = server.wait("phone", "hello")[0]
    assert {name: hello[name] for name in ("permission", "secure", "wake_lock")} == {
        "permission": "granted",
        "secure": True,
        "wake_lock": True,
    }
    assert hello["screen"] == {"w": 854, "h": 480, "ratio": 1}
    motions = server.wait("phone", "motion", 30)
    assert [round(part, 1) for part in motions[0]["a"]] == [0.1, 9.8, 0.3]
    assert [round(part) for part in motions[0]["r"]] == [29, 14, -7]
    steps = [later["seq"] - sooner["seq"] for sooner, later in pairwise(motions)]
    assert set(steps) == {1}
    assert all(later["t"] > sooner["t"] for sooner, later in pairwise(motions))
    turned = server.wait("phone", "orientation", 2)[-1]
    assert [round(part, 2) for part in turned["q"]] == [0.1, 0.2, 0.3, 0.93]
    assert turned["absolute"] is False


def flipped_signs_are_passed_on(tab: Tab, server: LiveServer) -> None:
    """A browser that gives gravity with the other sign is not corrected here."""
    fake_sensors(tab, up=-9.8)
    opened(tab, server, sensors=False)
    assert round(server.wait("phone", "motion")[0]["a"][1], 1) == -9.8


def angles_serve_where_there_is_no_finer_sensor(tab: Tab, server: LiveServer) -> None:
    """`deviceorientation` becomes the quaternion that SciPy makes of its angles, which turn about z, x', y''."""
    opened(tab, server, script="delete globalThis.RelativeOrientationSensor")
    angles = {"alpha": 30, "beta": -40, "gamma": 50, "absolute": True}
    tab.evaluate(f"dispatchEvent(new DeviceOrientationEvent('deviceorientation', {json.dumps(angles)}))")
    until(lambda: any(said["absolute"] for said in server.said("phone", "orientation")), "the orientation comes")
    turned = next(said for said in server.said("phone", "orientation") if said["absolute"])
    wanted = Rotation.from_euler("ZXY", [30, -40, 50], degrees=True).as_quat()
    assert np.allclose(turned["q"], wanted, atol=1e-6)


def a_phone_held_still_says_its_orientation(tab: Tab, server: LiveServer) -> None:
    """Browsers say an orientation only when it changes; what holds is sent again, with a number of its own."""
    opened(tab, server)
    turned = server.wait("phone", "orientation", 8)
    assert {later["seq"] - sooner["seq"] for sooner, later in pairwise(turned)} == {1}
    assert all(later["t"] - sooner["t"] > 100 for sooner, later in pairwise(turned[-5:]))


def pings_tell_the_clock(tab: Tab, server: LiveServer) -> None:
    """Frequent at first; each brings the four times of the answer before."""
    opened(tab, server)
    pings = server.wait("phone", "ping", 20)
    assert "last" not in pings[0]
    lasts = [ping["last"] for ping in pings if "last" in ping]
    assert len(lasts) >= 15
    assert all(last["t1"] <= last["t4"] and last["t2"] <= last["t3"] for last in lasts)
    assert {last["t1"] for last in lasts} <= {ping["t1"] for ping in pings}


def the_newest_estimate_wins(tab: Tab, server: LiveServer) -> None:
    """Of many that come at once the last is drawn, older ones never, and each drawn one is acknowledged once."""
    opened(tab, server)
    for n in range(1, 41):
        server.say("phone", **show(n))
    until(lambda: server.said("phone", "drawn")[-1:] != [] and server.said("phone", "drawn")[-1]["n"] == 40, "40 drawn")
    server.say("phone", **running(target=1))  # draws once more
    has_come(server)
    numbers = [drawn["n"] for drawn in server.said("phone", "drawn")]
    assert numbers == sorted(set(numbers))


def a_press_names_what_was_seen(tab: Tab, server: LiveServer) -> None:
    """By finger, mouse and key: one selection each, with the number that was drawn and the instant of touching."""
    opened(tab, server)
    drawn = shown(server, 7)
    point = place(tab, "#select")
    fingers(tab, "touchStart", point)
    assert value(tab, "#select", "it.classList.contains('pressed')")
    later = shown(server, 8)
    time.sleep(0.08)
    key(tab, " ")
    fingers(tab, "touchEnd")
    chosen = server.wait("phone", "select")[0]
    assert chosen["n"] == 7
    assert drawn["t"] - 1 <= chosen["t"] <= later["t"]
    assert 60 <= chosen["pressed_ms"] <= 400
    sized(tab, 1440, 900)
    shown(server, 9)
    point = place(tab, "#select")
    for kind in ("mousePressed", "mouseReleased"):
        mouse(tab, kind, point["x"], point["y"])
    shown(server, 10)
    key(tab, " ")
    assert [select["n"] for select in server.wait("phone", "select", 3)] == [7, 9, 10]
    time.sleep(0.6)
    assert len(server.said("phone", "select")) == 3


def a_press_names_nothing_that_was_not_drawn(tab: Tab, server: LiveServer) -> None:
    """An estimate that has come, but is not on the screen yet, was not seen."""
    opened(tab, server)
    shown(server, 7)
    tab.evaluate("globalThis.requestAnimationFrame = () => 1; 0")
    server.say("phone", **show(8))
    has_come(server)
    touch(tab, "#select")
    assert server.wait("phone", "select")[0]["n"] == 7


def the_checks_are_asked_for_and_a_press_is_one(tab: Tab, server: LiveServer) -> None:
    """Before anything is shown there is nothing that a press could select; it goes out all the same."""
    opened(tab, server)
    server.say("phone", type="state", state="checks")
    until(lambda: "hold the phone still" in text(tab, "#message"), "it says what to do")
    assert not value(tab, "#select", "it.disabled")
    touch(tab, "#select")
    (press,) = server.wait("phone", "select")
    assert press["n"] == 0
    server.say("phone", type="state", state="waiting")
    until(lambda: bool(value(tab, "#select", "it.disabled")), "the button rests")


def what_the_study_says_is_shown(tab: Tab, server: LiveServer) -> None:
    """Countdown, words from the computer (as text only), the end, and that another phone is in use."""
    opened(tab, server)
    server.say("phone", **running("countdown") | {"seconds_left": 2.2})
    until(lambda: text(tab, "#message") == "3", "the countdown")
    server.say("phone", type="say", text="<b>Wait.</b>")
    until(lambda: text(tab, "#message") == "<b>Wait.</b>", "the words")
    server.say("phone", type="say", text="")
    for state, words in (("done", "is done"), ("second", "Another phone"), ("finished", "All tasks")):
        server.say("phone", **running(state))
        until(lambda words=words: words in text(tab, "#message"), state)  # type: ignore[misc]
        assert value(tab, "#select", "it.disabled")


def without_a_wake_lock_it_says_so(tab: Tab, server: LiveServer) -> None:
    """What to set, and it goes on."""
    opened(tab, server, script=_NO_WAKE_LOCK)
    assert server.wait("phone", "hello")[0]["wake_lock"] is False
    wait_for(tab, "#problems")
    assert "automatic lock" in text(tab, "#problem-list")
    assert text(tab, "#go-on") == "Go on"
    touch(tab, "#go-on")
    shown(server, 1)


def without_permission_it_is_a_display(tab: Tab, server: LiveServer) -> None:
    """It says what was denied and the way out, and can go on as a display."""
    opened(tab, server, script=_DENIED)
    assert server.wait("phone", "hello")[0]["permission"] == "denied"
    wait_for(tab, "#problems")
    assert "does not let this page use the motion sensors" in text(tab, "#problem-list")
    touch(tab, "#go-on")
    shown(server, 1)
    tab.open(f"{server.address}/phone")  # which nobody is asked about twice
    server.wait("phone", "hello", 2)
    shown(server, 2)
    assert not is_seen(tab, "#problems")
    assert server.said("phone", "motion") == []


def without_sensors_it_says_so(tab: Tab, server: LiveServer) -> None:
    """A browser whose sensors say nothing."""
    opened(tab, server, sensors=False)
    assert server.wait("phone", "hello")[0]["permission"] == "unavailable"
    wait_for(tab, "#problems")
    assert "no motion readings" in text(tab, "#problem-list")


def without_a_secure_connection_it_says_so(tab: Tab, server: LiveServer) -> None:
    """Plain http from elsewhere than this machine."""
    server.address = server.address.replace("127.0.0.1", "phone.test")
    opened(tab, server)
    assert server.wait("phone", "hello")[0]["secure"] is False
    wait_for(tab, "#problems")
    assert "secure connection" in text(tab, "#problem-list")
    assert "adb reverse" in text(tab, "#problem-list")


def in_the_demo_the_mouse_is_the_hand(tab: Tab, server: LiveServer) -> None:
    """No word of missing sensors; the pointer's place goes out, a click selects."""
    opened(tab, server, sensors=False, mouse=True)
    wait_for(tab, "#picture")
    assert not is_seen(tab, "#problems")
    sized(tab, 1440, 900)
    shown(server, 1)
    mouse(tab, "mouseMoved", 720, 450)
    mouse(tab, "mouseMoved", 360, 225)

    def is_there() -> bool:
        said = server.said("phone", "mouse")[-1:]
        return bool(said) and abs(said[0]["x"] + 500) < 3 and abs(said[0]["y"] - 750) < 3

    until(is_there, "the mouse's last place is known")
    shown(server, 2)
    for kind in ("mousePressed", "mouseReleased"):
        mouse(tab, kind, 360, 225)
    assert [select["n"] for select in server.wait("phone", "select")] == [2]


def the_window_has_its_true_size(tab: Tab, server: LiveServer) -> None:
    """Where the study wants it, a bank card is asked for once, and the window's mm are the screen's."""
    opened(tab, server, window="true_size", window_mm=[60, 34])
    wait_for(tab, "#calibration")
    value(tab, "#card-size", "it.focus()")
    key(tab, "Home")
    key(tab, "ArrowRight", 50)
    box = value(tab, "#card", "[it.offsetWidth, it.offsetHeight]")
    assert box == [round(85.6 * 4), round(53.98 * 4)]
    touch(tab, "#card-fits")
    shown(server, 1)
    inside, outside = (_is_painted(tab, x) for x in (427 - 118, 427 - 122))
    assert (inside, outside) == (True, False)
    tab.open(f"{server.address}/phone")
    server.wait("phone", "hello", 2)
    shown(server, 2)
    assert not is_seen(tab, "#calibration")


def _is_painted(tab: Tab, x: int) -> bool:
    pixel = f"it.getContext('2d').getImageData({x}, {480 // 2 - 50}, 1, 1).data[3]"
    return bool(value(tab, "#picture", pixel) == 255)


def left_handers_have_the_button_left(tab: Tab, server: LiveServer) -> None:
    """And the page remembers it."""
    opened(tab, server)
    assert place(tab, "#select")["x"] > 700
    tab.evaluate("sessionStorage.clear()")
    tab.open(f"{server.address}/phone")
    wait_for(tab, "#start")
    touch(tab, "#left-handed")
    touch(tab, "#start")
    server.wait("phone", "hello", 2)
    until(lambda: place(tab, "#select")["x"] < 150, "the button is left")


CASES = (
    readings_go_out_as_the_browser_gives_them,
    flipped_signs_are_passed_on,
    angles_serve_where_there_is_no_finer_sensor,
    a_phone_held_still_says_its_orientation,
    pings_tell_the_clock,
    the_newest_estimate_wins,
    a_press_names_what_was_seen,
    a_press_names_nothing_that_was_not_drawn,
    the_checks_are_asked_for_and_a_press_is_one,
    what_the_study_says_is_shown,
    without_a_wake_lock_it_says_so,
    without_permission_it_is_a_display,
    without_sensors_it_says_so,
    without_a_secure_connection_it_says_so,
    in_the_demo_the_mouse_is_the_hand,
    the_window_has_its_true_size,
    left_handers_have_the_button_left,
)
