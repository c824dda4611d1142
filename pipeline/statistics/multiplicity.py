"""p values adjusted over a stated family."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.statistics import with_statsmodels

METHODS = {
    "holm": "holm",
    "bonferroni": "bonferroni",
    "benjamini_hochberg": "fdr_bh",
    "benjamini_yekutieli": "fdr_by",
    "hochberg": "simes-hochberg",
    "hommel": "hommel",
    "sidak": "sidak",
    "holm_sidak": "holm-sidak",
}
"""Ways of adjusting, by what statsmodels calls them."""


def adjusted(p_values: Sequence[float | None], method: str) -> list[float | None]:
    """Adjusted p values in the order given; undefined ones stay None and do not count in the family.

    Methods: those of `METHODS`; none gives None throughout.
    """
    known = [index for index, p in enumerate(p_values) if p is not None]
    result: list[float | None] = [None] * len(p_values)
    if method == "none" or not known:
        return result
    if method not in METHODS:
        raise ValueError(f"no adjustment is called {method!r}")
    changed = with_statsmodels.adjusted_p([p for p in p_values if p is not None], METHODS[method])
    for index, value in zip(known, changed, strict=True):
        result[index] = value
    return result
