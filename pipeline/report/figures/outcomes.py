"""What people did and felt: every participant in every condition, the differences, and a questionnaire's scales."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.style import (
    BLACK,
    COLOURS,
    GREY,
    MARKS_MAX,
    as_pixels,
    colour,
    finite,
    grouped,
    interval,
    legend,
    lowest,
    marker,
    multiples,
    name,
    panels,
    styled,
)
from pipeline.statistics.arrays import FloatArray
from pipeline.words import MINUS, measure_label, short_label, unit_of

_CLOUD = 0.3  # of the way to the next condition
_BOX = 0.07


@styled
def paired(wide: pd.DataFrame, measure: str) -> Figure:
    """Raincloud of a measure: each participant in each condition, and beside it the differences to the first.

    `wide` has a row a participant and a column a condition, as `participant_means` gives it. For each condition the
    participants, joined by lines where complete, their density, quartiles, and the mean with its 95 % t interval.
    """
    complete = wide.dropna()
    compared = len(wide.columns) > 1 and len(complete) > 1
    ratio = [len(wide.columns) + 0.4, len(wide.columns) - 0.4]
    options: dict[str, Any] = {"gridspec_kw": {"width_ratios": ratio}} if compared else {}
    figure, axes = panels(1, 2 if compared else 1, 3.1, **options)
    _rainclouds(axes[0], wide)
    _from_zero(axes[0], [wide])
    axes[0].set_ylabel(name(measure_label(measure)))
    axes[0].set_title(f"Participants (n = {len(complete)} complete)")
    if compared:
        _differences(axes[1], complete)
        unit = unit_of(measure)
        axes[1].set_ylabel(name(f"Difference ({unit})") if unit else "Difference")
        axes[1].set_title(f"Differences (n = {len(complete)})")
    return figure


@styled
def scales(wide: Mapping[str, pd.DataFrame]) -> Figure:
    """The same for every scale of a questionnaire, a small panel a scale, all of one height."""
    figure, every, across = multiples(len(wide), 1.9, a_row=3, sharex=False)
    for index, (axes, (measure, table)) in enumerate(zip(every, wide.items(), strict=True)):
        _rainclouds(axes, table, small=True)
        axes.set_title(f"{name(short_label(measure), 24)} (n = {len(table.dropna())})")
        if index % across == 0:
            axes.set_ylabel("Rating")
    _from_zero(every[0], wide.values())
    return figure


def _rainclouds(axes: Axes, wide: pd.DataFrame, small: bool = False) -> None:
    """A column a condition: participants at its place, density to the outer side, mean and quartiles between."""
    at = np.arange(len(wide.columns))
    complete = wide.dropna().to_numpy(np.float64)
    if len(at) > 1 and len(complete):
        faint: dict[str, Any] = {"alpha": 0.45, "linewidth": 0.7, "zorder": 1, "rasterized": complete.size > MARKS_MAX}
        axes.plot(at, complete.T, color=GREY, **faint)
    for index, condition in enumerate(wide.columns):
        side = -1 if index == 0 and len(at) > 1 else 1  # lines leave the first to the right
        _raincloud(axes, index, side, finite(wide[condition]), (colour(index), marker(index)))
    length = max(8, (24 if small else 40) // len(at))
    axes.set_xticks(at, [name(condition, length) for condition in wide.columns])
    axes.set_xlim(-0.6, len(at) - 0.4)
    grouped(axes)


def _from_zero(axes: Axes, tables: Iterable[pd.DataFrame]) -> None:
    """Values begin at zero where none is below it; asked for once all are drawn, for it ends the scaling."""
    if not any((finite(table) < 0).any() for table in tables):
        axes.set_ylim(bottom=0)


def _raincloud(axes: Axes, at: float, side: int, values: FloatArray, look: tuple[str, str]) -> None:
    """Participants, density, quartiles and mean of one condition."""
    if not len(values):
        return
    shade = look[0]
    rasterized = len(values) > MARKS_MAX
    axes.scatter(np.full(len(values), at), values, s=13, color=shade, alpha=0.55, zorder=2, rasterized=rasterized)
    found = _density(values)
    if found is not None:
        grid, height = found
        edge = at + side * 0.2
        axes.fill_betweenx(grid, edge, edge + side * _CLOUD * height, color=shade, alpha=0.25, linewidth=0)
    if len(values) > 3:
        low, middle, high = np.percentile(values, [25, 50, 75])
        place = at + side * 0.2
        axes.vlines(place, low, high, color=shade, linewidth=5, alpha=0.35, zorder=2)
        axes.hlines(middle, place - _BOX, place + _BOX, color=shade, linewidth=1.2, zorder=3)
    interval(axes, at + side * 0.1, values, look)


def _density(values: FloatArray, points: int = 60) -> tuple[FloatArray, FloatArray] | None:
    """Values from the least to the greatest and the density there, its peak 1; None where that says nothing.

    Gaussian kernels of Scott's width (Scott 1992). Nothing is drawn beyond the data.
    """
    if len(np.unique(values)) < 4:
        return None
    from scipy import stats

    try:
        kernel = stats.gaussian_kde(values)
    except np.linalg.LinAlgError:  # values that differ by no more than rounding
        return None
    grid = np.linspace(values.min(), values.max(), points)
    height = kernel(grid)
    if not np.isfinite(height).all() or not height.max() > 0:
        return None
    return grid, height / height.max()


def _differences(axes: Axes, complete: pd.DataFrame) -> None:
    """First condition less each other one: participants, density, mean and interval."""
    first, *others = complete.columns
    axes.axhline(0, color=BLACK, linewidth=0.8)
    for index, other in enumerate(others):
        difference = finite(complete[first] - complete[other])
        look = (COLOURS[2], "D") if len(others) == 1 else (colour(index + 1), marker(index + 1))
        _raincloud(axes, index, 1, difference, look)
    length = max(10, 34 // len(others))
    labels = [f"{first} {MINUS} {other}" for other in others]
    if len(others) > 1:
        labels = [f"{MINUS} {other}" for other in others]
        axes.set_xlabel(f"{name(first)} {MINUS} the other")
    axes.set_xticks(range(len(others)), [name(label, length) for label in labels])
    axes.set_xlim(-0.5, len(others) - 0.3)
    grouped(axes)


@styled
def workload(wide: Mapping[str, pd.DataFrame]) -> Figure:
    """Box plots of every scale of a questionnaire, a box a condition, with the ratings on them (paper, Fig. 14)."""
    figure, (axes,) = panels(height=3.2)
    conditions = list(next(iter(wide.values())).columns)
    width = 0.8 / len(conditions)
    for index, condition in enumerate(conditions):
        shade = colour(index)
        centres = np.arange(len(wide)) + (index - (len(conditions) - 1) / 2) * width
        ratings = [finite(table[condition]) for table in wide.values()]
        axes.boxplot(
            ratings,
            positions=centres,
            widths=0.75 * width,
            showfliers=False,
            patch_artist=True,
            boxprops={"facecolor": shade, "alpha": 0.3, "edgecolor": shade},
            medianprops={"color": shade, "linewidth": 2.2},
            whiskerprops={"color": shade},
            capprops={"color": shade},
            manage_ticks=False,
        )
        many = sum(map(len, ratings)) > MARKS_MAX
        for centre, values in zip(centres, ratings, strict=True):
            spread = np.linspace(-0.22, 0.22, len(values)) * width
            look: dict[str, Any] = {"color": shade, "marker": marker(index), "alpha": 0.8, "rasterized": many}
            axes.scatter(centre + spread, np.sort(values), s=9, **look)
        axes.plot([], [], color=shade, marker=marker(index), linewidth=5, alpha=0.6, label=name(condition))
    length = max(10, 84 // len(wide))
    axes.set_xticks(np.arange(len(wide)), [name(short_label(measure), length) for measure in wide])
    if len(wide) > 8:
        axes.tick_params(axis="x", rotation=60)
    axes.set_ylabel("Rating")
    grouped(axes)
    legend(figure, figure.axes, min(len(conditions), 6))
    return figure


@styled
def trials(table: pd.DataFrame, conditions: Sequence[str]) -> Figure:
    """Each participant's selection errors trial by trial, a small panel a participant, a line a condition.

    `table` has the columns of `trials`; rows whose estimator is `recorded` are shown.
    """
    recorded = table[(table["estimator"] == "recorded") & table["position_error_mm"].notna()]
    people = sorted(set(recorded["participant"]))
    figure, every, across = multiples(len(people), 1.35)
    for index, (axes, person) in enumerate(zip(every, people, strict=True)):
        zorder = as_pixels(axes, len(recorded))
        mine = recorded[recorded["participant"] == person]
        for place, condition in enumerate(conditions):
            rows = mine[mine["condition"] == condition].sort_values("trial", kind="stable")
            look: dict[str, Any] = {"color": colour(place), "marker": marker(place), "zorder": zorder}
            where = rows["trial"].to_numpy(np.float64), rows["position_error_mm"].to_numpy(np.float64)
            axes.plot(
                *where, markersize=2.5, linewidth=0.5 if zorder > 0 else 0, alpha=0.75, label=name(condition), **look
            )
        axes.set_title(f"{name(person, 18)} (n = {len(mine)})", fontsize=8.5)
        if index % across == 0:
            axes.set_ylabel("Error (mm)")
    every[0].set_ylim(bottom=0)
    for axes in lowest(every, across):
        axes.set_xlabel("Trial")
    legend(figure, [every[0]], min(len(conditions), 6))
    return figure
