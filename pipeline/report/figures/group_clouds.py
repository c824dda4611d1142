"""Groups of participants side by side: every participant, density, quartiles, and means with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap

import pandas as pd
from matplotlib.figure import Figure

from pipeline.report.figures.drawing import Words, drawing
from pipeline.report.figures.rainclouds import Drawn, from_zero, method_of, rainclouds
from pipeline.report.figures.style import as_label, finite, headed, multiples, styled
from pipeline.report.figures.wording import listed, mean_with_interval, spaced
from pipeline.words.names import measure_label, short_label, unit_of
from pipeline.words.phrases import counted

_LETTERS = 84  # beside each other below panels as wide as the page


def by_group(wide: pd.DataFrame, groups: Mapping[str, str], names: Sequence[str], conditions: bool) -> pd.DataFrame:
    """Values of participants (rows) with a column for each group: of their means, or of each condition by itself.

    `wide` has a column per condition, `groups` the group of each participant, `names` the groups in order. Only who has
    every condition counts. `A, kinect` is a group's column of a condition; everybody has values in one group's alone.
    """
    known = wide.dropna()
    known = known[[str(person) in groups for person in known.index]]
    whose = pd.Series([groups[str(person)] for person in known.index], index=known.index, dtype=object)
    columns: dict[str, pd.Series] = {}
    for name in names:
        if conditions:
            columns |= {f"{name}, {condition}": known[condition].where(whose == name) for condition in known.columns}
        else:
            columns[name] = known.mean(axis=1).where(whose == name)
    return pd.DataFrame(columns)


def _groups_words(tables: Mapping[str, pd.DataFrame], factor: str, looks: Sequence[int] = ()) -> Words:
    """How many participants each group has, and of one measure the means."""
    first = next(iter(tables))
    sizes = listed(f"{name} {tables[first][name].count()}" for name in tables[first])
    marks = (
        " Each small mark is a participant with a value in every condition; shapes show their density, pale bars the"
        " middle half of them, large marks the means with 95 % intervals."
    )
    if len(tables) > 1:
        head = f"{counted(len(tables), 'scale')} by {factor}; n: {sizes}."
        return Words(f"{head}{marks}", f"{head} One panel of rainclouds per scale.")
    wide, unit = tables[first], spaced(unit_of(first))
    means = listed(
        f"{name} {mean_with_interval(finite(wide[name]), method_of(wide, first))}{unit} (n = {wide[name].count()})"
        for name in wide
    )
    head = f"{measure_label(first)} by {factor}. Means with 95 % intervals: {means}."
    return Words(f"{head}{marks}", f"{head} One raincloud per group.")


@drawing(_groups_words)
@styled
def groups(tables: Mapping[str, pd.DataFrame], factor: str, looks: Sequence[int] = ()) -> Figure:
    """A panel of rainclouds for each measure of `tables`, whose columns are groups as `by_group` makes them.

    A participant's values under several conditions are joined by a line. `factor` tells the groups apart.
    `looks` are the places of the columns' colours among all, for conditions to have theirs in every group.
    """
    alone = len(tables) == 1
    figure, every, across = multiples(len(tables), 2.4 if alone else 1.9, a_row=1 if alone else 2, sharex=False)
    for index, (axes, (measure, wide)) in enumerate(zip(every, tables.items(), strict=True)):
        drawn = Drawn(method_of(wide, measure), unit_of(measure), looks)
        rainclouds(axes, wide, drawn, small=not alone, joined=wide)
        length = max(8, _LETTERS // (across * len(wide.columns)))
        axes.set_xticks(range(len(wide.columns)), [_in_lines(name, length) for name in wide.columns])
        headed(axes, f"{as_label(short_label(measure), 40)} by {as_label(factor, 20)}")
        if index % across == 0:
            axes.set_ylabel(as_label(measure_label(measure)) if alone else "Rating")
    from_zero(every[0], tables.values())
    return figure


def _in_lines(column: str, length: int) -> str:
    """A group's name in lines so long, two at most, and below it the condition's: cut, groups could look alike."""
    parts = (as_label(part, 2 * length - 1) for part in column.rsplit(", ", 1))
    return "\n".join(line for part in parts for line in wrap(part, length)[:2])
