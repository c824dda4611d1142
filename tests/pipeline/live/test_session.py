"""The laws of an attempt: its log replays to what was shown, each trial has one selection, nothing queues or grows."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion_core import Samples
from pipeline.engine.stage import Work
from pipeline.errors import PipelineError
from pipeline.live import session, session_state
from pipeline.live.clerk import agreement
from pipeline.live.events import Action, Close, Reading, Show, Tell, Tick, Write
from pipeline.live.outgoing import Say, Selected
from pipeline.live.session_state import PhoneDrew, PhoneIs, PhonePressed, Session
from pipeline.live.session_words import NOTES
from pipeline.live.setup import Setup
from pipeline.live.streams import sample_of
from pipeline.sessions import ingest, recording
from pipeline.sessions.estimators import build_estimator
from pipeline.sessions.logs.mcap import Message, write
from pipeline.study.session import Session as StudySession
from tests.pipeline.live.studies import STUDY, study_in

EPOCH_NS = 1_764_350_000_000_000_000
MS = 1_000_000
ESTIMATORS = ("raw", "kinect", "window", "fusion", "adaptive")
MOUNTINGS = ("lever_arm_mm: [40, -10, 25], mounting_xyzw: [0.1, 0, 0.05, 1]", "mounting_xyzw: [0, 0.2, 0, 1]")


@dataclass
class Played:
    """An attempt, and what came of it."""

    state: Session
    actions: list[Action] = field(default_factory=list)

    def happens(self, event: session_state.Event) -> list[Action]:
        """One more event; returns what followed."""
        self.state, actions = session.step(self.state, event)
        self.actions += actions
        return list(actions)

    @property
    def messages(self) -> list[Message]:
        """What was logged."""
        return [action.message for action in self.actions if isinstance(action, Write)]

    def events(self, kind: str) -> list[Message]:
        """The logged events of a type."""
        return [one for one in self.messages if one.content == "events" and one.event and one.event["type"] == kind]


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return study_in(tmp_path_factory.mktemp("study"))[1]


def begun(setup: Setup, estimator: str = "fusion", **changes: object) -> Played:
    """An attempt that shows an estimator, in its countdown."""
    study = setup.study.model_copy(update={"shown": {"kinect": "kinect", "fusion": estimator}})
    setup = replace(setup, study=study, estimators={estimator: build_estimator(study, estimator)})
    attempt = setup.attempt("P01", "fusion")
    attempt = replace(attempt, **changes)  # type: ignore[arg-type]
    state, actions = session.begin(attempt, 1, EPOCH_NS)
    return Played(state, list(actions))


def tracker(at_ms: float, x_mm: float, seq: int | None = None, arrival_ms: float | None = None) -> Reading:
    stamp, arrival = EPOCH_NS + round(at_ms * MS), EPOCH_NS + round((at_ms if arrival_ms is None else arrival_ms) * MS)
    return Reading("tracker", stamp, arrival, (x_mm / 1e3, 0.5, 1.2), seq)


def imu(at_ms: float, acceleration: float = 0.0, seq: int | None = None, arrival_ms: float | None = None) -> Reading:
    stamp, arrival = EPOCH_NS + round(at_ms * MS), EPOCH_NS + round((at_ms if arrival_ms is None else arrival_ms) * MS)
    return Reading("imu", stamp, arrival, (acceleration, 9.80665, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), seq)


def drawn(actions: list[Action], at_ms: float) -> list[PhoneDrew]:
    """The phone draws at once what it was sent."""
    at = EPOCH_NS + round(at_ms * MS)
    return [PhoneDrew(one.message.n, at, at) for one in actions if isinstance(one, Show)]  # type: ignore[union-attr]


HAPPENINGS = st.lists(
    st.tuples(
        st.sampled_from(["tracker", "imu", "imu", "imu", "draw", "draw", "press", "tick", "leave", "come"]),
        st.integers(0, 40_000),  # µs on
        st.integers(-60_000, 20_000),  # µs: the reading's stamp, from its arrival
        st.integers(0, 3),  # numbers back, for duplicates
        st.floats(-300, 300),
    ),
    min_size=30,
    max_size=150,
)


@pytest.mark.parametrize("name", ESTIMATORS)
@settings(max_examples=12)
@given(happenings=HAPPENINGS)
def test_the_log_replays_to_what_was_shown_whatever_happens(
    name: str,
    happenings: list[tuple[str, int, int, int, float]],
    setup: Setup,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    replays(name, happenings, setup, tmp_path_factory.mktemp("replay"))


@pytest.fixture(scope="module", params=MOUNTINGS)
def with_mounting(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return study_in(tmp_path_factory.mktemp("mounted"), mounted(request.param))[1]


@pytest.mark.parametrize("name", ["kinect", "fusion", "adaptive"])
@settings(max_examples=8)
@given(happenings=HAPPENINGS)
def test_so_it_does_with_a_phone_s_mounting(
    name: str,
    happenings: list[tuple[str, int, int, int, float]],
    with_mounting: Setup,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    replays(name, happenings, with_mounting, tmp_path_factory.mktemp("replay"))


def test_what_is_shown_moves_with_the_phone_s_lever_arm(tmp_path: Path) -> None:
    setup = study_in(tmp_path, mounted("lever_arm_mm: [40, -10, 0]"))[1]
    played = begun(setup, "raw", countdown_ns=0)
    assert not [one for one in played.happens(tracker(0.0, 100.0)) if isinstance(one, Show | Write)]  # turned how?
    played.happens(imu(-150.0, arrival_ms=1.0))  # the tracker is 100 ms late
    played.happens(tracker(2.0, 100.0))
    assert played.state.sent[-1].mean_mm == pytest.approx((100.0, 500.0))
    turned = (0.0, 9.80665, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))  # by 90° about z
    at = EPOCH_NS + 3 * MS
    played.happens(PhoneDrew(played.state.sent[-1].n, at, at))
    played.happens(Reading("imu", at, at, turned))
    assert played.state.sent[-1].mean_mm == pytest.approx((100.0 - 40.0 + 10.0, 500.0 + 10.0 + 40.0))


def test_what_a_live_study_cannot_do_about_mountings_is_said(tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match="imu: calibrate_s: a live study learns no mounting"):
        study_in(tmp_path, mounted("calibrate_s: 30"))
    text = mounted("lever_arm_mm: [1, 0, 0]").replace(
        "  display:",
        "  second: {topic: /second, kind: acceleration,"
        " gravity_mm_s2: [0, -9806.65, 0], mounting_xyzw: [0, 0, 1, 1]}\n  display:",
    )
    with pytest.raises(PipelineError, match="imu and second both state a mounting; a live study takes one"):
        study_in(tmp_path, text.replace("imu: {demo: {}}}", "imu: {demo: {}}, second: {demo: {}}}"))


def mounted(mounting: str) -> str:
    """The study with what a phone's stream says of its mounting."""
    return STUDY.replace("noise_sd_mm_s2: 100,", f"noise_sd_mm_s2: 100, {mounting},")


def replays(name: str, happenings: list[tuple[str, int, int, int, float]], setup: Setup, folder: Path) -> None:
    """Whatever happens, the log replays to what was shown by that estimator."""
    played = begun(setup, name, countdown_ns=0)
    now, sent = EPOCH_NS, [0]
    for number, (what, on_us, stamp_us, back, figure) in enumerate(happenings):
        now += on_us * 1000
        seq = max(number - back, 0)
        event: session_state.Event
        if what == "tracker":
            event = Reading("tracker", now + stamp_us * 1000, now, (figure / 1e3, 0.5, 1.2), seq)
        elif what == "imu":
            turn = np.array([np.sin(figure), 0.0, 0.0, np.cos(figure)]).tolist()
            event = Reading("imu", now + stamp_us * 1000, now, (figure / 100, 9.8, 0.1, 0, 0, 0, *turn), seq)
        elif what == "draw":
            event = PhoneDrew(sent[-1 - min(back, len(sent) - 1)], now, now)
        elif what == "press":
            event = PhonePressed(sent[-1], now - back * MS, now)
        else:
            event = Tick(now) if what == "tick" else PhoneIs(1 if what == "come" else None, now)
        actions = played.happens(event)
        sent += [one.message.n for one in actions if isinstance(one, Show)]  # type: ignore[union-attr]
    shown = [one for one in played.messages if one.topic == "/display/position"]
    path = folder / "P01_fusion.mcap"
    if not played.messages:
        return
    write(path, {"participant": "P01", "condition": "fusion"}, played.messages)
    study = setup.study.model_copy(update={"shown": {"kinect": "kinect", "fusion": name}})
    agreed = agreement(study, folder, path, "P01", "fusion")
    if agreed is not None:
        assert agreed[0] <= 2e-9  # round-off is in proportion to the readings: 1e-9 mm for 1 g, and here 2 g are left
        assert agreed[1] == len(shown)
    instants = [one.stamp_ns for one in shown]
    assert instants == sorted(set(instants))
    for trial, selections in enumerate(played.events("selection"), start=1):
        assert selections.event is not None
        assert selections.event["trial"] == trial  # each once, in order


def test_samples_are_those_that_a_report_makes_of_the_log(setup: Setup, tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    played = begun(setup, "fusion", countdown_ns=0)
    for number in range(120):
        at = number * 11.0
        turn = random.normal(0, 1, 4)
        values = (*random.normal(0, 5, 6).tolist(), *(turn / np.linalg.norm(turn)).tolist())
        played.happens(Reading("imu", EPOCH_NS + round((at - 3) * MS), EPOCH_NS + round(at * MS), values, number))
        if number % 3 == 0:
            played.happens(tracker(at + 1, float(random.normal(0, 100))))
    path = tmp_path / "P01_fusion.mcap"
    write(path, {"participant": "P01", "condition": "fusion"}, played.messages)
    out = tmp_path / "out"
    out.mkdir()
    ingest.run(Work("", setup.study, tmp_path, out, (StudySession("P01_fusion", "P01", "fusion", path),)))
    loaded = recording.load(setup.study, out)
    assert played.state.origin_ns == loaded.origin_ns
    for name in ("tracker", "imu"):
        samples: Samples = loaded.samples[name]
        logged = [one for one in played.messages if one.topic == setup.streams[name].topic]
        assert len(logged) == len(samples) > 30
        for row, one in enumerate(logged):
            assert one.values is not None
            stream = setup.streams[name]
            mine = sample_of(stream, one.stamp_ns, one.arrival_ns, tuple(one.values.tolist()), loaded.origin_ns)
            assert mine is not None
            assert (mine.time, mine.arrival) == (samples.time[row], samples.arrival[row])
            np.testing.assert_allclose(mine.value, samples.value[row], rtol=0, atol=1e-9)


def test_at_most_two_estimates_are_under_way_and_the_newest_wins(setup: Setup) -> None:
    played = begun(setup, countdown_ns=0)
    shows: list[Show] = []
    for number in range(100):
        for event in (tracker(number * 10.0, float(number)), imu(number * 10.0 + 5)):
            shows += [one for one in played.happens(event) if isinstance(one, Show)]
    assert len(shows) == 2  # the phone has drawn nothing
    later = played.happens(PhoneDrew(shows[0].message.n, EPOCH_NS + 1000 * MS, EPOCH_NS + 1000 * MS))  # type: ignore[union-attr]
    (show,) = (one for one in later if isinstance(one, Show))
    assert show.made_ns >= EPOCH_NS + 1000 * MS  # of all that is known now
    again = played.happens(PhoneDrew(shows[0].message.n, EPOCH_NS + 1001 * MS, EPOCH_NS + 1001 * MS))  # type: ignore[union-attr]
    assert again == []


def test_a_task_from_practice_to_its_last_selection(setup: Setup) -> None:
    played = begun(setup, practice=2)
    assert played.state.phase == "practice"
    at = 0.0
    actions = played.happens(tracker(at, 0.0))
    phases = []
    for number in range(1, 700):
        at = number * 11.0
        actions = [*played.happens(Tick(EPOCH_NS + round(at * MS))), *played.happens(imu(at))]
        if number % 3 == 0:
            actions += played.happens(tracker(at + 1, 0.0))
        for event in drawn(actions, at + 2):
            played.happens(event)
        if number % 60 == 0:
            played.happens(PhonePressed(played.state.drawn, EPOCH_NS + round(at * MS), EPOCH_NS + round((at + 3) * MS)))
        phases.append(played.state.phase)
    assert list(dict.fromkeys(phases)) == ["practice", "countdown", "running", "ended"]
    starts, selections = played.events("trial_start"), played.events("selection")
    assert [len(played.events(kind)) for kind in ("session_start", "session_end")] == [1, 1]
    assert [one.event and one.event["trial"] for one in starts] == [1, 2, 3]
    assert [one.event and one.event["trial"] for one in selections] == [1, 2, 3]
    for start, selection in zip(starts, selections, strict=True):
        assert start.arrival_ns < selection.arrival_ns
    for selection, start in zip(selections, starts[1:], strict=False):
        assert selection.arrival_ns < start.arrival_ns
    assert sum(isinstance(one, Tell) and isinstance(one.message, Selected) for one in played.actions) == 3
    assert played.actions[-1] == Close(set_aside=False)
    assert played.happens(imu(at + 100)) == []  # nothing after the end


def test_what_was_on_the_screen_is_what_was_selected(setup: Setup) -> None:
    played = begun(setup, "raw", countdown_ns=0)
    played.happens(Tick(EPOCH_NS + MS))
    first = drawn(played.happens(tracker(10, 111.0)), 12)
    second = drawn(played.happens(tracker(40, 222.0)), 42)
    for event in (*first, *second):
        played.happens(event)
    pressed = EPOCH_NS + 41 * MS
    played.happens(PhonePressed(first[0].n, pressed, EPOCH_NS + 60 * MS))
    (selection,) = played.events("selection")
    assert selection.arrival_ns == pressed
    assert selection.event is not None
    assert selection.event["x"] == pytest.approx(0.111)
    played.happens(PhonePressed(first[0].n, pressed, EPOCH_NS + 90 * MS))  # sent once more
    played.happens(PhonePressed(9999, EPOCH_NS + 900 * MS, EPOCH_NS + 900 * MS))  # nobody has seen that one
    assert len(played.events("selection")) == 1
    assert played.state.ignored_presses == 2


def test_duplicates_and_old_stamps_are_dropped_and_counted(setup: Setup) -> None:
    played = begun(setup, "adaptive", countdown_ns=0)
    played.happens(tracker(1, 0.0))
    for number, seq in enumerate([0, 1, 2, 2, 5, 3, 5, 1, 6]):
        played.happens(imu(10.0 + number, 0.1 * number, seq))
    played.happens(imu(200.0, 0.3))
    played.happens(imu(200.0, 0.3, arrival_ms=230))  # an exact copy without a number
    played.happens(imu(5_000.0, 0.1))
    played.happens(imu(2_500.0, 0.1, arrival_ms=5_001))  # from long ago
    heard = played.state.heard["imu"]
    assert (heard.taken, heard.dropped, heard.lost) == (8, 5, 1)  # number 4 never came
    assert sum(one.topic == "/phone/imu" for one in played.messages) == 8


def test_a_sender_that_begins_again_is_taken(setup: Setup) -> None:
    played = begun(setup, countdown_ns=0)
    for number in range(600):
        played.happens(imu(number * 10.0, 0.1, number))
    for number in range(50):
        played.happens(imu(6_000 + number * 10.0, 0.1, number))
    assert played.state.heard["imu"].dropped == 0


def test_an_acceleration_without_an_orientation_is_not_used_and_not_logged_where_it_would_be(setup: Setup) -> None:
    unknown = Reading("imu", EPOCH_NS, EPOCH_NS + MS, (0.0, 9.8, 0.0, 0.0, 0.0, 0.0, *[float("nan")] * 4))
    played = begun(setup, "fusion")
    played.happens(unknown)
    assert played.state.heard["imu"].dropped == 1
    assert all(one.topic != "/phone/imu" for one in played.messages)
    other = begun(setup, "kinect")  # which does not use it, so other estimators may have what there is
    other.happens(unknown)
    assert other.state.heard["imu"].taken == 1


def test_a_silent_sensor_is_said_and_noted_and_a_phone_that_stays_away_ends_the_attempt(setup: Setup) -> None:
    played = begun(setup, countdown_ns=0)
    for number in range(20):
        at = number * 33.0
        played.happens(Tick(EPOCH_NS + round(at * MS)))
        played.happens(tracker(at, 0.0))
        played.happens(imu(at + 5))
    said: list[str] = []
    for at in range(700, 3_500, 50):
        actions = [*played.happens(imu(float(at))), *played.happens(Tick(EPOCH_NS + at * MS))]
        said += [one.message.text for one in actions if isinstance(one, Tell) and isinstance(one.message, Say)]
    said += [
        one.message.text
        for event in (tracker(3_500, 0.0), Tick(EPOCH_NS + 3_510 * MS))
        for one in played.happens(event)
        if isinstance(one, Tell) and isinstance(one.message, Say)
    ]
    assert said == ["Please wait.", ""]
    notes = [one.event["type"] for one in played.messages if one.topic == NOTES and one.event]
    assert notes == ["sensor_silent", "sensor_lost", "sensor_back"]
    played.happens(PhoneIs(None, EPOCH_NS + 4_000 * MS))
    played.happens(Tick(EPOCH_NS + 5_900 * MS))
    assert played.state.phase == "running"
    played.happens(PhoneIs(2, EPOCH_NS + 5_950 * MS))  # back in time: the trial goes on
    played.happens(Tick(EPOCH_NS + 7_000 * MS))
    assert played.state.phase == "running"
    played.happens(PhoneIs(None, EPOCH_NS + 7_100 * MS))
    actions = played.happens(Tick(EPOCH_NS + 9_200 * MS))
    assert actions[-1] == Close(set_aside=True)
    assert "away" in played.state.ended_by


def test_the_state_does_not_grow(setup: Setup) -> None:
    played = begun(setup, "fusion", countdown_ns=0, abort_after_ns=10**15)
    sizes = []
    for number in range(9_000):
        at = number * 11.0
        actions = played.happens(imu(at, 0.01, number))
        if number % 3 == 0:
            actions += played.happens(tracker(at + 1, float(number % 100), number // 3, at + 50))
        for event in drawn(actions, at + 2):
            played.happens(event)
        if number % 3_000 == 2_999:
            sizes.append(len(pickle.dumps(played.state.__dict__ | {"attempt": None})))
        played.actions.clear()
    assert max(sizes) < 1.3 * min(sizes)  # copies are looked for among 2 to 4 s
    assert max(sizes) < 300_000


def test_out_of_time_ends_the_task_with_what_there_is(setup: Setup) -> None:
    played = begun(setup, countdown_ns=0, abort_after_ns=500 * MS)
    for at in range(0, 700, 10):
        played.happens(Tick(EPOCH_NS + at * MS))
        played.happens(tracker(float(at), 0.0))
    assert played.state.ended_by == "out of time"
    assert Close(set_aside=False) in played.actions
    assert len(played.events("session_end")) == 1
