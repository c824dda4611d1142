"""The variants of a replay: lag and jitter against error."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures import label_places
from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.rmse_axis import along_rmse, lag_label
from pipeline.report.figures.style import BLACK, GREY, arms, as_label, colour, legend, marker, panels, styled
from pipeline.words.phrases import counted

_LABEL_APART = 10  # points (1/72 inch), like the next two; closer marks share a label
_LABEL_GAP = 4  # beside a label
_MARK_RADIUS = 5.5  # with its ring


def _trade_off_words(means: pd.DataFrame) -> Words:
    """What the marks stand for, and which study they belong to."""
    study = means["study"].iloc[0]
    where = "all studies together" if pd.isna(study) else f"study “{study}”"
    return Words(
        f"Lag and jitter against RMSE, {where}: means over sessions with 95 % intervals. Numbers are the ranks of the"
        " table, a ring marks the settings of study.yaml. Better is further left and closer to zero.",
        f"Scatter plot of lag and jitter against RMSE for {counted(len(means), 'variant')}, {where}.",
    )


@drawing(_trade_off_words)
@styled
def trade_off(means: pd.DataFrame) -> Figure:
    """Lag and jitter against RMSE, one mark per variant with its rank; a ring marks the study's own settings.

    `means` has the columns of `replay_means`; a panel without values is left out.
    """
    quantities = [("lag", "_s", 1000, lag_label()), ("jitter", "_mm", 1, "Jitter at rest (mm)")]
    known = [quantity for quantity in quantities if means[f"{quantity[0]}{quantity[1]}"].notna().any()]
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
                label=as_label(estimator),
            )
            own = rows["variant"].isna().to_numpy(bool)
            ring: dict[str, Any] = {"s": 110, "facecolors": "none", "edgecolors": BLACK, "linewidths": 0.9}
            panel.scatter(errors_mm[0][own], values[0][own], **ring)
        panel.axhline(0, color=GREY, linewidth=0.8)
        panel.set_ylabel(label)
        panel.margins(0.2, 0.1)  # room for labels
        along_rmse(panel, means["rmse_mm"])
    legend(figure, [axes[0]], 4)
    figure.draw_without_rendering()  # lays the figure out, so that it is known how far apart the marks are
    for panel, (stem, unit, scale, _) in zip(axes, known, strict=False):
        _ranks(figure, panel, means, scale * means[f"{stem}{unit}"])
    return figure


def _ranks(figure: Figure, axes: Axes, means: pd.DataFrame, values: pd.Series) -> None:
    """Write each mark's rank beside it; marks too close to each other share a label. Needs the figure laid out."""
    known = values.notna().to_numpy(bool)
    points = np.column_stack([means["rmse_mm"], values])[known]
    pixels = axes.transData.transform(points)
    point = figure.dpi / 72  # in pixels
    look: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8, "in_layout": False}

    def size(text: str) -> tuple[float, float]:
        trial = axes.annotate(text, (0, 0), (0, 0), **look)
        box = trial.get_window_extent()
        trial.remove()
        return box.width + _LABEL_GAP * point, box.height

    ranks = means["rank"].to_numpy()[known].tolist()
    frame = np.array(axes.bbox.extents)
    for label in label_places.place_labels(
        pixels, ranks, cache(size), frame, _LABEL_APART * point, _MARK_RADIUS * point
    ):
        mark = label.marks[0]
        offset = (label.box[:2] - pixels[mark]) / point
        axes.annotate(label.text, tuple(points[mark]), (offset[0] + _LABEL_GAP / 2, offset[1]), va="bottom", **look)
