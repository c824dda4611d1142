"""Round-off is taken out by each pair's own size, and giant and tiny values are values."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, special, stats

from pipeline.statistics import diagnostics
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.art import art_anova
from pipeline.statistics.bayes import bayes_t
from pipeline.statistics.crossover import crossover
from pipeline.statistics.effect_size import (
    dz_interval,
    noncentral_t_cdf,
    partial_eta_squared_interval,
)
from pipeline.statistics.equivalence import tost
from pipeline.statistics.friedman import friedman
from pipeline.statistics.paired import t_paired
from pipeline.statistics.result import Result, rounded_differences
from pipeline.statistics.wilcoxon import wilcoxon

EPOCH_US = (
    np.array([123456, 98765, 150001, 99999, 134567, 88888, 101010], dtype=float)
    + 1_700_000_000_000_000
    + 1_000_000 * np.arange(7, dtype=float),
    1_700_000_000_000_000 + 1_000_000 * np.arange(7, dtype=float),
)
GIANT = (
    np.array([0.00012, 0.00015, 0.00031, 0.00022, 0.00018, 1e10]),
    np.array([0.00010, 0.00011, 0.00012, 0.00013, 0.00011, 9e9]),
)
N2_BIG = (np.array([10, 20.001]), np.array([5.0, 15]))


def test_microseconds_since_1970_keep_all_their_digits() -> None:
    t, f = t_paired(*EPOCH_US), rm_anova(np.column_stack(EPOCH_US), ["condition"])[0]
    differences = np.array([123456, 98765, 150001, 99999, 134567, 88888, 101010])
    assert t.statistic == pytest.approx(differences.mean() / stats.sem(differences), rel=1e-12)
    assert t.statistic == pytest.approx(13.387, abs=5e-4)
    assert f.statistic == pytest.approx((t.statistic or 0) ** 2, rel=1e-12)


def test_a_giant_value_does_not_level_the_others() -> None:
    found = wilcoxon(*GIANT)
    assert (found.statistic, found.p) == (21, 0.03125)
    assert friedman(np.column_stack(GIANT)).p == 0.03125
    assert rounded_differences(*GIANT)[:5] == pytest.approx([2e-5, 4e-5, 1.9e-4, 9e-5, 7e-5], rel=1e-9)


def test_a_participant_whose_values_are_all_giant_hides_no_difference_of_the_others() -> None:
    first, second = np.array([0.3, 0.5, 0.4, 1e12]), np.array([0.2, 0.1, 0.4, 1e12])
    assert t_paired(first, second).status == "ok"
    assert rm_anova(np.column_stack([first, second, second[::-1]]), ["condition"])[0].status == "ok"


def test_two_participants_and_a_huge_t_have_bounds() -> None:
    found, f = t_paired(*N2_BIG), rm_anova(np.column_stack(N2_BIG), ["condition"])[0]
    assert found.statistic is not None
    # With one degree of freedom and t this large δ is t·s, s the quantile of √χ²: both bounds in closed form.
    scale = found.statistic / np.sqrt(2)
    low, high = (float(scale * np.sqrt(stats.chi2.ppf(level, 1))) for level in (0.025, 0.975))
    assert (found.ci_low, found.ci_high) == pytest.approx((low, high), rel=1e-4)
    assert f.ci_high is not None
    partial = f.details["partial_eta_squared_ci"]
    # Partial η² = λ / (λ + df2), and λ = δ².
    assert np.sqrt(partial[1] / (1 - partial[1])) == pytest.approx((found.ci_high or 0) * np.sqrt(2), rel=1e-4)


@pytest.mark.parametrize("size", [1e-300, 1e-90, 1e-60, 1e60, 1e95, 1e300])
def test_giant_and_tiny_values_are_values(size: float) -> None:
    for result, plain in zip(everything(size), everything(1.0), strict=True):
        assert result.status == plain.status == "ok"
        if result.method.startswith("two one-sided"):
            continue  # its bounds stay in the old unit
        known = {name: plain.details.get(name) for name in ("residual_shapiro_w", "p_gg", "mauchly_w")}
        for name, wanted in {"statistic": plain.statistic, "p": plain.p, **known}.items():
            value = getattr(result, name, result.details.get(name))
            assert value == (None if wanted is None else pytest.approx(wanted, rel=1e-6)), name


def everything(size: float) -> list[Result]:
    first = size * np.array([1.2, 1.5, 1.7, 1.2, 1.79])
    second = size * np.array([1, 1.1, 1.2, 1.3, 1.1])
    third = size * np.array([0.9, 1.3, 1.6, 1.4, 1.5])
    values, both = np.column_stack([first, second, third]), np.column_stack([first, second])
    diagnostics.differences(first, second, list("abcde"))
    return [
        t_paired(first, second),
        wilcoxon(first, second),
        friedman(values),
        *rm_anova(values, ["condition"]),
        *rm_anova(both, ["condition"]),
        *art_anova(values, ["condition"]),
        bayes_t(first, second),
        tost(first, second, (-1, 1)),
        crossover(both, [True, False, True, False, True], ("A", "B"))[0],
    ]


def test_differences_that_are_known_to_a_few_units_only_are_no_ties() -> None:
    """At 10¹⁵ floats lie an eighth apart, and 64 of these are 8: a difference of 6 may be none; 10 and 12 are two."""
    first = 1e15 + np.array([6.125, 10.125, 12.125])
    assert rounded_differences(first, np.full(3, 1e15)).tolist() == [0.0, 10.125, 12.125]


# Laws -----------------------------------------------------------------------------------------------------------

decimals = st.integers(-12, 6).flatmap(
    lambda exponent: st.lists(
        st.tuples(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6)), min_size=2, max_size=12
    ).map(lambda pairs: [(Decimal(a).scaleb(exponent), Decimal(b).scaleb(exponent)) for a, b in pairs])
)


@given(pairs=decimals)
def test_differences_tie_and_vanish_exactly_where_their_decimals_do(pairs: list[tuple[Decimal, Decimal]]) -> None:
    exact = [abs(a - b) for a, b in pairs]
    sizes = np.abs(rounded_differences(*_floats(pairs)))
    assert sizes == pytest.approx([float(size) for size in exact], rel=1e-9)
    assert (sizes[:, None] == sizes).tolist() == [[one == other for other in exact] for one in exact]
    assert ((sizes == 0) == [size == 0 for size in exact]).all()


@given(pairs=decimals, giant=st.integers(10, 60), apart=st.sampled_from([0, 1, 3]))
def test_a_further_pair_of_any_size_changes_no_other_difference(
    pairs: list[tuple[Decimal, Decimal]], giant: int, apart: int
) -> None:
    first, second = _floats(pairs)
    alone = rounded_differences(first, second)
    beside = rounded_differences(np.append(first, (4 + apart) * 10.0**giant), np.append(second, 4 * 10.0**giant))
    assert beside[:-1] == pytest.approx(alone, rel=1e-9, abs=0)
    assert (stats.rankdata(np.abs(beside[:-1])) == stats.rankdata(np.abs(alone))).all()


@given(
    values=st.lists(st.lists(st.integers(0, 400), min_size=5, max_size=5), min_size=2, max_size=8),
    seed=st.integers(0, 99),
)
def test_means_of_the_same_trials_in_another_order_are_no_difference(values: list[list[int]], seed: int) -> None:
    random = np.random.default_rng(seed)
    first = np.array([np.mean([value / 100 for value in row]) for row in values])
    second = np.array([sum(random.permutation([value / 100 for value in row])) / 5 for row in values])
    assert not rounded_differences(first, second).any()


@given(st.lists(st.integers(-(2**52), 2**52), min_size=4, max_size=20))
def test_whole_numbers_have_exact_differences(values: list[int]) -> None:
    half = len(values) // 2
    first, second = values[:half], values[half : 2 * half]
    found = rounded_differences(np.array(first, dtype=float), np.array(second, dtype=float))
    assert found.tolist() == [float(a - b) for a, b in zip(first, second, strict=True)]


def _floats(pairs: list[tuple[Decimal, Decimal]]) -> tuple[FloatArray, FloatArray]:
    return np.array([float(a) for a, _ in pairs]), np.array([float(b) for _, b in pairs])


@pytest.mark.parametrize("df", [1, 2, 11, 100])
@pytest.mark.parametrize("t", [0.0, 1.4, 1.5, 4.7, 4.8, 30.0, 1e4])
def test_the_noncentral_t_by_adaptive_quadrature(t: float, df: int) -> None:
    """On both sides of where one integrand takes over from the other."""
    for shift in (-2.0, 0.0, 0.5, t / 2, t, 2.2 * t):
        step = shift * np.sqrt(df) / t if t else 0.0
        end = float(np.sqrt(stats.chi2.isf(1e-20, df)))
        near = [step + by * np.sqrt(df) / max(t, 1) for by in (-10, 0, 10)]
        wanted = integrate.quad(
            lambda s, shift=shift: stats.chi.pdf(s, df) * special.ndtr(t * s / np.sqrt(df) - shift),
            0,
            end,
            points=[point for point in near if 0 < point < end] or None,
            epsabs=1e-13,
            limit=500,
        )[0]
        assert noncentral_t_cdf(t, df, shift) == pytest.approx(wanted, abs=1e-11)
        assert noncentral_t_cdf(-t, df, -shift) == pytest.approx(1 - wanted, abs=1e-11)


@pytest.mark.parametrize("n", [2, 3, 12])
@pytest.mark.parametrize("dz", [0.0, 0.4, 5.0, 1e3, 1e6, 1e12])
def test_every_d_z_has_both_bounds(n: int, dz: float) -> None:
    low, high = dz_interval(dz, n)
    assert low is not None
    assert high is not None
    assert low <= dz <= high
    partial = partial_eta_squared_interval(n * dz**2, 1, n - 1)
    assert None not in partial
