"""Recomputed p values against printed tables, and the bounds that rounding leaves."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.analysis.audit.p_values import meets, p_bounds, p_bounds_corrected, p_two_sided
from pipeline.study.printed import Symbol
from pipeline.study.rounded import Interval, Rounded


def exactly(value: float) -> Interval:
    return Interval(Fraction(value), Fraction(value))


@pytest.mark.parametrize(
    ("symbol", "printed", "df", "p"),
    [  # critical values as the tables in textbooks print them
        ("t", "2.048", [28], 0.05),
        ("t", "2.763", [28], 0.01),
        ("F", "4.84", [1, 11], 0.05),
        ("F", "3.34", [2, 28], 0.05),
        ("r", "0.361", [28], 0.05),
        ("z", "1.960", [], 0.05),
        ("z", "2.576", [], 0.01),
        ("chi2", "41.34", [28], 0.05),
    ],
)
def test_p_at_the_critical_values_of_tables(symbol: Symbol, printed: str, df: list[float], p: float) -> None:
    low, high = p_bounds(symbol, Rounded.read(printed).interval, [exactly(value) for value in df])
    assert low <= p <= high
    assert high - low < 0.02 * p
    assert low <= float(p_two_sided(symbol, float(printed), df)) <= high


def test_a_correlation_of_one_has_p_zero() -> None:
    assert float(p_two_sided("r", 1.0, [10])) == 0
    assert p_bounds("r", Rounded.read("1.00").interval, [exactly(10)])[0] == 0


@settings(max_examples=200, deadline=None)
@given(st.floats(0, 30), st.floats(0.6, 4), st.floats(1.5, 60), st.integers(0, 2), st.integers(0, 2))
def test_bounds_hold_p_for_figures_and_degrees_of_freedom_that_are_rounded(
    statistic: float, df1: float, df2: float, digits: int, df_digits: int
) -> None:
    p = float(stats.f.sf(statistic, df1, df2))
    df = [Rounded.read(f"{value:.{df_digits}f}").interval for value in (df1, df2)]
    low, high = p_bounds("F", Rounded.read(f"{statistic:.{digits}f}").interval, df)
    assert low <= p <= high


@settings(max_examples=100, deadline=None)
@given(st.floats(0, 20), st.integers(2, 4), st.integers(3, 30), st.floats(0, 1))
def test_bounds_hold_p_corrected_for_sphericity(statistic: float, df1: int, n: int, part: float) -> None:
    epsilon = 1 / df1 + part * (1 - 1 / df1)
    p = float(stats.f.sf(statistic, epsilon * df1, epsilon * df1 * (n - 1)))
    df = [exactly(df1), exactly(df1 * (n - 1))]
    low, high = p_bounds_corrected(exactly(statistic), df, Interval(Fraction(1, df1), Fraction(1)))
    assert low <= p <= high


def test_bounds_are_narrow_where_nothing_but_the_statistic_is_rounded() -> None:
    low, high = p_bounds("F", Rounded.read("10.86").interval, [exactly(1), exactly(11)])
    assert low == pytest.approx(stats.f.sf(10.865, 1, 11), rel=1e-8)
    assert high == pytest.approx(stats.f.sf(10.855, 1, 11), rel=1e-8)
    assert meets((low, high), Rounded.read("0.0071").interval)
    assert not meets((low, high), Rounded.read("0.0072").interval)
    assert np.isclose(p_bounds("t", Rounded.read("-2.20").interval, [exactly(28)])[0], 2 * stats.t.sf(2.205, 28))


def test_bounds_hold_a_p_that_is_largest_within_the_degrees_of_freedom() -> None:
    """Of F = 1.5 over 20, p rises from 1 degree of freedom above to .24728 at 2.14 and falls from there to 9."""
    above = np.linspace(1, 9, 2001)
    p = np.asarray(stats.f.sf(1.5, above, 20))
    assert (above[np.argmax(p)], p.max()) == (pytest.approx(2.144, abs=0.002), pytest.approx(0.24728, abs=5e-6))
    low, high = p_bounds("F", exactly(1.5), [Interval(Fraction(1), Fraction(9)), exactly(20)])
    assert low <= p.min()
    assert p.max() <= high
