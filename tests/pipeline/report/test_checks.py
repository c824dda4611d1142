"""What a reader sees of a contradiction: the first page, the lights, the table of checks, results.json."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import write_session
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.sessions.checks.hand import Hand, messages, session
from tests.pipeline.sessions.checks.spoilt import EVENT_FAULTS, FAULTS

Folder = Callable[..., Path]
SETTINGS = """
conditions: [a]
sessions: data/{participant}_{condition}.mcap
streams:
  tracker:   {topic: /tracker/position, kind: position, stamp: arrival, latency_s: 0.1, noise_sd_mm: 8}
  imu:       {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, 0, -9806.65], noise_sd_mm_s2: 100}
  reference: {topic: /reference/position, kind: reference}
  display:   {topic: /display/position, kind: display}
events: {topic: /events}
estimators: {fusion: {type: fusion_kalman}}
"""


def text_of(report: Path) -> str:
    """The words of a page."""
    return re.sub(r"\s+", " ", html.unescape(re.sub("<[^>]+>", " ", report.read_text(encoding="utf-8"))))


def study_of(folder: Folder, fault: str | None) -> Path:
    """A study of one session with a fault."""
    log, study = session(Hand(seconds=30.0))
    if fault is not None:
        spoil = next(one.spoil for one in (*FAULTS, *EVENT_FAULTS) if one.name.startswith(fault))
        log, study = spoil(log, study)
    made = folder(SETTINGS)
    write_session(made / "data" / "P01_a.mcap", messages(log))
    return made


def test_one_log_under_two_names_is_said(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder(SETTINGS)
    for name, seed in (("P01_a", 0), ("P02_a", 1), ("P03_a", 0)):
        write_session(study / "data" / f"{name}.mcap", messages(session(Hand(seed=seed, seconds=20.0))[0]))
    ran = steadyhand("compare", study)
    assert ran.code == 0, ran.err
    (row,) = (row for row in steadyhand.results()["checks"] if row["check"] == "copied logs")
    assert (row["session"], row["status"]) == (None, "amber")
    assert "the logs of P01_a and P03_a hold the same readings" in row["message"]


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_a_contradiction_stands_on_the_first_page_and_the_exit_code_is_as_before(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    study = study_of(folder, "accelerometer in g")
    ran = steadyhand("report", study)
    assert ran.code == 0, ran.err
    found = [row for row in steadyhand.results()["checks"] if row["status"] == "red"]
    assert {row["check"] for row in found} >= {"specific force: imu"}
    text = text_of(steadyhand.out / "report.html")
    first_page, quality = text.index("The data contradict themselves or study.yaml"), text.index("Checks:")
    assert first_page < quality
    assert "they are in g; multiply by 9.80665" in text[first_page:quality]
    assert "✗ red: 1 m/s² (specific force: imu)" in text
    assert "they are in g" in (steadyhand.out / "tables" / "checks.csv").read_text(encoding="utf-8")


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_without_a_fault_the_report_says_the_lag_and_no_caution(folder: Folder, steadyhand: Steadyhand) -> None:
    assert steadyhand("report", study_of(folder, None)).code == 0
    rows = steadyhand.results()["checks"]
    assert {row["status"] for row in rows} == {"green"}
    assert all(row["message"] is None for row in rows)
    assert len({(row["session"], row["check"]) for row in rows}) == len(rows)
    text = text_of(steadyhand.out / "report.html")
    assert "contradict themselves" not in text
    lag = next(row for row in rows if row["check"] == "lag")
    assert f"P01_a {lag['found']}" in text


@pytest.mark.parametrize(
    "fault", ["tracker in mm", "stamped on arrival", "events an hour off", "phone frozen from half"]
)
def test_a_fault_of_the_file_reaches_results(folder: Folder, steadyhand: Steadyhand, fault: str) -> None:
    study = study_of(folder, fault)
    if fault == "stamped on arrival":
        path = study / "study.yaml"
        path.write_text(path.read_text().replace("stamp: arrival, latency_s: 0.1", "stamp: measurement"))
    assert steadyhand("compare", study).code in (0, 1)
    expected = next(one for one in (*FAULTS, *EVENT_FAULTS) if one.name.startswith(fault))
    rows = steadyhand.results()["checks"]
    assert any(
        row["check"].startswith(expected.check) and row["status"] != "green" and expected.says in row["message"]
        for row in rows
    ), rows
