"""Positions alone and fusion on one axis, and below each of them minus the reference (paper, Fig. 8)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.excerpts import errors_in, shade_of
from pipeline.report.figures.style import BLACK, GREY, as_label, finite, grouped, legend, panels, styled
from pipeline.statistics.arrays import FloatArray
from pipeline.words.numbers import number


def _overlay_words(excerpts: pd.DataFrame, positions_only: str, fused: str, order: Sequence[str] = ()) -> Words:
    """How far each of the two is off the reference, where there is one."""
    parts = []
    for name in (positions_only, fused):
        error = finite(errors_in(excerpts, name)[1])
        if len(error):
            parts.append(f"{name} {number(float(np.sqrt(np.mean(error**2))), 1)} mm")
    off = f" Error (RMS) in this stretch: {' and '.join(parts)}." if parts else ""
    where = f"session {excerpts['session'].iloc[0]}, axis {excerpts['axis'].iloc[0]}"
    below = ", and below each minus the reference" if parts else ""
    return Words(
        f"{positions_only}, of positions alone, and {fused}, which fuses accelerations, on one axis ({where}){below};"
        f" bands are two stated SDs. Where the hand sets off or turns, a lag shows as an error.{off}",
        f"Two estimates over time with the tracker's frames{below}: {positions_only} and {fused}.{off}",
    )


@drawing(_overlay_words)
@styled
def overlay(excerpts: pd.DataFrame, positions_only: str, fused: str, order: Sequence[str] = ()) -> Figure:
    """Two estimators over the same seconds, with bands of two SDs, and their errors if there is a reference.

    `excerpts` has the columns of that table, of one session, with estimates of both names. `order` is that of all
    estimators of the study, for their colours.
    """
    reference = _values(excerpts[excerpts["kind"] == "reference"])
    rows = 2 if len(reference[0]) else 1
    figure, axes = panels(rows, 1, 0.8 + 1.15 * rows, sharex=True)
    frames = _values(excerpts[excerpts["kind"] == "tracker"])
    axes[0].scatter(*frames, s=7, color=GREY, zorder=3, label="tracker, as it arrives")
    if rows == 2:
        axes[0].plot(*reference, color=BLACK, linewidth=1.1, linestyle=(0, (4, 1.5)), label="reference")
        axes[1].axhline(0, color=BLACK, linewidth=0.8)
        axes[1].set_ylabel("Minus reference\n(mm)")
    for name in (positions_only, fused):
        shade = shade_of(name, order or (fused, positions_only))
        rows_of = excerpts[(excerpts["kind"] == "estimate") & (excerpts["name"] == name)]
        (time, mean), sd = _values(rows_of), rows_of["sd"].to_numpy(np.float64)
        axes[0].fill_between(time, mean - 2 * sd, mean + 2 * sd, color=shade, alpha=0.18, linewidth=0)
        axes[0].plot(time, mean, color=shade, label=as_label(name))
        if rows == 2:
            axes[1].plot(time, errors_in(excerpts, name)[1], color=shade)
    values = finite(excerpts.loc[excerpts["kind"].isin(["tracker", "reference"]), "value"])
    if len(values):  # the wide band of an estimator that just started is cut
        margin = 0.15 * float(np.ptp(values)) + 1
        axes[0].set_ylim(float(values.min()) - margin, float(values.max()) + margin)
    axes[0].set_ylabel(f"Position, {excerpts['axis'].iloc[0]} (mm)")
    axes[-1].set_xlabel("Time since the session's start (s)")
    for panel in axes:
        grouped(panel)
    legend(figure, [axes[0]], 4)
    return figure


def _values(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    return rows["time_s"].to_numpy(np.float64), rows["value"].to_numpy(np.float64)
