"""GRIM and GRIMMER against published cases, and against every sample of small scales."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, ROUND_HALF_UP, Decimal
from fractions import Fraction
from itertools import combinations_with_replacement, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.analysis.audit.granularity import Steps, has_sample, possible_sample
from pipeline.study.rounded import Interval, Rounded

WHOLE = Steps(Fraction(1))


def interval(text: str) -> Interval:
    return Rounded.read(text).interval


@pytest.mark.parametrize(
    ("mean", "n", "items", "possible"),
    [
        ("5.19", 28, 1, False),  # Brown and Heathers (2017), their first example
        ("5.18", 28, 1, True),
        ("5.21", 28, 1, True),
        ("3.45", 10, 1, False),  # Allard (2018)
        ("5.27", 43, 1, False),  # the R package scrutiny's vignette on GRIM
        ("5.19", 28, 3, True),  # 436 / 84: three items make the steps a third
    ],
)
def test_grim_as_published(mean: str, n: int, items: int, possible: bool) -> None:
    steps = Steps(Fraction(1, items))
    assert bool(steps.totals(interval(mean), n)) is possible


@pytest.mark.parametrize(
    ("mean", "sd", "n", "possible"),
    [
        ("5.21", "1.60", 28, True),  # the tests of the R package rsprite2
        ("3.44", "2.47", 18, False),
        ("7.3", "2.51", 12, False),  # the vignette on GRIMMER of the R package scrutiny
        # scrutiny's data pigs5, the rows that pass GRIM; A-GRIMMER's own verdicts
        ("4.74", "6.55", 31, True),
        ("5.23", "2.55", 35, False),
        ("2.57", "2.57", 30, True),
        ("2.68", "2.59", 34, True),
        ("7.38", "3.65", 32, True),
        ("6.89", "4.18", 37, True),
        ("5.00", "2.18", 31, True),
        ("0.24", "6.43", 34, True),
    ],
)
def test_grimmer_as_published(mean: str, sd: str, n: int, possible: bool) -> None:
    assert (possible_sample(WHOLE, interval(mean), interval(sd), n, n - 1) is not None) is possible


@pytest.mark.parametrize(("n", "most"), [(1, 6), (2, 7), (3, 6), (4, 5), (5, 4), (6, 3), (7, 2)])
def test_a_sample_with_both_sums_is_found_where_there_is_one(n: int, most: int) -> None:
    samples = combinations_with_replacement(range(most + 1), n)
    there = {(sum(sample), sum(value**2 for value in sample)) for sample in samples}
    for total, squares in product(range(-1, n * most + 2), range(n * most**2 + 2)):
        assert has_sample(n, total, squares, 0, most) is ((total, squares) in there)
        assert has_sample(n, total - 3 * n, squares - 6 * total + 9 * n, -3, most - 3) is ((total, squares) in there)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_a_scale_without_ends_has_all_whole_numbers(n: int) -> None:
    samples = combinations_with_replacement(range(-9, 10), n)
    there = {(sum(sample), sum(value**2 for value in sample)) for sample in samples}
    for total, squares in product(range(-6, 7), range(40)):
        assert has_sample(n, total, squares, None, None) is ((total, squares) in there)


def both_roundings(value: Fraction, digits: int) -> set[str]:
    return quantized(Decimal(value.numerator) / value.denominator, digits)


def roots(value: Fraction, digits: int) -> set[str]:
    return quantized((Decimal(value.numerator) / value.denominator).sqrt(), digits)


def quantized(value: Decimal, digits: int) -> set[str]:
    return {f"{value.quantize(Decimal(1).scaleb(-digits), way)}" for way in (ROUND_HALF_UP, ROUND_HALF_EVEN)}


@pytest.mark.parametrize(
    ("n", "ends", "items", "digits"),
    [
        (3, (1, 5), 1, (1, 2)),
        (4, (1, 5), 1, (2, 1)),
        (5, (0, 3), 1, (2, 2)),
        (6, (0, 2), 1, (1, 2)),
        (3, (1, 3), 2, (2, 1)),
    ],
)
def test_every_mean_and_sd_of_a_small_scale(n: int, ends: tuple[int, int], items: int, digits: tuple[int, int]) -> None:
    """What is called possible is what some sample gives, half up or half to even; nothing more, nothing less."""
    low, high = ends
    there = set()
    for sample in combinations_with_replacement(range(low * items, high * items + 1), n):
        mean = Fraction(sum(sample), n * items)
        variance = sum(((Fraction(k, items) - mean) ** 2 for k in sample), Fraction(0)) / (n - 1)
        there |= set(product(both_roundings(mean, digits[0]), roots(variance, digits[1])))
    steps = Steps(Fraction(1, items), Fraction(low), 0, (high - low) * items)
    for mean_text in (f"{low + i / 10 ** digits[0]:.{digits[0]}f}" for i in range((high - low) * 10 ** digits[0] + 1)):
        possible = bool(steps.totals(interval(mean_text), n))
        assert possible is any(mean_text == known for known, _ in there)
        for sd_text in (
            f"{i / 10 ** digits[1]:.{digits[1]}f}" for i in range(int((high - low) * 0.75 * 10 ** digits[1]))
        ):
            found = possible and possible_sample(steps, interval(mean_text), interval(sd_text), n, n - 1)
            assert bool(found) is ((mean_text, sd_text) in there), (mean_text, sd_text)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(2, 400), st.sampled_from([(0, 20), (1, 7), (0, 100), (-3, 3)]), st.integers(0, 2**32), st.integers(1, 3)
)
def test_a_real_sample_is_never_called_impossible(n: int, ends: tuple[int, int], seed: int, digits: int) -> None:
    random = np.random.default_rng(seed)
    values = random.integers(ends[0], ends[1] + 1, n) if seed % 3 else random.choice(ends, n)
    mean, sd = f"{values.mean():.{digits}f}", f"{values.std(ddof=1):.{digits}f}"
    for least, most in ((ends[0], ends[1]), (None, None), (ends[0], None)):
        steps = Steps(Fraction(1), Fraction(0), least, most)
        assert possible_sample(steps, interval(mean), interval(sd), n, n - 1) is not None
