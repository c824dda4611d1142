"""Phones that come back, that are two, and that speak another language; forms with pairs."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest
import websockets

from pipeline.errors import PipelineError
from pipeline.live import run_state, study_run
from pipeline.live.access import Access
from pipeline.live.events import Action, Event, Joined, Replace, Said, Save, Tables, Tell
from pipeline.live.messages import Answer, Hello, Submit
from pipeline.live.outgoing import AnswerSaved, Form, Refused
from pipeline.live.plan import Plan, rating_rows
from pipeline.live.setup import warm_up
from tests.pipeline.helpers import Steadyhand, exit_code
from tests.pipeline.live.running import Running, hears, says, served
from tests.pipeline.live.studies import STUDY, brief, study_in

AT_NS = 1_764_350_000_000_000_000
WEIGHTED = STUDY.replace("questionnaires: [nasa_tlx]", "questionnaires: [weighted_tlx]").replace(
    "comparisons:", "scoring: {nasa_tlx: {rule: weighted_tlx, range: [0, 100]}}\ncomparisons:"
)


class Lab:
    """A study whose pages come and go."""

    def __init__(self, folder: Path, text: str = STUDY) -> None:
        _, setup = study_in(folder, text)
        self.run = run_state.begin(setup, setup.empty_plan())

    def happens(self, event: Event) -> list[Action]:
        self.run, actions = study_run.step(self.run, event)
        return list(actions)

    def joins(self, client: int, name: str) -> list[Action]:
        """A phone connects and says who it is."""
        actions = self.happens(Joined("phone", client, AT_NS))
        hello = Hello("phone", 1, "a test", wake_lock=True, id=name)
        return [*actions, *self.happens(Said("phone", client, hello, AT_NS))]


def test_a_phone_that_is_back_takes_its_own_place(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.joins(1, "red")
    assert (lab.run.phone, lab.run.phones) == (1, (1,))
    assert Replace(1) in lab.joins(2, "red")  # its page was loaded anew, and the old connection seems to live
    assert (lab.run.phone, lab.run.phones) == (2, (2,))
    assert lab.run.hello is not None and lab.run.hello.id == "red"


def test_a_second_phone_takes_nobody_s_place_and_comes_back_as_itself(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.joins(1, "red")
    assert not any(isinstance(one, Replace) for one in lab.joins(2, "blue"))
    assert Replace(2) in lab.joins(3, "blue")
    assert (lab.run.phone, lab.run.phones) == (1, (1, 3))
    lab.joins(4, "")  # of a page that does not say who it is nothing is known
    lab.joins(5, "")
    assert lab.run.phones == (1, 3, 4, 5)


def test_two_phones_in_one_browser_share_a_cookie_and_are_two(tmp_path: Path) -> None:
    async def play(running: Running) -> None:
        hello = {"type": "hello", "page": "phone", "version": 1, "agent": "one browser", "wake_lock": True}
        async with running.page("phone") as first:
            await says(first, **hello, id="a")
            await hears(first, "state", state="checks")
            async with running.page("phone") as second:
                await says(second, **hello, id="b")
                await hears(second, "state", state="second")
                again = await running.page("phone")
                await says(again, **hello, id="a")
                await hears(again, "state", state="checks")
                with pytest.raises(websockets.ConnectionClosed) as closed:
                    await asyncio.wait_for(hears(first, "never"), 10)
                assert closed.value.rcvd is not None and closed.value.rcvd.code == 4409
                await says(second, type="ping", t1=5)
                assert (await hears(second, "pong"))["t1"] == 5  # it is still there
                await again.close()
                await hears(second, "welcome")  # and active once the other has gone

    served(tmp_path, play, STUDY.replace("imu: {demo: {}}", "imu: {phone: motion}"))


def test_the_study_s_language_is_in_the_addresses_of_participants(tmp_path: Path) -> None:
    text = STUDY.replace("countdown_s: 1", "countdown_s: 1\n  language: LANGUAGE")
    assert study_in(tmp_path, text.replace("LANGUAGE", "de"))[1].recording.language == "de"
    access = Access("http", "127.0.0.1", 1, language="de")
    assert "/join?lang=de#k=" in access.address("phone")
    assert "lang" not in access.address("operator")
    with pytest.raises(PipelineError, match='no texts in "fr"; use de or en'):
        study_in(tmp_path, text.replace("LANGUAGE", "fr"))


def test_replaying_is_warm_before_the_first_log_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, setup = study_in(tmp_path)
    replayed: list[tuple[str, int]] = []

    def noting(kind: type[Any]) -> Any:
        replay = kind.replay

        def noted(self: Any, samples: Any, times: Any) -> Any:
            track = replay(self, samples, times)
            replayed.append((kind.__name__, len(track.mean)))
            return track

        return noted

    for estimator in setup.estimators.values():
        monkeypatch.setattr(type(estimator), "replay", noting(type(estimator)))
    warm_up(setup)
    assert sorted(replayed) == [("FusionKalman", 50), ("PositionKalman", 50)]


# --- NASA-TLX with its pairs


def filled_in(lab: Lab, chosen: dict[str, int]) -> list[Action]:
    """A task is over; its form is filled in, pairs as `chosen` says, and handed in."""
    person = lab.run.plan.persons[0]
    ids = {"participant": person.id, "condition": person.order[0]}
    for record in ({"type": "begun", **ids}, {"type": "finished", **ids, "trials": 3}):
        lab.run, _ = run_state.save(lab.run, record)
    lab.run = run_state.settled(lab.run)
    (told,) = lab.happens(Joined("questionnaire", 9, AT_NS))
    assert isinstance(told, Tell) and isinstance(told.message, Form)
    actions: list[Action] = []
    for one in told.message.items:
        actions += lab.happens(Said("questionnaire", 9, Answer("nasa_tlx", str(one["id"]), 10, "a"), AT_NS))
    for name, value in chosen.items():
        actions += lab.happens(Said("questionnaire", 9, Answer("nasa_tlx", name, value, "p"), AT_NS))
    return [*actions, *lab.happens(Said("questionnaire", 9, Submit("nasa_tlx", "s"), AT_NS))]


def weights(plan: Plan) -> dict[str, int]:
    """The weights that questionnaires.csv would hold."""
    rows = rating_rows(plan)
    return {row["scale"]: int(row["rating"]) for row in rows if row["scale"].startswith("weight_")}


def test_fifteen_pairs_are_asked_saved_and_counted_as_weights(tmp_path: Path) -> None:
    lab = Lab(tmp_path, WEIGHTED)
    (known,) = lab.run.setup.recording.questionnaires
    names = ["-".join(pair) for pair in known.pairs]
    assert len(names) == len(set(names)) == 15
    actions = filled_in(lab, dict.fromkeys(names, 0))
    saved = [one.record for one in actions if isinstance(one, Save) and one.record["type"] == "answer"]
    assert [record["item"] for record in saved[6:]] == names
    assert any(isinstance(one, Tables) for one in actions)
    # The first of each pair was chosen: five times the first scale, never the last.
    assert list(weights(lab.run.plan).values()) == [1, 0, 5, 2, 4, 3]  # by name: effort, frustration, mental, …
    assert sum(weights(lab.run.plan).values()) == 15


def test_without_all_pairs_a_form_is_not_handed_in_and_there_are_no_weights(tmp_path: Path) -> None:
    lab = Lab(tmp_path, WEIGHTED)
    actions = filled_in(lab, {"mental-physical": 1, "mental-temporal": 0})
    (refused,) = (one.message for one in actions if isinstance(one, Tell) and isinstance(one.message, Refused))
    assert "mental-performance" in refused.why and "mental-physical" not in refused.why
    assert weights(lab.run.plan) == {}
    for name, value in (("mental-physical", 2), ("physical-mental", 0), ("mental", 21)):
        (told,) = lab.happens(Said("questionnaire", 9, Answer("nasa_tlx", name, value, "x"), AT_NS))
        assert isinstance(told, Tell) and isinstance(told.message, Refused)
    (reopened,) = lab.happens(Joined("questionnaire", 10, AT_NS))
    assert isinstance(reopened, Tell) and isinstance(reopened.message, Form)
    assert [one["value"] for one in reopened.message.pairs][:3] == [1, 0, None]  # a reload goes on
    assert not any(isinstance(one, Tell) and isinstance(one.message, AnswerSaved) for one in actions)


def test_a_weighted_study_needs_the_rule_that_its_report_applies(tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match=r"write scoring: \{nasa_tlx: \{rule: weighted_tlx, range: \[0, 100\]\}\}"):
        study_in(tmp_path, STUDY.replace("[nasa_tlx]", "[weighted_tlx]"))
    own = "[{id: comfort, compared: true, items: [{id: arm, text: a, low: b, high: c}]}]"
    with pytest.raises(PipelineError, match="only nasa_tlx has a rule"):
        study_in(tmp_path, STUDY.replace("[nasa_tlx]", own))


def test_a_report_scores_what_the_pairs_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, steadyhand: Steadyhand
) -> None:
    study_in(tmp_path / "study", brief(WEIGHTED).replace("completion_time_s", "nasa_tlx/weighted_tlx"))
    demo = ("--demo", "--bots", "--participants", "2", "--out", tmp_path / "demo")
    assert exit_code(monkeypatch, "record", tmp_path / "study", *demo) == 0
    ran = steadyhand("compare", tmp_path / "demo")
    assert ran.code == 0, ran.err
    lines = (tmp_path / "demo/data/.recorder/answers.jsonl").read_text(encoding="utf-8").splitlines()
    given = [one for one in map(json.loads, lines) if one["type"] == "answer"]
    assert len(given) == 2 * 2 * 21
    scores: dict[str, list[float]] = {}
    for participant in ("P01", "P02"):
        for condition in ("kinect", "fusion"):
            ids = participant, condition
            mine = {one["item"]: one["value"] for one in given if (one["participant"], one["condition"]) == ids}
            chosen = [name.split("-")[value] for name, value in mine.items() if "-" in name]
            score = sum(5 * mine[item] for item in chosen) / 15  # Hart and Staveland 1988: weighted by the choices
            scores.setdefault(condition, []).append(score)
    rows = steadyhand.results()["descriptives"]
    found = {row["condition"]: row["mean"] for row in rows if row["measure"] == "nasa_tlx/weighted_tlx"}
    assert found == pytest.approx({condition: sum(both) / 2 for condition, both in scores.items()})


# --- keys of logs that others wrote


@pytest.mark.parametrize(
    ("stream", "addition", "words"),
    [
        ("tracker", "unit: mm", "streams.tracker: unit: mm .* say it under recording: senders: tracker: unit"),
        ("imu", "unit: g", "streams.imu: unit: g .* say it under recording: senders: imu: unit"),
        ("imu", "turning_unit: deg/s", "streams.imu: turning_unit: deg/s"),
        ("tracker", "fields: {position: pose.position}", "streams.tracker: fields: position .* remove it"),
        ("tracker", "child: hand", "streams.tracker: child: hand .* remove it"),
        ("tracker", "parent: world", "streams.tracker: parent: world"),
        ("imu", "stamp_unit: ms", "streams.imu: stamp_unit: ms"),
        ("imu", "arrival: stamps", "streams.imu: arrival: stamps"),
        ("display", "unit: mm", "streams.display: unit: mm .* remove it"),
        ("imu", "stamp: log_time", "streams.imu: stamp: log_time .* write stamp: arrival"),
    ],
)
def test_what_says_how_others_logs_are_read_is_refused(tmp_path: Path, stream: str, addition: str, words: str) -> None:
    with pytest.raises(PipelineError, match=rf"study\.yaml: {words}"):
        study_in(tmp_path, STUDY.replace(f"  {stream}: {{topic", f"  {stream}: {{{addition}, topic"))


def test_so_is_it_of_events(tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match=r"study\.yaml: events: arrival: stamps"):
        study_in(tmp_path, STUDY.replace("events: {topic: /events}", "events: {topic: /events, arrival: stamps}"))
