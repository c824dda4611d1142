"""The checks before a task: what each sees, in which light it shows that, and that a red one wants a reason."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.live import checks, run_state, study_run, watch
from pipeline.live.events import Action, Closed, Examine, Examined, Joined, Open, Reading, Said, Tell, Tick, Write
from pipeline.live.messages import Do, Exchange, Ping, Select
from pipeline.live.outgoing import PhaseOfTask, Refused
from pipeline.live.setup import Setup
from pipeline.live.watch import Kept, Light, Request, Row, Watched
from pipeline.statistics.arrays import FloatArray
from tests.pipeline.live import hands
from tests.pipeline.live.studies import study_in

MS = 1_000_000
OPERATOR, PHONE = 1, 2


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return study_in(tmp_path_factory.mktemp("study"))[1]


def seen(
    setup: Setup, phone: FloatArray | None = None, tracker_late_s: float = 0.1, sd: float | None = None
) -> dict[str, Light]:
    """The lights of a recording in which only what is given is unlike a good one, by their names."""
    time, good = hands.phone()
    tracker_s, places = hands.tracker()
    rows = {
        "imu": hands.rows(time, good if phone is None else phone, 0.01),
        "tracker": hands.rows(tracker_s, places, tracker_late_s, stamped_late=True),
    }
    guided, claims = checks.examined(setup.study, Request(rows, sd))
    return {one.id: one for one in (*guided, *claims)}


def test_a_good_phone_and_tracker_are_green(setup: Setup) -> None:
    found = seen(setup)
    assert {name: one.light for name, one in found.items()} == dict.fromkeys(
        ["still", "turn", "sweep", "claims"], "green"
    )
    assert found["still"].text.startswith("At rest 9.81 m/s², noise 0.05 m/s²")
    assert "100 ms by study.yaml" in found["sweep"].text
    assert found["claims"].text.endswith("contradict nothing in study.yaml.")


def test_an_accelerometer_in_g_is_red_at_rest_and_the_report_s_check_says_so_too(setup: Setup) -> None:
    _, values = hands.phone()
    found = seen(setup, np.hstack([values[:, :3] / 9.80665, values[:, 3:]]))
    assert found["still"].light == "red"
    assert "recording: senders: imu: unit" in found["still"].text
    assert "they are in g" in found["specific force: imu"].text


def test_a_biased_gyroscope_is_amber_at_rest(setup: Setup) -> None:
    _, values = hands.phone()
    found = seen(setup, values + np.array([0, 0, 0, 0.1, 0, 0, 0, 0, 0, 0]))["still"]
    assert (found.light, "Lay the phone down" in found.text) == ("amber", True)


@pytest.mark.parametrize(
    ("factors", "words"),
    [((-1, -1, -1), "turning"), ((57.3, 57.3, 57.3), "degrees per second"), ((1, -1, 1), "turning")],
)
def test_a_gyroscope_that_does_not_turn_as_the_orientation_is_red(
    setup: Setup, factors: tuple[float, ...], words: str
) -> None:
    _, values = hands.phone()
    values[:, 3:6] *= factors
    found = seen(setup, values)["turn"]
    assert found.light == "red"
    assert words in found.text


def test_without_an_orientation_gravity_tells_the_gyroscope_s_unit(setup: Setup) -> None:
    _, values = hands.phone()
    values[:, 6:] = np.nan
    assert seen(setup, values)["turn"].light == "green"
    values[:, 3:6] *= 57.3
    assert "degrees per second" in seen(setup, values)["turn"].text


@pytest.mark.parametrize(("late_s", "light"), [(0.1, "green"), (0.125, "green"), (0.02, "red"), (0.25, "red")])
def test_a_lag_that_study_yaml_does_not_state_is_red(setup: Setup, late_s: float, light: str) -> None:
    found = seen(setup, tracker_late_s=late_s)["sweep"]
    assert found.light == light
    assert ("set latency_s: " in found.text) == (light == "red")


@pytest.mark.parametrize(("pace_rad_s", "is_same_hand"), [(8.2, True), (12.6, True), (8.2, False)])
def test_an_even_sweep_accuses_nobody(setup: Setup, pace_rad_s: float, is_same_hand: bool) -> None:
    """Of an even beat any fits any other, a period off; and of another's movement it is said that it is another's."""
    random = np.random.default_rng(0)
    time, values = hands.phone()
    tracker_s, _ = hands.tracker()
    x, y = 0.1 * np.sin(pace_rad_s * tracker_s), 0.5 + 0.04 * np.sin(pace_rad_s / 2 * tracker_s)
    places = np.column_stack([x, y, np.full(len(x), 1.2)]) + random.normal(0, 1e-3, (len(x), 3))
    if is_same_hand:
        along_x, along_y = (
            -far * rate**2 * np.sin(rate * time) for far, rate in ((0.1, pace_rad_s), (0.04, pace_rad_s / 2))
        )
        moved = np.column_stack([along_x, along_y, np.zeros(len(time))])
        values[:, :3] = moved - hands.GRAVITY_M_S2 + random.normal(0, 0.05, moved.shape)
        values[:, 3:] = [0, 0, 0, 0, 0, 0, 1]
    rows = {"imu": hands.rows(time, values, 0.01), "tracker": hands.rows(tracker_s, places, 0.1, stamped_late=True)}
    guided, claims = checks.examined(setup.study, Request(rows))
    found = {one.id: one for one in (*guided, *claims)}
    assert found["sweep"].light != "red"
    if not is_same_hand:
        assert found["sweep"].text.endswith("it is another phone, or the axes of one are wrong.")
    assert not any(one.startswith(("one movement", "lag")) for one in found)


def test_a_heading_that_is_not_known_yet_is_amber(setup: Setup) -> None:
    assert seen(setup, sd=np.inf)["sweep"].light == "amber"
    assert seen(setup, sd=np.radians(6.0))["sweep"].light == "amber"
    known = seen(setup, sd=np.radians(3.0))["sweep"]
    assert (known.light, known.text.endswith("Heading ± 3.0°.")) == ("green", True)


def test_of_what_has_not_been_seen_nothing_is_said(setup: Setup) -> None:
    time, values = hands.phone()
    rows = {"imu": hands.rows(time[:100], values[:100], 0.01)}
    assert checks.examined(setup.study, Request(rows)) == ((), ())
    assert checks.examined(setup.study, Request({})) == ((), ())


@given(st.lists(st.integers(0, 900 * MS), max_size=300))
def test_the_last_twenty_seconds_are_kept_and_hardly_more(steps_ns: list[int]) -> None:
    watched, at, all_rows = Watched(), 0, []
    for step in steps_ns:
        at += step
        all_rows.append(Row(at, at, (0.0, 0.0, 0.0)))
        watched = watch.kept(watched, "tracker", all_rows[-1])
    kept = watched.streams.get("tracker", Kept())
    since = at - watch.KEPT_NS
    assert kept.since(since) == tuple(row for row in all_rows if row.arrival_ns >= since)
    assert len(kept.since(0)) <= len(kept.since(since)) + 2 * 64


class Lab:
    """A study whose checks are made at once."""

    def __init__(self, folder: Path) -> None:
        _, setup = study_in(folder)
        self.run = run_state.begin(setup, setup.empty_plan())
        self.at_ns = hands.EPOCH_NS
        self.actions: list[Action] = []
        for role, client in (("operator", OPERATOR), ("phone", PHONE)):
            self.happens(Joined(role, client, self.at_ns))  # type: ignore[arg-type]

    def happens(self, event: object) -> list[Action]:
        self.run, actions = study_run.step(self.run, event)  # type: ignore[arg-type]
        self.actions += actions
        found = list(actions)
        for action in actions:
            if isinstance(action, Examine):
                seen, claims = checks.examined(self.run.setup.study, action.request)
                found += self.happens(Examined(seen, claims, self.at_ns))
        return found

    def plays(self, gravity: float = 1.0) -> None:
        """A hand that does what the checks want; what it feels at rest is `gravity` times as much."""
        rows = [("imu", row) for row in hands.rows(*hands.phone(), late_s=0.01)]
        rows += [("tracker", row) for row in hands.rows(*hands.tracker(), late_s=0.1, stamped_late=True)]
        for count, (name, row) in enumerate(sorted(rows, key=lambda one: one[1].arrival_ns)):
            self.at_ns = row.arrival_ns
            scale = np.array([gravity] * 3 + [1.0] * 7) if name == "imu" else np.ones(3)
            values = tuple((np.array(row.values) * scale).tolist())
            self.happens(Reading(name, row.stamp_ns, row.arrival_ns, values))
            if count % 20 == 0:
                self.happens(Tick(self.at_ns))

    def taps(self) -> list[Action]:
        """A press of the button, 30 ms on its way."""
        at_ms = self.at_ns / MS
        self.says("phone", PHONE, Ping(at_ms, Exchange(at_ms - 4, at_ms, at_ms, at_ms + 4)))
        return self.says("phone", PHONE, Select(0, at_ms - 30))

    def says(self, role: str, client: int, message: object) -> list[Action]:
        return self.happens(Said(role, client, message, self.at_ns))  # type: ignore[arg-type]

    @property
    def lights(self) -> dict[str, str]:
        return {one.id: one.light for one in self.run.checks}


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    lab = Lab(tmp_path_factory.mktemp("played"))
    lab.plays()
    return lab


@pytest.fixture
def checked(played: Lab) -> Lab:
    """A study in which all checks but the press were seen; what it goes on to changes nobody else's state."""
    lab = copy(played)
    lab.actions = list(played.actions)
    return lab


def phases(actions: list[Action]) -> list[str]:
    return [one.message.state for one in actions if isinstance(one, Tell) and isinstance(one.message, PhaseOfTask)]


def test_the_phone_asks_for_the_checks_until_all_have_been_seen(tmp_path: Path, checked: Lab) -> None:
    begun, lab = Lab(tmp_path), checked
    assert phases(begun.actions) == ["checks"]
    assert begun.lights == dict.fromkeys(["still", "turn", "sweep", "reach", "tap"], "off")
    assert phases(lab.actions) == ["checks"]
    assert lab.lights == {
        "still": "green",
        "turn": "green",
        "sweep": "green",
        "reach": "green",
        "tap": "off",
        "claims": "green",
    }
    assert phases(lab.taps()) == ["waiting"]
    assert lab.lights["tap"] == "green"
    assert (
        next(one.text for one in lab.run.checks if one.id == "tap") == "A press is known after 30 ms, round trip 8 ms."
    )
    assert phases(lab.happens(Joined("phone", 3, lab.at_ns))) == ["second"]


def test_the_corners_are_seen_one_after_the_other(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    texts = []
    for x, y in ((-200, 500), (180, 520), (0, 550), (190, 610), (-230, 590)):
        lab.at_ns += 100 * MS
        lab.happens(Reading("tracker", None, lab.at_ns, (x / 1e3, y / 1e3, 1.0)))
        texts.append(next(one for one in lab.run.checks if one.id == "reach"))
    assert [one.light for one in texts] == ["amber", "amber", "amber", "amber", "green"]
    assert texts[2].text.startswith("The tracker has seen 2 of 4 corners.")


def test_a_red_check_wants_a_reason_which_the_log_gives(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.plays(gravity=1 / 9.80665)
    assert lab.lights["still"] == "red"
    (refused,) = (
        one.message
        for one in lab.says("operator", OPERATOR, Do("start", "", "d1"))
        if isinstance(one, Tell) and isinstance(one.message, Refused)
    )
    assert refused.reason_overrules
    assert refused.why.startswith("At rest 1.00 m/s²")
    (opened,) = (one for one in lab.says("operator", OPERATOR, Do("start", "a trial", "d2")) if isinstance(one, Open))
    assert opened.facts["started_although"] == "a trial"
    assert refused.why in opened.facts["overruled"]
    assert opened.facts["check_still"] == f"red: {refused.why}"
    assert opened.facts["check_tap"] == "off: Press the button on the phone."


def starts(lab: Lab, reason: str = "") -> tuple[list[Refused], list[Open]]:
    """What the operator is told, and the log that is begun."""
    actions = lab.says("operator", OPERATOR, Do("start", reason, "d"))
    told = [one.message for one in actions if isinstance(one, Tell) and isinstance(one.message, Refused)]
    return told, [one for one in actions if isinstance(one, Open)]


def test_a_first_task_wants_every_check_or_a_reason_which_the_log_gives(checked: Lab) -> None:
    lab = checked
    (refused,), opened = starts(lab)
    assert opened == []
    assert refused.reason_overrules
    assert refused.why == ("Not all checks are done: Press the button on the phone. Or give a reason to start without.")
    refusals, (log,) = starts(lab, "the button is out of reach")
    assert refusals == []
    assert log.facts["started_although"] == "the button is out of reach"
    assert log.facts["overruled"] == "tap: not done."


def test_a_first_task_begins_without_a_reason_once_every_check_is_done(checked: Lab) -> None:
    lab = checked
    lab.taps()
    refusals, (log,) = starts(lab)
    assert refusals == []
    assert "started_although" not in log.facts and "overruled" not in log.facts


def test_later_tasks_and_attempts_want_no_checks_again(checked: Lab) -> None:
    lab = checked
    starts(lab, "the button is out of reach")
    lab.says("operator", OPERATOR, Do("abort", "the light went out", "d"))
    lab.happens(Closed("data/set-aside/P01_kinect.1.mcap", lab.at_ns))
    refusals, opened = starts(lab)
    assert refusals == [] and len(opened) == 1


def test_without_a_phone_no_reason_helps(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.run = replace(lab.run, phone=None, phones=())
    (refused,) = (
        one.message
        for one in lab.says("operator", OPERATOR, Do("start", "anyway", "d"))
        if isinstance(one, Tell) and isinstance(one.message, Refused)
    )
    assert not refused.reason_overrules


def test_a_light_that_turns_red_during_a_task_is_noted_in_the_log(checked: Lab) -> None:
    lab = checked
    lab.taps()
    lab.says("operator", OPERATOR, Do("start", "", "d"))
    red = Light("held positions: tracker", "red", "It holds.")
    actions = lab.happens(Examined((), (red,), lab.at_ns))
    notes = [one.message.event for one in actions if isinstance(one, Write)]
    assert notes == [{"type": "light", "text": "held positions: tracker: It holds."}]
    assert lab.happens(Examined((), (red,), lab.at_ns)) == []  # said once


def test_another_phone_is_checked_anew_and_a_simulated_one_not_at_all(setup: Setup, tmp_path: Path) -> None:
    assert replace(setup, guided=()).guided == ()
    lab = Lab(tmp_path)
    light = checks.tap(20.0, None)
    lab.run = replace(lab.run, watched=replace(lab.run.watched, found={"tap": light, "still": light}))
    after, _ = run_state.activate(lab.run, 5, lab.at_ns)
    assert set(after.watched.found) == {"still"}  # the IMU is not in the phone, but sends by UDP
    assert study_in(tmp_path / "demo")[1].guided == ("still", "turn", "sweep", "reach", "tap")


@pytest.mark.parametrize(("late_ms", "light"), [(5, "green"), (80, "amber"), (300, "red")])
def test_a_slow_press_is_said_with_its_remedy(late_ms: float, light: str) -> None:
    found = checks.tap(late_ms, 40.0)
    assert found.light == light
    assert ("USB cable" in found.text) == (light != "green")
