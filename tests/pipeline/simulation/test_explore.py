"""`steadyhand explore`: simulated studies over trackers and estimators, and what pays."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pypdf import PdfReader
from scipy import stats

from pipeline.engine.processes import InThisProcess
from pipeline.errors import WorkerLostError
from pipeline.simulation.exploration import Grid, explore, stated, with_tracker
from pipeline.simulation.session import Setting
from pipeline.simulation.tracker import Tracker
from pipeline.simulation.what_pays import MEASURES, differences, means, what_pays
from pipeline.study.folder import load_study
from pipeline.tables import table as tables
from pipeline.tables.catalogue import TABLES
from tests.conftest import CLONE
from tests.pipeline.helpers import Ran, run

Folder = Callable[..., Path]
Command = Callable[..., Ran]
SETTINGS = """
title: Tried <again> & again
data_origin: simulated
conditions: [now, better]
participants: participants.csv
sessions: data/{participant}_{condition}.mcap
axes: [x, y]
streams:
  tracker: {topic: /tracker, kind: position, stamp: arrival, latency_s: 0.1, noise_sd_mm: 8, rate_hz: 30}
  imu: {topic: /phone, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0], noise_sd_mm_s2: 100, rate_hz: 90}
  display: {topic: /display, kind: display}
events: {topic: /events}
estimators:
  kinect_kalman: {type: position_kalman}
  raw: {type: raw}
  fusion: {type: fusion_kalman}
shown: {now: kinect_kalman, better: fusion}
task: {targets_mm: [[-100, 500], [100, 500]]}
simulation: {kind: selection, seed: 1, participants: 9, longest_s: 20}
"""
SMALL = ("--latency", "0.05,0.1", "--noise", "8", "--rate", "30", "--participants", "2", "--repeats", "1")


@pytest.fixture
def study(folder: Folder) -> Path:
    return folder(SETTINGS)


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Command:
    def explored(study: Path, *words: str) -> Ran:
        return run(capsys, monkeypatch, "explore", study, "--out", tmp_path / "out", "--jobs", "1", *words)

    return explored


def people_of(study: Path, grid: Grid, executor: Executor | None = None) -> pd.DataFrame:
    setting = Setting(load_study(study, to_be_made=True), str(study / "study.yaml"))
    rows = explore(setting, grid, executor or InThisProcess(), lambda _: None, lambda: None)
    return tables.frame("explore_people", rows)


class Backwards(Executor):
    """Computes the last call first, when the first answer is asked for."""

    def __init__(self) -> None:
        self._waiting: list[tuple[Future[Any], Any, tuple[Any, ...]]] = []

    def submit(self, fn: Any, /, *args: Any, **_: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self._waiting.append((future, fn, args))
        if len(self._waiting) == 4:
            for waiting, function, given in reversed(self._waiting):
                waiting.set_result(function(*given))
        return future


def test_the_report_says_what_pays_and_where_it_comes_from(study: Path, command: Command, tmp_path: Path) -> None:
    ran = command(study, *SMALL)
    assert ran.code == 0, ran.err
    assert "For selection error" in ran.out
    out = tmp_path / "out"
    content = json.loads((out / "results.json").read_text(encoding="utf-8"))
    points = {(row["latency_s"], row["estimator"]) for row in content["explore"]}
    assert points == {(late, name) for late in (0.05, 0.1) for name in ("kinect_kalman", "fusion")}
    assert [row["people"] for row in content["explore"]] == [2] * 4
    assert len(content["explore_differences"]) == 2 * len(MEASURES)
    assert len(content["explore_people"]) == 8
    assert content["explored"]["own_tracker"] == {"latency_s": 0.1, "noise_sd_mm": 8.0, "rate_hz": 30.0}
    page = (out / "explore.html").read_text(encoding="utf-8")
    for text in ("What pays more here?", "For completion time", "direction and rough size only", "Participants needed"):
        assert text in page
    assert page.count("data:image/svg+xml") == 4
    for leaf in PdfReader(out / "explore.pdf").pages:
        assert "Simulated participants; direction and rough size only." in leaf.extract_text()
    read = pd.read_csv(out / "explore.csv")
    assert read["completion_time_s"].tolist() == pytest.approx([row["completion_time_s"] for row in content["explore"]])
    assert tables.read("explore_people", out).shape == (8, len(TABLES["explore_people"].names))
    provenance = json.loads((out / "provenance.json").read_text(encoding="utf-8"))
    assert provenance["settings"]["simulation"]["seed"] == 1
    assert not (study / "data").exists()


def test_one_estimator_and_one_tracker_leave_nothing_to_weigh(study: Path, command: Command, tmp_path: Path) -> None:
    ran = command(study, *SMALL, "--latency", "0.1", "--estimators", "raw")
    assert ran.code == 0, ran.err
    assert "there is nothing to compare" in ran.out
    page = (tmp_path / "out" / "explore.html").read_text(encoding="utf-8")
    assert "How many participants" not in page


def test_where_nobody_selects_anything_the_report_says_so(folder: Folder, command: Command, tmp_path: Path) -> None:
    hidden = SETTINGS.replace("{targets_mm: [[-100, 500], [100, 500]]}", "{targets_mm: [[-900, 10], [900, 990]]}")
    study = folder(hidden.replace("longest_s: 20", "longest_s: 10, traits: {dwell_s: {mean: 60, source: none}}"))
    ran = command(study, *SMALL, "--noise", "500", "--estimators", "raw,kinect_kalman")
    assert ran.code == 0, ran.err
    content = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    assert {row["not_selected"] for row in content["explore"]} == {4}
    assert {row["completion_time_s"] for row in content["explore"]} == {None}
    assert {row["status"] for row in content["explore_differences"]} == {"nobody selected anything"}
    assert [row["now"]["value"] for row in content["what_pays"]] == [None, None]


def test_results_do_not_depend_on_what_else_is_explored_or_on_the_order_of_work(study: Path) -> None:
    both = people_of(study, Grid((0.05, 0.1), (8.0,), (30.0,), ("raw", "fusion"), 2, 1))
    assert people_of(study, Grid((0.05, 0.1), (8.0,), (30.0,), ("raw", "fusion"), 2, 1), Backwards()).equals(both)
    alone = people_of(study, Grid((0.1,), (8.0,), (30.0,), ("fusion",), 1, 1))
    same = both[(both["latency_s"] == 0.1) & (both["estimator"] == "fusion") & (both["participant"] == "P01")]
    assert same.reset_index(drop=True).equals(alone)


@pytest.mark.forks
@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_processes_give_the_same_results_as_this_process(study: Path, command: Command, tmp_path: Path) -> None:
    assert command(study, *SMALL, "--latency", "0.1").code == 0
    here = (tmp_path / "out" / "results.json").read_bytes()
    assert command(study, *SMALL, "--latency", "0.1", "--jobs", "2").code == 0
    assert (tmp_path / "out" / "results.json").read_bytes() == here


def test_a_tracker_is_stated_as_it_is_simulated(study: Path, folder: Folder) -> None:
    setting = Setting(load_study(study, to_be_made=True), "study.yaml")
    assert stated(setting) == Tracker(0.1, 8.0, 30.0)
    other = with_tracker(setting, Tracker(0.02, 1.0, 120.0), ("raw",), 3)
    assert stated(other) == Tracker(0.02, 1.0, 120.0)
    assert other.simulation.instruments.tracker_rate_hz == 120.0
    silent = folder(SETTINGS.replace(", rate_hz: 30}", "}"), "silent")
    unstated = with_tracker(Setting(load_study(silent, to_be_made=True), ""), Tracker(0.02, 1.0, 120.0), ("raw",), 3)
    assert unstated.streams[1].rate_hz is None
    assert unstated.simulation.instruments.tracker_rate_hz == 120.0


def made_up(values: dict[tuple[Tracker, str], list[float]]) -> pd.DataFrame:
    rows = [
        {
            **tracker._asdict(),
            "estimator": estimator,
            "repeat": 1,
            "participant": f"P{number}",
            "completion_time_s": value,
            "selection_mse_mm2": value**2,
            "selections": 6,
            "misses": 1,
            "not_selected": 0,
        }
        for (tracker, estimator), listed in values.items()
        for number, value in enumerate(listed)
    ]
    return tables.frame("explore_people", rows)


NOW, LATE, QUIET = Tracker(0.1, 8, 30), Tracker(0.2, 8, 30), Tracker(0.1, 4, 30)


def test_means_are_those_of_people_and_the_error_is_the_root_of_the_mean_square() -> None:
    (row,) = means(made_up({(NOW, "raw"): [1.0, 2.0, 6.0]}))
    assert row["completion_time_s"] == pytest.approx(3.0)
    low, high = stats.t.interval(0.95, 2, 3.0, stats.sem([1.0, 2.0, 6.0]))
    assert (row["completion_time_low_s"], row["completion_time_high_s"]) == pytest.approx((low, high))
    assert row["selection_rmse_mm"] == pytest.approx(np.sqrt(41 / 3))
    assert (row["people"], row["n"], row["misses"]) == (3, 3, 3)


def test_participants_needed_are_those_of_the_power_table() -> None:
    first = np.array([10.0, 12.0, 9.0, 14.0, 11.0])
    apart = np.array([-1.0, 1.0, 0.0, 2.0, -2.0])
    apart = apart / apart.std(ddof=1) + 0.5  # d_z = 0.5, for which G*Power 3.1 says 34
    found = differences(made_up({(NOW, "a"): list(first + apart), (NOW, "b"): list(first)}), 0.05)
    row = next(row for row in found if row["measure"] == "completion_time_s")
    assert row["effect_size"] == pytest.approx(0.5)
    assert row["participants_needed"] == 34
    assert row["participants_low"] < 34
    assert row["participants_high"] is None  # five people leave it open whether there is a difference


def test_equal_estimators_have_no_number_of_participants() -> None:
    rows = differences(made_up({(NOW, "a"): [1.0, 2.0], (NOW, "b"): [1.0, 2.0]}), 0.05)
    assert [row.get("participants_needed") for row in rows] == [None, None]
    assert all("zero" in row["status"] for row in rows)


@pytest.mark.parametrize(
    ("by_filter", "by_tracker", "verdict"),
    [
        (3.0, 6.0, "filter"),
        (6.0, 3.0, "tracker"),
        (5.0, 5.0, "equal"),
        (12.0, 11.0, "neither"),
        (12.0, 9.95, "neither"),
    ],
)
def test_what_pays_weighs_the_best_filter_against_the_best_tracker(
    by_filter: float, by_tracker: float, verdict: str
) -> None:
    people = np.array([-0.5, 0.0, 0.5])
    found = what_pays(
        made_up(
            {
                (LATE, "a"): list(0.1 + people),  # better by accident; a worse tracker is no way to improve
                (NOW, "a"): list(10 + people),
                (NOW, "b"): list(by_filter - people / 10),
                (QUIET, "a"): list(by_tracker + people / 10),
                (QUIET, "b"): list(people),
            }
        ),
        NOW,
        "completion_time_s",
    )
    assert found.verdict == verdict
    assert found.by_filter is not None
    assert found.by_filter.estimator == "b"
    assert found.by_tracker is not None
    assert found.by_tracker.tracker == QUIET
    assert (found.enough is not None) == (by_tracker <= by_filter < 10)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--latency", "0.1,soon"], '--latency: "soon" is not a number'),
        (["--latency", "0.1,2"], "--latency: should lie between 0 and 0.9, found 2"),
        (["--noise", "0"], "--noise: should lie between 0.01 and 1000, found 0"),
        (["--noise", "nan"], "--noise: should lie between"),
        (["--rate", "15,,30"], '--rate: a value is missing in "15,,30"'),
        (["--rate", "30,30.0"], "--rate: a value is listed twice"),
        (["--rate", "1,2,3,4,5"], "--rate: takes up to 4 values at once, found 5"),
        (["--estimators", "fusoin"], 'has no estimator "fusoin"; did you mean "fusion"?'),
        (["--executor", "proces"], '--executor: there is no "proces"'),
    ],
)
def test_a_bad_option_says_what_is_wrong(study: Path, command: Command, words: list[str], message: str) -> None:
    ran = command(study, *SMALL, *words)
    assert ran.code == 2
    assert message in ran.err
    assert "Traceback" not in ran.err


def test_a_study_without_simulated_participants_is_an_error(folder: Folder, command: Command, tmp_path: Path) -> None:
    none = re.sub(r"simulation:.*", "", SETTINGS)
    assert "found none" in command(folder(none, "none"), *SMALL).err
    assert "found kind: reach" in command(CLONE / "studies" / "reach", *SMALL).err
    taskless = re.sub(r"task:.*", "", SETTINGS)
    assert "selection needs a task" in command(folder(taskless, "taskless"), *SMALL).err
    assert not (tmp_path / "out").exists()


def test_a_lost_process_is_said(study: Path, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(*_: object) -> None:
        raise WorkerLostError("signal 9")

    monkeypatch.setattr("pipeline.simulation.exploration.small_study", lost)
    ran = command(study, *SMALL)
    assert ran.code == 2
    assert "a process died (signal 9), possibly out of memory" in ran.err


def test_ctrl_c_writes_nothing(study: Path, command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pipeline.simulation.exploration.small_study", interrupted)
    ran = command(study, *SMALL)
    assert ran.code == 130
    assert "interrupted; nothing was written" in ran.err
    assert "Finished work is cached" not in ran.err
    assert not (tmp_path / "out").exists()
