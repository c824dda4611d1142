"""How well estimators follow the hand: error, lag, what one costs the other, and whether the stated SD is honest."""

from __future__ import annotations

from functools import cache
from typing import Any

import matplotlib as mpl
import matplotlib.ticker
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures import label_places
from pipeline.report.figures.style import (
    BLACK,
    GREY,
    MARKS_MAX,
    PALE,
    arms,
    colour,
    finite,
    interval,
    legend,
    lowest,
    marker,
    mean_and_interval,
    multiples,
    name,
    panels,
    styled,
)
from pipeline.statistics.arrays import FloatArray

_LABEL_APART = 10  # points (1/72 inch), as are these: closer marks have one label
_LABEL_GAP = 4  # beside a label
_MARK_RADIUS = 5.5  # with its ring
_LAG = "Lag behind the reference (ms)"


@styled
def errors(accuracy: pd.DataFrame) -> Figure:
    """RMSE and lag of every estimator: a mark a session, the mean over sessions and its 95 % t interval."""
    names = list(dict.fromkeys(accuracy["estimator"]))
    figure, axes = panels(1, 2, 1.1 + 0.36 * len(names), sharey=True)
    many = len(accuracy) > MARKS_MAX
    for index, estimator in enumerate(names):
        rows = accuracy[accuracy["estimator"] == estimator]
        for panel, values in ((axes[0], rows["rmse_mm"]), (axes[1], 1000 * rows["lag_s"])):
            known = finite(values)
            below = np.full(len(known), index + 0.2)
            panel.scatter(known, below, s=11, color=colour(index), alpha=0.5, linewidth=0, rasterized=many)
            if len(known):
                interval(panel, index, known, (colour(index), marker(index)), upright=False)
    axes[0].set_yticks(range(len(names)), [name(estimator) for estimator in names])
    axes[0].invert_yaxis()
    _along_rmse(axes[0], accuracy["rmse_mm"])
    axes[0].set_title(f"Error (n = {_sessions(accuracy)})")
    axes[1].axvline(0, color=GREY, linewidth=0.8)
    axes[1].set_xlabel(_LAG)
    axes[1].set_title("Lag")
    for panel in axes:
        panel.grid(axis="y", color=PALE, linewidth=0.8)
        panel.set_axisbelow(True)
    return figure


def _sessions(accuracy: pd.DataFrame) -> str:
    n = accuracy["session"].nunique()
    return f"{n} session{'' if n == 1 else 's'}"


_WIDE = 100.0  # from end to end: so far apart, only powers of ten have room for their numbers


def _along_rmse(axes: Axes, rmse_mm: pd.Series) -> None:
    """RMSE along x; by its logarithm where the largest is many times the least."""
    if rmse_mm.max() > 15 * rmse_mm.min() > 0:
        axes.set_xscale("log")
        low, high = axes.get_xlim()
        axes.xaxis.set_major_locator(mpl.ticker.LogLocator(subs=(1.0, 2.0, 5.0) if high < _WIDE * low else (1.0,)))
        axes.xaxis.set_major_formatter(mpl.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(mpl.ticker.NullFormatter())
    else:
        axes.set_xlim(left=0)
    axes.set_xlabel("RMSE against the reference (mm)")


@styled
def lag_and_error(accuracy: pd.DataFrame) -> Figure:
    """Lag against RMSE, a mark an estimator: means over sessions with 95 % t intervals, small marks the sessions."""
    figure, (axes,) = panels(height=3.4)
    for index, (estimator, rows) in enumerate(accuracy.groupby("estimator", sort=False)):
        known = rows[rows["lag_s"].notna() & rows["rmse_mm"].notna()]
        if known.empty:
            continue
        rmse, lag = finite(known["rmse_mm"]), 1000 * finite(known["lag_s"])
        axes.scatter(rmse, lag, s=9, color=colour(index), alpha=0.4, linewidth=0, rasterized=len(accuracy) > MARKS_MAX)
        (x, half_x), (y, half_y) = mean_and_interval(rmse), mean_and_interval(lag)
        axes.errorbar(
            [x],
            [y],
            xerr=None if np.isnan(half_x) else [half_x],
            yerr=None if np.isnan(half_y) else [half_y],
            fmt=marker(index),
            color=colour(index),
            markersize=8,
            markeredgecolor="white",
            capsize=3,
            label=f"{name(estimator)} (n = {len(known)})",
        )
    axes.axhline(0, color=GREY, linewidth=0.8)
    _along_rmse(axes, accuracy["rmse_mm"])
    axes.set_ylabel(_LAG)
    legend(figure, [axes], 1, "outside right center")
    return figure


@styled
def calibration(table: pd.DataFrame) -> Figure:
    """Share of errors within k stated SDs, a small panel an estimator: all sessions together, each, and the normal's.

    `table` has the columns of `calibration`: counts by session, so that shares are of all instants, not means of means.
    """
    from scipy import stats

    names = list(dict.fromkeys(table["estimator"]))
    figure, every, across = multiples(len(names), 1.75, a_row=3)
    grid = np.linspace(0, table["percent_of_sd"].max() / 100, 100)
    many = table["session"].nunique() > LINES_MAX
    for index, (axes, estimator) in enumerate(zip(every, names, strict=True)):
        rows = table[table["estimator"] == estimator]
        axes.plot(grid, 100 * (2 * stats.norm.cdf(grid) - 1), color=BLACK, linewidth=1, linestyle=(0, (4, 2)))
        if many:
            axes.fill_between(*nine_of_ten(rows), **_BAND)
        elif rows["session"].nunique() > 1:
            axes.plot(*_one_line(rows), **_FAINT)
        k, share = shares(rows)
        look: dict[str, Any] = {"color": colour(index), "marker": marker(index), "markersize": 4}
        axes.plot(k, 100 * share, **look)
        axes.set_title(f"{name(estimator, 22)} (n = {_sessions(rows)})", fontsize=8.5)
        if index % across == 0:
            axes.set_ylabel("Within k SD (%)")
    every[0].plot([], [], color=BLACK, linewidth=1, linestyle=(0, (4, 2)), label="normal")
    every[0].plot([], [], color=colour(0), marker=marker(0), markersize=4, label="all sessions")
    if many:
        every[0].fill_between([], [], [], label="nine of ten sessions", **_BAND)
    else:
        every[0].plot([], [], label="one session", **_FAINT)
    legend(figure, figure.axes, 3)
    every[0].set_ylim(0, 102)
    every[0].set_xlim(left=0)
    for axes in lowest(every, across):
        axes.set_xlabel("k (stated SDs)")
    return figure


_FAINT: dict[str, Any] = {"color": GREY, "linewidth": 0.6, "alpha": 0.5}
_BAND: dict[str, Any] = {"color": GREY, "linewidth": 0, "alpha": 0.35}
LINES_MAX = 60  # sessions, each with a line of its own


def _by_session(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """k (k,), and each session's share in percent (k, sessions)."""
    whole = rows.pivot(index="percent_of_sd", columns="session", values=["within", "n"]).astype("float64")
    return whole.index.to_numpy(np.float64) / 100, 100 * (whole["within"] / whole["n"]).to_numpy()


def nine_of_ten(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray, FloatArray]:
    """k, and the 5 and 95 percentiles of the sessions' shares in percent."""
    k, share = _by_session(rows)
    low, high = np.nanpercentile(share, [5, 95], axis=1)
    return k, low, high


def _one_line(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """Each session's k and share in percent, NaN between sessions: one line draws faster than many."""
    found, share = _by_session(rows)
    k = np.broadcast_to(found[:, None], share.shape)
    parted = [np.vstack([part, np.full(part.shape[1], np.nan)]).T.ravel() for part in (k, share)]
    return parted[0], parted[1]


def shares(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """k, and the share of all instants and axes within k stated SDs, of one estimator's rows of `calibration`."""
    summed = rows.groupby("percent_of_sd")[["within", "n"]].sum()
    k: FloatArray = summed.index.to_numpy(np.float64) / 100
    share: FloatArray = summed["within"].to_numpy(np.float64) / summed["n"].to_numpy(np.float64)
    return k, share


@styled
def trade_off(means: pd.DataFrame) -> Figure:
    """Lag and jitter against RMSE, a mark a variant with its rank beside it; an estimator's own settings are ringed.

    `means` has the columns of `replay_means`; a panel without values is left out.
    """
    quantities = [("lag", "_s", 1000, _LAG), ("jitter", "_mm", 1, "Jitter at rest (mm)")]
    known = [one for one in quantities if means[f"{one[0]}{one[1]}"].notna().any()]
    figure, axes = panels(1, max(len(known), 1), 3.6)
    for panel, (stem, unit, scale, label) in zip(axes, known, strict=False):
        for index, estimator in enumerate(sorted(set(means["estimator"]))):
            rows = means[(means["estimator"] == estimator) & means[f"{stem}{unit}"].notna()]
            values = [scale * rows[f"{stem}{end}{unit}"].to_numpy(np.float64) for end in ("", "_low", "_high")]
            errors_mm = [rows[f"rmse{end}_mm"].to_numpy(np.float64) for end in ("", "_low", "_high")]
            panel.errorbar(
                errors_mm[0],
                values[0],
                xerr=arms(*errors_mm),
                yerr=arms(*values),
                fmt=marker(index),
                color=colour(index),
                elinewidth=0.7,
                markersize=6,
                alpha=0.85,
                label=name(estimator),
            )
            own = rows["variant"].isna().to_numpy(bool)
            ring: dict[str, Any] = {"s": 110, "facecolors": "none", "edgecolors": BLACK, "linewidths": 0.9}
            panel.scatter(errors_mm[0][own], values[0][own], **ring)
        panel.axhline(0, color=GREY, linewidth=0.8)
        panel.set_ylabel(label)
        panel.margins(0.2, 0.1)  # room for labels
        _along_rmse(panel, means["rmse_mm"])
    legend(figure, [axes[0]], 4)
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
