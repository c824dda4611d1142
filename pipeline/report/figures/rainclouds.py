"""Rainclouds: every participant in every condition, and their differences, for a measure or a questionnaire."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.named_marks import name_marks, people
from pipeline.report.figures.style import (
    BLACK,
    COLOURS,
    GREY,
    MARKS_MAX,
    as_label,
    colour,
    draw_mean,
    finite,
    grouped,
    headed,
    marker,
    multiples,
    panels,
    styled,
)
from pipeline.report.figures.wording import complete_counts, listed, mean_with_interval, spaced
from pipeline.statistics import T_OF_SHARES, WILSON, T
from pipeline.statistics.arrays import FloatArray
from pipeline.study.measures import score_limits
from pipeline.words.names import measure_label, short_label, unit_of
from pipeline.words.numbers import MINUS, number
from pipeline.words.phrases import counted

_CLOUD = 0.3  # height of a density, where conditions are 1 apart
_BOX = 0.07  # half the width of the line at the median
_BESIDE = 0.1  # from a condition's place to that of its mean
_INTERVALS = {
    WILSON: " (Wilson's, of answers 0 or 1)",
    T_OF_SHARES: " (t intervals, cut at 0 and 1, beyond which no share can be)",
}


def _paired_words(wide: pd.DataFrame, measure: str, shares: bool = False) -> Words:
    """The means, the differences, and how many participants have the same sign."""
    method = method_of(wide, measure, shares)
    label, unit, complete = measure_label(measure), spaced(unit_of(measure)), wide.dropna()
    means = listed(
        f"{name} {mean_with_interval(finite(wide[name]), method)}{unit} (n = {wide[name].count()})"
        for name in wide.columns
    )
    between = one_condition_each(wide)
    who = f"{counted(len(wide), 'participant')}, one condition each" if between else _complete_count(complete)
    head = f"{label} by condition, {who}. Means with 95 % intervals: {means}."
    alt = f"{label}: one raincloud per condition. {means}."
    if len(wide.columns) > 1 and len(complete) > 1:
        differences = _differences_words(complete, unit)
        head += f" {differences}"
        alt += f" {differences}"
    legend_text = (
        " Small marks are participants"
        + (", joined by lines" if len(wide.columns) > 1 and not between else "")
        + "; shapes show their density, pale bars the middle half of them, large marks the means with 95 % intervals"
        f"{interval_words(wide, measure, shares)}."
    )
    if draws_within(wide, method):
        legend_text += (
            f" The thick arms are of the {len(complete)} complete participants; they leave out how far people differ,"
            " as paired tests do."
        )
    return Words(head + legend_text, alt)


def interval_words(wide: pd.DataFrame, measure: str, shares: bool = False) -> str:
    """After "means with 95 % intervals": which kind, where it is not t, and what the thick arms are."""
    method = method_of(wide, measure, shares)
    thick = "; thick arms: within-participant 95 % intervals, Cousineau-Morey" if draws_within(wide, method) else ""
    return f"{_INTERVALS.get(method, '')}{thick}"


def one_condition_each(wide: pd.DataFrame) -> bool:
    """Whether every participant has a value in only one of several conditions, so that nobody is incomplete."""
    return len(wide.columns) > 1 and int(wide.notna().sum(axis=1).max()) <= 1


def draws_within(wide: pd.DataFrame, method: str) -> bool:
    """Whether some participants met every condition, so that intervals within participants exist.

    Differences of single answers 0 or 1 are no measurements, and have none.
    """
    return method != WILSON and len(wide.columns) > 1 and len(wide.dropna()) > 1


def method_of(wide: pd.DataFrame, measure: str, shares: bool = False) -> str:
    """How the intervals of a measure's means are computed; `shares`: it is of each participant's answers 0 or 1."""
    from pipeline.statistics.descriptive import interval_method

    return interval_method(finite(wide), shares, unit_of(measure) != "")


def _complete_count(complete: pd.DataFrame) -> str:
    return f"{counted(len(complete), 'complete participant')}"


def _differences_words(complete: pd.DataFrame, unit: str) -> str:
    first, *others = complete.columns
    parts = []
    for other in others:
        difference = finite(complete[first] - complete[other])
        lower = int(np.sum(difference > 0))
        mean = mean_with_interval(difference)
        parts.append(f"{first} {MINUS} {other}: {mean}{unit}, {lower} of {len(difference)} lower under {other}")
    return f"Right, differences: {listed(parts)}."


@drawing(_paired_words)
@styled
def paired(wide: pd.DataFrame, measure: str, shares: bool = False) -> Figure:
    """Rainclouds of a measure, one per condition, and beside them the differences from the first condition.

    `wide` has one row per participant and one column per condition, as `participant_means` gives it. A raincloud shows
    the participants, joined by lines if complete, their density and quartiles, and the mean with its 95 % interval and,
    of conditions that the same people met, the Cousineau-Morey interval within participants. `shares`: each value is a
    participant's share of answers 0 or 1.
    """
    complete = wide.dropna()
    compared = len(wide.columns) > 1 and len(complete) > 1
    ratio = [len(wide.columns) + 0.4, len(wide.columns) - 0.4]
    options: dict[str, Any] = {"gridspec_kw": {"width_ratios": ratio}} if compared else {}
    figure, axes = panels(1, 2 if compared else 1, 3.1, **options)
    rainclouds(axes[0], wide, Drawn(method_of(wide, measure, shares), unit_of(measure)))
    from_zero(axes[0], [wide])
    axes[0].set_ylabel(as_label(measure_label(measure)))
    headed(axes[0], f"Participants (n = {len(wide) if one_condition_each(wide) else f'{len(complete)} complete'})")
    if compared:
        unit = unit_of(measure)
        _differences(axes[1], complete, unit)
        axes[1].set_ylabel(as_label(f"Difference ({unit})") if unit else "Difference")
        headed(axes[1], f"Differences (n = {len(complete)})")
    return figure


def _scales_words(wide: Mapping[str, pd.DataFrame]) -> Words:
    """How many participants there are, and in which scale the conditions differ most."""
    conditions = next(iter(wide.values())).columns
    what = "All scales" if len(wide) > 1 else short_label(next(iter(wide)))
    head = f"{what} by participant ({complete_counts(wide)}), drawn like the measures above."
    alt = f"One panel of rainclouds per scale: {listed(short_label(name) for name in wide)}."
    if len(conditions) > 1:
        furthest = _furthest(wide)
        return Words(f"{head} {furthest}", f"{alt} {furthest}")
    return Words(head, alt)


def _furthest(wide: Mapping[str, pd.DataFrame]) -> str:
    """The scale whose means lie furthest apart."""
    spread: dict[str, tuple[float, pd.Series]] = {}
    for measure, table in wide.items():
        means = table.dropna().mean()
        if means.notna().all() and len(means):
            spread[measure] = (float(means.max() - means.min()), means)
    if not spread:
        return "No scale has a participant with every condition."
    measure, (apart, means) = max(spread.items(), key=lambda item: item[1][0])
    if apart == 0:
        return "The means are the same in every scale."
    where = f"differ most in {short_label(measure).lower()}" if len(wide) > 1 else "are"
    return (
        f"The means {where}: {number(means.max())} under {means.idxmax()},"
        f" {number(means.min())} under {means.idxmin()}."
    )


@drawing(_scales_words)
@styled
def scales(wide: Mapping[str, pd.DataFrame]) -> Figure:
    """The same for every scale of a questionnaire: one small panel per scale, all with the same axis."""
    figure, every, across = multiples(len(wide), 1.9, a_row=3, sharex=False)
    for index, (axes, (measure, table)) in enumerate(zip(every, wide.items(), strict=True)):
        rainclouds(axes, table, Drawn(method_of(table, measure)), small=True)
        headed(axes, f"{as_label(short_label(measure), 24)} (n = {len(table.dropna())})")
        if index % across == 0:
            axes.set_ylabel("Rating")
    limits = {score_limits(name) for name in wide}
    known = limits.pop() if len(limits) == 1 else None
    if known is None:
        from_zero(every[0], wide.values())
    else:
        low, high = known
        every[0].set_ylim(low, high + 0.04 * (high - low))  # room for a mark at the highest score
    return figure


class Drawn(NamedTuple):
    """How the intervals of means are computed, the measure's unit, and which colours."""

    method: str = T
    unit: str = ""
    looks: Sequence[int] = ()


def rainclouds(
    axes: Axes, wide: pd.DataFrame, drawn: Drawn, small: bool = False, joined: pd.DataFrame | None = None
) -> None:
    """One raincloud per condition: participants in the middle, density outside, mean and quartiles between.

    Lines join the values of the complete participants, or of those in `joined`, from each to the next that is there.
    """
    at = np.arange(len(wide.columns))
    complete = wide.dropna().to_numpy(np.float64)
    lines = complete if joined is None else joined.to_numpy(np.float64)
    if len(at) > 1 and len(lines):
        faint: dict[str, Any] = {"alpha": 0.45, "linewidth": 0.7, "zorder": 1, "rasterized": lines.size > MARKS_MAX}
        axes.plot(at, lines.T, color=GREY, **faint)
    from pipeline.statistics.estimation import within_intervals

    bounded = drawn.method == T_OF_SHARES
    within = within_intervals(complete, bounded=bounded) if draws_within(wide, drawn.method) else [None] * len(at)
    looks = drawn.looks or range(len(at))
    for index, condition in enumerate(wide.columns):
        side = -1 if index == 0 and len(at) > 1 else 1  # the lines from the first condition lead to the right
        ends = within[index]
        if ends is not None:  # in two tiers, as Baguley (2012) has them: inside the interval of the mean itself
            axes.vlines(
                index + side * _BESIDE, *ends, color=colour(looks[index]), linewidth=3.5 if small else 5, zorder=4
            )
        _raincloud(axes, index, side, wide[condition], (colour(looks[index]), marker(looks[index])), drawn)
    length = max(8, (24 if small else 40) // len(at))
    axes.set_xticks(at, [as_label(condition, length) for condition in wide.columns])
    axes.set_xlim(-0.6, len(at) - 0.4)
    grouped(axes)


def from_zero(axes: Axes, tables: Iterable[pd.DataFrame]) -> None:
    """Let the axis begin at zero unless a value is below. Call it last, since it ends matplotlib's own scaling."""
    if not any((finite(table) < 0).any() for table in tables):
        axes.set_ylim(bottom=0)


def _raincloud(axes: Axes, at: float, side: int, of: pd.Series, look: tuple[str, str], drawn: Drawn) -> None:
    """Participants, density, quartiles and mean of one condition, of values by participant."""
    known = of[np.isfinite(of.to_numpy(np.float64))]
    values = finite(known)
    if not len(values):
        return
    shade = look[0]
    rasterized = len(values) > MARKS_MAX
    marks = axes.scatter(
        np.full(len(values), at), values, s=13, color=shade, alpha=0.55, zorder=2, rasterized=rasterized
    )
    name_marks(marks, people(known.index, values, drawn.unit))
    density = _density(values)
    if density is not None:
        grid, height = density
        edge = at + side * 0.2
        axes.fill_betweenx(grid, edge, edge + side * _CLOUD * height, color=shade, alpha=0.25, linewidth=0)
    if len(values) > 3:
        low, middle, high = np.percentile(values, [25, 50, 75])
        place = at + side * 0.2
        axes.vlines(place, low, high, color=shade, linewidth=5, alpha=0.35, zorder=2)
        axes.hlines(middle, place - _BOX, place + _BOX, color=shade, linewidth=1.2, zorder=3)
    draw_mean(axes, at + side * _BESIDE, values, look, method=drawn.method)


def _density(values: FloatArray, points: int = 60) -> tuple[FloatArray, FloatArray] | None:
    """A grid from the smallest to the largest value, and the density there with its peak at 1; None for too few values.

    Gaussian kernels of Scott's width (Scott 1992). The grid ends at the data, so that nothing is drawn beyond them.
    """
    if len(np.unique(values)) < 4:
        return None
    from scipy import stats

    try:
        kernel = stats.gaussian_kde(values)
    except np.linalg.LinAlgError:  # values that differ by no more than rounding
        return None
    grid = np.linspace(values.min(), values.max(), points)
    height = kernel(grid)
    if not np.isfinite(height).all() or not height.max() > 0:
        return None
    return grid, height / height.max()


def _differences(axes: Axes, complete: pd.DataFrame, unit: str) -> None:
    """First condition minus each other one: participants, density, mean and interval."""
    first, *others = complete.columns
    axes.axhline(0, color=BLACK, linewidth=0.8)
    for index, other in enumerate(others):
        difference = complete[first] - complete[other]
        look = (COLOURS[2], "D") if len(others) == 1 else (colour(index + 1), marker(index + 1))
        _raincloud(axes, index, 1, difference, look, Drawn(unit=unit))
    length = max(10, 34 // len(others))
    labels = [f"{first} {MINUS} {other}" for other in others]
    if len(others) > 1:
        labels = [f"{MINUS} {other}" for other in others]
        axes.set_xlabel(f"{as_label(first)} {MINUS} the other")
    axes.set_xticks(range(len(others)), [as_label(label, length) for label in labels])
    axes.set_xlim(-0.5, len(others) - 0.3)
    grouped(axes)
