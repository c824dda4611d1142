"""statsmodels' adjustments held against R's p.adjust and against the formulas that stood here before."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.statistics.multiplicity import METHODS, adjusted
from tests.pipeline import r_reference

R = r_reference.expected("multiplicity")
IN_R = {
    "holm": "holm",
    "bonferroni": "bonferroni",
    "benjamini_hochberg": "BH",
    "benjamini_yekutieli": "BY",
    "hochberg": "hochberg",
    "hommel": "hommel",
}


@pytest.mark.parametrize("method", IN_R)
def test_against_p_adjust(method: str) -> None:
    for family in ("mixed", "tied", "one"):
        p, wanted = (np.atleast_1d(R[family][name]).tolist() for name in ("p", IN_R[method]))
        assert adjusted(p, method) == pytest.approx(wanted, rel=1e-12)


@given(p=st.lists(st.floats(0, 1), min_size=1, max_size=12))
def test_against_the_formulas(p: list[float]) -> None:
    order, m = np.argsort(p, kind="stable"), len(p)
    ranked = np.array(p)[order]
    holm, hochberg = np.empty(m), np.empty(m)
    holm[order] = np.minimum(1, np.maximum.accumulate((m - np.arange(m)) * ranked))
    hochberg[order] = np.minimum(1, np.minimum.accumulate((ranked * m / np.arange(1, m + 1))[::-1])[::-1])
    assert adjusted(p, "holm") == pytest.approx(holm, rel=1e-12)
    assert adjusted(p, "benjamini_hochberg") == pytest.approx(hochberg, rel=1e-12)
    assert adjusted(p, "bonferroni") == pytest.approx(np.minimum(1, m * np.array(p)), rel=1e-12)
    with np.errstate(divide="ignore"):  # of p = 1
        sidak, holm_sidak = -np.expm1(m * np.log1p(-np.array(p))), np.empty(m)
        holm_sidak[order] = np.maximum.accumulate(-np.expm1((m - np.arange(m)) * np.log1p(-ranked)))
    assert adjusted(p, "sidak") == pytest.approx(sidak, rel=1e-12)
    assert adjusted(p, "holm_sidak") == pytest.approx(holm_sidak, rel=1e-12)


@given(p=st.lists(st.none() | st.floats(0, 1), max_size=12), method=st.sampled_from(sorted(METHODS)))
def test_adjusting_keeps_the_order_and_lowers_no_p(p: list[float | None], method: str) -> None:
    changed = adjusted(p, method)
    assert [one is None for one in changed] == [one is None for one in p]
    pairs = sorted((one, other) for one, other in zip(p, changed, strict=True) if one is not None and other is not None)
    assert all(one <= other * (1 + 1e-12) and other <= 1 for one, other in pairs)
    assert all(a[1] <= b[1] * (1 + 1e-12) for a, b in pairwise(pairs))


def test_an_unknown_adjustment_is_an_error() -> None:
    with pytest.raises(ValueError, match="no adjustment is called 'tukey'"):
        adjusted([0.1], "tukey")
    assert adjusted([0.1, None], "none") == [None, None]
