"""How far each estimator is ahead of the tracker (paper, Fig. 9)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import GREY, as_label, colour, legend, marker, panels, styled
from pipeline.report.figures.wording import listed
from pipeline.words.numbers import milliseconds


def _lead_words(lead_curves: pd.DataFrame, lag_s: Mapping[str, float]) -> Words:
    """Where each curve peaks, and how late the estimator is by the better measure."""
    parts = []
    for name, rows in lead_curves.groupby("estimator", sort=False):
        peak = peak_s(rows)
        place = "has no peak within half a second" if peak is None else f"{milliseconds(peak)} ms"
        lag = lag_s.get(str(name))
        parts.append(f"{name} {place}" + ("" if lag is None else f" (lag {milliseconds(lag)} ms)"))
    peaks = f"Peaks: {listed(parts)}."
    where = lead_curves["session"].iloc[0]
    lags = " Lag: where the squared error is least." if lag_s else ""
    return Words(
        f"How far each estimator is ahead of the tracker as it arrived, by the paper's method (session {where})."
        f" {peaks}{lags} A peak at 0 need not mean that nothing is gained: an estimate shares the noise of the"
        " frame that it was made from, and a single reach has a flat top.",
        f"Cross-correlation with the tracker against lead. {peaks}",
    )


@drawing(_lead_words)
@styled
def lead(lead_curves: pd.DataFrame, lag_s: Mapping[str, float]) -> Figure:
    """Cross-correlation of each estimator with the tracker as it arrived, peaks marked (paper, Fig. 9).

    `lead_curves` has the columns of that table, of one session; `lag_s` the estimators' lags in it, for the caption.
    """
    figure, (axes,) = panels(height=2.4)
    for index, (estimator, rows) in enumerate(lead_curves.groupby("estimator", sort=False)):
        shift, correlation = rows["lead_s"].to_numpy(np.float64), rows["correlation_mm2"].to_numpy(np.float64)
        highest = np.max(np.abs(correlation), initial=0.0)
        if not highest > 0:
            continue
        peak = peak_s(rows)
        label = as_label(estimator) if peak is None else f"{as_label(estimator)}: peak at {milliseconds(peak)} ms"
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
    """The lead in s at which one estimator's curve is highest; None if it has no peak inside the range."""
    correlation = rows["correlation_mm2"].to_numpy(np.float64)
    if not len(correlation):
        return None
    at = int(np.argmax(correlation))
    inside = 0 < at < len(correlation) - 1 and correlation[at] > 0
    return float(rows["lead_s"].iloc[at]) if inside else None
