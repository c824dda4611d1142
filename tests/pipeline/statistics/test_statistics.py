"""Statistics against laws that must hold, and against slower arithmetic."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics.anova import rm_anova
from pipeline.statistics.effect_size import hedges_correction, noncentral_t_cdf, partial_eta_squared_interval
from pipeline.statistics.friedman import friedman
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.paired import t_paired
from pipeline.statistics.wilcoxon import hodges_lehmann, signed_rank_p, wilcoxon

values = st.lists(st.tuples(*[st.integers(-50, 50)] * 3), min_size=3, max_size=9).map(
    lambda rows: np.array(rows, dtype=float)
)


@settings(deadline=None, max_examples=60)
@given(data=values, scale=st.sampled_from([0.001, 0.1, 7.0, 1e6]), shift=st.integers(-1000, 1000))
def test_units_and_order_of_participants_do_not_matter(data: np.ndarray, scale: float, shift: int) -> None:
    other = (data[::-1] + shift) * scale
    for test in (lambda v: rm_anova(v, ["condition"])[0], friedman):
        one, two = test(data), test(other)
        assert one.status == two.status
        for name in ("statistic", "p", "effect_size"):
            before = getattr(one, name)
            assert getattr(two, name) == (None if before is None else pytest.approx(before, rel=1e-6, abs=1e-9))


@settings(deadline=None, max_examples=60)
@given(data=values)
def test_swapping_two_conditions_flips_signs_and_keeps_p(data: np.ndarray) -> None:
    first, second = data[:, 0], data[:, 1]
    for test in (t_paired, wilcoxon):
        one, two = test(first, second), test(second, first)
        assert one.status == two.status
        if one.effect_size is not None:
            assert two.p == pytest.approx(one.p)
            assert two.effect_size == pytest.approx(-one.effect_size)


@settings(deadline=None, max_examples=40)
@given(ranks=st.lists(st.integers(2, 12).map(lambda r: r / 2), min_size=1, max_size=8), data=st.data())
def test_signed_rank_p_by_writing_out_every_sign(ranks: list[float], data: st.DataObject) -> None:
    signs = data.draw(st.lists(st.booleans(), min_size=len(ranks), max_size=len(ranks)))
    w = sum(rank for rank, positive in zip(ranks, signs, strict=True) if positive)
    every = [sum(r for r, s in zip(ranks, chosen, strict=True) if s) for chosen in product([0, 1], repeat=len(ranks))]
    low = sum(value <= w for value in every) / len(every)
    high = sum(value >= w for value in every) / len(every)
    assert signed_rank_p(np.array(ranks), w) == pytest.approx(min(1.0, 2 * min(low, high)))


def test_signed_rank_p_agrees_with_scipys_exact_one_at_larger_n() -> None:
    differences = np.random.default_rng(0).normal(0.3, 1, 40)
    assert wilcoxon(differences, np.zeros(40)).p == pytest.approx(stats.wilcoxon(differences, method="exact").pvalue)


@pytest.mark.parametrize("n", [255, 257, 400])
def test_many_pairs_are_as_exact_as_few(n: int) -> None:
    """Where Fourier transforms take over, against counting in whole numbers, also far out in the tail."""
    for ranks in (list(range(1, n + 1)), [1 + index // 3 for index in range(n)]):
        total, half = sum(ranks), sum(ranks) // 2
        ways = np.array([1] + [0] * half, dtype=object)  # Python's whole numbers: 2⁴⁰⁰ is one
        for rank in ranks:
            ways[rank:] += ways[:-rank].copy()
        for w in (half - 5, round(0.42 * total), round(0.2 * total), 3):
            wanted = min(Fraction(1), 2 * Fraction(sum(ways[: w + 1]), 2**n))
            assert signed_rank_p(np.array(ranks, dtype=float), w) == pytest.approx(float(wanted), rel=1e-9)


def test_beyond_three_thousand_pairs_the_method_says_that_it_is_asymptotic() -> None:
    differences = np.random.default_rng(3).normal(0.03, 1, 3001)
    many = wilcoxon(differences, np.zeros(3001))
    assert many.method == "asymptotic (over 3000 pairs), tie-corrected, midranks, zeros dropped"
    assert many.p == pytest.approx(stats.wilcoxon(differences, method="approx").pvalue)
    assert many.details["hodges_lehmann"] is None
    assert wilcoxon(differences[:100], np.zeros(100)).method == "exact, midranks, zeros dropped"


def test_the_interval_of_kendalls_w_by_leaving_out_one_participant_after_the_other() -> None:
    data = np.random.default_rng(8).normal(size=(9, 4)) + np.array([0, 0.5, 1, 1.5])
    ranks = stats.rankdata(data, axis=1)

    def agreement(rows: np.ndarray) -> float:
        n, k = rows.shape
        w = 12 * np.sum((rows.sum(axis=0) - n * (k + 1) / 2) ** 2) / (n**2 * (k**3 - k))
        return float((n * w - 1) / (n - 1))

    whole = agreement(ranks)
    pseudo = [9 * whole - 8 * agreement(np.delete(ranks, row, axis=0)) for row in range(9)]
    margin = stats.t.ppf(0.975, 8) * stats.sem(pseudo) / (1 - whole**2)
    found = friedman(data)
    for bound, sign in ((found.ci_low, -1), (found.ci_high, 1)):
        rho = np.tanh(np.arctanh(whole) + sign * margin)
        assert bound == pytest.approx(np.clip((1 + 8 * rho) / 9, 0, 1))
    assert friedman(np.tile([1.0, 2, 3], (5, 1))).ci_low is None


def test_round_off_breaks_neither_ties_nor_zeros() -> None:
    """0.3 − 0.2 and 0.2 − 0.1 are one difference, and 0.1 + 0.2 − 0.3 is none."""
    first, second = np.array([0.3, 0.2, 0.1 + 0.2, 0.9]), np.array([0.2, 0.1, 0.3, 0.2])
    found = wilcoxon(first, second)
    assert (found.details["n_zero"], found.details["w_plus"]) == (1, 6.0)
    assert found.p == pytest.approx(0.25)


def test_f_of_two_conditions_is_the_square_of_t() -> None:
    data = np.random.default_rng(1).normal(size=(11, 2))
    f, t = rm_anova(data, ["condition"])[0], t_paired(data[:, 0], data[:, 1])
    assert t.statistic is not None
    assert f.statistic == pytest.approx(t.statistic**2)
    assert f.p == pytest.approx(t.p)


def test_the_noncentral_t_agrees_with_scipy_where_scipy_has_it() -> None:
    for t, df, shift in ((2.2, 11, 1.0), (0.3, 2, -1.5), (7.0, 30, 5.0), (-1.0, 1, 0.5)):
        assert noncentral_t_cdf(t, df, shift) == pytest.approx(float(stats.nct.cdf(t, df, shift)), abs=1e-9)


def test_the_interval_of_partial_eta_squared_leaves_out_its_tails() -> None:
    """P(F ≤ f) at the bounds is what the level leaves, also where R's search stops early."""
    for f, df1, df2 in ((0.0658682634730562, 1, 11), (5.45, 1, 11), (15.3, 3, 33)):
        low, high = partial_eta_squared_interval(f, df1, df2, 0.9)
        assert low is not None
        assert high is not None
        assert stats.ncf.cdf(f, df1, df2, high / (1 - high) * df2) == pytest.approx(0.05, rel=1e-9)
        if low > 0:
            assert stats.ncf.cdf(f, df1, df2, low / (1 - low) * df2) == pytest.approx(0.95, rel=1e-9)


def test_hedges_correction_by_its_gamma_functions() -> None:
    from math import gamma, sqrt

    assert hedges_correction(11) == pytest.approx(gamma(5.5) / (sqrt(5.5) * gamma(5)))
    assert hedges_correction(1) is None


def test_hodges_lehmann_interval_needs_six_pairs_for_95_percent() -> None:
    assert hodges_lehmann(np.array([1.0, 2, 3, 4, 5]))[1] is None
    assert hodges_lehmann(np.array([1.0, 2, 3, 4, 5, 6]))[1] == (1.0, 6.0)


def test_adjusted_p_values_by_hand() -> None:
    p = [0.01, None, 0.04, 0.03]
    assert adjusted(p, "holm") == [pytest.approx(0.03), None, pytest.approx(0.06), pytest.approx(0.06)]
    assert adjusted(p, "bonferroni") == [pytest.approx(0.03), None, pytest.approx(0.12), pytest.approx(0.09)]
    assert adjusted(p, "benjamini_hochberg") == [pytest.approx(0.03), None, pytest.approx(0.04), pytest.approx(0.04)]
    assert adjusted(p, "none") == [None] * 4


@given(p=st.lists(st.none() | st.floats(0, 1), max_size=12))
def test_adjusting_keeps_the_order_of_p_and_lowers_none(p: list[float | None]) -> None:
    for method in ("holm", "bonferroni", "benjamini_hochberg"):
        found = [(one, changed) for one, changed in zip(p, adjusted(p, method), strict=True) if one is not None]
        assert all(changed is not None and one <= changed <= 1 for one, changed in found)
        ordered = [changed for _, changed in sorted(found, key=lambda pair: pair[0])]
        assert ordered == sorted(ordered, key=lambda changed: changed or 0.0)


def test_a_constant_difference_has_no_error_to_test_against() -> None:
    first = np.array([1.0, 5.0, 2.5, 3.0])
    for result in (t_paired(first + 0.1, first), rm_anova(np.column_stack([first + 0.1, first]), ["condition"])[0]):
        assert result.status == "undefined: all differences are equal, so there is no error to test against"
        assert result.p is None
