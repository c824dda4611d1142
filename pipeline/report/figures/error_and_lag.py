"""How well estimators follow the hand: error, lag, and what one costs the other."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.rmse_axis import LAG_LABEL, along_rmse
from pipeline.report.figures.style import (
    GREY,
    MARKS_MAX,
    PALE,
    as_label,
    colour,
    draw_mean,
    finite,
    legend,
    marker,
    mean_and_interval,
    panels,
    styled,
)
from pipeline.words import counted, listing, number, seconds


def _errors_words(accuracy: pd.DataFrame) -> Words:
    """Which estimator errs least and most, and which is nearest to no lag."""
    n = counted(accuracy["session"].nunique(), "session")
    rmse = accuracy.groupby("estimator", sort=False)["rmse_mm"].mean().dropna().sort_values(kind="stable")
    lag = accuracy.groupby("estimator", sort=False)["lag_s"].mean().dropna()
    told = ""
    if len(rmse):
        told = f"Least RMSE: {rmse.index[0]}, {number(rmse.iloc[0])} mm"
        told += f"; most: {rmse.index[-1]}, {number(rmse.iloc[-1])} mm." if len(rmse) > 1 else "."
    if len(lag):
        nearest = int(np.argmin(np.abs(lag.to_numpy(np.float64))))
        told += f" Least lag: {lag.index[nearest]}, {seconds(float(lag.iloc[nearest]))} ms."
    return Words(
        f"Error (left) and lag (right) of each estimator over {n}: small marks are sessions, large ones their mean with"
        f" its 95 % interval. {told}",
        f"Dot plot of RMSE and lag by estimator over {n}. {told}",
    )


@drawing(_errors_words)
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
                draw_mean(panel, index, known, (colour(index), marker(index)), upright=False)
    axes[0].set_yticks(range(len(names)), [as_label(estimator) for estimator in names])
    axes[0].invert_yaxis()
    along_rmse(axes[0], accuracy["rmse_mm"])
    axes[0].set_title(f"Error (n = {counted(accuracy['session'].nunique(), 'session')})")
    axes[1].axvline(0, color=GREY, linewidth=0.8)
    axes[1].set_xlabel(LAG_LABEL)
    axes[1].set_title("Lag")
    for panel in axes:
        panel.grid(axis="y", color=PALE, linewidth=0.8)
        panel.set_axisbelow(True)
    return figure


def _lag_and_error_words(accuracy: pd.DataFrame) -> Words:
    """Which estimators no other beats in both."""
    known = accuracy[accuracy["lag_s"].notna() & accuracy["rmse_mm"].notna()]
    means = known.groupby("estimator", sort=False)[["rmse_mm", "lag_s"]].mean()
    cost = means.assign(lag_s=means["lag_s"].abs()).to_numpy(np.float64)
    beaten = [bool(np.any(np.all(cost <= one, axis=1) & np.any(cost < one, axis=1))) for one in cost]
    best = [str(name) for name, worse in zip(means.index, beaten, strict=True) if not worse]
    told = f"No other has both less error and less lag than {listing(best)}." if best else ""
    n = counted(known["session"].nunique(), "session")
    return Words(
        f"What less lag costs in error: means over {n} with 95 % intervals, small marks are sessions. To the left and"
        f" near zero is better. {told}",
        f"Scatter plot of lag against RMSE by estimator, {n}. {told}",
    )


@drawing(_lag_and_error_words)
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
            label=f"{as_label(estimator)} (n = {len(known)})",
        )
    axes.axhline(0, color=GREY, linewidth=0.8)
    along_rmse(axes, accuracy["rmse_mm"])
    axes.set_ylabel(LAG_LABEL)
    legend(figure, [axes], 1, "outside right center")
    return figure
