"""Tables to figures: one function a figure, one look for all. Colours are told apart by the colour-blind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.ticker
import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import stats

from pipeline import label_places
from pipeline.typeface import showable
from pipeline.wording import MINUS, THIN, measure_label, short_label, unit_of

FloatArray = npt.NDArray[np.float64]

# Okabe and Ito (2008), darkest first, so that neighbours also differ in print without colour.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_GREY = "#6b757d"
_WIDTH = 7.2  # inches: a page's text
_NAME_LENGTH = 32
_LABEL_APART = 10  # points (1/72 inch), as are these: closer marks have one label
_LABEL_GAP = 4  # beside a label
_MARK_RADIUS = 5.5  # with its ring

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.4,
    "figure.constrained_layout.use": True,
    "text.parse_math": False,  # a name with two dollar signs is a name
    "svg.fonttype": "path",
    "svg.hashsalt": "steadyhand",
    "savefig.dpi": 200,
}


def _name(text: str) -> str:
    """A name as a figure can show it: with glyphs for all of it, and no longer than leaves room for the data."""
    shown = showable(text)
    return shown if len(shown) <= _NAME_LENGTH else f"{shown[: _NAME_LENGTH - 1]}…"


def draw(function: Callable[..., Figure], path: Path, *arguments: Any) -> None:
    """Draw in the house's style and save as SVG, the same bytes for the same data."""
    with mpl.rc_context(_STYLE):
        function(*arguments).savefig(path, format="svg", metadata={"Date": None, "Creator": "Steadyhand"})


def _axes(rows: int = 1, columns: int = 1, height: float = 3.0, **options: Any) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(_WIDTH, height))
    return figure, list(np.atleast_1d(figure.subplots(rows, columns, **options)).ravel())


def _mean_and_interval(values: FloatArray) -> tuple[float, float]:
    """Mean and half the width of its 95 % t interval; zero width for a single value."""
    if len(values) < 2:
        return float(np.mean(values)), 0.0
    half = stats.t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    return float(np.mean(values)), float(half)


# Participants and conditions ------------------------------------------------------------------------------------


def paired(wide: pd.DataFrame, measure: str) -> Figure:
    """Each participant in each condition, with means and 95 % intervals; for two conditions the differences too.

    `wide` has a row a participant and a column a condition.
    """
    conditions = list(wide.columns)
    complete = wide.dropna()
    two = len(conditions) == 2 and len(complete) > 1
    options: dict[str, Any] = {"gridspec_kw": {"width_ratios": [2.2, 1]}} if two else {}
    figure, axes = _axes(1, 2 if two else 1, 2.9, **options)
    values = axes[0]
    at = np.arange(len(conditions))
    for _, row in complete.iterrows():
        values.plot(at, row.to_numpy(np.float64), color=_GREY, alpha=0.45, linewidth=0.8, zorder=1)
    for index, condition in enumerate(conditions):
        column = wide[condition].dropna().to_numpy(np.float64)
        if len(column):
            values.scatter(np.full(len(column), index), column, s=16, color=COLOURS[index % 7], alpha=0.55, zorder=2)
            _interval(values, index, column, COLOURS[index % 7], MARKERS[index % 7])
    values.set_xticks(at, [_name(condition) for condition in conditions])
    values.set_xlim(-0.5, len(conditions) - 0.5)
    values.set_ylabel(_name(measure_label(measure)))
    values.set_title(f"Participants (n = {len(complete)}), mean and 95 % interval")
    if not np.nanmin(wide.to_numpy(np.float64)) < 0:
        values.set_ylim(bottom=0)
    _grouped(values)
    if two:
        _differences(axes[1], complete, measure)
    return figure


def _grouped(axes: Axes) -> None:
    """Thousands set apart on the value axis."""
    axes.yaxis.set_major_formatter(
        mpl.ticker.FuncFormatter(lambda value, _: f"{value:,.10g}".replace(",", THIN).replace("-", MINUS))
    )


def _interval(axes: Axes, at: float, values: FloatArray, colour: str, marker: str) -> None:
    mean, half = _mean_and_interval(values)
    axes.errorbar(
        [at + 0.13],
        [mean],
        yerr=[half],
        fmt=marker,
        color=colour,
        markersize=8,
        markeredgecolor="white",
        capsize=4,
        linewidth=2,
        zorder=3,
    )


def _differences(axes: Axes, complete: pd.DataFrame, measure: str) -> None:
    first, second = complete.columns
    difference = (complete[first] - complete[second]).to_numpy(np.float64)
    spread = np.linspace(-0.08, 0.08, len(difference))
    axes.axhline(0, color=_GREY, linewidth=0.8)
    axes.scatter(spread, np.sort(difference), s=16, color=COLOURS[2], alpha=0.6)
    _interval(axes, 0.08, difference, COLOURS[2], "D")
    axes.set_xticks([0], [_name(f"{first} {MINUS} {second}")])
    axes.set_xlim(-0.5, 0.7)
    unit = unit_of(measure)
    axes.set_ylabel(_name(f"Difference ({unit})") if unit else "Difference")
    axes.set_title("Differences")
    _grouped(axes)


def workload(wide: Mapping[str, pd.DataFrame]) -> Figure:
    """Box plots of every scale of a questionnaire, a box a condition, with the participants' ratings on them."""
    figure, (axes,) = _axes(height=3.4)
    conditions = list(next(iter(wide.values())).columns)
    width = 0.8 / len(conditions)
    for index, condition in enumerate(conditions):
        colour = COLOURS[index % 7]
        centres = np.arange(len(wide)) + (index - (len(conditions) - 1) / 2) * width
        ratings = [table[condition].dropna().to_numpy(np.float64) for table in wide.values()]
        axes.boxplot(
            ratings,
            positions=centres,
            widths=0.75 * width,
            showfliers=False,
            patch_artist=True,
            boxprops={"facecolor": colour, "alpha": 0.3, "edgecolor": colour},
            medianprops={"color": colour, "linewidth": 2.2},
            whiskerprops={"color": colour},
            capprops={"color": colour},
            manage_ticks=False,
        )
        for centre, values in zip(centres, ratings, strict=True):
            spread = np.linspace(-0.22, 0.22, len(values)) * width
            axes.scatter(centre + spread, np.sort(values), s=9, color=colour, marker=MARKERS[index % 7], alpha=0.8)
        axes.plot([], [], color=colour, marker=MARKERS[index % 7], linewidth=5, alpha=0.6, label=_name(condition))
    axes.set_xticks(np.arange(len(wide)), [_name(short_label(measure)) for measure in wide])
    axes.set_ylabel("Rating")
    axes.legend(loc="upper left", bbox_to_anchor=(0, 1.12), ncols=min(len(conditions), 6))
    return figure


@dataclass(frozen=True)
class Labels:
    """What stands over a figure and along its value axis."""

    title: str
    value: str


def power(table: pd.DataFrame, series: Mapping[str, str], target: float, needed: int | None, labels: Labels) -> Figure:
    """Power against the number of participants: the columns of `table` that `series` names, the closed form as a line.

    Simulated columns stand with their 95 % intervals, `<column>_low` and `<column>_high`.
    """
    figure, (axes,) = _axes(height=3.8)
    n = table["participants"].to_numpy(np.float64)
    for index, (column, label) in enumerate(series.items()):
        values, colour = table[column].to_numpy(np.float64), COLOURS[index % 7]
        if f"{column}_low" in table:
            _with_intervals(axes, n, table, column, (colour, MARKERS[index % 7], label))
        else:
            axes.plot(n, values, color=colour, label=label)
    axes.axhline(target, color=_GREY, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
    axes.annotate(f"{target:g}", (n[0], target), (0, 3), textcoords="offset points", color=_GREY)
    if needed is not None:
        axes.axvline(needed, color=_GREY, linewidth=0.8, linestyle=(0, (1, 2)), zorder=1)
        axes.annotate(f"{needed} participants", (needed, 0), (4, 4), textcoords="offset points", color=_GREY)
    axes.set_ylim(0, 1.02)
    axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(integer=True))
    axes.set_title(labels.title)
    axes.set_xlabel("Complete participants")
    axes.set_ylabel(labels.value)
    figure.legend(loc="outside lower left", ncols=2)
    return figure


def _with_intervals(axes: Axes, n: FloatArray, table: pd.DataFrame, column: str, look: tuple[str, str, str]) -> None:
    """Simulated values with their intervals, joined by a thin line."""
    colour, marker, label = look
    values, low, high = (table[f"{column}{end}"].to_numpy(np.float64) for end in ("", "_low", "_high"))
    axes.errorbar(
        n,
        values,
        yerr=np.maximum(0, [values - low, high - values]),
        fmt=marker,
        linestyle=(0, (2, 2)),
        color=colour,
        label=label,
        markersize=4,
        capsize=3,
        linewidth=0.8,
    )


# Sensors and estimators -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class View:
    """A stretch of one session along one axis. Each stream is (time in s, value); tracks (time, mean, SD)."""

    axis: str
    frames: tuple[FloatArray, FloatArray]
    reference: tuple[FloatArray, FloatArray] | None = None
    accelerations: tuple[FloatArray, FloatArray] | None = None
    tracks: Mapping[str, tuple[FloatArray, FloatArray, FloatArray]] = field(default_factory=dict)


def streams(view: View) -> Figure:
    """The tracker's frames as they arrive with the reference, and the accelerations below (paper, Fig. 6)."""
    rows = 1 if view.accelerations is None else 2
    figure, axes = _axes(rows, 1, 1.2 + 1.9 * rows, sharex=True)
    if view.reference is not None:
        axes[0].plot(*view.reference, color=COLOURS[6], label="reference")
    axes[0].scatter(*view.frames, s=14, color=COLOURS[1], label="tracker, as it arrives", zorder=3)
    axes[0].set_ylabel(f"Position, {view.axis} (mm)")
    axes[0].legend(loc="upper left", bbox_to_anchor=(0, 1.18), ncols=2)
    if view.accelerations is not None:
        axes[1].plot(*view.accelerations, color=COLOURS[0], linewidth=1)
        axes[1].set_ylabel(f"Acceleration, {view.axis} (mm/s²)")
    axes[-1].set_xlabel("Time since the session's start (s)")
    return figure


def estimates(view: View) -> Figure:
    """Each estimator's mean and two SDs (paper, Figs. 7 and 8), and with a reference its error beside it."""
    names = list(view.tracks)
    columns = 1 if view.reference is None else 2
    figure = Figure(figsize=(_WIDTH, 0.7 + 1.45 * len(names)))
    panels = figure.subplots(len(names), columns, sharex=True, sharey="col", squeeze=False)
    for index, (name, row) in enumerate(zip(names, panels, strict=True)):
        _estimate(row[0], view, name, COLOURS[index % 6])
        if view.reference is not None:
            _error(row[1], view, name, COLOURS[index % 6])
    seen = [view.frames[1], *(mean for _, mean, _ in view.tracks.values())]
    seen += [view.reference[1]] if view.reference is not None else []
    _around(panels[0, 0], np.concatenate(seen))
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4)
    for panel in panels[-1]:
        panel.set_xlabel("Time since the session's start (s)")
    return figure


def _around(axes: Axes, values: FloatArray) -> None:
    margin = 0.15 * float(np.ptp(values)) + 1
    axes.set_ylim(float(values.min()) - margin, float(values.max()) + margin)


def _estimate(axes: Axes, view: View, name: str, colour: str) -> None:
    time, mean, sd = view.tracks[name]
    axes.fill_between(time, mean - 2 * sd, mean + 2 * sd, color=colour, alpha=0.2, linewidth=0, label="± 2 SD")
    axes.plot(time, mean, color=colour, label="estimate")
    if view.reference is not None:
        axes.plot(*view.reference, color=COLOURS[6], linewidth=1, linestyle=(0, (4, 1.5)), label="reference")
    axes.scatter(*view.frames, s=5, color=_GREY, label="tracker, as it arrives", zorder=3)
    axes.set_title(_name(name))
    axes.set_ylabel(f"{view.axis} (mm)")


def _error(axes: Axes, view: View, name: str, colour: str) -> None:
    """Estimate minus reference, within the band that the estimator states."""
    assert view.reference is not None  # noqa: S101 - the caller has one
    time, mean, sd = view.tracks[name]
    error = mean - np.interp(time, *view.reference, left=np.nan, right=np.nan)
    axes.fill_between(time, -2 * sd, 2 * sd, color=colour, alpha=0.2, linewidth=0)
    axes.axhline(0, color=COLOURS[6], linewidth=0.8)
    axes.plot(time, error, color=colour)
    axes.set_title(f"{_name(name)}: error")
    axes.set_ylabel("error (mm)")


def lead(curves: Mapping[str, tuple[FloatArray, FloatArray]], peaks: Mapping[str, float]) -> Figure:
    """Cross-correlation of each estimator with the tracker as it arrived, peaks marked (paper, Fig. 9)."""
    figure, (axes,) = _axes(height=3.0)
    for index, (name, (shift, correlation)) in enumerate(curves.items()):
        inside = np.abs(shift) <= 0.5
        scaled = correlation[inside] / np.max(np.abs(correlation[inside]))
        colour = COLOURS[index % 7]
        axes.plot(1000 * shift[inside], scaled, color=colour, label=_name(name))
        peak = peaks.get(name)
        if peak is not None and np.isfinite(peak):
            height = float(np.interp(peak, shift[inside], scaled))
            axes.plot(
                [1000 * peak],
                [height],
                MARKERS[index % 7],
                color=colour,
                markersize=7,
                markeredgecolor="white",
            )
    axes.axvline(0, color=_GREY, linewidth=0.8)
    axes.set_xlabel("Lead over the tracker (ms); to the right: ahead of it")
    axes.set_ylabel("Cross-correlation\n(share of its peak)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def errors(accuracy: pd.DataFrame) -> Figure:
    """RMSE and lag of every estimator: a mark a session, and the mean over sessions."""
    names = list(dict.fromkeys(accuracy["estimator"]))
    figure, axes = _axes(1, 2, 1.1 + 0.36 * len(names), sharey=True)
    for index, name in enumerate(names):
        rows = accuracy[accuracy["estimator"] == name]
        colour, marker = COLOURS[index % 7], MARKERS[index % 7]
        for panel, values in ((axes[0], rows["rmse_mm"]), (axes[1], 1000 * rows["lag_s"])):
            known = values.dropna().to_numpy(np.float64)
            panel.scatter(known, np.full(len(known), index), s=16, color=colour, alpha=0.5)
            if len(known):
                panel.plot([known.mean()], [index], marker, color=colour, markersize=9, markeredgecolor="white")
    axes[0].set_yticks(range(len(names)), [_name(name) for name in names])
    axes[0].invert_yaxis()
    _along_rmse(axes[0], accuracy["rmse_mm"])
    axes[1].axvline(0, color=_GREY, linewidth=0.8)
    axes[1].set_xlabel("Lag behind the reference (ms)")
    for panel in axes:
        panel.grid(axis="y", color="#e3e7ea", linewidth=0.8)
        panel.set_axisbelow(True)
    return figure


def _along_rmse(axes: Axes, rmse_mm: pd.Series) -> None:
    """RMSE along x; by its logarithm where the largest is many times the least."""
    if rmse_mm.max() > 15 * rmse_mm.min():
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(mpl.ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(mpl.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(mpl.ticker.NullFormatter())
    else:
        axes.set_xlim(left=0)
    axes.set_xlabel("RMSE against the reference (mm)")


def trade_off(means: pd.DataFrame) -> Figure:
    """Lag and jitter against RMSE, a mark a variant with its rank beside it; an estimator's own settings are ringed.

    `means` has the columns of `replay_means`; a panel without values is left out.
    """
    quantities = [("lag", "_s", 1000, "Lag behind the reference (ms)"), ("jitter", "_mm", 1, "Jitter at rest (mm)")]
    known = [one for one in quantities if means[f"{one[0]}{one[1]}"].notna().any()]
    figure, axes = _axes(1, max(len(known), 1), 3.6)
    for panel, (stem, unit, scale, label) in zip(axes, known, strict=False):
        for index, name in enumerate(sorted(set(means["estimator"]))):
            rows = means[(means["estimator"] == name) & means[f"{stem}{unit}"].notna()]
            values = [scale * rows[f"{stem}{end}{unit}"].to_numpy(np.float64) for end in ("", "_low", "_high")]
            errors_mm = [rows[f"rmse{end}_mm"].to_numpy(np.float64) for end in ("", "_low", "_high")]
            panel.errorbar(
                errors_mm[0],
                values[0],
                xerr=_arms(*errors_mm),
                yerr=_arms(*values),
                fmt=MARKERS[index % 7],
                color=COLOURS[index % 7],
                elinewidth=0.7,
                markersize=6,
                alpha=0.85,
                label=_name(name),
            )
            own = rows["variant"].isna().to_numpy(bool)
            ring: dict[str, Any] = {"s": 110, "facecolors": "none", "edgecolors": COLOURS[6], "linewidths": 0.9}
            panel.scatter(errors_mm[0][own], values[0][own], **ring)
        panel.axhline(0, color=_GREY, linewidth=0.8)
        panel.set_ylabel(label)
        panel.margins(0.2, 0.1)  # room for labels
        _along_rmse(panel, means["rmse_mm"])
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4)
    figure.draw_without_rendering()  # only then is it known how far apart marks are
    for panel, (stem, unit, scale, _) in zip(axes, known, strict=False):
        _ranks(figure, panel, means, scale * means[f"{stem}{unit}"])
    return figure


def _ranks(figure: Figure, axes: Axes, means: pd.DataFrame, values: pd.Series) -> None:
    """Each mark's rank beside it; marks without room for that share a label. The layout must be settled."""
    known = values.notna().to_numpy(bool)
    points = np.column_stack([means["rmse_mm"], values])[known]
    pixels = axes.transData.transform(points)
    point = figure.dpi / 72  # in pixels
    look: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8, "in_layout": False}

    def size(text: str) -> tuple[float, float]:
        tried = axes.annotate(text, (0, 0), (0, 0), **look)
        box = tried.get_window_extent()
        tried.remove()
        return box.width + _LABEL_GAP * point, box.height

    ranks = means["rank"].to_numpy()[known].tolist()
    frame = np.array(axes.bbox.extents)
    for label in label_places.placed(pixels, ranks, cache(size), frame, _LABEL_APART * point, _MARK_RADIUS * point):
        mark = label.marks[0]
        offset = (label.box[:2] - pixels[mark]) / point
        axes.annotate(label.text, tuple(points[mark]), (offset[0] + _LABEL_GAP / 2, offset[1]), va="bottom", **look)


def _arms(middle: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """An interval as matplotlib takes it: how far to each side, nothing where there is none."""
    return np.nan_to_num(np.maximum(0, np.stack([middle - low, high - middle])))


def noise(residuals: Sequence[FloatArray], units: Sequence[str], names: Sequence[str]) -> Figure:
    """Histogram of each sensor's readings in still stretches with the Gaussian of the same SD."""
    figure, axes = _axes(1, len(names), 2.9)
    for index, (panel, values, unit, name) in enumerate(zip(axes, residuals, units, names, strict=True)):
        sd = float(np.sqrt(np.mean(values**2)))
        reach = 4 * sd
        bins = int(np.clip(np.sqrt(len(values)), 12, 60))
        panel.hist(values, bins=bins, range=(-reach, reach), density=True, color=COLOURS[index % 7], alpha=0.35)
        grid = np.linspace(-reach, reach, 200)
        panel.plot(grid, stats.norm.pdf(grid, scale=sd), color=COLOURS[index % 7], linewidth=2)
        panel.set_xlabel(f"Reading {MINUS} slow drift ({unit})")
        panel.set_title(f"{_name(name)}: SD {sd:.3g} {unit}")
        panel.set_yticks([])
        panel.spines["left"].set_visible(False)
    return figure
