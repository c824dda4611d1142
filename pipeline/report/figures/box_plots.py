"""A questionnaire as box plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.style import (
    MARKS_MAX,
    as_label,
    colour,
    finite,
    grouped,
    legend,
    marker,
    panels,
    styled,
)
from pipeline.report.figures.wording import counts_of_columns
from pipeline.words.names import short_label
from pipeline.words.phrases import counted, listing


def _workload_words(wide: Mapping[str, pd.DataFrame]) -> Words:
    """In how many scales each condition has the lowest median."""
    conditions = list(next(iter(wide.values())).columns)
    names = listing([short_label(name) for name in wide])
    head = (
        f"Ratings by scale and condition ({counts_of_columns(wide)} a box): boxes show the middle half of the"
        " participants, the thick line is the median, marks are single participants."
    )
    alt = f"Box plots of {names} for {listing(conditions)}."
    if len(conditions) > 1:
        medians = _lowest_medians(wide, conditions)
        return Words(f"{head} {medians}", f"{alt} {medians}")
    return Words(head, alt)


def _lowest_medians(wide: Mapping[str, pd.DataFrame], conditions: Sequence[str]) -> str:
    """`The lowest median is under kinect in 1 and under fusion in 4 of 6 scales; …`."""
    scales_of = dict.fromkeys(conditions, 0)
    for table in wide.values():
        medians = table.median()
        lowest = medians.index[medians == medians.min()]
        if len(lowest) == 1:
            scales_of[str(lowest[0])] += 1
    lowest_in = [f"under {name} in {count}" for name, count in scales_of.items() if count]
    if not lowest_in:
        return "In every scale the lowest median is that of two conditions or more."
    counts = listing(lowest_in)
    ties = "; in the others two or more share it" if sum(scales_of.values()) < len(wide) else ""
    return f"The lowest median is {counts} of {counted(len(wide), 'scale')}{ties}."


@drawing(_workload_words)
@styled
def workload(wide: Mapping[str, pd.DataFrame]) -> Figure:
    """Box plots of every scale of a questionnaire, one box per condition, with the ratings on them (paper, Fig. 14)."""
    figure, (axes,) = panels(height=3.2)
    conditions = list(next(iter(wide.values())).columns)
    width = 0.8 / len(conditions)
    for index, condition in enumerate(conditions):
        shade = colour(index)
        centres = np.arange(len(wide)) + (index - (len(conditions) - 1) / 2) * width
        ratings = [finite(table[condition]) for table in wide.values()]
        axes.boxplot(
            ratings,
            positions=centres,
            widths=0.75 * width,
            showfliers=False,
            patch_artist=True,
            boxprops={"facecolor": shade, "alpha": 0.3, "edgecolor": shade},
            medianprops={"color": shade, "linewidth": 2.2},
            whiskerprops={"color": shade},
            capprops={"color": shade},
            manage_ticks=False,
        )
        many = sum(map(len, ratings)) > MARKS_MAX
        for centre, values in zip(centres, ratings, strict=True):
            spread = np.linspace(-0.22, 0.22, len(values)) * width
            look: dict[str, Any] = {"color": shade, "marker": marker(index), "alpha": 0.8, "rasterized": many}
            axes.scatter(centre + spread, np.sort(values), s=9, **look)
        axes.plot([], [], color=shade, marker=marker(index), linewidth=5, alpha=0.6, label=as_label(condition))
    length = max(10, 84 // len(wide))
    axes.set_xticks(np.arange(len(wide)), [as_label(short_label(measure), length) for measure in wide])
    if len(wide) > 8:
        axes.tick_params(axis="x", rotation=60)
    axes.set_ylabel("Rating")
    grouped(axes)
    legend(figure, figure.axes, min(len(conditions), 6))
    return figure
