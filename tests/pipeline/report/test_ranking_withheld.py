"""No estimator is called the best by sessions that contradict themselves, nor fusion where it used no acceleration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.sessions.logs.log import Log
from tests.conftest import write_session
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.report.test_checks import SETTINGS, text_of
from tests.pipeline.sessions.checks.hand import Hand, messages, session
from tests.pipeline.sessions.checks.ways_to_spoil import IMU

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

Folder = Callable[..., Path]
ESTIMATORS = "estimators: {raw: {type: raw}, fusion: {type: fusion_kalman}}"


def study_with(folder: Folder, log: Log, changed: tuple[str, str] = ("", "")) -> Path:
    """A study of one log, its settings changed."""
    settings = SETTINGS.replace("estimators: {fusion: {type: fusion_kalman}}", ESTIMATORS).replace(*changed)
    made = folder(settings)
    write_session(made / "data" / "P01_a.mcap", messages(log))
    return made


def without_orientation_or_turning(log: Log) -> Log:
    """A phone that logs neither orientation nor angular velocity."""
    readings = log.topics[IMU]
    value = readings.values.copy()
    value[:, 3:6] = 0.0
    value[:, 6:10] = np.nan
    return Log(log.facts, {**log.topics, IMU: replace(readings, values=value)}, log.faults)


def test_fusion_that_is_worse_than_its_tracker_is_named_and_nothing_is_best(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    log, _ = session(Hand(seconds=20.0))
    ran = steadyhand("report", study_with(folder, log, ("[0, 0, -9806.65]", "[0, 0, 9806.65]")))
    assert ran.code == 0
    (row,) = (row for row in steadyhand.results()["checks"] if row["check"] == "fusion against tracker: fusion")
    assert row["status"] == "red"
    assert "its tracker alone" in row["message"]
    assert "1 of 1 session with a red check, so no estimator is called best" in ran.out
    page = text_of(steadyhand.out / "report.html")
    assert "Which estimator is best is not said: 1 of 1 session contradicts what study.yaml states" in page
    assert "Fusion is worse than its tracker alone: fusion in 1 of 1 session (such as P01_a: fusion is " in page
    assert not any(
        words in page for words in ("comes closest", "Smallest RMSE", "smallest first", "No other estimator")
    )


def test_a_replay_says_beside_its_ranking_that_the_data_contradict_themselves(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    log, _ = session(Hand(seconds=20.0))
    ran = steadyhand("replay", study_with(folder, log, ("[0, 0, -9806.65]", "[0, 0, 9806.65]")))
    assert ran.code == 0, ran.err
    caution = "1 of 1 session with a red check (P01_a): do not rely on the order of the variants"
    assert caution in ran.out
    page = text_of(steadyhand.out / "replay.html")
    assert page.index(caution) < page.index("Least error")


def test_an_estimator_with_settings_that_do_not_suit_is_no_contradiction(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    """Where another does better than the tracker with the same readings, these are as study.yaml states them."""
    log, _ = session(Hand(seconds=20.0))
    unsuited = f"{ESTIMATORS[:-1]}, still: {{type: window_gp, window: 60, inverse_scale_s2: 0.05}}}}"
    ran = steadyhand("report", study_with(folder, log, (ESTIMATORS, unsuited)))
    assert ran.code == 0, ran.err
    rows = {row["check"]: row for row in steadyhand.results()["checks"]}
    assert rows["fusion against tracker: fusion"]["status"] == "green"
    row = rows["fusion against tracker: still"]
    assert row["status"] == "green"
    assert "fusion does better than the tracker with the same readings" in row["message"]
    page = text_of(steadyhand.out / "report.html")
    assert "fusion comes closest to the reference" in page
    assert "Fusion is worse than its tracker alone: still in 1 of 1 session (such as P01_a: still is " in page


def test_without_a_contradiction_the_best_is_named(folder: Folder, steadyhand: Steadyhand) -> None:
    log, _ = session(Hand(seconds=20.0))
    ran = steadyhand("report", study_with(folder, log))
    rows = {row["check"]: row["status"] for row in steadyhand.results()["checks"]}
    assert rows["fusion against tracker: fusion"] == "green"
    assert rows["accelerations used: imu"] == "green"
    page = text_of(steadyhand.out / "report.html")
    assert "fusion comes closest to the reference" in page
    assert "Smallest RMSE: fusion" in page
    assert "raw (the newest position, held, from the tracker alone); fusion (a Kalman filter of positions and" in page
    assert "is best is not said" not in page + ran.out
    assert "Nothing was left out: every session" in page


def test_an_estimator_that_used_no_acceleration_is_shown_as_such(folder: Folder, steadyhand: Steadyhand) -> None:
    log = without_orientation_or_turning(session(Hand(seconds=20.0, span_mm=(0.0, 0.0, 0.0), turn_rad=0.0))[0])
    assert steadyhand("report", study_with(folder, log)).code == 0
    (row,) = (row for row in steadyhand.results()["checks"] if row["check"] == "accelerations used: imu")
    assert row["status"] == "red", row
    assert "every estimate here is the tracker's alone" in row["message"]
    page = text_of(steadyhand.out / "report.html")
    assert "fusion (no acceleration used in 1 of 1)" in page
    assert "comes closest" not in page
    assert "Nothing was left out" not in page
    assert "of unknown orientation could not be used" in page


def test_where_there_is_no_accuracy_the_report_says_why(folder: Folder, steadyhand: Steadyhand) -> None:
    log, _ = session(Hand(seconds=20.0))
    there = {topic: readings for topic, readings in log.topics.items() if "reference" not in topic}
    made = study_with(folder, Log(log.facts, there, log.faults))
    assert steadyhand("report", made).code == 1
    page = text_of(steadyhand.out / "report.html")
    assert 'errors cannot be given, for no log has a usable "reference".' in page
