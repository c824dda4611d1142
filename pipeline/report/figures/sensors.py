"""What sensors delivered in a few seconds of a session, and what estimators made of it: the paper's Figures 6 to 9."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.style import (
    BLACK,
    COLOURS,
    GREY,
    WIDTH,
    colour,
    finite,
    grouped,
    legend,
    marker,
    name,
    panels,
    styled,
)
from pipeline.statistics.arrays import FloatArray
from pipeline.words import MINUS, seconds

_TIME = "Time since the session's start (s)"
_SHADES = 6  # the seventh colour is the reference's


@styled
def streams(excerpts: pd.DataFrame) -> Figure:
    """The tracker's frames as they arrive with the reference, and the accelerations below (paper, Fig. 6).

    `excerpts` has the columns of that table, of one session.
    """
    felt = _of_kind(excerpts, "acceleration")
    rows = 1 if felt is None else 2
    figure, axes = panels(rows, 1, 1.2 + 1.7 * rows, sharex=True)
    reference, frames = _of_kind(excerpts, "reference"), _of_kind(excerpts, "tracker")
    if reference is not None:
        axes[0].plot(*reference, color=BLACK, label="reference")
    if frames is not None:
        axes[0].scatter(*frames, s=12, color=COLOURS[1], zorder=3, label=f"tracker, as it arrives (n = {_n(frames)})")
    axis = _axis(excerpts)
    axes[0].set_ylabel(f"Position, {axis} (mm)")
    grouped(axes[0])
    if felt is not None:
        axes[1].plot(*felt, color=COLOURS[0], linewidth=0.9, label=f"acceleration (n = {_n(felt)})")
        axes[1].set_ylabel(f"Acceleration,\n{axis} (mm/s²)")
        grouped(axes[1])
    axes[-1].set_xlabel(_TIME)
    legend(figure, figure.axes, 3)
    return figure


@styled
def estimates(excerpts: pd.DataFrame) -> Figure:
    """Each estimator's mean and two SDs (paper, Figs. 7 and 8), and with a reference its error beside it.

    `excerpts` has the columns of that table, of one session.
    """
    names = list(dict.fromkeys(excerpts.loc[excerpts["kind"] == "estimate", "name"]))
    reference = _of_kind(excerpts, "reference")
    figure = Figure(figsize=(WIDTH, 0.7 + 1.4 * max(len(names), 1)))
    shared: dict[str, Any] = {"sharex": True, "sharey": "col", "squeeze": False}
    every = figure.subplots(max(len(names), 1), 1 if reference is None else 2, **shared)
    for index, (estimator, row) in enumerate(zip(names, every, strict=False)):
        _estimate(row[0], excerpts, estimator, COLOURS[index % _SHADES])
        if reference is not None:
            _error(row[1], excerpts, estimator, COLOURS[index % _SHADES])
    if reference is not None and names:
        every[0, 1].set_ylim(*_errors_range(excerpts, names))
    _around(every[0, 0], finite(excerpts.loc[excerpts["kind"] != "acceleration", "value"]))
    legend(figure, [every[0, 0]], 4)
    for axes in every[-1]:
        axes.set_xlabel(_TIME)
    return figure


def _errors_range(excerpts: pd.DataFrame, names: Sequence[str]) -> tuple[float, float]:
    """Room for every error and the usual band; the wide one of an estimator that has just begun may be cut."""
    reach = 1.0
    for one in names:
        _, error, sd = errors_in(excerpts, one)
        reach = max(reach, np.abs(finite(error)).max(initial=0.0), 2 * float(np.median(finite(sd))) if len(sd) else 0.0)
    return -1.15 * reach, 1.15 * reach


def _around(axes: Axes, values: FloatArray) -> None:
    if len(values):
        margin = 0.15 * float(np.ptp(values)) + 1
        axes.set_ylim(float(values.min()) - margin, float(values.max()) + margin)


def _estimate(axes: Axes, excerpts: pd.DataFrame, estimator: str, shade: str) -> None:
    time, mean, sd = _track(excerpts, estimator)
    axes.fill_between(time, mean - 2 * sd, mean + 2 * sd, color=shade, alpha=0.2, linewidth=0, label="± 2 SD")
    axes.plot(time, mean, color=shade, label="estimate")
    reference, frames = _of_kind(excerpts, "reference"), _of_kind(excerpts, "tracker")
    if reference is not None:
        axes.plot(*reference, color=BLACK, linewidth=1, linestyle=(0, (4, 1.5)), label="reference")
    if frames is not None:
        axes.scatter(*frames, s=4, color=GREY, label="tracker, as it arrives", zorder=3)
    axes.set_title(name(estimator))
    axes.set_ylabel(f"{_axis(excerpts)} (mm)")
    grouped(axes)


def _error(axes: Axes, excerpts: pd.DataFrame, estimator: str, shade: str) -> None:
    """Estimate minus reference, within the band that the estimator states."""
    time, error, sd = errors_in(excerpts, estimator)
    axes.fill_between(time, -2 * sd, 2 * sd, color=shade, alpha=0.2, linewidth=0)
    axes.axhline(0, color=BLACK, linewidth=0.8)
    axes.plot(time, error, color=shade)
    known = finite(error)
    rmse = float(np.sqrt(np.mean(known**2))) if len(known) else np.nan
    axes.set_title(f"error: RMS {rmse:.1f} mm here" if len(known) else "error: not known")
    axes.set_ylabel("error (mm)")
    grouped(axes)


def errors_in(excerpts: pd.DataFrame, estimator: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time in s, estimate minus reference in mm (NaN outside the reference), and the stated SD in mm."""
    time, mean, sd = _track(excerpts, estimator)
    reference = _of_kind(excerpts, "reference")
    if reference is None:
        return time, np.full(len(time), np.nan), sd
    error: FloatArray = mean - np.interp(time, *reference, left=np.nan, right=np.nan)
    return time, error, sd


def _of_kind(excerpts: pd.DataFrame, kind: str) -> tuple[FloatArray, FloatArray] | None:
    rows = excerpts[excerpts["kind"] == kind]
    return None if rows.empty else (rows["time_s"].to_numpy(np.float64), rows["value"].to_numpy(np.float64))


def _track(excerpts: pd.DataFrame, estimator: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    rows = excerpts[(excerpts["kind"] == "estimate") & (excerpts["name"] == estimator)]
    time, mean, sd = (rows[column].to_numpy(np.float64) for column in ("time_s", "value", "sd"))
    return time, mean, sd


def _axis(excerpts: pd.DataFrame) -> str:
    return str(excerpts["axis"].iloc[0]) if len(excerpts) else "x"


def _n(stream: tuple[FloatArray, FloatArray]) -> int:
    return len(stream[0])


@styled
def lead(lead_curves: pd.DataFrame) -> Figure:
    """Cross-correlation of each estimator with the tracker as it arrived, peaks marked (paper, Fig. 9).

    `lead_curves` has the columns of that table, of one session.
    """
    figure, (axes,) = panels(height=2.9)
    for index, (estimator, rows) in enumerate(lead_curves.groupby("estimator", sort=False)):
        shift, correlation = rows["lead_s"].to_numpy(np.float64), rows["correlation_mm2"].to_numpy(np.float64)
        highest = np.max(np.abs(correlation), initial=0.0)
        if not highest > 0:
            continue
        peak = peak_s(rows)
        label = name(estimator) if peak is None else f"{name(estimator)}: peak at {seconds(peak)} ms"
        axes.plot(1000 * shift, correlation / highest, color=colour(index), label=label)
        if peak is not None:
            mark: dict[str, Any] = {"markersize": 7, "markeredgecolor": "white", "color": colour(index)}
            axes.plot([1000 * peak], [float(correlation.max() / highest)], marker(index), **mark)
    axes.axvline(0, color=GREY, linewidth=0.8)
    axes.set_xlabel("Lead over the tracker (ms); to the right: ahead of it")
    axes.set_ylabel("Cross-correlation\n(share of its peak)")
    legend(figure, [axes], 1, "outside right center")
    return figure


def peak_s(rows: pd.DataFrame) -> float | None:
    """Where one estimator's curve is highest, in s; None at the edge of what was looked at, or where there is none."""
    correlation = rows["correlation_mm2"].to_numpy(np.float64)
    if not len(correlation):
        return None
    at = int(np.argmax(correlation))
    inside = 0 < at < len(correlation) - 1 and correlation[at] > 0
    return float(rows["lead_s"].iloc[at]) if inside else None


@styled
def noise(residuals: pd.DataFrame, units: pd.Series) -> Figure:
    """Histogram of each sensor's readings in still stretches with the Gaussian of the same SD.

    `residuals` has the columns `stream` and `residual` of `noise_residuals`, `units` each stream's unit, by its name,
    in the order in which they are drawn.
    """
    from scipy import stats

    figure, axes = panels(1, max(len(units), 1), 2.7)
    for index, (panel, (stream, unit)) in enumerate(zip(axes, units.items(), strict=False)):
        values = finite(residuals.loc[residuals["stream"] == stream, "residual"])
        sd = float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
        reach = 4 * sd or 1.0
        bins = int(np.clip(np.sqrt(len(values)), 12, 60))
        panel.hist(values, bins=bins, range=(-reach, reach), density=sd > 0, color=colour(index), alpha=0.35)
        if sd > 0:
            grid = np.linspace(-reach, reach, 200)
            panel.plot(grid, stats.norm.pdf(grid, scale=sd), color=colour(index), linewidth=2)
        panel.set_xlabel(f"Reading {MINUS} slow drift ({unit})")
        panel.set_title(f"{name(stream, 20)}: SD {sd:.3g} {unit}\n(n = {len(values)})")
        panel.set_yticks([])
        panel.spines["left"].set_visible(False)
    return figure
