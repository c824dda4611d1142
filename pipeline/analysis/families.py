"""Families of tests, over which p values are adjusted.

A family that study.yaml names (`family: main`) holds every test of the entries that name it. Without a name, the
measures of one entry are a family, effect by effect; where a measure has several pairs of conditions, those pairs are.
The follow-up tests of an omnibus test are a family of their own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from pipeline.statistics.multiplicity import adjusted
from pipeline.study.comparison import Comparison
from pipeline.tables.table import Row
from pipeline.words.comparison import unadjusted_p

MEASURES, PAIRS = "measures", "pairs"
"""What an unnamed family consists of."""


def adjust(entries: Sequence[tuple[Comparison, list[Row]]]) -> None:
    """Writes `p_adjusted`, the family's name and its size into the rows of every entry of study.yaml.

    What is adjusted is the p by which the report judges: the Greenhouse-Geisser one, where sphericity is in question.
    """
    for (name, *_), family in grouped(entries).items():
        _adjust(name, family)


def grouped(entries: Sequence[tuple[Comparison, list[Row]]]) -> dict[tuple[str, ...], list[Row]]:
    """The rows of each family; a key begins with the name of its family, or with what it consists of."""
    families: dict[tuple[str, ...], list[Row]] = {}
    for number, (entry, rows) in enumerate(entries):
        pairs = Counter((row["measure"], row["effect"]) for row in rows if row["contrast"] is not None)
        for row in rows:
            several = row["contrast"] is not None and pairs[row["measure"], row["effect"]] > 1
            if entry.family is not None and row["adjust"] == entry.adjust and not _follows_up(entry, row, rows):
                key: tuple[str, ...] = (entry.family,)
            elif several:
                key = (PAIRS, str(number), row["effect"], row["measure"])
            else:
                key = (MEASURES, str(number), row["effect"])
            families.setdefault(key, []).append(row)
    return families


def _follows_up(entry: Comparison, row: Row, rows: Iterable[Row]) -> bool:
    """Is it a pair beneath an omnibus test of the same entry, measure and effect?"""
    if row["contrast"] is None or "follow_up" not in entry.options:
        return False
    return any(
        omnibus["contrast"] is None and (omnibus["measure"], omnibus["effect"]) == (row["measure"], row["effect"])
        for omnibus in rows
    )


def _adjust(name: str, family: Sequence[Row]) -> None:
    """One family, whose rows are all adjusted in the same way; undefined p values do not count in it."""
    method = family[0]["adjust"]
    p_values = [unadjusted_p(row) for row in family]
    size = sum(p is not None for p in p_values)
    for row, value in zip(family, adjusted(p_values, method), strict=True):
        row["p_adjusted"] = value
        if value is not None:
            row["details"] = {**row["details"], "family": name, "family_size": size}
