"""The plane: the task, the hand's path, and where selections fell."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.patches import Circle, Ellipse

from pipeline.report import figures
from pipeline.report.figures.hand_paths import points_of
from pipeline.report.figures.layout import targets_of
from pipeline.report.figures.selections import ellipse_95, offsets_mm
from pipeline.report.figures.style import BLACK, COLOURS
from pipeline.tables import table as tables
from tests.pipeline.report.figures.drawn import pictures, saved, texts


def task(**changed: Any) -> Any:
    """The paper's canvas with three targets."""
    fields = {
        "canvas_x_mm": (-1000.0, 1000.0),
        "canvas_y_mm": (0.0, 1000.0),
        "window_mm": (48.0, 86.0),
        "path_mm": ((-900.0, 500.0), (0.0, 500.0), (0.0, 800.0)),
        "targets_mm": ((-900.0, 500.0), (0.0, 500.0), (0.0, 800.0)),
        "target_diameter_mm": 20.0,
        "rings": (),
    }
    return SimpleNamespace(**(fields | changed))


def test_the_layout_has_every_target_in_its_size_and_the_window(tmp_path: Path) -> None:
    figure = figures.task_layout(task())
    circles = [patch for patch in figure.axes[0].patches if isinstance(patch, Circle)]
    assert [(*circle.center, circle.radius) for circle in circles] == [(*at, 10.0) for at in task().targets_mm]
    shown = texts(figure, tmp_path)
    assert {"1", "2", "3", "x (mm)", "y (mm)", "path", "targets (n = 3)"} <= set(shown)
    assert "window, 48 × 86 mm, at target 1" in shown
    said = figures.task_layout.words(task()).caption
    assert "a canvas of 2000 × 1000 mm with 3 targets of 20 mm; the window of 48 × 86 mm shows 0.2 % of it" in said


def test_rings_without_window_or_path(tmp_path: Path) -> None:
    ring = SimpleNamespace(centre_mm=(0.0, 500.0), diameter_mm=400.0, targets=13, target_diameter_mm=40.0)
    ringed = task(targets_mm=(), path_mm=(), window_mm=None, rings=(ring,))
    places = np.array(targets_of(ringed))
    assert len(places) == 13
    np.testing.assert_allclose(np.hypot(places[:, 0], places[:, 1] - 500), 200)
    assert "targets (n = 13)" in texts(figures.task_layout(ringed), tmp_path)
    assert "window" not in figures.task_layout.words(ringed).caption


@pytest.fixture
def session() -> Any:
    """Tracks, positions and events of one session."""
    time = np.arange(3000) * 11_000_000
    line = pd.DataFrame({"time_ns": time, "x_mm": np.linspace(-100, 100, 3000), "y_mm": np.linspace(0, 50, 3000)})
    tracks = tables.as_table("tracks", line.assign(session="P1_a", estimator="fusion"))
    positions = tables.as_table("positions", line.assign(session="P1_a", stream="display", arrival_ns=time))
    events = tables.frame(
        "events",
        [
            {"session": "P1_a", "time_ns": 0, "type": "trial_start", "target_x_mm": 100.0, "target_y_mm": 50.0},
            {"session": "P1_a", "time_ns": 9, "type": "selection", "x_mm": 98.0, "y_mm": 51.0},
        ],
    )
    return tracks, positions, events


def test_a_path_has_its_lines_targets_and_selections(session: Any, tmp_path: Path) -> None:
    tracks, positions, events = session
    shown = texts(figures.path(tracks, positions, events, ["display", "fusion"]), tmp_path)
    assert {"display", "fusion", "targets (n = 1)", "selections (n = 1)", "x (mm)", "y (mm)"} <= set(shown)
    said = figures.path.words(tracks, positions, events, ["display", "fusion"]).caption
    assert "in session P1_a" in said
    assert "display 200 × 50 mm, fusion 200 × 50 mm; 1 selection." in said


def test_a_line_has_its_colour_of_other_figures_and_no_two_have_one(session: Any) -> None:
    looks = {"display": COLOURS[2], "fusion": COLOURS[2]}
    tracks, positions, events = session
    drawn = figures.path(tracks, positions, events, ["display", "fusion"], looks=looks).axes[0].lines
    assert [line.get_color() for line in drawn] == [COLOURS[2], COLOURS[0]]
    (line,) = figures.path(tracks, positions, events, ["display"], looks={"display": BLACK}).axes[0].lines
    assert line.get_color() == BLACK


def test_a_path_is_thinned_in_the_order_of_time(session: Any) -> None:
    tracks, positions, _ = session
    points = points_of(tracks.sample(frac=1, random_state=1), positions, "fusion", ("x", "y"))
    assert 700 < len(points) <= 1500
    assert np.all(np.diff(points[:, 0]) > 0)


def test_a_path_of_nothing(session: Any, tmp_path: Path) -> None:
    tracks, positions, events = session
    empty = (tracks.assign(x_mm=np.nan), positions[:0], events[:0])
    saved(figures.path(*empty, ["fusion", "absent"]), tmp_path)
    assert "nan" not in f"{figures.path.words(*empty, ['fusion', 'absent'])}"


def test_every_participant_has_a_panel_and_the_widest_way_is_named(session: Any, tmp_path: Path) -> None:
    tracks, positions, events = session
    far = tracks.assign(session="P2_a", x_mm=3 * tracks["x_mm"])
    both = pd.concat([tracks, far])
    sessions = pd.DataFrame({"participant": ["P1", "P2"], "condition": ["a", "a"], "session": ["P1_a", "P2_a"]})
    figure = figures.paths(both, positions, events, sessions, {"a": "fusion"})
    of_second = figures.paths(both, positions, events, sessions, {"a": "fusion"}, conditions=["z", "a"])
    assert {line.get_color() for line in of_second.axes[0].lines} == {COLOURS[1]}  # as in every other figure
    shown = texts(figure, tmp_path)
    assert {"P1", "P2", "a: fusion", "x (mm)", "y (mm)"} <= set(shown)
    assert not [text for text in shown if "n = " in text]  # a panel's number is not the figure's
    assert pictures(tmp_path / "figure.svg") == 2  # thousands of rows
    said = figures.paths.words(both, positions, events, sessions, {"a": "fusion"}).caption
    assert "2 participants" in said
    assert "The widest is session P2_a, 600 × 50 mm." in said


def chosen(offsets: np.ndarray, condition: str) -> pd.DataFrame:
    rows = pd.DataFrame({"x_mm": offsets[:, 0] + 100, "y_mm": offsets[:, 1] + 500})
    told = rows.assign(target_x_mm=100.0, target_y_mm=500.0, participant="P1", condition=condition)
    return tables.as_table("selections", told)


@pytest.mark.parametrize("n", [4, 6, 20])
def test_the_ellipse_holds_a_further_selection_with_95_per_cent(n: int) -> None:
    """Held against simulation: the next point of the same normal, over many samples."""
    random = np.random.default_rng(n)
    skew = np.array([[30.0, 0.0], [20.0, 5.0]])
    inside, tries = 0, 2000
    for _ in range(tries):
        points = random.normal(size=(n + 1, 2)) @ skew.T + [4.0, -7.0]
        found = ellipse_95(points[:n])
        assert found is not None
        angle = np.radians(found.angle_deg)
        turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        across = turned @ (points[n] - found.centre) / (np.array(found.lengths) / 2)
        inside += bool(across @ across <= 1)
    assert abs(inside / tries - 0.95) < 4 * np.sqrt(0.95 * 0.05 / tries)


def test_selections_are_counted_and_described_in_the_display_s_unit(tmp_path: Path) -> None:
    offsets = np.random.default_rng(1).normal([3, -2], [20, 5], (40, 2))
    rows = pd.concat([chosen(offsets, "a"), chosen(offsets[:3], "b")])
    rows.iloc[0, rows.columns.get_loc("x_mm")] = np.nan  # type: ignore[index]
    figure = figures.selection_errors(rows, ["a", "b", "c"], ("x", "y"), 10.0)
    shown = texts(figure, tmp_path)
    assert {"a (n = 39)", "b (n = 3)", "c (n = 0)", "Error, x (px)", "Error, y (px)"} <= set(shown)
    ellipses = [patch for axes in figure.axes for patch in axes.patches if isinstance(patch, Ellipse)]
    assert len(ellipses) == 1  # three points have none
    x, y = 10 * offsets[1:].mean(axis=0)
    said = figures.selection_errors.words(rows, ["a", "b", "c"], ("x", "y"), 10.0).caption
    assert f"a: n = 39, 1 participant, mean ({x:.1f}, {y:.1f}) px, ellipse".replace("-", "−") in said
    assert "c: none" in said


@pytest.mark.parametrize("spread", [0.0, 1e-9])
def test_selections_on_one_point_or_line(spread: float, tmp_path: Path) -> None:
    offsets = np.column_stack([np.arange(6.0) * spread, np.zeros(6)])
    rows = chosen(offsets, "a")
    assert ellipse_95(offsets_mm(rows, ("x", "y"))) is None
    saved(figures.selection_errors(rows, ["a"]), tmp_path)


def test_thousands_of_selections_are_pixels_and_more_of_them_take_no_more_room(tmp_path: Path) -> None:
    sizes = []
    for n in (6000, 12_000):
        rows = chosen(np.random.default_rng(2).normal(size=(n, 2)), "a")
        path = saved(figures.selection_errors(rows, ["a"]), tmp_path)
        assert pictures(path) == 1
        sizes.append(path.stat().st_size)
    assert sizes[1] < 1.5 * sizes[0]
