"""Each participant's value of each measure: whose mark is which, where a figure cannot be pointed at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import pandas as pd

from pipeline.report.document.model import Block, Folded, Table, columns
from pipeline.report.figures.rainclouds import one_condition_each
from pipeline.report.sections.material import Material
from pipeline.study.measures import measure
from pipeline.words.names import measure_label
from pipeline.words.numbers import number

_PEOPLE_MAX = 40  # more have a page each
_PRINTED = 9  # columns of numbers that fit on paper


def tables(material: Material) -> Iterator[Block]:
    """Folded tables of the measures that are tested, ratings by themselves; on paper those that fit across it."""
    tested = list(dict.fromkeys(row["measure"] for row in material.rows("comparisons")))
    ratings = [name for name in tested if measure(name).questionnaire]
    for kind, what, names in (
        ("values", "value of each measure", [name for name in tested if name not in ratings]),
        ("values-ratings", "rating", ratings),
    ):
        table = _table(material, f"table-{kind}", f"Each participant's {what}", names)
        if table is not None:
            summary = f"Whose mark is which in the figures? Each participant's {what}"
            fits = len(table.columns) <= 1 + _PRINTED
            yield Folded(summary, (table,), in_annex=fits, whole_in_annex=True)


def _table(material: Material, name: str, title: str, measures: Sequence[str]) -> Table | None:
    """A row per participant and a column per measure and condition; None for nobody, or for too many people.

    Where each participant met one condition it has a column of its own: a table of all would hold mostly dashes.
    """
    wide = {one: material.participant_means(one) for one in measures}
    people = sorted({str(person) for means in wide.values() for person in means.index})
    if not people or len(people) > _PEOPLE_MAX:
        return None
    if all(one_condition_each(means) for means in wide.values()):
        return _with_conditions(name, f"{title} and the condition that they met, as the figures show it.", wide)
    cells = {
        f"{measure_label(one)}: {condition}": means[condition] for one, means in wide.items() for condition in means
    }
    rows = tuple(
        (person, *(number(float(values.get(person, float("nan")))) for values in cells.values())) for person in people
    )
    caption = f"{title} under each condition, as the figures show it."
    return Table(name, caption, columns(("Participant", *cells), 1), rows)


def _with_conditions(name: str, caption: str, wide: Mapping[str, pd.DataFrame]) -> Table:
    """A row per participant with their condition, whose order the rows have, and a column per measure."""
    values = {
        measure: {(str(person), str(at)): float(one) for at in means for person, one in means[at].dropna().items()}
        for measure, means in wide.items()
    }
    conditions = list(dict.fromkeys(str(condition) for means in wide.values() for condition in means))
    met = {person: condition for cells in values.values() for person, condition in cells}
    rows = tuple(
        (person, met[person], *(number(cells.get((person, met[person]), float("nan"))) for cells in values.values()))
        for person in sorted(met, key=lambda person: (conditions.index(met[person]), person))
    )
    return Table(name, caption, columns(("Participant", "Condition", *map(measure_label, wide)), 2), rows)
