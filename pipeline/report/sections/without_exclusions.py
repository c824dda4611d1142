"""The comparisons as they would be without the exclusions of study.yaml."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator

from pipeline.report.document.model import Block, Paragraph, Strong, Table, columns
from pipeline.report.sections.material import Material
from pipeline.tables.table import Row
from pipeline.words.comparison import contrast, decisive_p, test_label
from pipeline.words.effect_sizes import effect_size
from pipeline.words.evidence import statistic
from pipeline.words.names import measure_label
from pipeline.words.numbers import NO_VALUE, p_value
from pipeline.words.phrases import counted

_FIGURES = ("n", "statistic", "p", "p_adjusted", "effect_size", "mean_difference", "status")
_ROUND_OFF = 1e-9
_Key = tuple[str, str, str, str | None, int]


def without_exclusions(material: Material) -> list[Block]:
    """The comparisons that change without the exclusions, beside those with them; empty without exclusions."""
    everything = material.rows("comparisons_all_data")
    if not everything:
        return []
    before, after = dict(_keyed(material.rows("comparisons"))), dict(_keyed(everything))
    changed = [
        (before.get(key), after.get(key)) for key in {**before, **after} if _differ(before.get(key), after.get(key))
    ]
    head = f"Without the {counted(len(material.study.exclusions), 'exclusion')} of study.yaml"
    if not changed:
        return [Paragraph((Strong(f"{head}: "), "every comparison has the same result."))]
    over = sum(
        _significant(old, material.study.alpha) != _significant(new, material.study.alpha) for old, new in changed
    )
    level = f"{100 * material.study.alpha:g} % level"
    crossing = f"{over or 'none'} of them between significant and not at the {level}"
    text = f"{len(changed)} of {counted(len({**before, **after}), 'comparison')} change, {crossing}."
    titles = ("Measure", "Test", "Compared", "Data", "n", "Statistic", "p", "Effect size [95 %]")
    cells = [cell for old, new in changed for cell in (_cells(old, new, "with"), _cells(new, old, "without"))]
    table = Table(
        "table-all-data",
        f"{head}, on all data: the comparisons that change, with the exclusions and without them.",
        columns(titles, 4),
        tuple(cells),
        "p: adjusted over its family where the study adjusts, else corrected for sphericity where that applies.",
    )
    return [Paragraph((Strong(f"{head}: "), text)), table]


def _keyed(rows: Iterable[Row]) -> Iterator[tuple[_Key, Row]]:
    """Rows by what they compare; a test that stands twice in study.yaml has a number too."""
    seen: Counter[tuple[str, str, str, str | None]] = Counter()
    for row in rows:
        key = (row["measure"], row["test"], row["effect"], row["contrast"])
        yield (*key, seen[key]), row
        seen[key] += 1


def _differ(one: Row | None, other: Row | None) -> bool:
    if one is None or other is None:
        return True
    return any(not _same(one[name], other[name]) for name in _FIGURES)


def _same(one: object, other: object) -> bool:
    numbers = isinstance(one, int | float) and isinstance(other, int | float)
    return math.isclose(one, other, rel_tol=_ROUND_OFF, abs_tol=1e-12) if numbers else one == other  # type: ignore[arg-type]


def _significant(row: Row | None, alpha: float) -> bool | None:
    p = None if row is None else decisive_p(row)
    return None if p is None else p < alpha


def _cells(row: Row | None, other: Row | None, which: str) -> tuple[str, ...]:
    """A line of the table; a comparison that there is in one of the two only has nothing in the other."""
    named = row or other or {}
    head = (measure_label(named["measure"]), test_label(named), contrast(named), f"{which} exclusions")
    if row is None:
        return (*head, *(NO_VALUE,) * 4)
    result = statistic(row) if row["status"] == "ok" else row["status"]
    return (*head, f"{row['n']}", result, p_value(decisive_p(row)), effect_size(row))
