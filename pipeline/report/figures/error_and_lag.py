"""How well estimators follow the hand: error and lag, side by side and against each other."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.rmse_axis import along_rmse, lag_label
from pipeline.report.figures.style import (
    GREY,
    MARKS_MAX,
    PALE,
    arms_of,
    as_label,
    colour,
    draw_mean,
    finite,
    headed,
    legend,
    marker,
    mean_and_interval,
    panels,
    styled,
)
from pipeline.words.accuracy_reference import SMOOTHED, reference_phrase
from pipeline.words.numbers import milliseconds, number
from pipeline.words.phrases import counted, listing


def _errors_words(accuracy: pd.DataFrame, contradicted: str = "") -> Words:
    """Which estimators have the smallest and the largest error, and which the smallest lag, where that is known.

    `contradicted` says why none is called the best although there is a reference.
    """
    n = counted(accuracy["session"].nunique(), "session")
    standard = reference_phrase(accuracy["reference"])
    if SMOOTHED in standard:
        return Words(
            f"Distance from {standard} (left) and lag behind them (right) of each estimator over {n}: small marks are"
            " sessions, large ones their mean with its 95 % interval. What the sensors have wrong together is in"
            " neither.",
            f"Dot plot of distance and lag from {standard} by estimator over {n}.",
        )
    rmse = accuracy.groupby("estimator", sort=False)["rmse_mm"].mean().dropna().sort_values(kind="stable")
    lag = accuracy.groupby("estimator", sort=False)["lag_s"].mean().dropna()
    summary = contradicted
    if len(rmse) and not contradicted:
        summary = f"Smallest RMSE: {rmse.index[0]}, {number(rmse.iloc[0])} mm"
        summary += f"; largest: {rmse.index[-1]}, {number(rmse.iloc[-1])} mm." if len(rmse) > 1 else "."
    if len(lag) and not contradicted:
        nearest = int(np.argmin(np.abs(lag.to_numpy(np.float64))))
        summary += f" Smallest lag: {lag.index[nearest]}, {milliseconds(float(lag.iloc[nearest]))} ms."
    return Words(
        f"Error (left) and lag (right) of each estimator over {n}: small marks are sessions, large ones their mean with"
        f" its 95 % interval. {summary}",
        f"Dot plot of RMSE and lag by estimator over {n}. {summary}",
    )


@drawing(_errors_words)
@styled
def errors(accuracy: pd.DataFrame, contradicted: str = "") -> Figure:
    """RMSE and lag of every estimator: one mark per session, and the mean over sessions with its 95 % t interval."""
    names, standard = list(dict.fromkeys(accuracy["estimator"])), reference_phrase(accuracy["reference"])
    figure, axes = panels(1, 2, 0.9 + 0.26 * len(names), sharey=True)
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
    along_rmse(axes[0], accuracy["rmse_mm"], standard)
    what = "Distance" if SMOOTHED in standard else "Error"
    headed(axes[0], f"{what} (n = {counted(accuracy['session'].nunique(), 'session')})")
    axes[1].axvline(0, color=GREY, linewidth=0.8)
    axes[1].set_xlabel(lag_label(standard))
    headed(axes[1], "Lag")
    for panel in axes:
        panel.grid(axis="y", color=PALE, linewidth=0.8)
        panel.set_axisbelow(True)
    return figure


def _lag_and_error_words(accuracy: pd.DataFrame, contradicted: str = "") -> Words:
    """Which estimators no other beats in both error and lag, where that is known; `contradicted` as above."""
    n, standard = counted(accuracy["session"].nunique(), "session"), reference_phrase(accuracy["reference"])
    if SMOOTHED in standard:
        return Words(
            f"Lag behind {standard} against the distance from them: means over {n} with 95 % intervals; small marks are"
            " sessions.",
            f"Scatter plot of lag against distance from {standard} by estimator, {n}.",
        )
    known = accuracy[accuracy["lag_s"].notna() & accuracy["rmse_mm"].notna()]
    means = known.groupby("estimator", sort=False)[["rmse_mm", "lag_s"]].mean()
    cost = means.assign(lag_s=means["lag_s"].abs()).to_numpy(np.float64)
    beaten = [bool(np.any(np.all(cost <= own, axis=1) & np.any(cost < own, axis=1))) for own in cost]
    best = [str(name) for name, worse in zip(means.index, beaten, strict=True) if not worse]
    summary = f"No other estimator has both less error and less lag than {listing(best)}." if best else ""
    summary = contradicted or summary
    n = counted(known["session"].nunique(), "session")
    return Words(
        f"Lag against error: means over {n} with 95 % intervals; small marks are sessions. Better is further left and"
        f" closer to zero. {summary}",
        f"Scatter plot of lag against RMSE by estimator, {n}. {summary}",
    )


@drawing(_lag_and_error_words)
@styled
def lag_and_error(accuracy: pd.DataFrame, contradicted: str = "") -> Figure:
    """Lag against RMSE, one mark per estimator: means over sessions with 95 % t intervals; small marks are sessions."""
    figure, (axes,) = panels(height=2.9)
    standard = reference_phrase(accuracy["reference"])
    for index, (estimator, rows) in enumerate(accuracy.groupby("estimator", sort=False)):
        known = rows[rows["lag_s"].notna() & rows["rmse_mm"].notna()]
        if known.empty:
            continue
        rmse, lag = finite(known["rmse_mm"]), 1000 * finite(known["lag_s"])
        axes.scatter(rmse, lag, s=9, color=colour(index), alpha=0.4, linewidth=0, rasterized=len(accuracy) > MARKS_MAX)
        (x, *ends_x), (y, *ends_y) = mean_and_interval(rmse), mean_and_interval(lag)
        axes.errorbar(
            [x],
            [y],
            xerr=arms_of(x, *ends_x),
            yerr=arms_of(y, *ends_y),
            fmt=marker(index),
            color=colour(index),
            markersize=8,
            markeredgecolor="white",
            capsize=3,
            label=f"{as_label(estimator)} (n = {len(known)})",
        )
    axes.axhline(0, color=GREY, linewidth=0.8)
    along_rmse(axes, accuracy["rmse_mm"], standard)
    axes.set_ylabel(lag_label(standard))
    legend(figure, [axes], 1, "outside right center")
    return figure
