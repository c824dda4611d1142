"""How people moved: throughput against figures worked out by hand, and what a study says of movements."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.sessions import movements
from pipeline.sessions.logs.mcap import Message
from pipeline.sessions.trials import selections_by_trial
from pipeline.statistics.arrays import FloatArray
from pipeline.tables import table as tables
from pipeline.words.names import measure_label, unit_of
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]

# Five movements to and fro over 100 mm that end −2, −1, 0, 1 and 2 mm beyond their targets, 0.8 s each. By hand:
# SD = √2.5 = 1.58114, W_e = 6.53485; distances 98, 97, 99, 101, 103, A_e = 99.6; ID_e = log₂(16.24137) = 4.02160.
TARGET_X = np.array([0.0, 100, 0, 100, 0, 100])
SELECTED_X = np.array([0.0, 98, 1, 100, -1, 102])
THROUGHPUT = 5.02700


def in_plane(x: FloatArray, y: float = 0.0) -> FloatArray:
    return np.column_stack([x, np.full_like(x, y), np.full_like(x, np.nan)])


def throughputs(target: FloatArray, selected: FloatArray, duration_s: float = 0.8) -> FloatArray:
    found = movements.aimed(target, selected, selected, np.zeros(len(target)))
    duration = np.full(len(target), duration_s)
    return movements.throughputs(found.amplitude_mm, found.moved_mm, found.along_mm, duration)


def test_throughput_of_a_sequence_with_a_known_spread() -> None:
    found = movements.aimed(in_plane(TARGET_X), in_plane(SELECTED_X, 3.0), in_plane(SELECTED_X, 3.0), np.zeros(6))
    assert np.isnan(found.amplitude_mm[0])
    assert found.amplitude_mm[1:] == pytest.approx(100)
    assert found.along_mm[1:] == pytest.approx([-2, -1, 0, 1, 2])
    assert found.moved_mm[1:] == pytest.approx([98, 97, 99, 101, 103])
    assert throughputs(in_plane(TARGET_X), in_plane(SELECTED_X)) == pytest.approx([THROUGHPUT], abs=1e-5)


def test_a_movement_begins_where_the_trial_before_was_left() -> None:
    left = in_plane(SELECTED_X + 5)  # a second selection, 5 mm on
    found = movements.aimed(in_plane(TARGET_X), in_plane(SELECTED_X), left, np.zeros(6))
    assert found.moved_mm[1:] == pytest.approx([93, 102, 94, 106, 98])


def test_after_a_pause_nobody_knows_where_the_movement_began() -> None:
    pause = np.array([np.nan, 0.0, 1.0, 1.01, np.nan, 0.5])
    found = movements.aimed(in_plane(TARGET_X), in_plane(SELECTED_X), in_plane(SELECTED_X), pause)
    assert np.isfinite(found.moved_mm).tolist() == [False, True, True, False, False, True]
    assert np.isfinite(found.along_mm[1:]).all()


def test_each_amplitude_has_its_own_throughput() -> None:
    both = np.concatenate([TARGET_X, 1000 + 3 * TARGET_X]), np.concatenate([SELECTED_X, 1000 + 3 * SELECTED_X])
    found = throughputs(in_plane(both[0]), in_plane(both[1]))
    assert found == pytest.approx([THROUGHPUT, THROUGHPUT], abs=1e-5)


def test_a_ring_agrees_with_the_definitions_written_out_for_one_trial_after_the_other() -> None:
    random = np.random.default_rng(7)
    angle = 2 * np.pi * 5 * np.arange(10) / 9
    target = 125 * np.column_stack([np.cos(angle), np.sin(angle)])
    selected = target + random.normal(0, 4, target.shape)
    duration = random.uniform(0.8, 1.6, 10)
    deviations, distances = [], []
    for (ax, ay), (bx, by), (px, py), (qx, qy) in zip(target, target[1:], selected, selected[1:], strict=False):
        length = math.hypot(bx - ax, by - ay)
        ux, uy = (bx - ax) / length, (by - ay) / length
        deviations.append((qx - bx) * ux + (qy - by) * uy)
        distances.append((qx - px) * ux + (qy - py) * uy)
    index_bits = math.log2(statistics.mean(distances) / (4.133 * statistics.stdev(deviations)) + 1)
    found = movements.aimed(target, selected, selected, np.zeros(10))
    (throughput,) = movements.throughputs(found.amplitude_mm, found.moved_mm, found.along_mm, duration)
    assert throughput == pytest.approx(index_bits / statistics.mean(duration[1:]), rel=1e-12)


def test_amplitudes_within_ten_per_cent_of_one_are_a_sequence() -> None:
    random = np.random.default_rng(0)

    def sequences(amplitudes: list[float]) -> int:
        n = len(amplitudes)
        return len(movements.throughputs(np.array(amplitudes), np.full(n, 9.0), random.normal(size=n), np.ones(n)))

    assert sequences([90, 95, 100, 105, 110]) == 1
    assert sequences([89.9, 95, 100, 105, 110]) == 0
    assert sequences([80, 90, 95, 100, 105, 110, 50, 50, 50, 50, 50]) == 2
    assert sequences([100.0] * 4) == 0
    assert sequences([]) == 0


@pytest.mark.parametrize(
    ("moved", "along", "duration"),
    [
        ([9.0] * 5, [1.0] * 5, [1.0] * 5),  # no spread
        ([-9.0] * 5, [1, 2, 3, 4, 5], [1.0] * 5),  # away from the targets
        ([9.0] * 5, [1, 2, 3, 4, 5], [0.0] * 5),  # no time
        ([9.0] * 5, [1, 2, 3, 4, np.nan], [1.0] * 5),
        ([9.0] * 5, [1, 2, 3, 4, 5], [1, 1, 1, 1, np.inf]),
    ],
)
def test_what_has_no_throughput(moved: list[float], along: list[float], duration: list[float]) -> None:
    assert len(movements.throughputs(np.full(5, 10.0), np.array(moved), np.array(along), np.array(duration))) == 0


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3))
def test_neither_place_nor_turn_nor_unit_nor_order_changes_throughput(seed: int, scale: float) -> None:
    random = np.random.default_rng(seed)
    angle = 2 * np.pi * 4 * np.arange(10) / 9
    target = 100 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(10)])
    selected = target + random.normal(0, 4, target.shape)
    turn, shift = np.linalg.qr(random.normal(size=(3, 3)))[0], random.normal(0, 100, 3)
    expected = throughputs(target, selected)
    assert len(expected) == 1
    moved = [scale * (places @ turn.T + shift) for places in (target, selected)]
    assert throughputs(*moved) == pytest.approx(expected, rel=1e-9)
    found = movements.aimed(target, selected, selected, np.zeros(10))
    rows = np.column_stack([found.amplitude_mm, found.moved_mm, found.along_mm, random.uniform(0.5, 1, 10)])
    shuffled = random.permutation(rows)
    assert movements.throughputs(*shuffled.T) == pytest.approx(movements.throughputs(*rows.T), rel=1e-12)


def test_hostile_sizes_of_sequences() -> None:
    random = np.random.default_rng(0)
    amplitude = 10.0 ** random.uniform(-100, 100, 5000)
    found = movements.throughputs(amplitude, amplitude, random.normal(size=5000) * amplitude, np.ones(5000))
    assert np.isfinite(found).all()
    huge = movements.aimed(in_plane(1e100 * TARGET_X), in_plane(1e100 * SELECTED_X), in_plane(SELECTED_X), np.zeros(6))
    assert huge.along_mm[1:] == pytest.approx(1e100 * np.arange(-2, 3))


def test_a_selection_at_the_very_moment_of_the_next_start_stays_with_its_trial() -> None:
    kinds = [
        ("trial_start", 1, 0),
        ("selection", 1, 5),
        ("trial_start", 2, 5),
        ("selection", 2, 9),
        ("selection", 1, 9),
    ]
    rows = [{"session": "s", "type": kind, "trial": trial, "time_ns": at} for kind, trial, at in kinds]
    for order in (rows, rows[::-1]):
        _, selections = selections_by_trial(list(tables.records("events", tables.frame("events", order))))
        found = sorted((selection["time_ns"], selection["trial"], place) for selection, place in selections)
        assert [place for *_, place in found] == [0, -1, 1]


TRIALS = "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm,start_s,selection_s\n"


def trials_csv(pause_s: float = 0.0, order: int = 1) -> str:
    rows = []
    for condition in "ab":
        for index, (target, selected) in enumerate(zip(TARGET_X, SELECTED_X, strict=True)):
            start = index * (0.8 + pause_s)
            rows.append(f"P1,{condition},{index + 1},{target},0,{selected},2,{start},{start + 0.8}\n")
    return TRIALS + "".join(rows[::order])


def described(steadyhand: Steadyhand) -> dict[str, float]:
    return {row["measure"]: row["mean"] for row in steadyhand.results()["descriptives"] if row["condition"] == "a"}


@pytest.mark.parametrize("order", [1, -1])
def test_throughput_from_a_table_of_trials(folder: Folder, steadyhand: Steadyhand, order: int) -> None:
    study = folder("conditions: [a, b]\ntrials: trials.csv\n", **{"trials.csv": trials_csv(order=order)})
    assert steadyhand("compare", study).code == 0
    found = described(steadyhand)
    assert found["throughput_bits_s"] == pytest.approx(THROUGHPUT, abs=1e-5)
    assert not {"path_efficiency", "overshoot_mm", "corrections"} & set(found)


@pytest.mark.parametrize("without", ["times", "pauses of 1 s or less", "five movements"])
def test_no_throughput_without(folder: Folder, steadyhand: Steadyhand, without: str) -> None:
    text = trials_csv(pause_s=2.0 if without.startswith("pauses") else 0.0)
    if without == "times":
        text = "".join(",".join(line.split(",")[:-2]) + "\n" for line in text.splitlines())
    if without == "five movements":
        text = "".join(line + "\n" for line in text.splitlines() if ",6," not in line)
    study = folder("conditions: [a, b]\ntrials: trials.csv\n", **{"trials.csv": text})
    assert steadyhand("compare", study).code == 0
    assert set(described(steadyhand)) - {"trial_time_s"} == {"selection_mse_mm2", "selection_rmse_mm"}


LOGS = "title: T\nconditions: [a]\nsessions: data/{participant}_{condition}.mcap\n"


def logged(folder: Folder, steadyhand: Steadyhand, settings: str, messages: list[Message]) -> dict[str, float]:
    study = folder(LOGS + settings)
    write_session(study / "data" / "P1_a.mcap", messages, participant="P1", condition="a")
    ran = steadyhand("compare", study)
    assert ran.code == 0, ran.err
    return described(steadyhand)


def test_the_path_of_a_log(folder: Folder, steadyhand: Steadyhand) -> None:
    """The hand is at 100·sin 2t mm: in trial 1 from 90.93 to −44.25, in trial 2 from −75.68 by −100 to 11.65."""
    found = logged(folder, steadyhand, STREAMS, session_messages())
    detour = (75.680 + 11.655) / (100 - 75.680 + 100 + 11.655)
    assert found["path_efficiency"] == pytest.approx((1 + detour) / 2, abs=1e-4)
    assert found["overshoot_mm"] == pytest.approx((0 + 50) / 2, abs=0.01)  # its second target is at −50
    assert found["corrections"] == 0
    assert "throughput_bits_s" not in found


def test_the_path_along_the_tasks_own(folder: Folder, steadyhand: Steadyhand) -> None:
    task = "task: {path_mm: [[100, 500], [100, 700], [-50, 700], [-50, 500]], targets_mm: [[100, 500], [-50, 500]]}\n"
    found = logged(folder, steadyhand, STREAMS + task, session_messages())
    shortest = 200 + 150 + 200  # of trial 2; in trial 1 the hand is at the path's begin already
    assert found["path_efficiency"] == pytest.approx(shortest / (100 - 75.680 + 100 + 11.655) / 2, abs=1e-3)


def test_without_a_reference_the_path_is_what_was_displayed_then_what_was_tracked(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    as_display = STREAMS.replace("kind: reference", "kind: display")
    found: list[Any] = [logged(folder, steadyhand, STREAMS, session_messages())]
    found.append(logged(folder, steadyhand, as_display, session_messages()))
    assert found[0] == pytest.approx(found[1])
    tracked = "".join(line for line in STREAMS.splitlines(keepends=True) if "reference" not in line)
    found.append(logged(folder, steadyhand, tracked, session_messages()))
    assert found[2]["path_efficiency"] < found[0]["path_efficiency"]  # 8 mm of noise


def test_trials_without_a_path_are_listed(folder: Folder, steadyhand: Steadyhand) -> None:
    begin = min(message.arrival_ns for message in session_messages())
    messages = [
        message
        for message in session_messages()
        if message.topic != "/reference/position" or not 2.4 < (message.arrival_ns - begin) * 1e-9 < 2.8
    ]
    found = logged(folder, steadyhand, STREAMS, messages)
    assert found["path_efficiency"] == pytest.approx(1)
    entries = [row for row in steadyhand.results()["exclusions"] if row["what"] == "trials without a path of the hand"]
    assert [(row["session"], row["reason"]) for row in entries] == [("P1_a", "1 of the cell's trials: 2")]


def test_one_trial_has_a_path_and_no_throughput(folder: Folder, steadyhand: Steadyhand) -> None:
    messages = [m for m in session_messages() if m.content != "events" or (m.event or {}).get("trial") != 2]
    found = logged(folder, steadyhand, STREAMS, messages)
    assert found["path_efficiency"] == pytest.approx(1, abs=1e-4)
    assert "throughput_bits_s" not in found


def test_targets_that_the_log_does_not_name(folder: Folder, steadyhand: Steadyhand) -> None:
    messages = [
        m if m.event is None else replace(m, event={k: v for k, v in m.event.items() if "target" not in k})
        for m in session_messages()
    ]
    found = logged(folder, steadyhand, STREAMS + "axes: [x]\n", messages)
    assert set(found) == {"completion_time_s", "corrections", "path_efficiency", "trial_time_s"}


def test_a_log_whose_trials_were_never_ended(folder: Folder, steadyhand: Steadyhand) -> None:
    messages = [m for m in session_messages() if m.content != "events" or (m.event or {}).get("type") != "selection"]
    assert logged(folder, steadyhand, STREAMS, messages) == {}


def test_measures_of_movement_can_be_compared(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder(
        "conditions: [a, b]\ntrials: trials.csv\ncomparisons: [{measure: throughput_bits_s, test: t_paired}]\n",
        **{"trials.csv": trials_csv() + "".join(trials_csv().replace("P1,", "P2,").splitlines(keepends=True)[1:])},
    )
    assert steadyhand("compare", study).code == 0
    (row,) = steadyhand.results()["comparisons"]
    assert (row["measure"], row["n"], row["status"]) == (
        "throughput_bits_s",
        2,
        "undefined: all differences are zero",
    )


@pytest.mark.parametrize(
    ("measure", "label", "unit"),
    [
        ("throughput_bits_s", "Throughput (bit/s)", "bit/s"),
        ("path_efficiency", "Path efficiency", ""),
        ("overshoot_mm", "Overshoot (mm)", "mm"),
        ("corrections", "Corrections per trial", ""),
    ],
)
def test_what_the_report_calls_them(measure: str, label: str, unit: str) -> None:
    assert (measure_label(measure), unit_of(measure)) == (label, unit)
