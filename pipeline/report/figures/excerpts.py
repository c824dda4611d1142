"""A few seconds of a session: what the sensors delivered and what the estimators made of it (paper, Figs. 6 to 8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import (
    BLACK,
    COLOURS,
    GREY,
    WIDTH,
    as_label,
    finite,
    grouped,
    headed,
    legend,
    panels,
    styled,
)
from pipeline.report.figures.wording import listed
from pipeline.statistics.arrays import FloatArray
from pipeline.words.numbers import number, percent
from pipeline.words.phrases import counted

_TIME = "Time since the session's start (s)"
_SHADES = 6  # the seventh colour is the reference's


def _streams_words(excerpts: pd.DataFrame) -> Words:
    """How many frames and accelerations there are, and how far a frame is off the reference when it arrives."""
    counts = excerpts["kind"].value_counts()
    felt, frames = int(counts.get("acceleration", 0)), excerpts[excerpts["kind"] == "tracker"]
    summary = f"{counted(len(frames), 'frame')} of the tracker"
    summary += f" against {counted(felt, 'acceleration')}" if felt else ""
    reference = excerpts[excerpts["kind"] == "reference"]
    if len(reference) > 1 and len(frames):
        at = np.interp(frames["time_s"], reference["time_s"], reference["value"], left=np.nan, right=np.nan)
        error = finite(frames["value"].to_numpy(np.float64) - at)
        if len(error):
            rms = number(float(np.sqrt(np.mean(error**2))), 1)
            summary += f"; on arrival a frame is {rms} mm (RMS) off the reference"
    return Words(
        f"What the sensors delivered ({_span(excerpts)}): {summary}.",
        f"Tracker positions over time{', accelerations below' if felt else ''}: {summary}.",
    )


@drawing(_streams_words)
@styled
def streams(excerpts: pd.DataFrame) -> Figure:
    """The tracker's frames as they arrive, with the reference, and the accelerations below (paper, Fig. 6).

    `excerpts` has the columns of that table, of one session.
    """
    felt = _of_kind(excerpts, "acceleration")
    rows = 1 if felt is None else 2
    figure, axes = panels(rows, 1, 0.9 + 1.25 * rows, sharex=True)
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


def _estimates_words(excerpts: pd.DataFrame, contradicted: str = "", order: Sequence[str] = ()) -> Words:
    """Each estimator's error in this stretch, and how often it lies within the stated band.

    The smallest comes first, unless `contradicted` says why none is called the best.
    """
    names = list(dict.fromkeys(excerpts.loc[excerpts["kind"] == "estimate", "name"]))
    parts = []
    for name in names:
        _, error, sd = errors_in(excerpts, name)
        known = np.isfinite(error)
        if known.any():
            rms = float(np.sqrt(np.mean(error[known] ** 2)))
            inside = float(np.mean(np.abs(error[known]) <= 2 * sd[known]))
            parts.append((rms, f"{name} {number(rms, 1)} mm, {percent(inside, 0)} within ± 2 SD"))
    order = "" if contradicted else ", smallest first"
    texts = [text for _, text in (parts if contradicted else sorted(parts))]
    errors = f" Error (RMS) in this stretch{order}: {listed(texts)}." if parts else ""
    errors += f" {contradicted}" if parts and contradicted else ""
    return Words(
        f"What each estimator makes of these readings ({_span(excerpts)}): its mean with a band of two stated SDs"
        f"{', and beside it its error and the same band' if parts else ''}.{errors}",
        f"One panel per estimator ({listed(names, ', ')}) with mean, band and tracker frames.{errors}",
    )


@drawing(_estimates_words)
@styled
def estimates(excerpts: pd.DataFrame, contradicted: str = "", order: Sequence[str] = ()) -> Figure:
    """Each estimator's mean and two SDs (paper, Figs. 7 and 8), and beside it its error if there is a reference.

    `excerpts` has the columns of that table, of one session. `order` is that of all estimators of the study, so that
    each has the colour that it has in the other figures.
    """
    names = list(dict.fromkeys(excerpts.loc[excerpts["kind"] == "estimate", "name"]))
    reference = _of_kind(excerpts, "reference")
    figure = Figure(figsize=(WIDTH, 0.7 + 1.4 * max(len(names), 1)))
    shared: dict[str, Any] = {"sharex": True, "sharey": "col", "squeeze": False}
    every = figure.subplots(max(len(names), 1), 1 if reference is None else 2, **shared)
    for estimator, row in zip(names, every, strict=False):
        shade = shade_of(estimator, order or names)
        _estimate(row[0], excerpts, estimator, shade)
        if reference is not None:
            _error(row[1], excerpts, estimator, shade)
    if reference is not None and names:
        every[0, 1].set_ylim(*_errors_range(excerpts, names))
    _set_range_around(every[0, 0], finite(excerpts.loc[excerpts["kind"] != "acceleration", "value"]))
    legend(figure, [every[0, 0]], 4)
    for axes in every[-1]:
        axes.set_xlabel(_TIME)
    return figure


def shade_of(estimator: str, order: Sequence[str]) -> str:
    """The colour of an estimator by its place in `order`; never black, which is the reference's."""
    return COLOURS[order.index(estimator) % _SHADES]


def _span(excerpts: pd.DataFrame) -> str:
    time = finite(excerpts["time_s"])
    where = f"session {excerpts['session'].iloc[0]}, axis {excerpts['axis'].iloc[0]}"
    return f"{where}, {number(time.min(), 1)} to {number(time.max(), 1)} s, chosen for its movement"


def _errors_range(excerpts: pd.DataFrame, names: Sequence[str]) -> tuple[float, float]:
    """Limits with room for all errors and the usual band; the wide band of an estimator that just started is cut."""
    reach = 1.0
    for name in names:
        _, error, sd = errors_in(excerpts, name)
        reach = max(reach, np.abs(finite(error)).max(initial=0.0), 2 * float(np.median(finite(sd))) if len(sd) else 0.0)
    return -1.15 * reach, 1.15 * reach


def _set_range_around(axes: Axes, values: FloatArray) -> None:
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
    headed(axes, as_label(estimator))
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
    headed(axes, f"error: RMS {rmse:.1f} mm in this stretch" if len(known) else "error: unknown")
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
