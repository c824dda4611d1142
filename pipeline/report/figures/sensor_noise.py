"""The sensors' noise in still stretches."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import as_label, colour, finite, panels, styled
from pipeline.report.figures.wording import listed
from pipeline.words.numbers import MINUS, number, percent


def _noise_words(residuals: pd.DataFrame, units: pd.Series) -> Words:
    """Each sensor's SD, and the share of readings further out than a normal distribution has."""
    parts = []
    for stream, unit in units.items():
        values = finite(residuals.loc[residuals["stream"] == stream, "residual"])
        sd = float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
        outside = f", {percent(float(np.mean(np.abs(values) > 3 * sd)), 1)} beyond 3 SD" if sd > 0 else ""
        parts.append(f"{stream}: SD {number(sd, 1)} {unit}, n = {len(values)}{outside}")
    summary = listed(parts)
    return Words(
        "Sensor readings while the hand is still, minus slow drift, and the normal distribution of the same SD"
        f" ({summary}; a normal distribution has 0.3 % beyond 3 SD). A hand is never quite still, so this is an upper"
        " bound on the sensor's own noise.",
        f"Histograms with the curves of normal distributions. {summary}.",
    )


@drawing(_noise_words)
@styled
def noise(residuals: pd.DataFrame, units: pd.Series) -> Figure:
    """Histogram of each sensor's readings in still stretches, with the normal distribution of the same SD.

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
        panel.set_title(f"{as_label(stream, 20)}: SD {sd:.3g} {unit}\n(n = {len(values)})")
        panel.set_yticks([])
        panel.spines["left"].set_visible(False)
    return figure
