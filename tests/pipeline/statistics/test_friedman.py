"""Friedman's exact p against enumeration in R, printed tables, and laws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.friedman import exact_friedman_p, friedman
from pipeline.statistics.wilcoxon import wilcoxon
from tests.pipeline import r_reference

CASES = [name for name in r_reference.expected("friedman_exact") if name != "versions"]
EXACT = "Friedman, exact over all orders of each participant's ranks, ties corrected"


@pytest.mark.parametrize("case", CASES)
def test_against_every_order_written_out_in_r(case: str) -> None:
    wanted = r_reference.expected("friedman_exact")[case]
    rows = [row for row in r_reference.rows("friedman_exact") if row["case"] == case]
    found = friedman(r_reference.matrix(rows, "condition", "value"))
    assert found.statistic == pytest.approx(wanted["chi2"], rel=1e-9)
    assert found.p == pytest.approx(wanted["exact_p"], rel=1e-9)
    assert found.details["chi2_p"] == pytest.approx(wanted["chi2_p"], rel=1e-9)
    assert found.method == ("Friedman of two conditions, exact: the sign test" if "two" in case else EXACT)


@pytest.mark.parametrize(
    ("rows", "chi2", "p"),
    [
        ([(1, 2, 3)] * 3 + [(1, 3, 2)], 6.5, 0.042),
        ([(1, 2, 3)] * 4, 8.0, 0.005),
        ([(1, 2, 3)] * 3 + [(1, 3, 2), (2, 1, 3)], 6.4, 0.039),
        ([(1, 2, 3, 4)] * 2, 6.0, 0.042),
    ],
)
def test_against_the_printed_table(rows: list[tuple[int, ...]], chi2: float, p: float) -> None:
    """Siegel and Castellan (1988), table M; Hollander and Wolfe (1999), table A.22."""
    found = friedman(np.array(rows, dtype=float))
    assert found.statistic == pytest.approx(chi2)
    assert found.p == pytest.approx(p, abs=5e-4)


def test_two_conditions_and_five_people_of_one_mind() -> None:
    """χ² says p = .025; the exact p of 5 of 5 is .0625, and Wilcoxon's the same."""
    values = np.array([[5, 6], [6, 7], [7, 9], [5, 6], [4, 5.5]])
    found = friedman(values)
    assert (found.p, found.effect_size) == (0.0625, 1.0)
    assert found.details["chi2_p"] == pytest.approx(0.02535, abs=1e-5)
    assert wilcoxon(values[:, 0], values[:, 1]).p == 0.0625


def test_where_it_would_take_long_the_method_says_that_p_is_that_of_chi_squared() -> None:
    values = np.random.default_rng(0).normal(size=(200, 3))
    found = friedman(values)
    assert found.method == "Friedman, chi-squared approximation, ties corrected"
    assert found.p == found.details["chi2_p"] == pytest.approx(stats.friedmanchisquare(*values.T).pvalue)
    assert friedman(np.random.default_rng(0).normal(size=(3, 9))).method == found.method


def test_against_orders_drawn_at_random() -> None:
    random = np.random.default_rng(3)
    for n, k in ((60, 3), (12, 4), (7, 5)):
        values = random.integers(0, 9, size=(n, k)).astype(np.float64) + np.arange(k, dtype=np.float64)
        ranks = stats.rankdata(values, axis=1)
        drawn = random.permuted(np.broadcast_to(ranks, (20_000, n, k)), axis=2).sum(axis=1)
        share = float(np.mean(np.sum(drawn**2, axis=1) >= np.sum(ranks.sum(axis=0) ** 2)))
        found = friedman(values)
        assert found.method == EXACT
        assert found.p is not None
        assert abs(share - found.p) < 4 * np.sqrt(found.p * (1 - found.p) / 20_000)


ratings = st.integers(2, 4).flatmap(
    lambda k: st.lists(st.lists(st.integers(1, 5), min_size=k, max_size=k), min_size=2, max_size=7)
)


@settings(deadline=None)
@given(rows=ratings, data=st.data())
def test_neither_the_order_of_people_nor_of_conditions_matters(rows: list[list[int]], data: st.DataObject) -> None:
    values = np.array(rows, dtype=float)
    people, conditions = (data.draw(st.permutations(range(size))) for size in values.shape)
    one, two = friedman(values), friedman(values[people][:, conditions])
    assert one.status == two.status
    assert two.p == (None if one.p is None else pytest.approx(one.p, rel=1e-9))
    assert one.p is None or 0 < one.p <= 1


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(1, 3), st.integers(1, 3)), min_size=1, max_size=12))
def test_of_two_conditions_the_orders_are_signs(pairs: list[tuple[int, int]]) -> None:
    ranks: FloatArray = np.array([stats.rankdata(pair) for pair in pairs])
    first = int(np.sum(ranks[:, 0] > ranks[:, 1]))
    told_apart = int(np.sum(ranks[:, 0] != ranks[:, 1]))
    wanted = stats.binomtest(first, told_apart).pvalue if told_apart else 1.0
    assert exact_friedman_p(ranks) == pytest.approx(wanted)
