"""Calibration: whether the standard deviation that an estimator states fits its errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import BLACK, GREY, as_label, colour, legend, lowest, marker, multiples, styled
from pipeline.report.figures.wording import listed
from pipeline.statistics.arrays import FloatArray
from pipeline.words.numbers import percent
from pipeline.words.phrases import counted

_FAINT: dict[str, Any] = {"color": GREY, "linewidth": 0.6, "alpha": 0.5}
_BAND: dict[str, Any] = {"color": GREY, "linewidth": 0, "alpha": 0.35}
_ONE_ROW = 4  # as many panels stand in one row
LINES_MAX = 60  # sessions with a line each; of more, a band is drawn


def _calibration_words(table: pd.DataFrame) -> Words:
    """The share of errors within 1.96 SD, where a normal distribution has 95 %."""
    parts = []
    for name, rows in table.groupby("estimator", sort=False):
        k, share = shares(rows)
        at = int(np.argmin(np.abs(k - 1.96)))
        parts.append(f"{name} {percent(float(share[at]), 0)}")
    summary = f"Within 1.96 SD, where a normal distribution has 95 %: {listed(parts, ', ')}."
    sessions = table["session"].nunique()
    n = counted(sessions, "session")
    single = "band: nine of ten sessions" if sessions > LINES_MAX else "thin lines: single sessions"
    return Words(
        f"Does the stated SD fit the errors? The share of errors within k stated SDs over {n} (pooled; {single}), and"
        " that of a normal distribution (dashed). Below the dashed line errors are larger than stated, above it"
        f" smaller. {summary}",
        f"Share of errors within k stated SDs by estimator, {n}. {summary}",
    )


@drawing(_calibration_words)
@styled
def calibration(table: pd.DataFrame) -> Figure:
    """Share of errors within k stated SDs, one small panel per estimator: pooled, by session, and of a normal.

    `table` has the columns of `calibration`: counts by session, so that shares are of all instants, not means of means.
    """
    from scipy import stats

    names = list(dict.fromkeys(table["estimator"]))
    figure, every, across = multiples(len(names), 1.45, a_row=4 if len(names) <= _ONE_ROW else 3)
    grid = np.linspace(0, table["percent_of_sd"].max() / 100, 100)
    many = table["session"].nunique() > LINES_MAX
    for index, (axes, estimator) in enumerate(zip(every, names, strict=True)):
        rows = table[table["estimator"] == estimator]
        axes.plot(grid, 100 * (2 * stats.norm.cdf(grid) - 1), color=BLACK, linewidth=1, linestyle=(0, (4, 2)))
        if many:
            axes.fill_between(*nine_of_ten(rows), **_BAND)
        elif rows["session"].nunique() > 1:
            axes.plot(*_one_line(rows), **_FAINT)
        k, share = shares(rows)
        look: dict[str, Any] = {"color": colour(index), "marker": marker(index), "markersize": 4}
        axes.plot(k, 100 * share, **look)
        axes.set_title(f"{as_label(estimator, 60 // across)} (n = {rows['session'].nunique()})", fontsize=8.5)
        if index % across == 0:
            axes.set_ylabel("Within k SD (%)")
    every[0].plot([], [], color=BLACK, linewidth=1, linestyle=(0, (4, 2)), label="normal")
    every[0].plot([], [], color=colour(0), marker=marker(0), markersize=4, label="all sessions")
    if many:
        every[0].fill_between([], [], [], label="nine of ten sessions", **_BAND)
    else:
        every[0].plot([], [], label="one session", **_FAINT)
    legend(figure, figure.axes, 3)
    every[0].set_ylim(0, 102)
    every[0].set_xlim(left=0)
    for axes in lowest(every, across):
        axes.set_xlabel("k (stated SDs)")
    return figure


def _by_session(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """k (k,), and each session's share in percent (k, sessions)."""
    counts = rows.pivot(index="percent_of_sd", columns="session", values=["within", "n"]).astype("float64")
    return counts.index.to_numpy(np.float64) / 100, 100 * (counts["within"] / counts["n"]).to_numpy()


def nine_of_ten(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray, FloatArray]:
    """k, and the 5th and 95th percentiles of the sessions' shares in percent."""
    k, share = _by_session(rows)
    low, high = np.nanpercentile(share, [5, 95], axis=1)
    return k, low, high


def _one_line(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """k and share in percent of all sessions, NaN between them: one line is drawn faster than many."""
    grid, share = _by_session(rows)
    k = np.broadcast_to(grid[:, None], share.shape)
    parted = [np.vstack([part, np.full(part.shape[1], np.nan)]).T.ravel() for part in (k, share)]
    return parted[0], parted[1]


def shares(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    """k, and the share of all instants and axes within k stated SDs, of one estimator's rows of `calibration`."""
    summed = rows.groupby("percent_of_sd")[["within", "n"]].sum()
    k: FloatArray = summed.index.to_numpy(np.float64) / 100
    share: FloatArray = summed["within"].to_numpy(np.float64) / summed["n"].to_numpy(np.float64)
    return k, share
