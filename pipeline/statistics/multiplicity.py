"""p values adjusted over a stated family."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def adjusted(p_values: Sequence[float | None], method: str) -> list[float | None]:
    """Adjusted p values in the order given; undefined ones stay None and do not count in the family.

    Methods: holm, bonferroni, benjamini_hochberg; none gives None throughout.
    """
    known = [index for index, p in enumerate(p_values) if p is not None]
    result: list[float | None] = [None] * len(p_values)
    if method == "none" or not known:
        return result
    p = np.array([p_values[index] for index in known], dtype=np.float64)
    order, m = np.argsort(p, kind="stable"), len(p)
    if method == "bonferroni":
        changed = np.minimum(1.0, m * p)
    elif method == "holm":
        changed = np.empty(m)
        changed[order] = np.minimum(1.0, np.maximum.accumulate((m - np.arange(m)) * p[order]))
    elif method == "benjamini_hochberg":
        changed = np.empty(m)
        scaled = p[order] * (m / np.arange(1, m + 1))
        changed[order] = np.minimum(1.0, np.minimum.accumulate(scaled[::-1])[::-1])
    else:
        raise ValueError(f"no adjustment is called {method!r}")
    for index, value in zip(known, changed, strict=True):
        result[index] = float(value)
    return result
