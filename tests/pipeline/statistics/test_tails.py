"""Tails and quantiles beside `scipy.stats`, which looks at its arguments before it asks the same functions."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics.tails import chi2_above, f_above, t_above, t_quantile

VALUES = st.floats(-1e3, 1e6)
DEGREES = st.floats(1e-2, 1e7)


@given(value=VALUES, df1=DEGREES, df2=DEGREES)
def test_they_are_those_of_scipy(value: float, df1: float, df2: float) -> None:
    """Of an F or χ² below 0, as round-off leaves it, everything is above."""
    assert t_above(value, df1) == pytest.approx(stats.t.sf(value, df1), rel=1e-14)
    assert f_above(value, df1, df2) == pytest.approx(stats.f.sf(value, df1, df2), rel=1e-14)
    assert chi2_above(value, df1) == pytest.approx(stats.chi2.sf(value, df1), rel=1e-14)


@given(probability=st.floats(1e-6, 1 - 1e-6), df=st.floats(0.5, 1e7))
def test_a_quantile_is_that_of_scipy(probability: float, df: float) -> None:
    assert t_quantile(probability, df) == pytest.approx(stats.t.ppf(probability, df), rel=1e-14, abs=1e-14)
