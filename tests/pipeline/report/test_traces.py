"""The page of traces: what it holds is what was measured, to 0.1 mm, and it stays small."""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.engine.stage import Work
from pipeline.report.document import traces
from pipeline.report.document.traces import Event, Scene, Series, Traces
from pipeline.report.sections import traces as section
from pipeline.sessions import ingest, recording
from pipeline.study.folder import load_study
from pipeline.study.session import Session
from pipeline.tables import table as tables
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]


def unpacked(session: dict[str, Any]) -> list[np.ndarray]:
    """Times and axes one after the other, number by number as traces.js has it: the slow reference."""
    content, begin, found = zlib.decompress(base64.b64decode(session["data"])), 0, []
    for series in session["series"]:
        for _ in range(1 + len(series["axes"])):
            n, total, values = series["n"], 0, []
            for index in range(n):
                zigzag = sum(content[begin + plane * n + index] << (8 * plane) for plane in range(4))
                total += (zigzag >> 1) ^ -(zigzag & 1)
                total = (total + 2**31) % 2**32 - 2**31
                values.append(total / 10)
            begin += 4 * n
            found.append(np.array(values))
    assert begin == len(content)
    return found


def page_of(sessions: list[Traces], folder: Path) -> list[dict[str, Any]]:
    traces.render("title", "origin", sessions, len(sessions), folder / "traces.html")
    page = (folder / "traces.html").read_text(encoding="utf-8")
    (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page)
    content: list[dict[str, Any]] = json.loads(data)
    return content


@settings(max_examples=40, deadline=None)
@given(arrays(np.float64, (12, 3), elements=st.floats(-2e8, 2e8)))
def test_what_is_packed_comes_out_to_a_tenth(value_mm: np.ndarray) -> None:
    time_s = np.arange(12) / 90
    session = traces.pack(Traces("s", None, None, (Series("a", "estimator", ("x", "y", "z"), time_s, value_mm),)), 0)
    times, *axes = unpacked(session)
    assert session["left_out"] == 0
    np.testing.assert_allclose(times / 1e3, time_s, atol=0.00005 + 1e-12)
    np.testing.assert_allclose(np.column_stack(axes), value_mm, atol=0.05 + 1e-6)


def test_readings_that_cannot_be_drawn_are_left_out_and_counted() -> None:
    value_mm = np.array([[1.0], [np.nan], [np.inf], [1e12], [2.0]])
    session = traces.pack(Traces("s", None, None, (Series("a", "tracker", ("x",), np.arange(5.0), value_mm),)), 0)
    assert session["left_out"] == 3
    times, values = unpacked(session)
    assert times.tolist() == [0, 4000]
    assert values.tolist() == [1, 2]


def test_many_long_sessions_are_thinned_out_to_fit_and_say_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(traces, "BUDGET_BYTES", 60_000)
    random, time_s = np.random.default_rng(0), np.arange(20_000) / 90
    walk = [
        Traces(name, None, None, (Series("a", "estimator", ("x",), time_s, random.normal(0, 9, (20_000, 1))),))
        for name in ("long", "too")
    ]
    short = Traces("short", None, None, (Series("a", "estimator", ("x",), time_s[:50], np.zeros((50, 1))),))
    packed = page_of([*walk, short], tmp_path)
    assert (tmp_path / "traces.html").stat().st_size < 60_000 + 130_000  # beside the data: fonts, style and scripts
    assert packed[0]["step_s"] > 0
    assert packed[2]["step_s"] == 0
    times = unpacked(packed[0])[0] / 1e3
    assert 100 < len(times) < 20_000
    assert np.all(np.diff(np.floor((times + 1e-6) / packed[0]["step_s"])) > 0)


def a_line(n: int = 50) -> tuple[Series, ...]:
    return (Series("a", "estimator", ("x", "y"), np.arange(n) / 90, np.zeros((n, 2))),)


def test_the_page_holds_what_a_session_is_played_on(tmp_path: Path) -> None:
    events = (
        Event("trial_start", 1.0, (50.0, -20.0), None),
        Event("selection", 2.34567, (50.0, -20.0), (53.14, -21.0)),
        Event("selection", 3.0, None, None),
    )
    scene = Scene(
        ("x", "z"), "display", "a", "b", events, ((0.0, 0.0), (90.0, 0.0)), ((50.0, -20.0),), 20.0, (85.4, 48.0)
    )
    (packed,) = page_of([Traces("s", None, None, a_line(), scene)], tmp_path)
    assert packed["scene"] == {
        "plane": ["x", "z"],
        "displayed": "display",
        "displayed_by": "a",
        "compared": "b",
        "path": [[0, 0], [90, 0]],
        "targets": [[50, -20]],
        "diameter": 20,
        "window": [85.4, 48],
        "events": [
            {"type": "trial_start", "time": 1, "target": [50, -20], "at": None},
            {"type": "selection", "time": 2.3457, "target": [50, -20], "at": [53.1, -21]},
            {"type": "selection", "time": 3, "target": None, "at": None},
        ],
        "events_left_out": 0,
    }


def test_events_without_number_do_not_fill_the_page_and_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(traces, "BUDGET_BYTES", 40_000)
    events = tuple(Event("selection", 1000 + index / 7, (-1234.5, 5.1), (-1e4, 9.9)) for index in range(5000))
    (packed,) = page_of([Traces("s", None, None, a_line(), Scene(("x", "y"), None, None, None, events))], tmp_path)
    kept = packed["scene"]["events"]
    assert 0 < len(kept) < 5000
    assert len(kept) + packed["scene"]["events_left_out"] == 5000
    assert len(json.dumps(kept)) < 40_000 / 4


TASK = """
conditions: [a, b]
shown: {a: raw, b: fusion}
sessions: '{participant}_{condition}.mcap'
estimators: {raw: {type: raw}, kinect: {type: position_kalman}, fusion: {type: fusion_kalman}}
task: {window_mm: [80, 50], targets_mm: [[10, 20]], path_mm: [[0, 0], [10, 20]], target_diameter_mm: 12}
"""


def played(folder: Folder, steadyhand: Steadyhand, settings: str) -> dict[str, dict[str, Any]]:
    root = folder(settings + STREAMS)
    for condition in "ab":
        write_session(root / f"P_{condition}.mcap", session_messages(3.0))
    assert steadyhand("report", root).code == 0
    page = (steadyhand.out / "traces.html").read_text(encoding="utf-8")
    (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page)
    return {session["condition"]: session["scene"] for session in json.loads(data)}


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_a_session_is_played_on_its_task_beside_an_estimator_that_it_did_not_show(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    scenes = played(folder, steadyhand, TASK)
    for scene in scenes.values():
        assert scene["plane"] == ["x", "y"]
        assert (scene["window"], scene["diameter"]) == ([80, 50], 12)
        assert (scene["path"], scene["targets"]) == ([[0, 0], [10, 20]], [[10, 20]])
        assert scene["compared"] not in (scene["displayed_by"], None)
    assert [scenes[condition]["displayed_by"] for condition in "ab"] == ["raw", "fusion"]


def test_a_selection_that_names_no_target_has_that_of_its_trial(tmp_path: Path) -> None:
    nowhere = dict.fromkeys([f"{prefix}{axis}_mm" for prefix in ("", "target_") for axis in "xyz"])
    target = {"target_x_mm": 10.0, "target_y_mm": 20.0}
    rows = [
        {**nowhere, "session": "s", "time_ns": 10**9, "type": "selection", "trial": None, "x_mm": 1.0, "y_mm": 2.0},
        {**nowhere, "session": "s", "time_ns": 2 * 10**9, "type": "trial_start", "trial": 1, **target},
        {**nowhere, "session": "s", "time_ns": 3 * 10**9, "type": "selection", "trial": 1, "x_mm": 13.0, "y_mm": 24.0},
        {**nowhere, "session": "s", "time_ns": 4 * 10**9, "type": "selection", "trial": 7, "x_mm": 13.0, "y_mm": 24.0},
        {**nowhere, "session": "s", "time_ns": 5 * 10**9, "type": "selection", "trial": None, "x_mm": 9.0, "y_mm": 9.0},
    ]
    tables.write("events", tables.frame("events", rows), tmp_path)
    assert section.events_of(tmp_path, 0, ("x", "y")) == (
        Event("selection", 1.0, None, (1.0, 2.0)),
        Event("trial_start", 2.0, (10.0, 20.0), None),
        Event("selection", 3.0, (10.0, 20.0), (13.0, 24.0)),
        Event("selection", 4.0, None, (13.0, 24.0)),  # of a trial that never started
        Event("selection", 5.0, (10.0, 20.0), (9.0, 9.0)),
    )


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_a_session_of_one_axis_is_not_played(folder: Folder, steadyhand: Steadyhand) -> None:
    one_axis = TASK.replace("conditions", "axes: [x]\nconditions", 1)
    one_axis = "".join(line for line in one_axis.splitlines(keepends=True) if not line.startswith("task"))
    assert played(folder, steadyhand, one_axis) == {"a": None, "b": None}


def test_positions_are_those_of_the_whole_recording(folder: Folder, tmp_path: Path) -> None:
    """The quick way to the streams of positions agrees with the one by which the estimators get them."""
    turned = STREAMS.replace("kind: reference}", "kind: reference, translation_mm: [1, 2, 3], latency_s: 0.01}")
    root = folder("conditions: [a]\naxes: [x, z]\nsessions: '{participant}_{condition}.mcap'\n" + turned)
    write_session(root / "P_a.mcap", session_messages(2.0))
    study, out = load_study(root), tmp_path / "ingested"
    out.mkdir()
    session = Session("P_a", "P", "a", root / "P_a.mcap")
    ingest.run(Work("study", study, root, out, (session,)))
    whole, (origin_ns, quick) = recording.load(study, out), recording.positions(study, out)
    late_s = (origin_ns - whole.origin_ns) * 1e-9
    assert set(quick) == {"tracker", "reference"}
    assert whole.reference is not None
    for name, samples in (("tracker", whole.samples["tracker"]), ("reference", whole.reference)):
        np.testing.assert_array_equal(quick[name].value, samples.value)
        np.testing.assert_allclose(quick[name].time + late_s, samples.time, atol=2e-9)
        np.testing.assert_allclose(quick[name].arrival + late_s, samples.arrival, atol=2e-9)


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_a_study_of_tables_alone_has_no_page_of_traces(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "participant,condition,measure,value\n" + "".join(f"P{p},{c},m,{p}\n" for p in range(3) for c in "ab")
    assert steadyhand("report", folder("conditions: [a, b]\nmeasures: m.csv\n", **{"m.csv": rows})).code == 0
    assert not (steadyhand.out / "traces.html").exists()
    assert "traces.html" not in (steadyhand.out / "report.html").read_text(encoding="utf-8")
