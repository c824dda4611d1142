"""The plane people pointed in: the task's layout, the hand's path past its targets, and where selections fell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Rectangle

from pipeline.report.figures.style import (
    BLACK,
    COLOURS,
    GREY,
    MARKS_MAX,
    PALE,
    WIDTH,
    as_pixels,
    colour,
    finite,
    grouped,
    legend,
    lowest,
    marker,
    multiples,
    name,
    panels,
    styled,
    thinned,
)
from pipeline.statistics.arrays import FloatArray

Plane = tuple[str, str]
XY: Plane = ("x", "y")
_PANEL = 3.4  # inches: the highest
_VERTICES = 1500  # of a path; a line of more looks the same
_CANVAS_MARGIN = 0.06
_TARGETS_NAMED = 30  # more numbers would lie on each other


class Ring(Protocol):
    """Targets on a circle."""

    @property
    def centre_mm(self) -> tuple[float, float]: ...
    @property
    def diameter_mm(self) -> float: ...
    @property
    def targets(self) -> int: ...
    @property
    def target_diameter_mm(self) -> float: ...


class Task(Protocol):
    """Where the targets are, in the tracker's x and y, and how much of it the display shows."""

    @property
    def canvas_x_mm(self) -> tuple[float, float]: ...
    @property
    def canvas_y_mm(self) -> tuple[float, float]: ...
    @property
    def window_mm(self) -> tuple[float, float] | None: ...
    @property
    def path_mm(self) -> Sequence[tuple[float, float]]: ...
    @property
    def targets_mm(self) -> Sequence[tuple[float, float]]: ...
    @property
    def target_diameter_mm(self) -> float: ...
    @property
    def rings(self) -> Sequence[Ring]: ...


# The task ---------------------------------------------------------------------------------------------------------


@styled
def task_layout(task: Task) -> Figure:
    """The canvas with the path, the targets by number and size, and the window the display shows (paper, Fig. 11)."""
    (left, right), (bottom, top) = task.canvas_x_mm, task.canvas_y_mm
    figure, (axes,) = panels(height=0.9 + 6.2 * float(np.clip((top - bottom) / (right - left), 0.2, 0.9)))
    frame: dict[str, Any] = {"facecolor": "none", "edgecolor": GREY, "linewidth": 1}
    axes.add_patch(Rectangle((left, bottom), right - left, top - bottom, **frame))
    if task.path_mm:
        axes.plot(*np.transpose(task.path_mm), color=GREY, linewidth=1.4, zorder=1, label="path")
    places = targets_of(task)
    for number, (x, y, diameter) in enumerate(places, 1):
        axes.add_patch(Circle((x, y), diameter / 2, facecolor=COLOURS[0], alpha=0.85, linewidth=0, zorder=2))
        if len(places) <= _TARGETS_NAMED:
            axes.annotate(str(number), (x, y), (5, 5), textcoords="offset points", fontsize=8.5)
    axes.scatter([], [], color=COLOURS[0], label=f"targets (n = {len(places)})")
    if task.window_mm is not None and places:
        _window(axes, places[0][:2], task.window_mm)
    _square(axes)
    across, down = _CANVAS_MARGIN * (right - left), _CANVAS_MARGIN * (top - bottom)
    axes.set_xlim(left - across, right + across)
    axes.set_ylim(bottom - down, top + down)
    legend(figure, figure.axes, 3)
    return figure


def targets_of(task: Task) -> list[tuple[float, float, float]]:
    """x, y and diameter in mm of every target, each once."""
    found = [(x, y, task.target_diameter_mm) for x, y in task.targets_mm]
    for ring in task.rings:
        angles = 2 * np.pi * np.arange(ring.targets) / ring.targets
        x = ring.centre_mm[0] + ring.diameter_mm / 2 * np.cos(angles)
        y = ring.centre_mm[1] + ring.diameter_mm / 2 * np.sin(angles)
        found += [(float(a), float(b), ring.target_diameter_mm) for a, b in zip(x, y, strict=True)]
    return found


def _window(axes: Axes, centre: tuple[float, float], size: tuple[float, float]) -> None:
    """What the display shows at once, about a place."""
    corner = (centre[0] - size[0] / 2, centre[1] - size[1] / 2)
    look: dict[str, Any] = {"facecolor": COLOURS[1], "alpha": 0.25, "edgecolor": COLOURS[1], "linewidth": 1.2}
    label = f"window, {size[0]:g} × {size[1]:g} mm, at target 1"
    axes.add_patch(Rectangle(corner, *size, zorder=1.5, label=label, **look))


def _square(axes: Axes, plane: Plane = XY, unit: str = "mm") -> None:
    """A millimetre is as long in both directions."""
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel(f"{plane[0]} ({unit})")
    axes.set_ylabel(f"{plane[1]} ({unit})")
    axes.xaxis.set_major_formatter("{x:g}")
    grouped(axes)


# The hand's path --------------------------------------------------------------------------------------------------


@styled
def path(
    tracks: pd.DataFrame, positions: pd.DataFrame, events: pd.DataFrame, lines: Sequence[str], plane: Plane = XY
) -> Figure:
    """One session's way past its targets: a line for each stream of `positions` or estimator of `tracks` in `lines`."""
    found = [(line, way(tracks, positions, line, plane)) for line in lines]
    extent = _extent([*(points for _, points in found), _targets(events, plane)])
    figure, (axes,) = panels(height=0.9 + 6.0 * float(np.clip(extent[1] / extent[0], 0.25, 0.8)))
    for index, (line, points) in enumerate(found):
        if len(points):
            begin = points[np.isfinite(points).all(axis=1)][:1]
            look: dict[str, Any] = {"linewidth": 1.1, "alpha": 0.85, "color": colour(index)}
            axes.plot(*points.T, label=name(line), **look)
            axes.scatter(begin[:, 0], begin[:, 1], s=30, marker=">", color=colour(index), edgecolor="white", zorder=4)
    _marked(axes, events, plane)
    _square(axes, plane)
    legend(figure, figure.axes, 5)
    return figure


@styled
def paths(
    tracks: pd.DataFrame,
    positions: pd.DataFrame,
    events: pd.DataFrame,
    sessions: pd.DataFrame,
    shown: Mapping[str, str],
    plane: Plane = XY,
) -> Figure:
    """Every participant's ways past the targets, a small panel a participant, a line a session.

    `sessions` says whose each is (participant, condition, session: any table that has them); `shown` which stream or
    estimator is drawn of each condition, in the study's order.
    """
    told = sessions[["participant", "condition", "session"]].drop_duplicates().dropna()
    people = sorted(set(told["participant"]))
    seen = [tracks, positions, events]
    extent = _extent([rows[[f"{axis}_mm" for axis in plane]].to_numpy(np.float64) for rows in seen])
    row_height = 0.35 + 1.5 * float(np.clip(extent[1] / extent[0], 0.3, 1.2))
    figure, every, across = multiples(len(people), row_height)
    for index, (axes, person) in enumerate(zip(every, people, strict=True)):
        mine = told[told["participant"] == person]
        zorder = as_pixels(axes, len(tracks) + len(positions))
        for place, (condition, line) in enumerate(shown.items()):
            for session in mine.loc[mine["condition"] == condition, "session"]:
                one, found = tracks[tracks["session"] == session], positions[positions["session"] == session]
                points = way(one, found, line, plane)
                axes.plot(*points.T, linewidth=0.7, alpha=0.85, color=colour(place), zorder=zorder)
        _marked(axes, events[events["session"].isin(mine["session"])], plane, small=True)
        axes.set_aspect("equal", adjustable="box")
        axes.set_title(name(person, 18), fontsize=8.5)
        if index % across == 0:
            axes.set_ylabel(f"{plane[1]} (mm)")
    for axes in lowest(every, across):
        axes.set_xlabel(f"{plane[0]} (mm)")
    for place, (condition, line) in enumerate(shown.items()):
        every[0].plot([], [], color=colour(place), label=f"{name(condition)}: {name(line)}")
    legend(figure, [every[0]], 3)
    return figure


def way(tracks: pd.DataFrame, positions: pd.DataFrame, line: str, plane: Plane) -> FloatArray:
    """Points (n, 2) in mm of a stream, or of an estimator where no stream has that name, in the order of time."""
    rows = positions[positions["stream"] == line]
    if rows.empty:
        rows = tracks[tracks["estimator"] == line]
    rows = rows.sort_values("time_ns", kind="stable").iloc[thinned(len(rows), _VERTICES)]
    points: FloatArray = rows[[f"{axis}_mm" for axis in plane]].to_numpy(np.float64)
    return points


def _targets(events: pd.DataFrame, plane: Plane) -> FloatArray:
    """Where targets were (n, 2), each place once."""
    places = events[[f"target_{axis}_mm" for axis in plane]].dropna().drop_duplicates()
    found: FloatArray = places.to_numpy(np.float64)
    return found


def _marked(axes: Axes, events: pd.DataFrame, plane: Plane, small: bool = False) -> None:
    """Targets and selections."""
    targets = _targets(events, plane)
    chosen = events.loc[events["type"] == "selection", [f"{axis}_mm" for axis in plane]].dropna().to_numpy(np.float64)
    size = 9 if small else 60
    many: dict[str, Any] = {"rasterized": len(targets) + len(chosen) > MARKS_MAX}
    if len(targets):
        ring: dict[str, Any] = {
            "facecolors": "none",
            "edgecolors": BLACK,
            "linewidths": 0.6 if small else 0.9,
            "zorder": 3,
        }
        axes.scatter(
            targets[:, 0],
            targets[:, 1],
            s=size,
            label="targets" if small else f"targets (n = {len(targets)})",
            **ring,
            **many,
        )
    if len(chosen):
        cross: dict[str, Any] = {"marker": "x", "color": BLACK, "linewidths": 0.5 if small else 0.9, "zorder": 4}
        axes.scatter(
            chosen[:, 0],
            chosen[:, 1],
            s=size / 2.5,
            label="selections" if small else f"selections (n = {len(chosen)})",
            **cross,
            **many,
        )


def _extent(parts: Sequence[FloatArray]) -> tuple[float, float]:
    """How wide and how high everything is, in mm; never nothing."""
    every = np.concatenate([part[np.isfinite(part).all(axis=1)] for part in parts])
    if not len(every):
        return 1.0, 1.0
    across, up = np.ptp(every, axis=0)
    return max(float(across), 1.0), max(float(up), 1.0)


# Selections -------------------------------------------------------------------------------------------------------


@styled
def selection_errors(
    selections: pd.DataFrame, conditions: Sequence[str], plane: Plane = XY, px_per_mm: float | None = None
) -> Figure:
    """Where selections fell about their targets, a panel a condition, with the ellipse that holds 95 % of a normal.

    `selections` has the columns of that table; in pixels where `px_per_mm` is given.
    """
    scale, unit = (1.0, "mm") if px_per_mm is None else (px_per_mm, "px")
    across = min(len(conditions), 4)
    figure, every, across = multiples(len(conditions), min(WIDTH / across * 0.92, _PANEL), a_row=4)
    reach = 0.0
    for index, (axes, condition) in enumerate(zip(every, conditions, strict=True)):
        rows = selections[selections["condition"] == condition]
        offsets = scale * offsets_mm(rows, plane)
        reach = max(reach, _scatter(axes, offsets, (colour(index), marker(index))))
        axes.set_title(f"{name(condition, 80 // across)} (n = {len(offsets)})", fontsize=9)
        axes.axhline(0, color=GREY, linewidth=0.6, zorder=0)
        axes.axvline(0, color=GREY, linewidth=0.6, zorder=0)
        _square(axes, plane, unit)
        axes.set_xlabel(f"Error, {plane[0]} ({unit})")
        axes.set_ylabel(f"Error, {plane[1]} ({unit})" if index % across == 0 else "")
        axes.grid(color=PALE, linewidth=0.6)
        axes.set_axisbelow(True)
    reach = 1.05 * reach or 1.0
    every[0].set_xlim(-reach, reach)
    every[0].set_ylim(-reach, reach)
    return figure


def offsets_mm(selections: pd.DataFrame, plane: Plane) -> FloatArray:
    """Selected minus target (n, 2) in mm, of the selections that have both in this plane."""
    parts = [selections[f"{axis}_mm"].to_numpy(np.float64) - selections[f"target_{axis}_mm"] for axis in plane]
    offsets = np.column_stack(parts).astype(np.float64)
    kept: FloatArray = offsets[np.isfinite(offsets).all(axis=1)]
    return kept


def _scatter(axes: Axes, offsets: FloatArray, look: tuple[str, str]) -> float:
    """Selections, their mean and ellipse; how far from zero anything of it is."""
    if not len(offsets):
        return 0.0
    shade, mark = look
    many = len(offsets) > MARKS_MAX // 4  # there is a panel a condition
    axes.scatter(offsets[:, 0], offsets[:, 1], s=9, color=shade, marker=mark, alpha=0.4, linewidth=0, rasterized=many)
    found = ellipse_95(offsets)
    reach = float(np.abs(offsets).max())
    if found is not None:
        patch = Ellipse(found.centre, *found.lengths, angle=found.angle_deg)
        patch.set(facecolor="none", edgecolor=BLACK, linewidth=1.3, zorder=3)
        axes.add_patch(patch)
        reach = max(reach, float(np.abs(found.centre).max() + max(found.lengths) / 2))
    axes.plot(*offsets.mean(axis=0), "+", color=BLACK, markersize=9, markeredgewidth=1.6, zorder=4)
    return reach


@dataclass(frozen=True)
class Ellipse95:
    """Centre, the two whole axes, and the angle of the first from the plane's first axis."""

    centre: tuple[float, float]
    lengths: tuple[float, float]
    angle_deg: float


def ellipse_95(points: FloatArray) -> Ellipse95 | None:
    """The ellipse that holds a further point of the same bivariate normal with 95 %; None of fewer than four points.

    T² of one new observation: its squared Mahalanobis distance is below 2 (n² − 1) / (n (n − 2)) · F(2, n − 2)
    (Johnson and Wichern, Applied Multivariate Statistical Analysis, 5.4). None where all points lie on one line.
    """
    from scipy import stats

    n = len(points)
    if n < 4:
        return None
    variances, directions = np.linalg.eigh(np.cov(finite(points).reshape(n, 2), rowvar=False))
    if not variances[0] > 1e-12 * variances[1]:
        return None
    squared = 2 * (n**2 - 1) / (n * (n - 2)) * stats.f.ppf(0.95, 2, n - 2)
    lengths = 2 * np.sqrt(squared * variances[::-1])
    along = directions[:, 1]
    x, y = points.mean(axis=0)
    angle = float(np.degrees(np.arctan2(along[1], along[0])))
    return Ellipse95((float(x), float(y)), (float(lengths[0]), float(lengths[1])), angle)
