"""Heat maps of an exploration over latency and noise: one panel per rate of the tracker and estimator."""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.cm
import matplotlib.colors
import matplotlib.patches
import matplotlib.ticker
import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import WIDTH, styled
from pipeline.report.glyphs import showable
from pipeline.simulation.tracker import Tracker
from pipeline.simulation.what_pays import MEASURES, MOST
from pipeline.statistics.arrays import FloatArray
from pipeline.words.numbers import NO_VALUE, number

_COLOURS = colormaps["cividis"]  # read alike by the colour-blind (Nuñez, Anderton and Renslow 2018)
_EMPTY, _OWN = "#e3e6e8", "#D55E00"
_TITLE_LENGTH = 24  # characters
_INK = (0.2126, 0.7152, 0.0722)  # weights of red, green and blue in a colour's brightness


@dataclass(frozen=True)
class Surface:
    """A column of the table, its label with the unit, and how its cells are written."""

    column: str
    label: str
    decimals: int = 1
    logarithmic: bool = False
    empty: str = NO_VALUE


ERROR = Surface("selection_rmse_mm", "Selection error, RMSE (mm)", logarithmic=True)
TIME = Surface("completion_time_s", "Completion time (s)")
PARTICIPANTS = Surface("participants_needed", "Participants needed", 0, logarithmic=True, empty=f"> {MOST}")
NAMES = dict(zip(MEASURES, ("selection error", "completion time"), strict=True))
"""The two measures in a sentence."""
_OUTLINED = "The outlined cell is the tracker closest to the study's own."


def _outcome_words(table: pd.DataFrame, surface: Surface, own: Tracker) -> Words:
    caption = f"{surface.label} over the tracker's latency and noise, one panel per rate and estimator. {_OUTLINED}"
    return Words(caption, _alt(surface))


@drawing(_outcome_words)
@styled
def outcome(table: pd.DataFrame, surface: Surface, own: Tracker) -> Figure:
    """Error or time over trackers, a row of panels for each estimator; `table` has the columns of `explore`."""
    return _surfaces(table, "estimator", surface, own)


def _participants_words(differences: pd.DataFrame, own: Tracker) -> Words:
    return Words(
        f"Participants needed to show a difference in {NAMES[differences['measure'].iloc[0]]}; in brackets where the"
        f" first of the two is the better one. {_OUTLINED} Grey: more than {MOST}, or no difference. The table has the"
        " range of each number.",
        _alt(PARTICIPANTS),
    )


@drawing(_participants_words)
@styled
def participants(differences: pd.DataFrame, own: Tracker) -> Figure:
    """Participants needed over trackers, a row of panels for each pair of estimators.

    `differences` has the columns of `explore_differences`, of one measure.
    """
    pair = differences["first"] + " or " + differences["second"]
    bracketed = differences["mean_difference"] < 0
    return _surfaces(differences.assign(pair=pair, bracketed=bracketed), "pair", PARTICIPANTS, own)


def _alt(surface: Surface) -> str:
    return f"Heat maps of {surface.label} over latency and noise; the values are in the table that follows."


def _surfaces(table: pd.DataFrame, panels: str, surface: Surface, own: Tracker) -> Figure:
    """One row of panels for each value of the text column `panels`, one panel for each rate; a frame marks `own`.

    All share a scale. A cell without a value is grey; one whose row is true in `bracketed` is written in brackets.
    """
    names, rates = list(dict.fromkeys(table[panels])), sorted(table["rate_hz"].unique())
    figure = Figure(figsize=(WIDTH, 0.75 + 1.3 * len(names)))
    grid = figure.subplots(len(names), len(rates), squeeze=False, sharex=True, sharey=True)
    scale = _scale(table[surface.column].to_numpy(np.float64, na_value=np.nan), surface)
    for name, line in zip(names, grid, strict=True):
        for rate, axes in zip(rates, line, strict=True):
            rows = table[(table[panels] == name) & (table["rate_hz"] == rate)]
            _panel(axes, rows, surface, scale, own if own.rate_hz == rate else None)
            axes.set_title(f"{_short(name)}, {rate:g} Hz")
        line[0].set_ylabel("Noise SD (mm)")
    for axes in grid[-1]:
        axes.set_xlabel("Latency (ms)")
    bar = figure.colorbar(matplotlib.cm.ScalarMappable(scale, _COLOURS), ax=grid.ravel().tolist(), aspect=30)
    bar.set_label(surface.label)
    if surface.logarithmic:
        bar.ax.yaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 3, 5, 7)))
        bar.ax.yaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        bar.ax.yaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    return figure


def _short(name: str) -> str:
    shown = showable(name)
    return shown if len(shown) <= _TITLE_LENGTH else f"{shown[: _TITLE_LENGTH - 1]}…"


def _scale(values: FloatArray, surface: Surface) -> matplotlib.colors.Normalize:
    """A scale from the smallest to the largest value, widened a little if they are equal."""
    known = values[np.isfinite(values) & ((values > 0) | (not surface.logarithmic))]
    low, high = (float(known.min()), float(known.max())) if len(known) else (1.0, 2.0)
    if surface.logarithmic:
        return matplotlib.colors.LogNorm(low, max(high, 1.1 * low))
    return matplotlib.colors.Normalize(low, max(high, low + 1e-9 + 0.01 * abs(low)))


def _panel(
    axes: Axes, rows: pd.DataFrame, surface: Surface, scale: matplotlib.colors.Normalize, own: Tracker | None
) -> None:
    """Draw one cell per tracker with its value: latency to the right, noise upwards."""
    latencies, noises = (sorted(map(float, rows[name].unique())) for name in ("latency_s", "noise_sd_mm"))
    values, bracketed = np.full((len(noises), len(latencies)), np.nan), np.zeros((len(noises), len(latencies)), bool)
    for row in rows.to_dict("records"):
        cell = noises.index(row["noise_sd_mm"]), latencies.index(row["latency_s"])
        value = row[surface.column]
        values[cell] = np.nan if pd.isna(value) else value
        bracketed[cell] = row.get("bracketed", False)
    _cells(axes, values, bracketed, surface, scale)
    axes.set_xticks(np.arange(len(latencies)) + 0.5, [f"{1000 * latency:g}" for latency in latencies])
    axes.set_yticks(np.arange(len(noises)) + 0.5, [f"{noise:g}" for noise in noises])
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)
    if own is not None:
        corner = latencies.index(own.latency_s), noises.index(own.noise_sd_mm)
        axes.add_patch(
            matplotlib.patches.Rectangle(corner, 1, 1, fill=False, edgecolor=_OWN, linewidth=2.2, clip_on=False)
        )


def _cells(
    axes: Axes,
    values: FloatArray,
    bracketed: npt.NDArray[np.bool_],
    surface: Surface,
    scale: matplotlib.colors.Normalize,
) -> None:
    axes.set_facecolor(_EMPTY)
    axes.pcolormesh(np.ma.masked_invalid(values), cmap=_COLOURS, norm=scale, edgecolors="white", linewidth=0.5)
    size = 8.0 if values.shape[1] <= 3 else 6.5
    for (row, column), value in np.ndenumerate(values):
        text = number(float(value), surface.decimals) if np.isfinite(value) else surface.empty
        text = f"({text})" if bracketed[row, column] else text
        ink = _ink(_COLOURS(scale(value))) if np.isfinite(value) else "black"
        axes.text(column + 0.5, row + 0.5, text, ha="center", va="center", color=ink, fontsize=size)


def _ink(colour: tuple[float, float, float, float]) -> str:
    """Black or white, whichever is easier to read on a colour."""
    return "black" if float(np.dot(_INK, colour[:3])) > 0.42 else "white"
