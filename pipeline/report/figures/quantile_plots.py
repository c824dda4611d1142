"""Normal Q-Q plots: values whose normality a test assumes, beside those of a normal distribution."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.named_marks import name_marks, people
from pipeline.report.figures.style import COLOURS, GREY, MARKS_MAX, PALE, as_label, headed, lowest, multiples, styled
from pipeline.report.figures.wording import listed
from pipeline.study.statistical_tests import TESTS
from pipeline.words.names import measure_label
from pipeline.words.numbers import MINUS
from pipeline.words.phrases import listing

SAMPLE = ["measure", "test", "kind", "of", "logarithms"]
"""The columns of `normal_quantiles` that tell its samples apart."""
_NAMED = 4  # participants of a panel: more make its sentence a list
_LINE = 30  # characters of a panel's title


class Panel(NamedTuple):
    """A sample of the table `normal_quantiles`: what it is of, and its rows."""

    measure: str
    title: str
    rows: pd.DataFrame

    @property
    def outside(self) -> pd.DataFrame:
        """The rows outside the band."""
        return self.rows[self.rows["outside"] == 1]


def samples(table: pd.DataFrame) -> list[Panel]:
    """The samples of the table `normal_quantiles` in their order, a panel each."""
    found = [([str(part) for part in name], rows) for name, rows in table.groupby(SAMPLE, sort=False)]
    alike = Counter((measure, *others) for (measure, _, *others), _ in found)
    panels = []
    for (measure, test, kind, of, logarithms), rows in found:
        label = measure_label(measure) + (", logarithms" if int(logarithms) else "")
        several = alike[measure, kind, of, logarithms] > 1
        panels.append(Panel(label, _title(kind, of) + (f", {TESTS[test].label}" if several else ""), rows))
    return panels


def _title(kind: str, of: str) -> str:
    what = of.replace(" - ", f" {MINUS} ") if kind == "differences" else of
    return f"residuals of {of.replace(':', ' × ')}" if kind == "residuals" else what


def _words(table: pd.DataFrame) -> Words:
    """Which panels have values outside their band, and whose."""
    every = samples(table)
    leaving = [panel for panel in every if len(panel.outside)]
    alone = len(every) == 1
    if leaving:
        where = "" if alone else f" in {len(leaving)} of {len(every)} panels"
        found = f"Values lie outside the band{where}: " + listed(
            f"{panel.measure}, {panel.title} ({_who(panel)})" for panel in leaving
        )
    else:
        found = f"No value lies outside the band{'' if alone else f' in any of the {len(every)} panels'}"
    caption = (
        "Q-Q plots of the values that tests assume to be normal: each value, as so many SDs from the mean of its"
        " panel, against what the normal distribution gives for its rank. Normal values follow the line."
        f" {found}. Grey: pointwise 95 % band of normal values"
        " that are standardised by their own mean and SD (beta distribution of ordered values, narrowed by what mean"
        " and SD take up). About 1 in 20 lies outside by chance; several, or a bend, speak against a normal"
        " distribution."
    )
    what = listed(f"{panel.measure}, {panel.title}" for panel in every)
    return Words(caption, f"Normal Q-Q plots, one panel each: {what}. {found}.")


def _who(panel: Panel) -> str:
    people = list(dict.fromkeys(panel.outside["participant"]))
    names = f": {listing(people)}" if len(people) <= _NAMED else ""
    return f"{len(panel.outside)} of {len(panel.rows)}{names}"


@drawing(_words)
@styled
def normality(table: pd.DataFrame) -> Figure:
    """Q-Q plots of the table `normal_quantiles`, a small panel for each sample: the values, the line, and the band."""
    every = samples(table)
    figure, axes, across = multiples(len(every), 1.5)
    for place, (panel, chart) in enumerate(zip(every, axes, strict=True)):
        rows = panel.rows.sort_values("quantile")
        chart.fill_between(rows["quantile"], rows["band_low"], rows["band_high"], color=PALE, linewidth=0)
        ends = [rows["quantile"].min(), rows["quantile"].max()]
        chart.plot(ends, ends, color=GREY, linewidth=0.8)
        for outside, shade, mark in ((0, COLOURS[0], "o"), (1, COLOURS[1], "D")):
            some = rows[rows["outside"] == outside]
            marks = chart.scatter(
                some["quantile"],
                some["standardised"],
                s=11 if outside == 0 else 20,
                color=shade,
                marker=mark,
                linewidths=0,
                zorder=3,
                rasterized=len(table) > MARKS_MAX,
            )
            whose = zip(some["participant"], some["cell"], strict=True)
            names = [f"{person}, {cell}" if isinstance(cell, str) else str(person) for person, cell in whose]
            name_marks(marks, people(names, some["value"]))
        title = f"{as_label(panel.measure, _LINE)}\n{as_label(panel.title, _LINE)}"
        headed(chart, title, fontsize=8)
        if place % across == 0:
            chart.set_ylabel("Standardised")
    for chart in lowest(axes, across):
        chart.set_xlabel("Normal quantile")
    return figure
