"""A whole study played by simulated people: what they did is what the report says, and nothing of it is lost."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.errors import PipelineError
from pipeline.live import plan, run_state
from pipeline.live.bots import FORMS, PHONE, Players, as_simulated
from pipeline.live.events import Joined, Left, Said, Tick
from pipeline.live.journal import PART, Journal, known_plan
from pipeline.live.messages import Answer, Do, Drawn, Select, Submit
from pipeline.live.outgoing import AnswerSaved, Form, FormState, Refused, to_json
from pipeline.report.sections import recorded_live
from pipeline.sessions.logs import mcap
from pipeline.sessions.logs.log import Wanted
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.live.studies import BRIEF, STUDY, shown_alone, study_in

EPOCH_NS = 1_764_350_000_000_000_000
TEXT = shown_alone(STUDY)


def players(folder: Path) -> Players:
    """Simulated people in a study folder, which goes on where it stands."""
    study, setup = study_in(folder, TEXT)
    journal = Journal(folder, study)
    journal.hold()
    known = setup.empty_plan()
    for record in journal.records():
        known = plan.after(known, record)
    return Players(as_simulated(setup), folder, journal, plan.with_logs(known, journal.found_logs()), EPOCH_NS)


@dataclass
class Demo:
    """A study that was played, and who played it."""

    folder: Path
    players: Players


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    folder = tmp_path_factory.mktemp("demo")
    playing = players(folder)
    playing.play(2)
    playing.clerk.journal.release()
    return Demo(folder, playing)


def test_the_report_says_what_the_participants_did(demo: Demo, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", demo.folder)
    assert ran.code == 0, ran.err
    results = steadyhand.results()
    assert results["exclusions"] == []
    assert len(results["replay_agreement"]) == 4
    for row in results["replay_agreement"]:
        assert row["max_mm"] <= 1e-9
        assert row["n"] > 500
    targets = demo.players.run.setup.targets_mm
    for condition in ("kinect", "fusion"):
        errors, seconds = [], []
        for participant in ("P01", "P02"):
            taps = demo.players.played[participant, condition].taps
            errors.append(float(np.mean(np.sum((taps[:, 1:3] - np.array(targets)) ** 2, axis=1))))
            start = next(one["at"] for one in _events(demo, participant, condition) if one["type"] == "session_start")
            begins = demo.players.played[participant, condition].begins_ns
            seconds.append(float(taps[-1, 0]) - (start - begins) / 1e9)
        means = {row["measure"]: row["mean"] for row in results["descriptives"] if row["condition"] == condition}
        assert means["selection_mse_mm2"] == pytest.approx(np.mean(errors), rel=1e-6)
        assert means["completion_time_s"] == pytest.approx(np.mean(seconds), abs=1e-6)
        assert 0 <= means["nasa_tlx/mental"] <= 100


def _events(demo: Demo, participant: str, condition: str) -> list[dict[str, Any]]:
    log = mcap.read(demo.folder / f"data/{participant}_{condition}.mcap", [Wanted("/events", "events")])
    readings = log.topics["/events"]
    return [{**one, "at": int(at)} for one, at in zip(readings.events, readings.arrival_ns, strict=True)]


def test_a_log_says_how_it_was_recorded(demo: Demo) -> None:
    log = mcap.read(demo.folder / "data/P02_fusion.mcap", [Wanted("/events", "events")])
    assert log.faults == ()
    facts = log.facts
    assert (facts["participant"], facts["condition"], facts["order"], facts["attempt"]) == ("P02", "fusion", "1", "1")
    assert facts["estimator"].startswith("fusion_kalman")
    assert facts["origin"].startswith("simulated")
    assert {"/recorder/notes", "/display/drawn"} <= set(log.types)


def test_the_report_says_how_sessions_were_recorded_and_that_settings_changed(
    tmp_path: Path, steadyhand: Steadyhand
) -> None:
    for count, sd in ((1, "8"), (2, "9")):  # noise_sd_mm is changed after the first participant
        study, setup = study_in(tmp_path, BRIEF.replace("noise_sd_mm: 8", f"noise_sd_mm: {sd}"))
        journal = Journal(tmp_path, study)
        journal.hold()
        if count == 2:
            with pytest.raises(PipelineError, match="has changed since P01"):
                known_plan(setup.empty_plan(), journal, setup.digest, goes_on=False)
        known = known_plan(setup.empty_plan(), journal, setup.digest, goes_on=True)
        Players(as_simulated(setup), tmp_path, journal, known, EPOCH_NS + count * 10**13).play(count)
        journal.release()
    ran = steadyhand("compare", tmp_path)
    assert ran.code == 0, ran.err
    rows = steadyhand.results()["recorders"]
    assert [row["session"] for row in rows] == ["P01_fusion", "P01_kinect", "P02_fusion", "P02_kinect"]
    assert len({row["settings"] for row in rows}) == 2
    assert {(row["attempt"], row["started_although"]) for row in rows} == {("1", "simulated")}
    material = SimpleNamespace(rows=lambda name: rows if name == "recorders" else [])
    words = repr([*recorded_live.blocks(material), *recorded_live.cautions(material)])  # type: ignore[arg-type]
    assert "4 sessions recorded live, by steadyhand" in words
    assert words.count("study.yaml was changed while the study was recorded") == 2
    red = {**rows[0], "overruled": "At rest 1.00 m/s²", "attempt": "2"}
    material = SimpleNamespace(rows=lambda name: [red])
    words = repr(list(recorded_live.blocks(material)))  # type: ignore[arg-type]
    assert "At a further attempt: P01_fusion" in words
    assert "At rest 1.00 m/s²" in words
    assert list(recorded_live.cautions(material)) == []  # type: ignore[arg-type]


def test_no_message_to_phone_or_questionnaire_names_a_condition(demo: Demo) -> None:
    sent = b"\n".join(to_json(message) for client, message in demo.players.told if client in (PHONE, FORMS))
    assert len(sent) > 1000
    for word in (b"kinect", b"fusion", b"kalman", b"Two systems"):
        assert word not in sent


def test_orders_and_ratings_are_in_the_tables(demo: Demo) -> None:
    people = (demo.folder / "participants.csv").read_text(encoding="utf-8").splitlines()
    assert people == ["participant,sequence", "P01,kinect-fusion", "P02,fusion-kinect"]
    ratings = (demo.folder / "questionnaires.csv").read_text(encoding="utf-8").splitlines()
    assert len(ratings) == 1 + 2 * 2 * 6
    records = [json.loads(line) for line in (demo.folder / "data/.recorder/answers.jsonl").read_bytes().splitlines()]
    assert sum(record["type"] == "answer" for record in records) == 24


def test_who_has_done_everything_is_thanked(demo: Demo, tmp_path: Path) -> None:
    assert run_state.form(demo.players.run) == FormState("thanks")
    assert run_state.form(players(tmp_path).run) == FormState("waiting")  # nobody has begun


def test_a_study_goes_on_where_it_stands(demo: Demo, tmp_path: Path) -> None:
    again = players(demo.folder)
    again.clerk.journal.release()
    assert [person.id for person in again.run.plan.persons] == ["P01", "P02", "P03"]
    assert all(task.state == "done" for person in again.run.plan.persons[:2] for task in person.tasks)
    assert again.run.phase == "ready"


def test_another_recorder_keeps_out(demo: Demo) -> None:
    journal = Journal(demo.folder, demo.players.clerk.journal.study)
    (journal.own / "lock").write_text("1", encoding="ascii")  # process 1 is always there
    with pytest.raises(PipelineError, match="another recorder"):
        journal.hold()
    (journal.own / "lock").write_text("999999999", encoding="ascii")  # and this one never
    journal.hold()
    journal.release()


class CutError(Exception):
    """The power is gone."""


def cut_at(folder: Path, readings: int) -> Players:
    """A study that was cut during the first task, after so many readings."""
    playing = players(folder)
    before, count = playing.happens, [0]

    def happens(event: object) -> None:
        count[0] += isinstance(event, Tick)
        if count[0] % 45 == 0:
            playing.clerk.flush(lambda: playing.now_ns)
        if count[0] > readings:
            raise CutError
        before(event)  # type: ignore[arg-type]

    playing.happens = happens  # type: ignore[method-assign]
    with pytest.raises(CutError):
        playing.play(1)
    playing.clerk.journal.abandon()
    return playing


@pytest.mark.parametrize("decision", ["redo", "keep"])
def test_a_log_that_was_cut_is_done_again_or_kept(decision: str, tmp_path: Path) -> None:
    cut_at(tmp_path, 900)
    part = tmp_path / f"data/P01_kinect.mcap{PART}"
    assert part.exists()
    bytes_before = part.read_bytes()
    playing = players(tmp_path)
    run = playing.run
    assert run.phase == "cut"
    for role, client in (("operator", 1), ("phone", PHONE)):
        playing.happens(Joined(role, client, EPOCH_NS))  # type: ignore[arg-type]
    state = json.loads(to_json(next(message for client, message in reversed(playing.told) if client == 1)))
    assert state["problems"] == ["P01, task 1 was cut after 7.5 s, 2 of 3 targets: redo or keep it."]
    playing.says("operator", 1, Do("start", "", "d1"))
    assert isinstance(playing.told[-1][1], Refused)
    playing.says("operator", 1, Do(decision, "", "d2"))
    kept = tmp_path / ("data/P01_kinect.mcap" if decision == "keep" else "data/set-aside/P01_kinect.1.mcap")
    assert kept.read_bytes() == bytes_before
    assert not part.exists()
    assert playing.run.phase == ("questionnaire" if decision == "keep" else "ready")
    if decision == "redo":
        playing.says("operator", 1, Do("start", "again", "d3"))
        assert playing.run.plan.persons[0].tasks[0].attempt == 2
        playing.says("operator", 1, Do("abort", "the tracker fell down", "d4"))
        assert (tmp_path / "data/set-aside/P01_kinect.2.mcap").exists()
        assert not (tmp_path / "data/P01_kinect.mcap").exists()


def test_a_dropped_participant_s_order_goes_to_the_next(tmp_path: Path) -> None:
    playing = players(tmp_path)
    for role, client in (("operator", 1), ("phone", PHONE), ("questionnaire", FORMS)):
        playing.happens(Joined(role, client, EPOCH_NS))  # type: ignore[arg-type]
    playing.says("operator", 1, Do("drop", "did not come", "d1"))
    first, second = playing.run.plan.persons
    assert (first.dropped, second.id, second.order) == (True, "P02", first.order)


def test_a_second_phone_waits_and_a_second_operator_reads_only(tmp_path: Path) -> None:
    playing = players(tmp_path)
    for role, client in (("operator", 1), ("operator", 11), ("phone", PHONE), ("phone", 12)):
        playing.happens(Joined(role, client, EPOCH_NS))  # type: ignore[arg-type]
    assert json.loads(to_json(playing.told[-2][1]))["type"] == "state"
    assert playing.run.phone == PHONE
    playing.says("operator", 11, Do("swap", "", "d1"))
    assert isinstance(playing.told[-1][1], Refused)
    playing.says("operator", 1, Do("swap", "", "d2"))
    assert playing.run.phone == 12
    playing.says("operator", 11, Do("take_over", "", "d3"))
    assert playing.run.operators == (11, 1)
    playing.happens(Left("phone", 12, EPOCH_NS))
    assert playing.run.phone == PHONE


def test_a_reloaded_form_has_the_answers_so_far(tmp_path: Path) -> None:
    playing = players(tmp_path)
    playing._fill_in = lambda: (_ for _ in ()).throw(CutError)  # type: ignore[method-assign]
    with pytest.raises(CutError):
        playing.play(1)
    playing.says("questionnaire", FORMS, Answer("nasa_tlx", "mental", 7, "a1"))
    assert (FORMS, AnswerSaved("a1")) in playing.told
    playing.says("questionnaire", FORMS, Answer("nasa_tlx", "mental", 99, "a2"))
    assert isinstance(playing.told[-1][1], Refused)
    playing.says("questionnaire", FORMS, Submit("nasa_tlx", "a3"))
    refused = playing.told[-1][1]
    assert isinstance(refused, Refused) and "physical" in refused.why
    again = players(tmp_path)
    again.happens(Joined("questionnaire", FORMS, EPOCH_NS))
    form = again.told[-1][1]
    assert isinstance(form, Form)
    assert {str(item["id"]): item["value"] for item in form.items}["mental"] == 7


def test_messages_of_pages_that_are_not_active_change_nothing(tmp_path: Path) -> None:
    playing = players(tmp_path)
    playing.happens(Joined("phone", PHONE, EPOCH_NS))
    before = playing.run
    for message in (Drawn(5, 1.0), Select(5, 1.0)):
        playing.happens(Said("phone", 77, message, EPOCH_NS))
    assert playing.run == before
    assert run_state.form(playing.run).TYPE == "state"
