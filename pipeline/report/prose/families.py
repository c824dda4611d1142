"""Over which tests p values were adjusted, in words, from the rows themselves."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.analysis.families import MEASURES, PAIRS
from pipeline.tables.table import Row
from pipeline.words.comparison import over_all_pairs
from pipeline.words.names import adjustment_label
from pipeline.words.phrases import counted, listing


def families(rows: Sequence[Row]) -> str:
    """`p values are adjusted by Holm over 6 tests (the measures of one entry)`, without a full stop."""
    kinds: dict[tuple[str, str, int], None] = {}
    for row in rows:
        details = row["details"] or {}
        if row["p_adjusted"] is not None:
            kinds[row["adjust"], details["family"], details["family_size"]] = None
    together = [row for row in rows if over_all_pairs(row)]
    if not kinds:
        alone = "p values are not adjusted"
        return f"{alone}, but those of pairs of groups hold for all pairs of a measure together" if together else alone
    parts = [f"by {adjustment_label(method)} over {_members(family, size)}" for method, family, size in kinds]
    return f"p values are adjusted {listing(parts)}"


def _members(family: str, size: int) -> str:
    if family == PAIRS:
        return f"{counted(size, 'pair')} of each measure"
    if family == MEASURES:
        return f"{counted(size, 'test')} (the measures of one entry of study.yaml)"
    return f'the {counted(size, "test")} of the family "{family}"'
