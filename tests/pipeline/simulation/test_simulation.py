"""Simulated participants: their movement, their independence, the loop's two forms, and the files they leave."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipeline.analysis.simulated_reductions import reductions
from pipeline.errors import PipelineError
from pipeline.simulation import hand_steps, layout, people, study_files
from pipeline.simulation.motion import minimum_jerk
from pipeline.simulation.session import Setting, simulate
from pipeline.simulation.workload import ratings
from pipeline.study.folder import load_study
from pipeline.study.settings import Study
from pipeline.study.simulation import SelectionSimulation, Task, Workload
from tests.pipeline.helpers import Steadyhand, run

WORKLOAD = {
    "questionnaire": "nasa_tlx",
    "usual": {"completion_time_s": 10.0},
    "scales": {"effort": {"base": 50, "per_doubling": {"completion_time_s": 20}}, "mental": {"base": 40}},
}


def settings(**changes: Any) -> dict[str, Any]:
    """A small study: a ring of five targets, all in view."""
    return {
        "title": "Ring",
        "data_origin": "simulated",
        "conditions": ["kinect", "fusion"],
        "participants": "participants.csv",
        "questionnaires": "questionnaires.csv",
        "repeats": "repeats.csv",
        "sessions": "data/{participant}_{condition}.mcap",
        "axes": ["x", "y"],
        "streams": {
            "tracker": {
                "topic": "/tracker",
                "kind": "position",
                "stamp": "arrival",
                "latency_s": 0.1,
                "noise_sd_mm": 8,
                "rate_hz": 30,
            },
            "imu": {"topic": "/imu", "kind": "acceleration", "gravity_mm_s2": [0, -9806.65, 0], "rate_hz": 90},
            "reference": {"topic": "/reference", "kind": "reference"},
            "display": {"topic": "/display", "kind": "display"},
        },
        "events": {"topic": "/events"},
        "estimators": {
            "kinect": {"type": "position_kalman"},
            "window": {"type": "window_gp"},
            "fusion": {"type": "fusion_kalman"},
            "raw": {"type": "raw"},
            "smooth": {"type": "one_euro"},
        },
        "shown": {"kinect": "kinect", "fusion": "fusion"},
        "task": {"rings": [{"centre_mm": [0, 500], "diameter_mm": 150, "targets": 5}]},
        "comparisons": [{"measure": "completion_time_s", "test": "t_paired"}],
        "simulation": {
            "kind": "selection",
            "seed": 7,
            "participants": 2,
            "repeats": 1,
            "longest_s": 60,
            "workload": WORKLOAD,
            **changes,
        },
    }


def setting(content: dict[str, Any]) -> Setting:
    return Setting(Study.model_validate(content), "study.yaml")


def changed(content: dict[str, Any], **streams: dict[str, Any]) -> dict[str, Any]:
    """The study with other sensors."""
    known = content["streams"]
    return {**content, "streams": {name: {**stream, **streams.get(name, {})} for name, stream in known.items()}}


def test_a_session_depends_on_its_own_names_alone() -> None:
    """Not on how many take part, nor on what was simulated before."""
    alone = simulate(setting(settings(participants=1)), "P01", "kinect")
    simulate(setting(settings()), "P02", "fusion")
    among = simulate(setting(settings(participants=9)), "P01", "kinect")
    assert np.array_equal(alone.trace, among.trace)
    assert np.array_equal(alone.shown, among.shown, equal_nan=True)
    other = simulate(setting(settings(seed=8)), "P01", "kinect")
    assert not np.array_equal(alone.taps, other.taps)


@pytest.mark.parametrize("shown", ["kinect", "window", "fusion", "raw"])
def test_the_compiled_loop_is_the_plain_one(shown: str) -> None:
    """By the estimator's own update and predict, one reading at a time."""
    one = setting({**settings(), "shown": {"kinect": shown, "fusion": "fusion"}})
    fast, plain = simulate(one, "P01", "kinect"), simulate(one, "P01", "kinect", compiled=False)
    assert len(fast.shown) == len(plain.shown)
    np.testing.assert_allclose(fast.shown, plain.shown, atol=1e-6)
    np.testing.assert_allclose(fast.taps, plain.taps, atol=1e-6)


def test_an_estimator_without_a_compiled_form_runs_too() -> None:
    found = simulate(setting({**settings(), "shown": {"kinect": "smooth", "fusion": "fusion"}}), "P01", "kinect")
    assert found.selected == 6


@pytest.mark.parametrize("model", ["intermittent", "second_order_lag"])
def test_lag_costs_time_whatever_the_model_of_people(model: str) -> None:
    """Without noise, each of three people takes longer behind 0.3 s of lag than behind 0.02 s."""
    quiet = settings(model=model)
    for participant in ("P01", "P02", "P03"):
        prompt, late = (
            simulate(
                setting(changed(quiet, tracker={"latency_s": latency_s, "noise_sd_mm": 0.01})), participant, "kinect"
            )
            for latency_s in (0.02, 0.3)
        )
        assert late.completion_time_s > prompt.completion_time_s
        assert prompt.selected == late.selected == 6


def test_lag_adds_as_much_time_as_mackenzie_and_ware_found() -> None:
    """Pointing behind 8.3 and 225 ms of lag took 911 and 1493 ms a movement (MacKenzie and Ware 1993, Table 1)."""
    ring = {"rings": [{"centre_mm": [0, 500], "diameter_mm": 75, "targets": 7, "target_diameter_mm": 4}]}
    tracker, imu = {"noise_sd_mm": 0.01, "rate_hz": 125}, {"rate_hz": 125}
    content = {**settings(instruments={"tracker_rate_hz": 125, "imu_rate_hz": 125}), "task": ring}
    content["shown"] = {"kinect": "raw", "fusion": "raw"}
    took = []
    for lag_s in (0.0083, 0.225):
        late = setting(changed(content, tracker={**tracker, "latency_s": lag_s}, imu=imu))
        outcomes = [simulate(late, f"P{number:02d}", "kinect") for number in range(8)]
        took.append(np.mean([np.diff(outcome.taps[:, 0]).mean() for outcome in outcomes]))
    assert 0.5 * (1.493 - 0.911) < took[1] - took[0] < 2 * (1.493 - 0.911)


def test_the_same_estimator_in_both_conditions_makes_no_difference() -> None:
    """Thirty small studies: as few false positives as chance allows (at most 6 of 30 with p = .998)."""
    from scipy.stats import ttest_rel

    same = {**settings(), "shown": {"kinect": "kinect", "fusion": "kinect"}}
    same["task"] = {"targets_mm": [[0, 500], [100, 500], [0, 450]]}
    positives = 0
    for seed in range(30):
        same["simulation"] = {**same["simulation"], "seed": seed}
        one = setting(same)
        times = [
            [simulate(one, f"P{number}", condition).completion_time_s for number in range(5)]
            for condition in one.study.conditions
        ]
        positives += bool(ttest_rel(times[0], times[1]).pvalue < 0.05)
    assert positives <= 6


def test_a_plan_from_rest_to_rest_is_the_movement_of_least_jerk() -> None:
    """Flash and Hogan's polynomial, position and acceleration."""
    person = people.person(SelectionSimulation.model_validate(settings()["simulation"]), "P01")
    hand = hand_steps.hand_at(np.zeros(2), 0.0)
    hand_steps.replan(person, hand, 120.0, -60.0, 1.0)
    lasts = person.base_time_s + person.time_per_sqrt_mm_s * np.sqrt(np.hypot(120.0, 60.0))
    for now in (1.0, 1.1, 1.0 + lasts / 2, 1.0 + lasts, 3.0):
        hand_steps.follow_plan(hand, now)
        share, bend = minimum_jerk(np.array([now]), 1.0, lasts)
        np.testing.assert_allclose(hand.planned[0], np.array([120.0, -60.0]) * share, atol=1e-9)
        np.testing.assert_allclose(hand.planned[2], np.array([120.0, -60.0]) * bend, atol=1e-6)


def test_a_plan_begins_with_the_motion_there_is() -> None:
    """Position, velocity and acceleration go on without a jump where a movement is planned anew."""
    person = people.person(SelectionSimulation.model_validate(settings()["simulation"]), "P01")
    hand = hand_steps.hand_at(np.zeros(2), 0.0)
    hand_steps.replan(person, hand, 200.0, 0.0, 0.0)
    hand_steps.follow_plan(hand, 0.2)
    before = hand.planned.copy()
    hand_steps.replan(person, hand, -50.0, 80.0, 0.2)
    hand_steps.follow_plan(hand, 0.2)
    np.testing.assert_allclose(hand.planned, before, atol=1e-9)
    hand_steps.follow_plan(hand, 5.0)
    np.testing.assert_allclose(hand.planned, [[-50.0, 80.0], [0.0, 0.0], [0.0, 0.0]], atol=1e-9)


def test_sway_has_the_stated_spread() -> None:
    """The resonator run for 400 s: its SD within four standard errors of the stated one."""
    motion, state = people.sway(8.0, 0.1, 0.1), np.zeros((3, 2))
    random = np.random.default_rng(1)
    positions = []
    for step in range(200_000):
        hand_steps.sway(motion, state, 0, random.standard_normal())
        if step % 50 == 0:
            positions.append(state[0, 0])
    assert np.std(positions) == pytest.approx(0.1, rel=0.1)


def test_people_differ_as_stated_and_stay_who_they_are() -> None:
    traits = SelectionSimulation.model_validate(settings()["simulation"])
    delays = [people.person(traits, f"P{number}").visual_delay_s for number in range(400)]
    assert np.mean(delays) == pytest.approx(0.15, rel=0.03)
    assert np.std(delays) / np.mean(delays) == pytest.approx(0.12, rel=0.15)
    assert people.person(traits, "P1") == people.person(traits, "P1")


def test_a_ring_is_crossed_from_side_to_side() -> None:
    """Every target once, each nearly a diameter from the last, and back to the first (ISO 9241-411)."""
    for count in (8, 13):
        task = Task.model_validate({"rings": [{"centre_mm": [10, 400], "diameter_mm": 200, "targets": count}]})
        found = layout.targets(task)
        assert len({tuple(np.round(target, 6)) for target in found}) == count
        np.testing.assert_allclose(found[0], found[-1])
        np.testing.assert_allclose(np.linalg.norm(found - [10, 400], axis=1), 100)
        assert np.linalg.norm(np.diff(found[:-1], axis=0), axis=1).min() > 200 * np.cos(np.pi / count) - 1


def test_ratings_follow_the_stated_model() -> None:
    """Twice the time adds what the model says; ratings keep to the questionnaire's steps and ends."""
    model = Workload.model_validate({**WORKLOAD, "person_sd": 0.0, "noise_sd": 0.0})
    usual = ratings(model, 1, "P01", "a", {"completion_time_s": 10.0})
    twice = ratings(model, 1, "P01", "a", {"completion_time_s": 20.0})
    assert usual == {"effort": 50, "mental": 40}
    assert twice == {"effort": 70, "mental": 40}
    assert ratings(model, 1, "P01", "a", {"completion_time_s": 1e6})["effort"] == 100
    assert ratings(model, 1, "P01", "a", {"completion_time_s": float("nan")})["effort"] == 50


def test_reductions_are_those_of_each_repeated_study() -> None:
    simulation = settings(
        published=[{"source": "A and B", "measure": "m", "conditions": ["kinect", "fusion"], "reduction": 0.3}]
    )["simulation"]
    repeats = pd.DataFrame(
        [(1, "kinect", "m", 10.0), (1, "fusion", "m", 5.0), (2, "kinect", "m", 20.0), (2, "fusion", "m", 5.0)],
        columns=["repeat", "condition", "measure", "value"],
    )
    (row,) = reductions(SelectionSimulation.model_validate(simulation), ("kinect", "fusion"), repeats)
    assert row["n"] == 2
    assert row["reduction"] == pytest.approx((0.5 + 0.75) / 2)
    assert row["ci_low"] == pytest.approx(0.5 + 0.025 * 0.25)
    assert (row["published_reduction"], row["source"], row["contrast"]) == (0.3, "A and B", "kinect - fusion")


def written(folder: Callable[..., Path], content: dict[str, Any]) -> Path:
    return folder(json.dumps(content))  # JSON is YAML


def test_a_simulated_study_goes_the_ordinary_way(
    folder: Callable[..., Path],
    steadyhand: Steadyhand,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Logs, participants, ratings and repeats; the replay of each log is exactly what was displayed."""
    study = written(folder, settings())
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert "participants.csv" in ran.err
    assert "it is made by: steadyhand simulate" in ran.err
    ran = run(capsys, monkeypatch, "simulate", study, "--jobs", "1")
    assert ran.code == 0, ran.err
    assert "wrote 4 logs" in ran.out
    assert (study / "participants.csv").read_text() == "participant,sequence\nP01,kinect-fusion\nP02,fusion-kinect\n"
    assert len((study / "questionnaires.csv").read_text().splitlines()) == 1 + 2 * 2 * 2
    assert steadyhand("compare", study).code == 0
    results = steadyhand.results()
    assert len(results["replay_agreement"]) == 4
    assert max(row["max_mm"] for row in results["replay_agreement"]) < 1e-9
    assert min(row["n"] for row in results["replay_agreement"]) > 300
    assert {row["contrast"] for row in results["simulated_reductions"]} == {"kinect - fusion"}
    assert [row["what"] for row in results["exclusions"]] == []
    before = {path.name: path.stat().st_mtime_ns for path in study.rglob("*")}
    assert run(capsys, monkeypatch, "simulate", study, "--if-needed").out == ""
    assert {path.name: path.stat().st_mtime_ns for path in study.rglob("*")} == before


def test_a_run_that_is_stopped_leaves_the_files_of_the_run_before(
    folder: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And what is made anew with fewer people leaves none of the others behind."""
    study = written(folder, {**settings(repeats=0), "repeats": None})
    assert run(capsys, monkeypatch, "simulate", study, "--jobs", "1").code == 0
    before = {path.relative_to(study): path.read_bytes() for path in study.rglob("*") if path.is_file()}
    (study / "study.yaml").write_text(json.dumps({**settings(repeats=0, seed=99), "repeats": None}))

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as during:
        during.setattr(study_files, "made_from", stopped)  # the last thing before the files take their places
        run(capsys, monkeypatch, "simulate", study, "--jobs", "1")
    after = {path.relative_to(study): path.read_bytes() for path in study.rglob("*") if path.is_file()}
    assert {name for name in before if before[name] != after[name]} == {Path("study.yaml")}
    assert before.keys() == after.keys()
    (study / "study.yaml").write_text(json.dumps({**settings(repeats=0, participants=1), "repeats": None}))
    assert run(capsys, monkeypatch, "simulate", study, "--if-needed", "--jobs", "1").code == 0
    assert sorted(path.name for path in (study / "data").iterdir()) == ["P01_fusion.mcap", "P01_kinect.mcap"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"task": None}, "selection needs a task: with targets"),
        ({"task": {"window_mm": [80, 40], "targets_mm": [[0, 1]]}}, "window_mm needs a path_mm"),
        (
            {"task": {"path_mm": [[0, 500], [100, 500]], "targets_mm": [[50, 560]]}},
            "[50.0, 560.0] is 60 mm off what is left of the path",
        ),
        ({"shown": {"kinect": "kinect"}}, 'shown has no estimator for "fusion"'),
        ({"axes": ["x"]}, "selection needs axes: [x, y], found ['x']"),
        ({"simulation": settings(repeats=0)["simulation"]}, "repeats: names a file, but simulation: repeats is 0"),
        ({"participants": None}, "participants: is missing; name the file that the simulation is to write"),
        ({"sessions": "data/{session}.mcap"}, "needs {participant} and {condition} for the logs' names"),
    ],
)
def test_a_bad_simulation_is_a_clear_error(
    folder: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    change: dict[str, Any],
    message: str,
) -> None:
    study = written(folder, {**settings(), **change})
    ran = run(capsys, monkeypatch, "simulate", study, "--jobs", "1")
    assert ran.code == 2
    assert message in ran.err
    assert "study.yaml" in ran.err
    assert not (study / "data").exists()


@pytest.mark.parametrize(
    ("simulation", "message"),
    [
        ({"kind": "jump"}, '"simulation" needs a kind: reach, selection'),
        ({"traits": {"visual_delay": {"mean": 1, "source": "x"}}}, 'unknown key "simulation.traits.visual_delay"'),
        ({"traits": {"dwell_s": {"mean": 1}}}, '"simulation.traits.dwell_s.source" is missing'),
        ({"participants": 0}, "simulation.participants"),
        ({"workload": {**WORKLOAD, "usual": {}}}, "effort depends on completion_time_s, for which usual has no value"),
    ],
)
def test_a_bad_simulation_block_is_named(folder: Callable[..., Path], simulation: dict[str, Any], message: str) -> None:
    with pytest.raises(PipelineError) as caught:
        load_study(written(folder, settings(**simulation)), to_be_made=True)
    assert message in str(caught.value)
