"""A study's data for other programs: tables with a dictionary, a script for R, logs with every track."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Wanted
from pipeline.tables.catalogue import TABLES
from tests.conftest import CLONE, session_messages, write_session
from tests.pipeline.helpers import Steadyhand

NO_ANALYTICS = {**os.environ, "RERUN_ANALYTICS": "0", "DO_NOT_TRACK": "1"}
FENG = CLONE / "studies" / "feng2016"
STREAMS = """conditions: [a]
sessions: '{participant}_{condition}.mcap'
streams:
  tracker: {topic: /tracker/position, kind: position, stamp: arrival, latency_s: 0.1}
  imu: {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0]}
events: {topic: /events}
estimators: {raw: {type: raw}}
"""


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_every_table_with_a_dictionary(to: str, steadyhand: Steadyhand) -> None:
    assert steadyhand("export", FENG, "--to", to).code == 0
    dictionary = pd.read_csv(steadyhand.out / "dictionary.csv")
    names = set(dictionary["table"])
    assert names == {path.stem for path in steadyhand.out.glob(f"*.{to}")} - {"dictionary"}
    assert {"measures", "comparisons", "descriptives"} <= names
    for name in names:
        path = steadyhand.out / f"{name}.{to}"
        columns = list(pd.read_csv(path).columns) if to == "csv" else pq.read_schema(path).names
        of_table = dictionary[(dictionary["table"] == name) & dictionary["column"].notna()]
        assert columns == list(of_table["column"]) == TABLES[name].names
        assert of_table["meaning"].notna().all()


def test_a_script_for_r_computes_the_comparisons_anew(steadyhand: Steadyhand) -> None:
    rscript = shutil.which("Rscript")
    if rscript is None:
        pytest.skip("Rscript is not installed")
    assert steadyhand("export", FENG, "--to", "r").code == 0
    done = subprocess.run([rscript, "analysis.R"], cwd=steadyhand.out, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = pd.read_csv(steadyhand.out / "comparisons_in_r.csv")
    ours = found[found["figure"].isin(["p", "p_adjusted"]) & found["steadyhand"].notna()]
    assert set(ours["test"]) == {"rm_anova", "wilcoxon"}
    anova = ours[ours["test"] == "rm_anova"]
    np.testing.assert_allclose(anova["in_r"], anova["steadyhand"], rtol=1e-9)
    assert "selection_mse_px2, rm_anova, condition, p by" in done.stdout


def test_logs_with_every_track(folder: Callable[..., Path], steadyhand: Steadyhand) -> None:
    study = folder(STREAMS)
    write_session(study / "P1_a.mcap", session_messages(3.0))
    assert steadyhand("export", study, "--to", "mcap").code == 0
    wanted = [
        Wanted("/tracker/position", "position"),
        Wanted("/phone/imu", "acceleration"),
        Wanted("/events", "events"),
    ]
    before, after = (read_log(path / "P1_a.mcap", wanted) for path in (study, steadyhand.out))
    for want in wanted[:2]:
        one, other = before.topics[want.key], after.topics[want.key]
        np.testing.assert_allclose(other.values, one.values, rtol=1e-12)
        np.testing.assert_array_equal([other.stamp_ns, other.arrival_ns], [one.stamp_ns, one.arrival_ns])
    assert [one["type"] for one in after.topics["/events"].events] == [
        one["type"] for one in before.topics["/events"].events
    ]
    assert after.facts == {"participant": "P1", "condition": "a", "session": "P1_a"}
    with (steadyhand.out / "P1_a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        track = [decoded for *_, decoded in reader.iter_decoded_messages(topics=["/steadyhand/raw"])]
    assert len(track) > 100
    assert track[0].pose.orientation.w == 1.0
    layout = json.loads((steadyhand.out / "layout.json").read_text())
    assert "/steadyhand/raw.pose.position.x" in json.dumps(layout["configById"])


def test_rerun_draws_every_track_in_space(folder: Callable[..., Path], steadyhand: Steadyhand) -> None:
    rerun = Path(sys.executable).with_name("rerun")
    if not rerun.exists():
        pytest.skip("rerun-sdk is not installed; `make test-exports` installs it")
    study = folder(STREAMS)
    write_session(study / "P1_a.mcap", session_messages(3.0))
    assert steadyhand("export", study, "--to", "mcap").code == 0
    log, recording = steadyhand.out / "P1_a.mcap", steadyhand.out / "P1_a.rrd"
    commands: list[list[str | Path]] = [["mcap", "convert", log, "-o", recording], ["rrd", "print", recording]]
    for command in commands:
        done = subprocess.run([rerun, *command], capture_output=True, text=True, check=True, env=NO_ANALYTICS)
    wanted = [Wanted("/tracker/position", "position"), Wanted("/steadyhand/raw", "position")]
    for topic, readings in read_log(log, wanted).topics.items():
        rows = re.findall(rf"with (\d+) rows .* - {topic} - .*InstancePoses3D:translations", done.stdout)
        assert sum(map(int, rows)) == readings.read > 80


def test_what_cannot_be_exported_is_said(steadyhand: Steadyhand, tmp_path: Path) -> None:
    assert '--to: there is no "excel"' in steadyhand("export", FENG, "--to", "excel").err
    assert "has no logs to export" in steadyhand("export", FENG, "--to", "mcap").err
    study = shutil.copytree(FENG, tmp_path / "feng")
    steadyhand.out = study / "export"
    assert "is within the study folder, which is never changed" in steadyhand("export", study, "--to", "csv").err
