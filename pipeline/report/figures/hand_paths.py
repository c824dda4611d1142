"""The path of the hand past the targets, of one session and of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.plane import XY, Plane, square
from pipeline.report.figures.style import (
    BLACK,
    COLOURS,
    MARKS_MAX,
    as_label,
    as_pixels,
    colour,
    legend,
    lowest,
    multiples,
    panels,
    styled,
    thinned,
)
from pipeline.report.figures.wording import listed
from pipeline.statistics.arrays import FloatArray
from pipeline.words.numbers import number
from pipeline.words.phrases import counted

_VERTICES = 1500  # of a path; a line of more looks the same


def _path_words(
    tracks: pd.DataFrame,
    positions: pd.DataFrame,
    events: pd.DataFrame,
    lines: Sequence[str],
    plane: Plane = XY,
    looks: Mapping[str, str] | None = None,
) -> Words:
    """How large an area each line covers, and how many selections there are."""
    sessions = [*tracks["session"].iloc[:1], *positions["session"].iloc[:1]]
    where = f" in session {sessions[0]}" if sessions else ""
    spans = listed((f"{line} {_size_words(points_of(tracks, positions, line, plane))}" for line in lines), ", ")
    summary = f"Extent of each line: {spans}; {counted(int((events['type'] == 'selection').sum()), 'selection')}."
    return Words(
        f"The hand's path{where} in {plane[0]} and {plane[1]}; it starts at the arrow. {summary} Look where the lines"
        " separate, and how much each trembles.",
        f"Lines of the hand's path in the plane{where}. {summary}",
    )


@drawing(_path_words)
@styled
def path(
    tracks: pd.DataFrame,
    positions: pd.DataFrame,
    events: pd.DataFrame,
    lines: Sequence[str],
    plane: Plane = XY,
    looks: Mapping[str, str] | None = None,
) -> Figure:
    """One session's path past its targets: a line for each stream or estimator in `lines`.

    `looks` has the colours of lines that have one in other figures too.
    """
    drawn = [(line, points_of(tracks, positions, line, plane)) for line in lines]
    extent = _extent([*(points for _, points in drawn), _target_points(events, plane)])
    figure, (axes,) = panels(height=0.9 + 6.0 * float(np.clip(extent[1] / extent[0], 0.25, 0.8)))
    taken: set[str] = set()
    for index, (line, points) in enumerate(drawn):
        if len(points):
            begin = points[np.isfinite(points).all(axis=1)][:1]
            shade = _free((looks or {}).get(line, colour(index)), taken)
            axes.plot(*points.T, label=as_label(line), linewidth=1.1, alpha=0.85, color=shade)
            axes.scatter(begin[:, 0], begin[:, 1], s=30, marker=">", color=shade, edgecolor="white", zorder=4)
    _draw_targets(axes, events, plane)
    square(axes, plane)
    legend(figure, figure.axes, 5)
    return figure


def _free(shade: str, taken: set[str]) -> str:
    """The colour, or where another line has it the first that none has; it is taken then."""
    free = next((other for other in (shade, *COLOURS) if other not in taken), shade)
    taken.add(free)
    return free


def _paths_words(
    tracks: pd.DataFrame,
    positions: pd.DataFrame,
    events: pd.DataFrame,
    sessions: pd.DataFrame,
    shown: Mapping[str, str],
    plane: Plane = XY,
    conditions: Sequence[str] = (),
) -> Words:
    """How many sessions there are of each condition, and which covers the largest area."""
    listed_sessions = sessions[["participant", "condition", "session"]].drop_duplicates().dropna()
    counts, furthest = [], ("", 0.0, "")
    for condition, line in shown.items():
        of_condition = list(listed_sessions.loc[listed_sessions["condition"] == condition, "session"])
        if of_condition:
            counts.append(f"{condition} ({line}), n = {len(of_condition)}")
        for session in of_condition:
            own_tracks, own_positions = (rows[rows["session"] == session] for rows in (tracks, positions))
            points = points_of(own_tracks, own_positions, line, plane)
            reach = float(np.hypot(*_span_of(points)))
            if reach > furthest[1]:
                furthest = (str(session), reach, _size_words(points))
    summary = f"{listed(counts)}."
    summary += f" The widest is session {furthest[0]}, {furthest[2]}." if furthest[0] else ""
    people = counted(listed_sessions["participant"].nunique(), "participant")
    return Words(
        f"The hand's path in each session, one panel per participant ({people}): {summary} Look for paths unlike the"
        " others.",
        f"Paths of {people} in the plane: {summary}",
    )


@drawing(_paths_words)
@styled
def paths(
    tracks: pd.DataFrame,
    positions: pd.DataFrame,
    events: pd.DataFrame,
    sessions: pd.DataFrame,
    shown: Mapping[str, str],
    plane: Plane = XY,
    conditions: Sequence[str] = (),
) -> Figure:
    """Everybody's paths past the targets: one small panel per participant, one line per session.

    `sessions` is any table with the columns participant, condition and session; `shown` names the stream or estimator
    that is drawn for each condition, in the study's order; `conditions` are all of the study's, for each to have the
    colour that it has in other figures.
    """
    order = list(conditions or shown)
    listed_sessions = sessions[["participant", "condition", "session"]].drop_duplicates().dropna()
    people = sorted(set(listed_sessions["participant"]))
    columns = [f"{axis}_mm" for axis in plane]
    extent = _extent([rows[columns].to_numpy(np.float64) for rows in (tracks, positions, events)])
    row_height = 0.35 + 1.5 * float(np.clip(extent[1] / extent[0], 0.3, 1.2))
    figure, every, across = multiples(len(people), row_height)
    for index, (axes, person) in enumerate(zip(every, people, strict=True)):
        of_person = listed_sessions[listed_sessions["participant"] == person]
        zorder = as_pixels(axes, len(tracks) + len(positions))
        for condition, line in shown.items():
            for session in of_person.loc[of_person["condition"] == condition, "session"]:
                own_tracks, own_positions = (rows[rows["session"] == session] for rows in (tracks, positions))
                points = points_of(own_tracks, own_positions, line, plane)
                axes.plot(*points.T, linewidth=0.7, alpha=0.85, color=colour(order.index(condition)), zorder=zorder)
        _draw_targets(axes, events[events["session"].isin(of_person["session"])], plane, small=True)
        axes.set_aspect("equal", adjustable="box")
        axes.set_title(as_label(person, 18), fontsize=8.5)
        if index % across == 0:
            axes.set_ylabel(f"{plane[1]} (mm)")
    for axes in lowest(every, across):
        axes.set_xlabel(f"{plane[0]} (mm)")
    for condition, line in shown.items():
        every[0].plot([], [], color=colour(order.index(condition)), label=f"{as_label(condition)}: {as_label(line)}")
    legend(figure, [every[0]], 3)
    return figure


def _span_of(points: FloatArray) -> tuple[float, float]:
    known = points[np.isfinite(points).all(axis=1)]
    across, up = np.ptp(known, axis=0) if len(known) else (0.0, 0.0)
    return float(across), float(up)


def _size_words(points: FloatArray) -> str:
    across, up = _span_of(points)
    return f"{number(across, 0)} × {number(up, 0)} mm"


def points_of(tracks: pd.DataFrame, positions: pd.DataFrame, line: str, plane: Plane) -> FloatArray:
    """Points (n, 2) in mm of a stream, or of an estimator where no stream has that name, in the order of time."""
    rows = positions[positions["stream"] == line]
    if rows.empty:
        rows = tracks[tracks["estimator"] == line]
    rows = rows.sort_values("time_ns", kind="stable").iloc[thinned(len(rows), _VERTICES)]
    points: FloatArray = rows[[f"{axis}_mm" for axis in plane]].to_numpy(np.float64)
    return points


def _target_points(events: pd.DataFrame, plane: Plane) -> FloatArray:
    """Where targets were (n, 2), each place once."""
    places: FloatArray = events[[f"target_{axis}_mm" for axis in plane]].dropna().drop_duplicates().to_numpy(np.float64)
    return places


def _draw_targets(axes: Axes, events: pd.DataFrame, plane: Plane, small: bool = False) -> None:
    """Draw targets and selections."""
    targets = _target_points(events, plane)
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
    """Width and height of all points together, in mm; at least 1."""
    every = np.concatenate([part[np.isfinite(part).all(axis=1)] for part in parts])
    if not len(every):
        return 1.0, 1.0
    across, up = np.ptp(every, axis=0)
    return max(float(across), 1.0), max(float(up), 1.0)
