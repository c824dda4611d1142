"""A study as Motion-BIDS: the numbers as read, names as required, and what the validator of BIDS says."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipeline.commands.export_bids.names import Names, labels
from tests.conftest import session_messages, write_session
from tests.pipeline.helpers import Steadyhand

STUDY = """title: Müller's study
conditions: [with-fusion, b]
sessions: '{participant}_{condition}.mcap'
participants: participants.csv
streams:
  hand tracker: {topic: /tracker/position, kind: position, stamp: arrival, latency_s: 0.1}
  imu: {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0]}
events: {topic: /events}
estimators: {raw: {type: raw}}
"""


@pytest.fixture
def study(folder: Callable[..., Path], steadyhand: Steadyhand) -> Path:
    """Two people in two conditions, of which the names differ in a sign that BIDS does not allow."""
    path = folder(STUDY)
    (path / "participants.csv").write_text("participant,hand\nP1,left\nP-1,right\n")
    for person, seconds in (("P1", 2.0), ("P-1", 2.5)):
        for condition in ("with-fusion", "b"):
            write_session(path / f"{person}_{condition}.mcap", session_messages(seconds))
    assert steadyhand("export", path, "--to", "bids").code == 0
    return path


def read(path: Path, **options: Any) -> pd.DataFrame:
    table: pd.DataFrame = pd.read_csv(path, sep="\t", na_values="n/a", **options)
    return table


def test_the_numbers_read_back_are_those_of_the_tables(study: Path, steadyhand: Steadyhand) -> None:
    exported = steadyhand.out
    steadyhand.out = exported.with_name("tables")
    assert steadyhand("export", study, "--to", "parquet").code == 0
    people = read(exported / "participants.tsv").set_index("study_id")
    assert dict(people["participant_id"]) == {"P-1": "sub-P1", "P1": "sub-P1x2"}
    assert dict(people["hand"]) == {"P-1": "right", "P1": "left"}
    columns = {"handtracker": ("hand tracker", "positions", 3), "imu": ("imu", "imu", 10)}
    tables = {name: pd.read_parquet(steadyhand.out / f"{name}.parquet") for name in ("positions", "imu")}
    for person, subject in dict(people["participant_id"]).items():
        scans = read(exported / subject / f"{subject}_scans.tsv").set_index("filename")["acq_time"]
        assert len(scans) == 4
        for filename, onset in scans.items():
            stem = str(filename).removesuffix("_motion.tsv")
            names = dict(part.split("-") for part in Path(stem).name.split("_"))
            assert list(names) == ["sub", "task", "tracksys", "acq"]
            stream, table, width = columns[names["tracksys"]]
            condition = {"withfusion": "with-fusion", "b": "b"}[names["acq"]]
            rows = tables[table]
            rows = rows[(rows["session"] == f"{person}_{condition}") & (rows["stream"] == stream)]
            samples = read(exported / subject / str(filename), header=None)
            channels = read(exported / subject / f"{stem}_channels.tsv")
            facts = json.loads((exported / subject / f"{stem}_motion.json").read_text())
            assert len(samples) == len(rows) > 0
            assert len(channels) == facts["MotionChannelCount"] == samples.shape[1] == width + 2
            values = rows.drop(columns=["session", "stream", "time_ns", "arrival_ns"])
            np.testing.assert_array_equal(samples.iloc[:, :width], values)
            assert list(channels["type"][-2:]) == ["LATENCY", "LATENCY"]
            onset_ns = pd.Timestamp(onset).value
            for place, time in enumerate(("time_ns", "arrival_ns"), start=width):
                np.testing.assert_array_equal(np.rint(samples[place] * 1e9).astype(np.int64) + onset_ns, rows[time])
            assert facts["SamplingFrequency"] == {"imu": 90.0, "handtracker": 30.0}[names["tracksys"]]


@pytest.mark.usefixtures("study")
def test_events_stand_beside_the_samples(steadyhand: Steadyhand) -> None:
    events = read(steadyhand.out / "sub-P1" / "motion" / "sub-P1_task-selection_acq-b_events.tsv")
    assert list(events.columns[:3]) == ["onset", "duration", "trial_type"]
    chosen = events[events["trial_type"] == "selection"]
    assert len(chosen) > 0 and chosen["x_mm"].notna().all() and events["onset"].is_monotonic_increasing


@pytest.mark.usefixtures("study")
def test_the_validator_of_bids_finds_no_error(steadyhand: Steadyhand) -> None:
    program = Path(sys.executable).with_name("bids-validator-deno")
    if not program.exists():
        pytest.skip("bids-validator-deno is not installed; `make test-exports` installs it")
    done = subprocess.run([program, "--format", "json", steadyhand.out], capture_output=True, text=True, check=False)
    issues = json.loads(done.stdout)["issues"]["issues"]
    assert [issue for issue in issues if issue["severity"] == "error"] == []
    assert {issue["code"] for issue in issues} <= {
        "SIDECAR_KEY_RECOMMENDED",  # the maker and model of a tracker, which nobody has said
        "JSON_KEY_RECOMMENDED",  # the licence, and who pays
        "NO_AUTHORS",
        "TOO_FEW_AUTHORS",
    }


def test_labels_are_letters_and_digits_and_tell_apart() -> None:
    assert labels(["P-1", "P1", "p1", "Ü", "é"]) == {"P-1": "P1", "P1": "P1x2", "p1": "p1x3", "Ü": "x", "é": "xx2"}
    assert Names("P1", "a", 2).stem("selection", "imu") == "sub-P1_task-selection_tracksys-imu_acq-a_run-02"


def test_a_study_without_logs_is_refused(folder: Callable[..., Path], steadyhand: Steadyhand) -> None:
    study = folder("conditions: [a, b]\nmeasures: measures.csv\n")
    (study / "measures.csv").write_text("participant,condition,measure,value\nP1,a,m,1\nP1,b,m,2\n")
    assert "has no logs to export" in steadyhand("export", study, "--to", "bids").err
