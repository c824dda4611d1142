"""Tests of groups of participants: against R, against writing out every permutation, and against laws."""

from __future__ import annotations

import warnings
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics import (
    EMPTY_GROUP,
    EQUAL_IN_GROUP,
    EQUAL_IN_GROUPS,
    NO_VARIATION,
    OK,
    ONE_IN_GROUP,
    STATUSES,
    TOO_FEW_GROUPS,
)
from pipeline.statistics.groups import midranks
from pipeline.statistics.kruskal import kruskal_pairs, kruskal_wallis
from pipeline.statistics.mann_whitney import hodges_lehmann_shift, mann_whitney, rank_sum_p
from pipeline.statistics.result import Result
from pipeline.statistics.welch import anova_welch, games_howell, spreads, t_welch
from tests.pipeline.statistics.r_cases import close, expected, groups, with_key

# Against R --------------------------------------------------------------------------------------------------------

BOUND = 1e-5  # R finds the bounds of noncentral distributions by a search that stops there
RANGE = 5e-9  # R's ptukey misses the p of a Welch test of two groups by 2e-9; SciPy's has it


@pytest.mark.parametrize("case", [case for case in with_key("welch") if case.startswith("groups")])
def test_welch_against_r(case: str) -> None:
    wanted = expected(case)
    first, second = groups(case).values()
    found = t_welch(first, second)
    close([found.statistic, found.df2, found.p], [wanted["welch"][name] for name in ("t", "df", "p")])
    close(found.details["ci_difference"], wanted["welch"]["ci"])
    close([found.effect_size, found.ci_low, found.ci_high], wanted["d_av"], BOUND)
    close([found.details["cohen_ds"], *found.details["cohen_ds_ci"]], wanted["cohens_ds"], BOUND)
    close([found.details["hedges_gs"], *found.details["hedges_gs_ci"]], wanted["hedges_gs"], BOUND)


@pytest.mark.parametrize("case", with_key("mann_whitney"))
def test_mann_whitney_against_r(case: str) -> None:
    wanted = expected(case)["mann_whitney"]
    first, second = groups(case).values()
    found = mann_whitney(first, second)
    assert found.method == "Mann-Whitney test, exact, midranks, two-sided"
    close([found.statistic, found.p], [wanted["U"], wanted["p_exact"]])
    close(found.details["hodges_lehmann"], wanted["shift"])
    close([found.effect_size, found.ci_low, found.ci_high], [wanted["rank_biserial"], *wanted["rank_biserial_ci"]])
    if wanted["shift_ci"] is not None:  # without ties
        close(found.p, wanted["p_without_ties"])
        close(found.details["hodges_lehmann_ci"], wanted["shift_ci"])


@pytest.mark.parametrize("case", with_key("mann_whitney"))
def test_many_values_are_asymptotic_as_in_coin(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.statistics.mann_whitney.EXACT_UP_TO", 10)
    first, second = groups(case).values()
    found = mann_whitney(first, second)
    assert found.method == "Mann-Whitney test, asymptotic, tie-corrected, two-sided"
    close(found.p, expected(case)["mann_whitney"]["p_asymptotic"])


@pytest.mark.parametrize("case", with_key("kruskal"))
def test_several_groups_against_r(case: str) -> None:
    wanted, values = expected(case), groups(case)
    welch, ranked = anova_welch(list(values.values())), kruskal_wallis(list(values.values()))
    theirs = wanted["anova_welch"]
    close([welch.statistic, welch.df1, welch.df2, welch.p], [theirs[name] for name in ("F", "df1", "df2", "p")])
    close([welch.effect_size, welch.ci_low, welch.ci_high], theirs["partial_eta_squared"], 1e-4)
    for name in ("levene", "brown_forsythe"):
        close([welch.details[f"{name}_f"], welch.details[f"{name}_p"]], [wanted[name]["F"], wanted[name]["p"]])
    theirs = wanted["kruskal"]
    close([ranked.statistic, ranked.df1, ranked.p], [theirs[name] for name in ("H", "df", "p")])
    close(ranked.effect_size, theirs["rank_epsilon_squared"])
    close([ranked.ci_low, ranked.ci_high], theirs["epsilon_squared_ci"], 1e-4)
    close(max(0.0, ranked.details["eta_squared_h"]), theirs["rank_eta_squared"])
    for found, pair in zip(games_howell(list(values.values()), list(values)), wanted["games_howell"], strict=True):
        assert found.contrast == pair["contrast"]
        close([found.statistic, found.df2], [pair["t"], pair["df"]])
        assert found.p == pytest.approx(pair["p"], abs=RANGE)
        close(found.details["ci_difference"], pair["ci"])


# Against slower mathematics ---------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=40)
@given(data=st.lists(st.integers(0, 6), min_size=3, max_size=9), cut=st.integers(1, 8))
def test_the_exact_p_by_writing_out_every_choice(data: list[int], cut: int) -> None:
    n = min(cut, len(data) - 1)
    ranks = stats.rankdata(data)
    mean = n * (len(data) + 1) / 2
    apart = [abs(sum(ranks[list(chosen)]) - mean) for chosen in combinations(range(len(data)), n)]
    wanted = np.mean([one >= abs(sum(ranks[:n]) - mean) - 1e-9 for one in apart])
    assert rank_sum_p(ranks, n)[0] == pytest.approx(wanted)


@pytest.mark.parametrize(("n", "m"), [(40, 50), (3, 200)])
def test_the_exact_p_of_many_values_without_ties_is_scipys(n: int, m: int) -> None:
    random = np.random.default_rng(3)
    first, second = random.normal(0.5, 1, n), random.normal(0, 1, m)
    wanted = stats.mannwhitneyu(first, second, method="exact").pvalue
    assert mann_whitney(first, second).p == pytest.approx(wanted, rel=1e-9)


def test_means_that_round_off_parts_tie() -> None:
    """(0.1 + 0.2) / 2 is 0.15, if not to the last bit."""
    assert list(midranks(np.array([0.15, 0.1, (0.1 + 0.2) / 2, 0.3]))) == [2.5, 1.0, 2.5, 4.0]
    assert list(midranks(np.array([1.7e15, 1.7e15 + 5]))) == [1.0, 2.0]


def test_a_shift_needs_enough_values_for_its_interval() -> None:
    assert hodges_lehmann_shift(np.array([1.0, 2, 3]), np.array([4.0, 5, 6]))[1] is None
    found = mann_whitney(np.array([1.0, 2, 3]), np.array([4.0, 5, 6]))
    assert found.details["hodges_lehmann_ci_reason"] == "too few values for a 95 % interval"
    assert hodges_lehmann_shift(np.arange(4.0), np.arange(4.0))[1] == (-3.0, 3.0)


# Laws -------------------------------------------------------------------------------------------------------------

samples = st.lists(
    st.lists(st.integers(-30, 30), min_size=2, max_size=8).map(lambda values: np.array(values, dtype=float)),
    min_size=2,
    max_size=4,
)
FIGURES = ("statistic", "df2", "p", "effect_size", "ci_low", "ci_high")


def figures(result: Result) -> dict[str, float]:
    """Those that are defined."""
    return {name: getattr(result, name) for name in FIGURES if getattr(result, name) is not None}


@settings(deadline=None, max_examples=30)
@given(data=samples)
def test_swapping_two_groups_flips_signs_and_keeps_p(data: list[np.ndarray]) -> None:
    first, second = data[:2]
    for test in (t_welch, mann_whitney):
        one, two = test(first, second), test(second, first)
        assert one.status == two.status
        if one.p is not None and one.effect_size is not None and one.ci_low is not None:
            assert two.p == pytest.approx(one.p)
            assert two.effect_size == pytest.approx(-one.effect_size)
            assert two.ci_high == pytest.approx(-one.ci_low, abs=1e-9)


@settings(deadline=None, max_examples=25)
@given(data=samples, scale=st.sampled_from([0.001, 7.0, 1e6]), shift=st.integers(-1000, 1000), seed=st.integers(0, 99))
def test_units_and_the_order_of_rows_do_not_matter(data: list[np.ndarray], scale: float, shift: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    other = [random.permutation(group + shift) * scale for group in data]
    for test in (lambda g: t_welch(g[0], g[1]), lambda g: mann_whitney(g[0], g[1]), anova_welch, kruskal_wallis):
        one, two = test(data), test(other)
        assert one.status == two.status
        assert figures(two) == pytest.approx(figures(one), rel=1e-6, abs=1e-7)


@settings(deadline=None, max_examples=25)
@given(data=samples)
def test_of_two_groups_f_is_the_square_of_t_and_h_that_of_z(data: list[np.ndarray]) -> None:
    first, second = data[:2]
    f, t = anova_welch([first, second]), t_welch(first, second)
    if f.status == OK and t.statistic is not None:
        assert f.statistic == pytest.approx(t.statistic**2)
        assert (f.df2, f.p) == pytest.approx((t.df2, t.p))
        assert games_howell([first, second], "ab")[0].p == pytest.approx(t.p, rel=1e-9)
    h = kruskal_wallis([first, second])
    if h.status == OK:
        asymptotic = stats.mannwhitneyu(first, second, method="asymptotic", use_continuity=False)
        assert h.p == pytest.approx(asymptotic.pvalue)


@settings(deadline=None, max_examples=25)
@given(data=samples)
def test_ranks_are_all_that_counts(data: list[np.ndarray]) -> None:
    bent = [np.exp(group / 5) for group in data]
    for test in (kruskal_wallis, lambda g: mann_whitney(g[0], g[1])):
        one, two = test(data), test(bent)
        assert figures(two) == pytest.approx(figures(one))


@settings(deadline=None, max_examples=25)
@given(data=samples)
def test_an_interval_never_holds_zero_against_p(data: list[np.ndarray]) -> None:
    found = t_welch(data[0], data[1])
    if found.p is not None:
        assert found.ci_low is not None
        assert found.ci_high is not None
        assert (found.ci_low <= 0 <= found.ci_high) == (found.p >= 0.05)
    ranked = mann_whitney(data[0], data[1])
    if ranked.p is not None and ranked.p >= 0.05:
        assert ranked.ci_low is not None
        assert ranked.ci_high is not None
        assert ranked.ci_low <= 0 <= ranked.ci_high


# What cannot be tested --------------------------------------------------------------------------------------------


def every_test(data: list[np.ndarray]) -> dict[str, Result]:
    names = [str(number) for number in range(len(data))]
    found = {
        "anova_welch": anova_welch(data),
        "kruskal": kruskal_wallis(data),
        "games_howell": games_howell(data, names)[0],
        "kruskal_pairs": kruskal_pairs(data, names)[0],
        "t_welch": t_welch(data[0], data[1]),
        "mann_whitney": mann_whitney(data[0], data[1]),
    }
    for result in found.values():
        assert result.status in STATUSES
        assert (result.p is None) == (result.status != OK)
    return found


def test_degenerate_groups_have_a_status() -> None:
    varied, constant = np.array([1.0, 2, 4]), np.array([3.0, 3])
    empty, single = np.array([]), np.array([2.0])
    assert {result.status for result in every_test([varied, empty]).values()} == {EMPTY_GROUP}
    assert {result.status for result in every_test([constant, constant]).values()} == {NO_VARIATION}
    found = every_test([varied, single])
    assert found["t_welch"].status == found["anova_welch"].status == found["games_howell"].status == ONE_IN_GROUP
    assert (found["mann_whitney"].status, found["mann_whitney"].p) == (OK, 1.0)
    found = every_test([varied, constant])
    assert found["anova_welch"].status == EQUAL_IN_GROUP
    assert found["t_welch"].p == pytest.approx(stats.ttest_1samp(varied, 3).pvalue)
    found = every_test([constant, constant + 1])
    assert found["t_welch"].status == EQUAL_IN_GROUPS
    assert (found["kruskal"].ci_low, found["kruskal"].ci_high) == (0.0, 1.0)
    assert anova_welch([varied]).status == kruskal_wallis([varied]).status == TOO_FEW_GROUPS


@pytest.mark.parametrize("size", [1e95, 1e-90, 1e300, 1e-300])
def test_giant_and_tiny_values_are_values(size: float) -> None:
    data = [np.array([1.0, 2, 4, 3.5]), np.array([3.0, 5, 6]), np.array([2.5, 2, 7])]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for plain, scaled in zip(every_test(data).values(), every_test([g * size for g in data]).values(), strict=True):
            assert figures(scaled) == pytest.approx(figures(plain))
        scaled_interval = t_welch(data[0] * size, data[1] * size).details["ci_difference"]
    assert scaled_interval == pytest.approx([one * size for one in t_welch(data[0], data[1]).details["ci_difference"]])


def test_two_in_each_group_far_apart_have_bounds() -> None:
    found = t_welch(np.array([10.0, 10.001]), np.array([15.0, 15.003]))
    low, effect, high = (float(getattr(found, name)) for name in ("ci_low", "effect_size", "ci_high"))
    assert low < effect < high < 0
    assert spreads([np.array([1.0, 2]), np.array([3.0, 5])])["levene_f"] is None
