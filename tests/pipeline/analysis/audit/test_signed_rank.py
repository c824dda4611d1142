"""Which Wilcoxon p values n pairs can have, against every sign and every pattern of zeros and ties."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations_with_replacement, product
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.analysis.audit.signed_rank import (
    exact_p_possible,
    exact_p_with_sum,
    exact_tails,
    normal_p_possible,
    smallest_p,
    sum_fits,
    untied_p_possible,
)
from pipeline.statistics.wilcoxon import signed_rank_p
from pipeline.study.rounded import Interval, Rounded


def at(value: Fraction) -> Interval:
    return Interval(value, value)


def every_pattern(n: int) -> list[np.ndarray]:
    """Ranks of the differences that are not zero: all zeros and ties, zeros dropped or by Pratt."""
    found = []
    for sizes in combinations_with_replacement(range(n + 1), n):
        if any(sizes):
            nonzero = np.array([size for size in sizes if size])
            found += [stats.rankdata(nonzero), stats.rankdata(sizes)[np.array(sizes) > 0]]
    return list({tuple(ranks): ranks for ranks in found}.values())


def every_tail(n: int) -> dict[tuple[Fraction, Fraction], set[tuple[float, float]]]:
    """P(W₊ ≤ w) and the two-sided p of every outcome, with W₊ and the sum of all ranks."""
    found: dict[tuple[Fraction, Fraction], set[tuple[float, float]]] = {}
    for ranks in every_pattern(n):
        sums = np.array([ranks @ signs for signs in product((0, 1), repeat=len(ranks))])
        for w in set(sums):
            lower = Fraction(int((sums <= w).sum()), len(sums))
            upper = Fraction(int((sums >= w).sum()), len(sums))
            found.setdefault((lower, min(Fraction(1), 2 * min(lower, upper))), set()).add((w, float(ranks.sum())))
    return found


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_exact_p_values_are_those_of_all_signs_zeros_and_ties(n: int) -> None:
    tails = every_tail(n)
    one_sided, two_sided = ({pair[i] for pair in tails} for i in (0, 1))
    for count in range(2**n + 1):
        p = Fraction(count, 2**n)
        assert exact_tails(n)[count] == (p in one_sided)
        assert exact_p_possible(n, at(p), 1) is (p in one_sided)
        assert exact_p_possible(n, at(p), 2) is (p in two_sided)
        between = Interval(p + Fraction(1, 2 ** (n + 2)), p + Fraction(1, 2 ** (n + 1)))
        assert not exact_p_possible(n, between, 2) or between.high > 1


def test_exact_p_values_that_belong_to_a_rank_sum() -> None:
    tails = every_tail(4)
    for doubled in range(21):
        w = doubled / 2
        for count in range(17):
            p = Fraction(count, 16)
            there = any(
                pair[1] == p and w in (plus, total - plus, abs(2 * plus - total))
                for pair, outcomes in tails.items()
                for plus, total in outcomes
            )
            assert exact_p_with_sum(4, at(Fraction(doubled, 2)), at(p), 2) is there, (w, p)


def test_the_paper_prints_exact_p_values_that_twelve_pairs_can_have() -> None:
    for text in ("0.0137", "0.0898", "0.0508", "0.0249", "0.1611", "0.0195"):
        assert exact_p_possible(12, Rounded.read(text).interval, 2)
    # Exact p values are multiples of 1/2048 here, so most of four digits are none.
    possible = sum(exact_p_possible(12, Rounded.read(f"0.{i:04d}").interval, 2) for i in range(1, 1000))
    assert 150 < possible < 250


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 14), st.integers(0, 2**32), st.sampled_from([1, 2, 5, 50]), st.integers(2, 5))
def test_an_exact_p_of_real_data_is_never_called_impossible(n: int, seed: int, spread: int, digits: int) -> None:
    differences = np.random.default_rng(seed).integers(-spread, spread + 1, n)
    if not differences.any():
        return
    ranks = stats.rankdata(np.abs(differences[differences != 0]))
    w = float(ranks[differences[differences != 0] > 0].sum())
    p = Rounded.read(f"{signed_rank_p(ranks, w):.{digits}f}").interval
    assert exact_p_possible(n, p, 2)
    if n <= 10:
        assert exact_p_with_sum(n, Rounded.read(f"{w:.1f}").interval, p, 2)


@settings(max_examples=150, deadline=None)
@given(
    st.integers(2, 40),
    st.integers(0, 2**32),
    st.sampled_from([1, 2, 5, 50]),
    st.sampled_from([(zeros, corrected) for zeros in ("wilcox", "pratt", "zsplit") for corrected in (True, False)]),
    st.integers(1, 2),
)
def test_a_normal_approximation_by_scipy_is_never_called_impossible(
    n: int, seed: int, spread: int, options: tuple[Literal["wilcox", "pratt", "zsplit"], bool], sides: int
) -> None:
    differences = np.random.default_rng(seed).integers(-spread, spread + 1, n)
    if not differences.any():
        return
    found = stats.wilcoxon(
        differences,
        zero_method=options[0],
        correction=options[1],
        alternative="two-sided" if sides == 2 else "greater",
        method="approx",
    )
    p = Rounded.read(f"{min(found.pvalue, 1.0):.5f}").interval
    assert normal_p_possible(n, p, sides)
    assert float(p.high) >= smallest_p(n, 1)


def test_without_ties_a_normal_approximation_is_one_of_few() -> None:
    """n = 5: the smallest two-sided p is .0253 (all tied), and the next small ones leave gaps."""
    assert smallest_p(5, 2) == pytest.approx(2 * stats.norm.sf(5**0.5))
    assert not normal_p_possible(5, Rounded.read("0.0200").interval, 2)
    possible = [i for i in range(1, 1000) if normal_p_possible(5, Rounded.read(f"0.{i:04d}").interval, 2)]
    assert min(possible) == 253
    assert len(possible) < 60


@pytest.mark.parametrize("n", [15, 20, 40])
def test_larger_n_are_judged_by_a_witness(n: int) -> None:
    random = np.random.default_rng(n)
    differences = random.normal(0.5, 1, n)
    p = stats.wilcoxon(differences, method="exact").pvalue
    assert untied_p_possible(n, Rounded.read(f"{p:.4f}").interval, 2)
    assert not untied_p_possible(n, at(Fraction(1, 2**n)), 2)


@pytest.mark.parametrize("n", [4, 5, 6])
def test_of_a_rank_sum_of_nought_p_is_that_with_or_without_the_correction_for_continuity(n: int) -> None:
    """|W − T/2| = n(n + 1)/4, less a half with it, over √(n(n + 1)(2n + 1)/24). SciPy gives both as well."""
    by_correction = {}
    for correction in (False, True):
        size = n * (n + 1) / 4 - (0.5 if correction else 0.0)
        p = 2 * stats.norm.sf(size / np.sqrt(n * (n + 1) * (2 * n + 1) / 24))
        ranked = np.arange(1.0, n + 1)
        assert p == pytest.approx(stats.wilcoxon(ranked, correction=correction, method="approx").pvalue)
        by_correction[correction] = Rounded.read(f"{p:.4f}").interval
        assert normal_p_possible(n, by_correction[correction], 2, of_nought)
    between = (by_correction[False].high + by_correction[True].low) / 2
    assert not normal_p_possible(n, at(between), 2, of_nought)


def of_nought(doubled: int, doubled_total: int) -> bool:
    return sum_fits(at(Fraction(0)), doubled, doubled_total)


@pytest.mark.parametrize("n", [3, 5, 20])
def test_the_smallest_exact_p_is_that_of_differences_of_one_sign(n: int) -> None:
    alternatives: dict[int, Literal["two-sided", "greater"]] = {2: "two-sided", 1: "greater"}
    for sides, alternative in alternatives.items():
        p = stats.wilcoxon(np.arange(1.0, n + 1), alternative=alternative, method="exact").pvalue
        assert smallest_p(n, sides, "exact") == pytest.approx(p)
