"""Power against the number of participants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import matplotlib as mpl
import matplotlib.ticker
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.style import GREY, colour, legend, marker, panels, styled
from pipeline.statistics.arrays import FloatArray


@dataclass(frozen=True)
class Labels:
    """The title of a figure, and the label of its value axis."""

    title: str
    value: str


@styled
def power(table: pd.DataFrame, series: Mapping[str, str], target: float, needed: int | None, labels: Labels) -> Figure:
    """Power against the number of participants, for the columns of `table` that `series` labels.

    A column with an interval, `<column>_low` and `<column>_high`, was simulated and is drawn as marks with these; any
    other is a closed form and drawn as a line.
    """
    figure, (axes,) = panels(height=3.8)
    n = table["participants"].to_numpy(np.float64)
    for index, (column, label) in enumerate(series.items()):
        values, shade = table[column].to_numpy(np.float64), colour(index)
        if f"{column}_low" in table:
            _with_intervals(axes, n, table, column, (shade, marker(index), label))
        else:
            axes.plot(n, values, color=shade, label=label)
    axes.axhline(target, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
    axes.annotate(f"{target:g}", (n[0], target), (0, 3), textcoords="offset points", color=GREY)
    if needed is not None:
        axes.axvline(needed, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)), zorder=1)
        axes.annotate(f"{needed} participants", (needed, 0), (4, 4), textcoords="offset points", color=GREY)
    axes.set_ylim(0, 1.02)
    axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(integer=True))
    axes.set_title(labels.title)
    axes.set_xlabel("Complete participants")
    axes.set_ylabel(labels.value)
    legend(figure, [axes], 2, "outside lower left")
    return figure


def _with_intervals(axes: Axes, n: FloatArray, table: pd.DataFrame, column: str, look: tuple[str, str, str]) -> None:
    """Draw simulated values with their intervals, joined by a thin line."""
    shade, mark, label = look
    values, low, high = (table[f"{column}{end}"].to_numpy(np.float64) for end in ("", "_low", "_high"))
    axes.errorbar(
        n,
        values,
        yerr=np.maximum(0, [values - low, high - values]),
        fmt=mark,
        linestyle=(0, (2, 2)),
        color=shade,
        label=label,
        markersize=4,
        capsize=3,
        linewidth=0.8,
    )
