"""The tables behind figures: a session's liveliest seconds, what arrived when, selections and calibration counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import pipeline
from fusion_core import Samples
from pipeline.notebook import Tables
from pipeline.sessions import excerpts
from pipeline.sessions.logs.mcap import Message
from pipeline.tables import table as tables
from tests.conftest import EPOCH_NS, STREAMS, session_messages, write_session

SETTINGS = (
    "conditions: [a, b]\nsessions: '{participant}_{condition}.mcap'\naxes: [x, y]\n"
    "estimators: {raw: {type: raw}, fusion: {type: fusion_kalman}}\n" + STREAMS
)


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tables]:
    """Two participants; the tracker of one falls silent for a second, and one session is excluded."""
    root = tmp_path_factory.mktemp("study")
    excluded = "exclusions: [{session: P2_b, reason: fell}]\n"
    (root / "study.yaml").write_text(SETTINGS + excluded, encoding="utf-8")
    for person in (1, 2):
        for condition in "ab":
            messages = session_messages(4.0, seed=person, bias_mm=4.0 * (condition == "b"))
            if (person, condition) == (1, "a"):
                messages = [one for one in messages if not _silent(one)]
            write_session(root / f"P{person}_{condition}.mcap", messages)
    yield pipeline.load(root, cache=root / "cache")


def _silent(message: Message) -> bool:
    return message.topic == "/tracker/position" and 2.0 < (message.arrival_ns - EPOCH_NS) / 1e9 < 3.1


def frames_of(x_mm: np.ndarray, time: np.ndarray) -> Samples:
    value = np.column_stack([x_mm, np.zeros(len(time))]) + np.random.default_rng(0).normal(0, 8, (len(time), 2))
    return Samples(time, time + 0.1, value)


def test_an_excerpt_holds_a_turn_rather_than_a_longer_way() -> None:
    time = np.arange(0, 30, 1 / 30)
    there_and_back = 200 * np.clip(1 - np.abs(time - 22), 0, None)
    axis, begin = excerpts.liveliest(frames_of(500 * np.clip(time - 5, 0, 1) + there_and_back, time))
    assert axis == 0
    assert begin < 22.1 < begin + excerpts.EXCERPT_S  # when the turn's frame arrives


def test_where_nothing_but_noise_turns_the_longest_way_is_shown() -> None:
    time = np.arange(0, 30, 1 / 30)
    axis, begin = excerpts.liveliest(frames_of(500 * np.clip(time - 15, 0, 1), time))
    assert axis == 0
    assert begin < 15.1 and begin + excerpts.EXCERPT_S > 16.1


def test_excerpts_hold_every_signal_of_the_axis_that_moves(loaded: Tables) -> None:
    one = loaded.in_session("P1_b").excerpts
    assert set(one["axis"]) == {"x"}  # the hand moves along x alone
    assert set(zip(one["kind"], one["name"], strict=True)) == {
        ("tracker", "tracker"),
        ("reference", "reference"),
        ("acceleration", "imu"),
        ("estimate", "fusion"),
    }
    assert float(np.ptp(one["time_s"])) <= excerpts.EXCERPT_S
    frames = one[one["kind"] == "tracker"]
    positions = loaded.in_session("P1_b").positions
    tracker = positions[positions["stream"] == "tracker"]
    assert set(frames["value"].round(6)) <= set(tracker["x_mm"].round(6))
    assert one.loc[one["kind"] == "estimate", "sd"].gt(0).all()


def test_rates_count_every_message_and_its_silences(loaded: Tables) -> None:
    rates = loaded.stream_rates
    for (session, stream), rows in rates.groupby(["session", "stream"]):
        session_tables = loaded.in_session(str(session))
        table = session_tables.imu if stream == "imu" else session_tables.positions
        assert rows["messages"].sum() == (table["stream"] == stream).sum()
    one = rates[(rates["session"] == "P1_a") & (rates["stream"] == "tracker")]
    arrival = loaded.in_session("P1_a").positions.query("stream == 'tracker'")["arrival_ns"].sort_values()
    assert one["gap_max_s"].max() == pytest.approx(float(arrival.diff().max()) * 1e-9)
    ends = one["time_ns"] + one["duration_s"] * 1e9
    np.testing.assert_allclose(ends.iloc[:-1], one["time_ns"].iloc[1:], atol=1e3)


def test_selections_are_those_that_the_trials_are_measured_by(loaded: Tables) -> None:
    selections = loaded.selections
    assert "P2_b" not in set(selections["session"])  # excluded
    assert len(selections) == 6
    squared = sum((selections[f"{a}_mm"] - selections[f"target_{a}_mm"]) ** 2 for a in "xy")
    recorded = loaded.trials[loaded.trials["estimator"] == "recorded"]
    both = selections.assign(squared=squared).merge(recorded, on=["session", "trial"])
    np.testing.assert_allclose(both["squared"], both["squared_error_mm2"])


def test_calibration_counts_what_coverage_is_the_share_of(loaded: Tables) -> None:
    counted = loaded.calibration[loaded.calibration["percent_of_sd"] == 196]
    both = counted.merge(loaded.accuracy, on=["session", "estimator"])
    assert len(both) == len(counted) == 6  # of three sessions
    np.testing.assert_allclose((both["within"] / both["n"]).astype("float64"), both["coverage_95"])
    by_k = loaded.calibration.groupby(["session", "estimator"])["within"]
    assert by_k.apply(lambda values: values.is_monotonic_increasing).all()


def test_the_highest_of_a_lead_curve_is_the_lead(loaded: Tables) -> None:
    curves = loaded.lead_curves
    at = curves.loc[curves.groupby(["session", "estimator"])["correlation_mm2"].idxmax()]
    assert set(at["session"]) >= {"P1_b", "P2_a"}
    assert curves["lead_s"].abs().max() <= 0.5


def test_selections_of_a_table_of_trials(folder: Callable[..., Path], tmp_path: Path) -> None:
    root = folder(
        "conditions: [a]\ntrials: trials.csv\nexclusions: [{participant: P2, condition: a, reason: ill}]\n",
        **{
            "trials.csv": """
                participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm
                P1,a,1,0,0,3,4
                P1,a,2,10,0,10,
                P2,a,1,0,0,1,1
                """
        },
    )
    found = pipeline.load(root, cache=tmp_path / "cache").selections
    assert found["participant"].tolist() == ["P1", "P1"]
    assert found["x_mm"].tolist() == [3.0, 10.0]
    assert found["y_mm"].isna().tolist() == [False, True]
    assert found["session"].isna().all()


def test_a_session_without_messages_has_no_rates(tmp_path: Path) -> None:
    assert list(excerpts.rates(tmp_path)) == []
    for name in ("positions", "readings", "imu"):
        tables.write(name, tables.frame(name, []), tmp_path)
    assert list(excerpts.rates(tmp_path)) == []


def test_a_single_message_is_a_stretch(tmp_path: Path) -> None:
    row = pd.DataFrame([{"session": "s", "stream": "t", "time_ns": 5, "arrival_ns": 5}])
    tables.write("positions", row, tmp_path)
    (one,) = excerpts.rates(tmp_path)
    assert (one["messages"], one["gap_max_s"]) == (1, 0.0)
