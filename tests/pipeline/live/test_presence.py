"""Whether the phone is there, and what its light says of it."""

from __future__ import annotations

from pathlib import Path

from pipeline.live import panel
from pipeline.live.events import Action, Close, Said
from pipeline.live.messages import VERSION, Battery, Hello, Ping, Visible
from tests.pipeline.live.lab import MS, PHONE, Lab, lab, notes
from tests.pipeline.live.studies import STUDY

__all__ = ["lab"]  # a fixture


def test_a_phone_that_sleeps_is_away_though_its_connection_seems_to_live(lab: Lab) -> None:
    def speaks() -> list[Action]:
        return lab.happens(Said("phone", PHONE, Ping(lab.now / MS), lab.now))

    lab.goes_on(0.5)
    lab.does("start")
    assert notes(lab.goes_on(1.5)) == []  # it has never asked for the time: nothing is known of its silence
    speaks()
    assert notes([*lab.goes_on(0.9), *speaks()]) == []
    assert notes(lab.goes_on(1.5)) == ["phone_away"]
    light = panel.lights(lab.run, lab.now).content["lights"]["phone"]  # type: ignore[index]
    assert light["light"] == "red" and "wake the phone up" in light["text"]
    assert notes([*speaks(), *lab.goes_on(0.5)]) == ["phone_back"]
    assert lab.run.phase == "session"
    actions = lab.goes_on(2.2)
    assert any(isinstance(one, Close) and one.set_aside for one in actions)
    assert lab.run.attempt is not None and lab.run.attempt.ended_by == "the phone was away for over 2 s"


def test_a_hidden_page_is_noted_and_a_low_battery_said(lab: Lab) -> None:
    lab.goes_on(0.5)
    lab.does("start")
    assert notes(lab.happens(Said("phone", PHONE, Visible(False, lab.now / MS), lab.now))) == ["phone_hidden"]
    assert notes(lab.happens(Said("phone", PHONE, Visible(True, lab.now / MS), lab.now))) == ["phone_visible"]
    lab.happens(Said("phone", PHONE, Battery(0.12), lab.now))
    light = panel.lights(lab.run, lab.now).content["lights"]["phone"]  # type: ignore[index]
    assert light == {"light": "amber", "text": "Connected; its battery is at 12%: plug it in."}


def test_a_phone_whose_browser_gives_no_motion_is_red(tmp_path: Path) -> None:
    lab = Lab(tmp_path, STUDY.replace("imu: {demo: {}}}", "imu: {phone: motion}}"))
    lab.happens(Said("phone", PHONE, Hello("phone", 1, "a browser", permission="denied", wake_lock=True), lab.now))
    light = panel.lights(lab.run, lab.now).content["lights"]["phone"]  # type: ignore[index]
    assert light == {"light": "red", "text": "Connected; it gives no motion: see its page."}


def test_a_page_that_a_browser_has_kept_of_an_older_version_is_red(lab: Lab) -> None:
    """What it sends may mean something else now."""
    lab.happens(Said("phone", PHONE, Hello("phone", VERSION + 1, "a browser", wake_lock=True), lab.now))
    light = panel.lights(lab.run, lab.now).content["lights"]["phone"]  # type: ignore[index]
    assert light == {"light": "red", "text": "Connected; its page is of another version of Steadyhand: load it anew."}
