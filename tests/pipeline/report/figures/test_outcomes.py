"""Rainclouds, scales, box plots and trials: every participant is there, and what is said of them is so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy import stats

from pipeline.report import figures
from pipeline.tables import table as tables
from tests.pipeline.report.figures.drawn import pictures, saved, texts

TIMES = pd.DataFrame(
    {"kinect": [44.0, 51.5, 38.2, 60.1, 29.9], "fusion": [31.0, 40.5, 39.2, 41.1, 22.4]},
    index=pd.Index(["P1", "P2", "P3", "P4", "P5"], name="participant"),
)
MEASURE = "completion_time_s"
HOSTILE = ["<script>alert(1)</script>", "$x_1$ & -- \u202e", "=cmd()|'", "x" * 300]


def marks(figure: Figure, panel: int = 0) -> list[float]:
    """The values of the scattered marks of a panel."""
    found = [np.asarray(one.get_offsets(), dtype=np.float64) for one in figure.axes[panel].collections]
    return sorted(float(value) for offsets in found for value in offsets[:, 1])


def test_every_participant_is_a_mark_and_the_differences_have_an_axis_of_their_own(tmp_path: Path) -> None:
    figure = figures.paired(TIMES, MEASURE)
    values, differences = figure.axes
    assert set(TIMES.to_numpy().ravel()) <= set(marks(figure))
    assert set((TIMES["kinect"] - TIMES["fusion"]).round(6)) <= {round(value, 6) for value in marks(figure, 1)}
    assert values.get_ylabel() == "Completion time (s)"
    assert differences.get_ylabel() == "Difference (s)"
    shown = texts(figure, tmp_path)
    assert {"Completion time (s)", "kinect", "fusion", "kinect − fusion"} <= set(shown)
    assert any("n = 5" in text for text in shown)


def test_means_and_intervals_are_those_of_the_t_distribution() -> None:
    said = figures.paired.words(TIMES, MEASURE)
    difference = TIMES["kinect"] - TIMES["fusion"]
    low, high = stats.t.interval(0.95, 4, difference.mean(), stats.sem(difference))
    told = f"kinect − fusion: {difference.mean():.2f} [{low:.2f}, {high:.2f}] s, 4 of 5 lower under fusion"
    assert told.replace("-", "−") in said.caption
    assert told.replace("-", "−") in said.alt
    assert "5 complete participants" in said.caption


def test_intervals_within_participants_are_drawn_where_people_met_every_condition() -> None:
    """Of two conditions they are as wide as the paired t's of the difference, over √2."""
    difference = TIMES["kinect"] - TIMES["fusion"]
    half = stats.t.ppf(0.975, 4) * stats.sem(difference) / np.sqrt(2)
    drawn = [
        line
        for one in figures.paired(TIMES, MEASURE).axes[0].collections
        if isinstance(one, LineCollection)
        for line in one.get_segments()
        if len(line) == 2 and line[0][0] == line[1][0]
    ]
    for name in TIMES:
        ends = [TIMES[name].mean() - half, TIMES[name].mean() + half]
        assert any(line[:, 1] == pytest.approx(ends) for line in drawn), name
    assert "within-participant 95 % intervals, Cousineau-Morey" in figures.paired.words(TIMES, MEASURE).caption


def test_people_who_met_one_condition_each_have_no_interval_within() -> None:
    apart = TIMES.copy()
    apart.loc[["P1", "P2"], "fusion"] = np.nan
    apart.loc[["P3", "P4", "P5"], "kinect"] = np.nan
    assert "Cousineau" not in figures.paired.words(apart, MEASURE).caption
    assert "Cousineau" not in figures.paired.words(TIMES[["kinect"]], MEASURE).caption


def test_a_caption_follows_the_data_and_not_a_wish() -> None:
    turned = TIMES.rename(columns={"kinect": "fusion", "fusion": "kinect"})[["kinect", "fusion"]]
    assert "1 of 5 lower under fusion" in figures.paired.words(turned, MEASURE).caption


def test_missing_cells_are_not_paired_and_n_says_so(tmp_path: Path) -> None:
    gap = TIMES.copy()
    gap.loc["P2", "fusion"] = np.nan
    assert "Participants (n = 4 complete)" in texts(figures.paired(gap, MEASURE), tmp_path)
    said = figures.paired.words(gap, MEASURE).caption
    assert "4 complete participants" in said
    assert "(n = 5)" in said  # of kinect, which all have
    assert "(n = 4)" in said


@pytest.mark.parametrize("count", [3, 4, 9])
def test_more_conditions_are_held_against_the_first(count: int, tmp_path: Path) -> None:
    random = np.random.default_rng(count)
    wide = pd.DataFrame(random.normal(10, 2, (8, count)), columns=[f"c{place}" for place in range(count)])
    shown = texts(figures.paired(wide, "m_mm"), tmp_path)
    assert {f"− c{place}" for place in range(1, count)} <= set(shown)
    assert "c0 − the other" in shown
    assert figures.paired.words(wide, "m_mm").caption.count("lower under") == min(count - 1, 8)


@pytest.mark.parametrize(
    "values",
    [
        [[1.0, 2.0]],  # one participant
        [[3.0, 3.0]] * 6,  # nothing varies
        [[1.0, np.nan], [np.nan, 2.0]],  # nobody is complete
        [[np.nan, np.nan], [1.0, np.nan]],  # an empty condition
        [[1e-100, 2e99], [2e-100, 1e100], [0, 0], [1, -1], [5, 5]],  # the most and least a table may hold
        [[0.1 + 0.2, 0.3], [0.3, 0.3], [0.3, 0.1 + 0.2], [0.3 + 1e-16, 0.3]],
    ],
)
def test_odd_data_are_drawn_and_described(values: list[list[float]], tmp_path: Path) -> None:
    wide = pd.DataFrame(values, columns=["a", "b"])
    saved(figures.paired(wide, "m"), tmp_path)
    saved(figures.scales({"q/one": wide, "q/two": wide + 1}), tmp_path)
    saved(figures.workload({"q/one": wide, "q/two": wide + 1}), tmp_path)
    for said in (
        figures.paired.words(wide, "m"),
        figures.scales.words({"q/one": wide}),
        figures.workload.words({"q/one": wide}),
    ):
        assert "nan" not in f"{said.caption}{said.alt}"


def test_boxes_hold_whoever_has_a_value_and_the_caption_counts_them() -> None:
    wide = TIMES.assign(fusion=[np.nan, *TIMES["fusion"][1:]])
    n = len(TIMES)
    assert f"(n = {n} a box)" in figures.workload.words({"q/one": TIMES}).caption
    assert f"(n = {n - 1} to {n} a box)" in figures.workload.words({"q/one": TIMES, "q/two": wide}).caption


def test_one_condition_has_no_differences() -> None:
    wide = TIMES[["kinect"]]
    assert len(figures.paired(wide, MEASURE).axes) == 1
    assert "difference" not in figures.paired.words(wide, MEASURE).caption


def test_a_name_that_begins_with_an_underscore_is_in_the_legend(tmp_path: Path) -> None:
    wide = {"q/one": TIMES.rename(columns={"kinect": "_hidden"})}
    assert any("_hidden" in text for text in texts(figures.workload(wide), tmp_path))


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_are_text(name: str, tmp_path: Path) -> None:
    wide = TIMES.rename(columns={"kinect": name})
    path = saved(figures.paired(wide, f"../{name}_mm"), tmp_path)
    assert "<script" not in path.read_text(encoding="utf-8")
    saved(figures.workload({f"q/{name}": wide}), tmp_path)
    assert name in figures.paired.words(wide, MEASURE).caption  # the pages escape it


def test_a_notebook_without_our_style_draws_names_as_they_are(tmp_path: Path) -> None:
    wide = TIMES.rename(columns={"kinect": r"$\frac{$ and $"})
    figure = figures.paired(wide, MEASURE)
    figure.savefig(tmp_path / "plain.svg")  # in matplotlib's own style, which would take it for a broken formula
    assert figure.axes[0].spines["top"].get_visible() is False


def test_the_same_table_gives_the_same_bytes(tmp_path: Path) -> None:
    first = saved(figures.paired(TIMES, MEASURE), tmp_path).read_bytes()
    assert saved(figures.paired(TIMES.copy(), MEASURE), tmp_path).read_bytes() == first


def test_scales_are_of_one_height_and_none_is_cut() -> None:
    wide = {"nasa_tlx/mental": TIMES / 10, "nasa_tlx/effort": TIMES}
    figure = figures.scales(wide)
    low, high = figure.axes[0].get_ylim()
    assert figure.axes[1].get_ylim() == (low, high)
    assert low == 0
    assert high > TIMES.to_numpy().max()
    said = figures.scales.words(wide).caption
    assert "differ most in effort: 44.74 under kinect, 34.84 under fusion" in said


def test_the_box_plot_says_where_medians_are_lowest() -> None:
    wide = {"q/a": TIMES, "q/b": TIMES[["fusion", "kinect"]].set_axis(["kinect", "fusion"], axis=1)}
    assert (
        "The lowest median is under kinect in 1 and under fusion in 1 of 2 scales."
        in figures.workload.words(wide).caption
    )
    equal = {"q/a": TIMES.assign(fusion=TIMES["kinect"])}
    assert "In every scale the lowest median is that of two conditions or more." in figures.workload.words(equal).alt


def trial_rows(people: int, trials: int) -> pd.DataFrame:
    rows = [
        {
            "participant": f"P{person}",
            "condition": condition,
            "session": f"P{person}_{condition}",
            "trial": trial,
            "estimator": estimator,
            "position_error_mm": 10.0 / trial if estimator == "recorded" else 999.0,
        }
        for person in range(people)
        for condition in "ab"
        for trial in range(1, trials + 1)
        for estimator in ("recorded", "raw")
    ]
    return tables.frame("trials", rows)


def test_trials_are_those_recorded_a_panel_a_participant(tmp_path: Path) -> None:
    table = trial_rows(3, 4)
    table.loc[0, "position_error_mm"] = np.nan
    shown = texts(figures.trials(table, ["a", "b"]), tmp_path)
    assert {"P0 (n = 7)", "P1 (n = 8)", "Error (mm)", "Trial", "a", "b"} <= set(shown)
    said = figures.trials.words(table, ["a", "b"]).caption
    assert "3 participants, 23 selections" in said
    assert "b 7.5 to 2.9 mm" in said


def test_many_marks_are_one_picture_a_panel(tmp_path: Path) -> None:
    assert pictures(saved(figures.trials(trial_rows(2, 10), "ab"), tmp_path)) == 0
    path = saved(figures.trials(trial_rows(2, 600), "ab"), tmp_path)
    assert pictures(path) == 2
    assert path.stat().st_size < 300_000
