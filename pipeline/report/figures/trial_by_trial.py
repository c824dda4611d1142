"""Each participant's selection errors, trial by trial."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import as_label, as_pixels, colour, legend, lowest, marker, multiples, styled
from pipeline.report.figures.wording import listed
from pipeline.words.numbers import number
from pipeline.words.phrases import counted


def _trials_words(table: pd.DataFrame, conditions: Sequence[str]) -> Words:
    """Whether errors shrink from the first half of the trials to the second."""
    recorded = table[(table["estimator"] == "recorded") & table["position_error_mm"].notna()]
    people = recorded["participant"].nunique()
    head = f"Selection error trial by trial, one panel per participant ({counted(people, 'participant')}"
    head += f", {counted(len(recorded), 'selection')})."
    halves = _halves(recorded, conditions)
    return Words(f"{head} {halves}".strip(), f"Selection error by trial, one panel per participant. {halves}".strip())


def _halves(recorded: pd.DataFrame, conditions: Sequence[str]) -> str:
    parts = []
    for condition in conditions:
        rows = recorded[recorded["condition"] == condition]
        middle = rows.groupby("participant")["trial"].transform("median") if len(rows) else rows["trial"]
        early, late = rows.loc[rows["trial"] <= middle], rows.loc[rows["trial"] > middle]
        if len(early) and len(late):
            means = [part["position_error_mm"].mean() for part in (early, late)]
            parts.append(f"{condition} {number(means[0], 1)} to {number(means[1], 1)} mm")
    return f"Mean error from the first half of the trials to the second: {listed(parts)}." if parts else ""


@drawing(_trials_words)
@styled
def trials(table: pd.DataFrame, conditions: Sequence[str]) -> Figure:
    """Selection errors trial by trial: one small panel per participant, one line per condition.

    `table` has the columns of `trials`; rows whose estimator is `recorded` are shown.
    """
    recorded = table[(table["estimator"] == "recorded") & table["position_error_mm"].notna()]
    people = sorted(set(recorded["participant"]))
    figure, every, across = multiples(len(people), 1.35)
    for index, (axes, person) in enumerate(zip(every, people, strict=True)):
        zorder = as_pixels(axes, len(recorded))
        own = recorded[recorded["participant"] == person]
        for place, condition in enumerate(conditions):
            rows = own[own["condition"] == condition].sort_values("trial", kind="stable")
            look: dict[str, Any] = {"color": colour(place), "marker": marker(place), "zorder": zorder}
            where = rows["trial"].to_numpy(np.float64), rows["position_error_mm"].to_numpy(np.float64)
            axes.plot(
                *where,
                markersize=2.5,
                linewidth=0.5 if zorder > 0 else 0,
                alpha=0.75,
                label=as_label(condition),
                **look,
            )
        axes.set_title(f"{as_label(person, 18)} (n = {len(own)})", fontsize=8.5)
        if index % across == 0:
            axes.set_ylabel("Error (mm)")
    every[0].set_ylim(bottom=0)
    for axes in lowest(every, across):
        axes.set_xlabel("Trial")
    legend(figure, [every[0]], min(len(conditions), 6))
    return figure
