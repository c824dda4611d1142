"""Families of tests, over which p values are adjusted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pipeline.statistics.multiplicity import adjusted
from pipeline.tables.table import Row


def adjust(rows: Sequence[Row]) -> None:
    """Writes `p_adjusted` into the rows of one entry of study.yaml.

    A family are the measures of the entry, effect by effect; where a measure has several pairs, those pairs.
    """
    pairs = Counter((row["measure"], row["effect"]) for row in rows if row["contrast"] is not None)
    families: dict[tuple[str, str | None], list[Row]] = {}
    for row in rows:
        one_of_several = row["contrast"] is not None and pairs[row["measure"], row["effect"]] > 1
        families.setdefault((row["effect"], row["measure"] if one_of_several else None), []).append(row)
    for family in families.values():
        values = adjusted([row["p"] for row in family], family[0]["adjust"])
        for row, value in zip(family, values, strict=True):
            row["p_adjusted"] = value
