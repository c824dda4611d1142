"""Outliers and the test of normality, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.statistics.diagnostics import far_out, normality


def test_an_outlier_may_lie_on_either_side() -> None:
    """Median 7, median deviation 1: 0.6745 · 6 / 1 = 4.05 is beyond 3.5, and 0.6745 · 5 = 3.37 is not."""
    assert far_out(np.array([1.0, 6, 7, 8, 9])) == [0]
    assert far_out(np.array([2.0, 6, 7, 8, 9])) == []
    assert far_out(np.array([1.0, 6, 7, 7, 7.5, 8, 13])) == [0, 6]


def test_three_values_are_enough_for_shapiro_and_wilk() -> None:
    """Of three, W is the squared range over twice the sum of squares, and p = 6/π · (asin √W − π/3) is exact.

    Shapiro and Wilk (1965), whose distribution of W for n = 3 this is: of 0, 1, 3 W = 9 / (2 · 14/3) = 27/28.
    """
    found = normality(np.array([0.0, 1.0, 3.0]))
    assert found["shapiro_w"] == pytest.approx(27 / 28)
    assert found["shapiro_p"] == pytest.approx(6 / math.pi * (math.asin(math.sqrt(27 / 28)) - math.pi / 3))
