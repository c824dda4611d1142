"""`steadyhand replay`: variants of estimators over studies, ranked; and what of them is computed."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pypdf import PdfReader
from scipy import stats

from pipeline.analysis.ranking import ranked
from pipeline.sessions.variants import read_changes
from pipeline.statistics.descriptive import summarize
from pipeline.tables import table as tables
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Ran, Steadyhand

Folder = Callable[..., Path]
SETTINGS = (
    """
title: Tried <again> & again
conditions: [a, b]
sessions: data/{participant}_{condition}.mcap
estimators:
  raw: {type: raw}
  fusion: {type: window_gp, window: 5}
"""
    + STREAMS
)


@pytest.fixture
def study(folder: Folder) -> Path:
    return with_logs(folder(SETTINGS))


def with_logs(root: Path) -> Path:
    for index, condition in enumerate("ab"):
        write_session(root / "data" / f"P1_{condition}.mcap", session_messages(2.5, seed=index))
    return root


def computed(ran: Ran) -> dict[str, int]:
    """What the command says that it computed."""
    return {stage: int(count) for stage, count in re.findall(r"(ingest|replay) (\d+)", ran.out)}


def rows_of(rows: list[dict[str, Any]], **wanted: Any) -> list[dict[str, Any]]:
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def test_adding_a_variant_computes_that_one_only_and_a_second_run_nothing(study: Path, steadyhand: Steadyhand) -> None:
    assert computed(steadyhand("replay", study)) == {"ingest": 2, "replay": 4}
    assert computed(steadyhand("replay", study, "--set", "fusion.window=3,8")) == {"replay": 4}
    assert computed(steadyhand("replay", study, "--set", "fusion.window=3,8,10")) == {"replay": 2}
    again = steadyhand("replay", study, "--set", "fusion.window=3,8,10")
    assert computed(again) == {}
    assert "Nothing had changed, so nothing was computed again" in again.out
    assert computed(steadyhand("replay", study, "--set", "fusion.window=8")) == {}
    # The settings of the study's own are not computed again under another name.
    assert computed(steadyhand("replay", study, "--set", "fusion.window=5")) == {}


def test_only_what_a_change_touches_is_computed_again(study: Path, steadyhand: Steadyhand) -> None:
    steadyhand("replay", study, "--set", "fusion.window=3")
    settings = (study / "study.yaml").read_text()
    (study / "study.yaml").write_text(settings.replace("raw: {type: raw}", "kalman: {type: position_kalman}"))
    assert computed(steadyhand("replay", study, "--set", "fusion.window=3")) == {"replay": 2}
    write_session(study / "data" / "P1_a.mcap", session_messages(2.5, seed=9))
    assert computed(steadyhand("replay", study, "--set", "fusion.window=3")) == {"ingest": 1, "replay": 3}


def test_an_estimators_own_settings_give_what_compare_gives(study: Path, steadyhand: Steadyhand) -> None:
    """The report's stages are the slow, separate way to the same rows."""
    steadyhand("compare", study)
    compared = steadyhand.results()
    steadyhand("replay", study, "--set", "fusion.window=3,5")
    replayed = steadyhand.results()
    own = rows_of(replayed["accuracy"], variant=None)
    assert sorted(own, key=str) == sorted(compared["accuracy"], key=str)
    same = rows_of(replayed["accuracy"], variant="fusion[window=5]")
    assert [{**row, "variant": None} for row in same] == rows_of(own, estimator="fusion")
    assert rows_of(replayed["accuracy"], variant="fusion[window=3]")[0]["rmse_mm"] != same[0]["rmse_mm"]


@pytest.mark.usefixtures("blank_figures")
def test_a_variant_gives_what_study_yaml_with_its_settings_gives(study: Path, steadyhand: Steadyhand) -> None:
    steadyhand("replay", study, "--set", "fusion.window=3")
    replayed = rows_of(steadyhand.results()["accuracy"], variant="fusion[window=3]")
    trials = pd.read_parquet(steadyhand.out / "replay_trials.parquet")
    settings = (study / "study.yaml").read_text()
    (study / "study.yaml").write_text(settings.replace("window: 5", "window: 3"))
    steadyhand("report", study)
    fused = rows_of(steadyhand.results()["accuracy"], estimator="fusion")
    assert [{**row, "variant": None} for row in replayed] == fused
    shown = pd.read_csv(steadyhand.out / "tables" / "trials.csv").query("estimator == 'fusion'")
    np.testing.assert_allclose(
        trials.query("variant == 'fusion[window=3]'")["squared_error_mm2"], shown["squared_error_mm2"], rtol=1e-12
    )


def test_sets_on_one_estimator_multiply_out(study: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("replay", study, "--set", "fusion.window=3,8", "--set", "fusion.use=[tracker],[tracker,imu]")
    assert ran.code == 0
    labels = {row["variant"] for row in steadyhand.results()["accuracy"]}
    assert labels == {
        None,
        "fusion[window=3,use=[tracker]]",
        "fusion[window=3,use=[tracker,imu]]",
        "fusion[window=8,use=[tracker]]",
        "fusion[window=8,use=[tracker,imu]]",
    }


def test_the_report_ranks_and_says_everything(study: Path, steadyhand: Steadyhand) -> None:
    for index, condition in enumerate("ab"):  # long enough for a lag
        write_session(study / "data" / f"P1_{condition}.mcap", session_messages(4.0, seed=index))
    ran = steadyhand("replay", study, "--set", "fusion.window=3")
    found = steadyhand.results()
    assert found["schema_version"] == 1
    (facts,) = found["studies"]
    assert (facts["name"], facts["title"], facts["sessions"]) == ("study", "Tried <again> & again", 2)
    assert facts["variants"] == [
        {"estimator": "raw", "variant": None, "settings": {"type": "raw"}},
        {"estimator": "fusion", "variant": None, "settings": {"type": "window_gp", "window": 5}},
        {"estimator": "fusion", "variant": "fusion[window=3]", "settings": {"type": "window_gp", "window": 3}},
    ]
    made = json.loads((steadyhand.out / "provenance.json").read_text())
    assert made["command"] == ["steadyhand", "replay", "study", "--set", "fusion.window=3"]
    assert "data/P1_a.mcap" in made["studies"]["study"]["inputs_sha256"]
    means = found["replay_means"]
    assert [row["rank"] for row in means] == [1, 2, 3]
    assert [row["rmse_mm"] for row in means] == sorted(row["rmse_mm"] for row in means)
    best = means[0]
    of_best = rows_of(found["accuracy"], estimator=best["estimator"], variant=best["variant"])
    errors = [row["rmse_mm"] for row in of_best]
    interval = stats.ttest_1samp(errors, 0).confidence_interval()
    assert best["rmse_mm"] == pytest.approx(np.mean(errors))
    assert best["rmse_low_mm"] == pytest.approx(max(0, interval.low))
    assert best["rmse_high_mm"] == pytest.approx(interval.high)
    page = (steadyhand.out / "replay.html").read_text()
    assert "fusion[window=3]" in page
    assert "Tried &lt;again&gt; &amp; again" in page
    assert "data:image/svg" in page
    assert "At the selections" in page
    assert {row["selection_n"] for row in means} == {2}
    reader = PdfReader(steadyhand.out / "replay.pdf")
    printed = " ".join("".join(sheet.extract_text() for sheet in reader.pages).split())
    for words in ("fusion[window=3]", "Tried <again> & again", "At the selections", "The best of many"):
        assert words in printed
    assert "fusion[window=3]" in ran.out
    assert "replay.pdf" in ran.out
    for name in ("accuracy", "replay_trials", "replay_means", "replay_exclusions"):
        assert (steadyhand.out / f"{name}.parquet").is_file()
    whole = list(tables.records("accuracy", tables.read("accuracy", steadyhand.out)))
    assert whole == found["accuracy"]


def test_sessions_too_short_for_a_lag_are_ranked_without_a_picture(study: Path, steadyhand: Steadyhand) -> None:
    assert steadyhand("replay", study).code == 0
    assert {row["lag_s"] for row in steadyhand.results()["replay_means"]} == {None}
    page = (steadyhand.out / "replay.html").read_text()
    assert "Neither lag nor jitter could be measured" in page


def test_several_studies_give_one_report(folder: Folder, steadyhand: Steadyhand) -> None:
    first, second = with_logs(folder(SETTINGS, "first")), with_logs(folder(SETTINGS, "second"))
    settings = (second / "study.yaml").read_text().replace("  raw: {type: raw}\n", "")
    (second / "study.yaml").write_text(settings)
    ran = steadyhand("replay", first, str(second), "--set", "fusion.window=3")
    assert ran.code == 0
    found = steadyhand.results()
    assert [study["name"] for study in found["studies"]] == ["first", "second"]
    # All together are ranked over what each study has: raw is in one of them only.
    together = rows_of(found["replay_means"], study=None)
    assert {(row["estimator"], row["variant"], row["n"]) for row in together} == {
        ("fusion", None, 4),
        ("fusion", "fusion[window=3]", 4),
    }
    assert len(rows_of(found["replay_means"], study="first")) == 3
    assert len(rows_of(found["replay_means"], study="second")) == 2
    page = (steadyhand.out / "replay.html").read_text()
    assert "all studies together" in page
    assert not list(steadyhand.out.glob("*/"))


def test_estimators_from_a_file(study: Path, steadyhand: Steadyhand, tmp_path: Path) -> None:
    file = tmp_path / "more.yaml"
    file.write_text("estimators:\n  euro: {type: one_euro}\n")
    ran = steadyhand("replay", study, "--estimators", str(file), "--set", "euro.beta_per_mm=0.1,1")
    assert ran.code == 0, ran.err
    labels = [row["variant"] for row in rows_of(steadyhand.results()["accuracy"], estimator="euro", session="P1_a")]
    assert labels == [None, "euro[beta_per_mm=0.1]", "euro[beta_per_mm=1]"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--set", "fusion.windw=3"], '--set: fusion[windw=3]: unknown key "windw"; did you mean "window"?'),
        (["--set", "fusion.window=three"], '--set: fusion[window=three]: "window": input should be a valid integer'),
        (["--set", "fusion.window=0"], "--set: fusion[window=0]: "),
        (["--set", "fusion.use=[trackr]"], '--set: fusion[use=[trackr]]: use: "trackr" is not known; did you mean'),
        (["--set", "fusion.type=windw_gp"], 'type "windw_gp" is not known; did you mean "window_gp"?'),
        (
            ["--set", "fusoin.window=3"],
            '--set "fusoin.window=3": there is no estimator "fusoin"; did you mean "fusion"?',
        ),
        (["--set", "fusion=3"], '--set "fusion=3": needs an estimator, a key and values, such as fusion.window=3,5,10'),
        (["--set", "fusion.window"], "needs an estimator, a key and values"),
        (["--set", "fusion.window="], "names no value"),
        (["--set", "fusion.window=3,,5"], "not a list of values"),
        (["--set", "fusion.window=3,~"], "a value is missing"),
        (["--set", "fusion.window=[3"], "not a list of values"),
        (["--set", "fusion.window=3,5,3"], "a value is listed twice"),
        (["--set", "fusion.window=3", "--set", "fusion.window=5"], "fusion.window is set twice"),
    ],
)
def test_a_bad_set_says_what_is_wrong(study: Path, steadyhand: Steadyhand, words: list[str], message: str) -> None:
    ran = steadyhand("replay", study, *words)
    assert ran.code == 2
    assert message in ran.err
    assert "Traceback" not in ran.err
    assert not steadyhand.out.exists()
    assert not steadyhand.cache.exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("estimators:\n  raw: {type: raw}\n", "more.yaml: estimators.raw: study.yaml has an estimator of that name"),
        ("estimators:\n  gp: {use: [tracker]}\n", 'more.yaml: "estimators.gp.type" is missing'),
        ("estimators:\n  gp: {type: gp}\n", 'more.yaml: estimators.gp: type "gp" is not known'),
        (
            "estimators:\n  gp: {type: window_gp, windw: 3}\n",
            'estimators.gp: unknown key "windw"; did you mean "window"?',
        ),
        ("estimator:\n  gp: {type: window_gp}\n", 'unknown key "estimator"; did you mean "estimators"?'),
        ("", "holds no settings"),
        ("estimators: [\n", "not valid YAML"),
    ],
)
def test_a_bad_file_of_estimators_says_what_is_wrong(
    study: Path, steadyhand: Steadyhand, tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "more.yaml").write_text(text)
    ran = steadyhand("replay", study, "--estimators", str(tmp_path / "more.yaml"))
    assert ran.code == 2
    assert message in ran.err


def test_a_study_that_cannot_be_replayed_does_not_stop_the_others(
    study: Path, folder: Folder, steadyhand: Steadyhand
) -> None:
    without = folder(SETTINGS.replace("fusion:", "other:"), "without")
    ran = steadyhand("replay", study, str(without), "--set", "fusion.window=3")
    assert ran.code == 2
    assert 'without: --set "fusion.window=3": there is no estimator "fusion"' in ran.err
    assert [row["name"] for row in steadyhand.results()["studies"]] == ["study"]


def test_sessions_that_are_not_in_it_are_said(study: Path, steadyhand: Steadyhand) -> None:
    write_session(study / "data" / "P2_a.mcap", session_messages(2.5, seed=4))
    (study / "data" / "P3_a.mcap").write_bytes(b"not a log")
    with (study / "study.yaml").open("a") as settings:
        settings.write("exclusions: [{participant: P2, reason: left early}]\n")
    ran = steadyhand("replay", study)
    assert ran.code == 1
    assert "session P3_a set aside" in ran.err
    found = steadyhand.results()
    assert {row["session"] for row in found["accuracy"]} == {"P1_a", "P1_b"}
    left_out = {(row["session"], row["what"]) for row in found["replay_exclusions"]}
    assert left_out == {("P2_a", "excluded in study.yaml"), ("P3_a", "session set aside")}
    assert "left early" in (steadyhand.out / "replay.html").read_text()


def test_a_fault_of_ours_in_one_variant_leaves_the_others(
    study: Path, steadyhand: Steadyhand, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipeline.sessions import replay

    original = replay.run

    def failing(work: Any) -> Any:
        if work.session.id == "P1_a" and work.study.estimators["fusion"].parameters["window"] == 3:
            raise ZeroDivisionError("no")
        return original(work)

    settings = (study / "study.yaml").read_text()
    (study / "study.yaml").write_text(settings.replace("  raw: {type: raw}\n", ""))
    monkeypatch.setattr(replay, "run", failing)
    ran = steadyhand("replay", study, "--set", "fusion.window=3")
    assert ran.code == 1
    assert 'session P1_a set aside: fusion[window=3]: internal error in stage "replay"; please report it' in ran.err
    assert len(steadyhand.results()["accuracy"]) == 3
    assert [row["variant"] for row in steadyhand.results()["replay_exclusions"]] == ["fusion[window=3]"]
    monkeypatch.setattr(replay, "run", original)
    assert computed(steadyhand("replay", study, "--set", "fusion.window=3")) == {"replay": 1}
    assert len(steadyhand.results()["accuracy"]) == 4


def test_what_cannot_be_replayed_is_an_error(study: Path, folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "participant,condition,measure,value\nP1,a,m,1\nP1,b,m,2\n"
    tabled = folder("conditions: [a, b]\nmeasures: measures.csv\n", "tabled", **{"measures.csv": rows})
    ran = steadyhand("replay", tabled)
    assert (ran.code, "there is none to replay; name some, or give --estimators FILE" in ran.err) == (2, True)
    before = (study / "study.yaml").read_bytes()
    steadyhand.out = study
    ran = steadyhand("replay", study)
    assert (ran.code, "is the folder of a study; choose another folder for the report" in ran.err) == (2, True)
    assert (study / "study.yaml").read_bytes() == before


def test_studies_without_reference_or_selections_have_no_such_figures(folder: Folder, steadyhand: Steadyhand) -> None:
    """Held against the smoothed readings, and said."""
    root = with_logs(folder("\n".join(line for line in SETTINGS.splitlines() if "/reference/" not in line)))
    settings = (root / "study.yaml").read_text()
    (root / "study.yaml").write_text(settings.replace("events: {topic: /events}", ""))
    ran = steadyhand("replay", root)
    assert ran.code == 0
    assert {row["reference"] for row in steadyhand.results()["accuracy"]} == {"smoothed readings"}
    assert {row["selection_rmse_mm"] for row in steadyhand.results()["replay_means"]} == {None}
    page = (steadyhand.out / "replay.html").read_text()
    assert "No reference was recorded" in page
    assert "Without a recorded reference variants are not ranked." in page
    assert {row["rank"] for row in steadyhand.results()["replay_means"]} == {None}
    assert "mm from the smoothed readings" in ran.out
    assert "Least error" not in page and "to the reference" not in page
    assert "At the selections" not in page


def test_at_the_selections_is_the_root_of_the_mean_over_sessions_of_their_means() -> None:
    trials = tables.frame(
        "replay_trials",
        [
            {"study": "s", "session": session, "estimator": "e", "squared_error_mm2": value}
            for session, value in (("1", 1.0), ("1", 3.0), ("2", 10.0), ("2", None))
        ],
    )
    (row,) = ranked(tables.frame("accuracy", []), trials)
    assert (row["rank"], row["selection_n"], row["selection_rmse_mm"]) == (None, 2, pytest.approx(np.sqrt(6)))
    summary = summarize(np.array([2.0, 10.0]))
    assert row["selection_rmse_low_mm"] == 0
    assert row["selection_rmse_high_mm"] == pytest.approx(np.sqrt(summary["ci_high"]))


def test_values_are_read_as_study_yaml_reads_them() -> None:
    asked = read_changes(["a.b.window=3, 0.5", "gp.jerk=1e5,1.0e+6", "gp.path=event_time"])
    assert asked == {"a.b": {"window": [3, 0.5]}, "gp": {"jerk": ["1e5", 1e6], "path": ["event_time"]}}


@pytest.mark.forks
def test_processes_give_the_same_results_as_this_process(study: Path, steadyhand: Steadyhand) -> None:
    steadyhand("replay", study, "--set", "fusion.window=3")
    here = (steadyhand.out / "results.json").read_bytes()
    steadyhand.cache = steadyhand.cache.with_name("other")
    steadyhand("replay", study, "--set", "fusion.window=3", "--jobs", "2")
    assert (steadyhand.out / "results.json").read_bytes() == here
    assert json.loads(here)["accuracy"]
