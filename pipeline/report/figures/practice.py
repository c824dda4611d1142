"""The time of a trial over its number in the condition, with the curves of practice."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import (
    arms,
    as_label,
    colour,
    grouped,
    legend,
    marker,
    mean_and_interval,
    panels,
    styled,
)
from pipeline.report.figures.wording import listed
from pipeline.words.numbers import MINUS, number, percent

_POINTS_MAX = 16  # of a condition; more intervals side by side cannot be distinguished
_SHARE_MIN = 0.5  # of the participants: a point of the few who had the most trials is no point of the same people


def _practice_words(trials: pd.DataFrame, rows: pd.DataFrame, conditions: Sequence[str]) -> Words:
    """What each condition's curve begins with, and what doubling the trials makes of the time."""
    parts = []
    for condition in conditions:
        for row in _curve_of(rows, condition):
            change = row.ratio_when_trials_double - 1
            sign = MINUS if change < 0 else "+"
            parts.append(
                f"{condition} from {number(row.first_trial_s)} s, {sign}{percent(abs(change))} with every doubling of"
                f" the trials (n = {row.n})"
            )
    several = width_of_points(trials)
    taken = f", of {several} trials in a row taken together" if several > 1 else ""
    curves = f"Curves, by the power law of practice: {listed(parts)}." if parts else ""
    return Words(
        "Time per trial by the number of the trial in its condition. Points are geometric means over participants"
        f"{taken}, with 95 % intervals between participants. {curves}".strip(),
        f"Time per trial over the trial's number, a line of points and a curve for each condition. {curves}".strip(),
    )


@drawing(_practice_words)
@styled
def practice(trials: pd.DataFrame, rows: pd.DataFrame, conditions: Sequence[str]) -> Figure:
    """Time per trial over its number: geometric means with 95 % intervals, and each condition's curve.

    `trials` has the columns of `movements`, of the trials that count; `rows` those of `learning`.
    """
    figure, (axes,) = panels(height=3.2)
    width = width_of_points(trials)
    for place, condition in enumerate(conditions):
        own = trials[trials["condition"] == condition]
        if own.empty:
            continue
        look: dict[str, Any] = {"color": colour(place), "zorder": 3}
        at, middle, low, high = points(own, width)
        beside = (place - (len(conditions) - 1) / 2) * 0.12 * width
        axes.errorbar(
            at + beside,
            middle,
            yerr=arms(middle, low, high),
            fmt=marker(place),
            markersize=4,
            capsize=2,
            linewidth=0.9,
            label=as_label(condition),
            **look,
        )
        for row in _curve_of(rows, condition):
            grid = np.linspace(1, float(own["order"].max()), 200)
            axes.plot(grid, row.first_trial_s * grid**row.slope, color=colour(place), linewidth=1.8, zorder=2)
    axes.set_xlabel("Number of the trial in its condition")
    axes.set_ylabel("Time per trial (s)")
    axes.set_ylim(bottom=0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    grouped(axes)
    legend(figure, [axes], min(len(conditions), 6))
    return figure


def _curve_of(rows: pd.DataFrame, condition: str) -> list[Any]:
    known = rows[(rows["contrast"] == condition) & rows["first_trial_s"].notna() & rows["slope"].notna()]
    return list(known.itertuples())


def width_of_points(trials: pd.DataFrame) -> int:
    """How many trials in a row a point stands for."""
    return max(1, -(-int(trials["order"].max()) // _POINTS_MAX)) if len(trials) else 1


def points(trials: pd.DataFrame, width: int) -> tuple[np.ndarray[Any, Any], ...]:
    """Of one condition: places, geometric means over participants and ends of their 95 % intervals, (k,) each.

    A point needs half of the participants.
    """
    people = trials["participant"].nunique()
    by_point = trials.assign(point=(trials["order"] - 1) // width, log=np.log(trials["duration_s"]))
    rows = []
    for own in (own for _, own in by_point.groupby("point")):
        values = own.groupby("participant")["log"].mean().to_numpy(np.float64)
        if len(values) >= _SHARE_MIN * people:
            mean, low, high = mean_and_interval(values)
            rows.append((float(own["point"].iloc[0]) * width + (width + 1) / 2, mean, low, high))
    at, *logs = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return at, *map(np.exp, logs)
