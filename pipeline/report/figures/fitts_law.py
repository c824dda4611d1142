"""Fitts' law: movement time over the index of difficulty, with the line of each condition."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import as_label, colour, grouped, headed, legend, marker, panels, styled
from pipeline.report.figures.wording import listed
from pipeline.words.numbers import MINUS, fraction, number

_TITLES = {"nominal": "Nominal, targets as shown", "effective": "Effective, as people selected"}


def _fitts_words(points: pd.DataFrame, lines: pd.DataFrame, conditions: Sequence[str]) -> Words:
    """Each line, by condition and kind of difficulty."""
    parts = [
        f"{condition}, {basis}: {line_in_words(row.intercept_s, row.slope_s_bit)}, R² = {fraction(row.r_squared)}"
        for basis in _bases(points)
        for condition in conditions
        for row in _line_of(lines, condition, basis)
    ]
    head = "Movement time by index of difficulty (Fitts' law). A point is a distance and width, mean over participants."
    return Words(
        f"{head} Lines by least squares: {listed(parts)}.",
        f"Points and a line for each condition, by {listed(_bases(points))} difficulty. {listed(parts)}.",
    )


def line_in_words(intercept_s: float, slope_s_bit: float) -> str:
    """`0.82 + 0.50 · ID s`."""
    sign = MINUS if slope_s_bit < 0 else "+"
    return f"{number(intercept_s)} {sign} {number(abs(slope_s_bit))} · ID s"


@drawing(_fitts_words)
@styled
def fitts(points: pd.DataFrame, lines: pd.DataFrame, conditions: Sequence[str]) -> Figure:
    """Mean movement time of each distance and width over its difficulty: a panel for nominal, one for effective.

    `points` has the columns of `fitts_points`, `lines` those of `fitts`.
    """
    bases = _bases(points)
    figure, every = panels(1, len(bases), 3.2, sharey=True)
    for axes, basis in zip(every, bases, strict=True):
        for place, condition in enumerate(conditions):
            own = points[(points["condition"] == condition) & (points["difficulty"] == basis)]
            where = own["difficulty_bits"].to_numpy(np.float64), own["movement_time_s"].to_numpy(np.float64)
            look: dict[str, Any] = {"color": colour(place), "marker": marker(place)}
            axes.plot(*where, linewidth=0, markersize=6, markeredgecolor="white", label=as_label(condition), **look)
            for row in _line_of(lines, condition, basis):
                ends = np.array([where[0].min(), where[0].max()])
                axes.plot(ends, row.intercept_s + row.slope_s_bit * ends, color=colour(place), linewidth=1.6, zorder=1)
        headed(axes, _TITLES[basis])
        axes.set_xlabel("Index of difficulty (bits)")
        grouped(axes)
    every[0].set_ylabel("Movement time (s)")
    every[0].set_ylim(bottom=0)
    legend(figure, every, min(len(conditions), 6))
    return figure


def _bases(points: pd.DataFrame) -> list[str]:
    return [basis for basis in _TITLES if (points["difficulty"] == basis).any()]


def _line_of(lines: pd.DataFrame, condition: str, basis: str) -> list[Any]:
    own = lines[(lines["condition"] == condition) & (lines["difficulty"] == basis) & lines["slope_s_bit"].notna()]
    return list(own.itertuples())
