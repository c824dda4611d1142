"""Power of groups, factorial and mixed designs, and of equivalence: against R, G*Power and the tests themselves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.statistics.anova import rm_anova
from pipeline.statistics.equivalence import tost
from pipeline.statistics.kruskal import kruskal_wallis
from pipeline.statistics.mann_whitney import mann_whitney
from pipeline.statistics.mixed_anova import mixed_anova
from pipeline.statistics.power import paired_t_power, rm_anova_power
from pipeline.statistics.power_designs import (
    Equivalence,
    FactorialEffect,
    PairedT,
    Planned,
    SeveralGroups,
    TwoGroups,
    detectable,
    detectable_bound,
    fewest,
)
from pipeline.statistics.power_groups import (
    TESTS,
    Groups,
    anova_welch_p,
    critical_u,
    detectable_by_simulation,
    effect_of,
    kruskal_p,
    mann_whitney_significant,
    simulate_groups,
)
from pipeline.statistics.power_simulation import Share
from pipeline.statistics.welch import anova_welch, t_welch
from tests.pipeline.statistics.r_cases import expected

# Against R --------------------------------------------------------------------------------------------------------

OF_R: dict[str, tuple[Planned, float, int]] = {
    "two_groups_r": (TwoGroups(), 0.5, 20),
    "welch_unequal": (TwoGroups(sd_ratio=2, size_ratio=2), 0.7, 12),
    "one_way_r": (FactorialEffect((), (), groups=4, with_group=True), 0.3, 15),
    "welch_anova": (SeveralGroups(3, sds=(1, 2, 3)), 0.4, 15),
    "welch_anova_equal": (SeveralGroups(4), 0.3, 12),
    "within_2x3_interaction": (FactorialEffect((2, 3), (0, 1)), 0.2, 18),
    "within_epsilon": (FactorialEffect((4,), (0,), correlation=0.6, epsilon=0.7), 0.25, 15),
    "mixed_between": (FactorialEffect((3,), (), groups=2, with_group=True, correlation=0.6), 0.3, 12),
    "mixed_within": (FactorialEffect((3,), (0,), groups=2, correlation=0.6), 0.2, 12),
    "mixed_interaction": (
        FactorialEffect((3,), (0,), groups=2, with_group=True, correlation=0.6, epsilon=0.8),
        0.2,
        12,
    ),
    "equivalence_paired": (Equivalence(0.6), 0.0, 30),
    "equivalence_shifted": (Equivalence(0.6), 0.2, 20),
    "equivalence_groups": (Equivalence(0.8, groups=True), 0.1, 25),
}


@pytest.mark.parametrize("name", OF_R)
def test_power_against_r(name: str) -> None:
    design, effect, n = OF_R[name]
    assert design.power(effect, n) == pytest.approx(expected("power")["power"][name], rel=1e-6)
    assert design.method.startswith(("closed form", "exact"))


def test_every_power_of_r_is_met() -> None:
    assert set(expected("power")["power"]) == {*OF_R, "two_groups_n_r", "two_groups_effect_r"}


def test_participants_and_detectable_effect_against_r() -> None:
    wanted = expected("power")["power"]
    assert fewest(TwoGroups(), 0.5, 0.8, 200) == int(np.ceil(wanted["two_groups_n_r"]))
    assert detectable(TwoGroups(), 20, 0.8) == pytest.approx(wanted["two_groups_effect_r"], rel=1e-4)
    assert fewest(TwoGroups(), 0.05, 0.8, 100) is None


# Laws -------------------------------------------------------------------------------------------------------------


@given(f=st.floats(0.05, 1), n=st.integers(3, 60), k=st.integers(2, 6), r=st.floats(0, 0.9))
def test_one_within_factor_is_the_repeated_measures_analysis(f: float, n: int, k: int, r: float) -> None:
    design = FactorialEffect((k,), (0,), correlation=r)
    assert design.power(f, n) == pytest.approx(rm_anova_power(f, n, k, r), abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(n=st.integers(3, 60), power=st.floats(0.2, 0.97), index=st.integers(0, 4))
def test_the_detectable_effect_has_the_power_and_a_smaller_one_has_not(n: int, power: float, index: int) -> None:
    design: Planned = (
        PairedT(),
        TwoGroups(sd_ratio=1.5),
        SeveralGroups(3),
        FactorialEffect((2, 3), (1,), groups=2),
        FactorialEffect((3,), (0,), epsilon=0.6),
    )[index]
    effect = detectable(design, n, power)
    assert effect is not None
    assert design.power(effect, n) == pytest.approx(power, abs=1e-6)
    assert design.power(effect * 0.99, n) < power
    assert fewest(design, effect * 1.0001, power, n + 5) == n


def test_the_detectable_difference_of_pairs_is_that_of_the_closed_form() -> None:
    effect = detectable(PairedT(), 34, 0.8)
    assert effect is not None
    assert 0.49 < effect < 0.5  # 34 participants are the fewest for 0.5
    assert paired_t_power(effect, 34) == pytest.approx(0.8)
    assert detectable(PairedT(), 2, 0.999999, largest=1.0) is None
    assert detectable(PairedT(), 10, 0.04) == 0.0


def test_equivalence_needs_bounds_that_can_be_met() -> None:
    assert Equivalence(0.1).power(0.0, 5) < 0.01
    bound = detectable_bound(24, 0.8)
    assert bound is not None
    assert Equivalence(bound).power(0.0, 24) == pytest.approx(0.8)
    assert (detectable_bound(24, 0.8, effect=0.2) or 0) > bound
    assert (detectable_bound(24, 0.8, groups=True) or 0) > bound
    assert Equivalence(0.5).power(0.3, 40) == pytest.approx(Equivalence(0.5).power(-0.3, 40))


# Against the tests a study takes ----------------------------------------------------------------------------------

Study = Callable[[np.random.Generator], float | None]


def agrees(study: Study, wanted: float, studies: int = 250, seed: int = 1) -> None:
    """Is the power in the 99.9 % interval of that many studies, each tested as a study is?"""
    random = np.random.default_rng(seed)
    found = [study(random) for _ in range(studies)]
    low, high = Share(sum(p is not None and p < 0.05 for p in found), studies).interval(0.999)
    assert low <= wanted <= high


def people(random: np.random.Generator, shape: tuple[int, ...], correlation: float) -> np.ndarray:
    """Values of SD 1, any two of a person's correlated alike."""
    shared = random.standard_normal((shape[0], *[1] * (len(shape) - 1)))
    values: np.ndarray = np.sqrt(correlation) * shared + np.sqrt(1 - correlation) * random.standard_normal(shape)
    return values


@pytest.mark.parametrize("effect", [0, 1, 2])
def test_mixed_designs_have_the_power_that_is_said(effect: int) -> None:
    codes, pattern = np.repeat([0, 1], 12), np.array([1, 0, -1]) * np.sqrt(1.5)
    group, condition = 0.3 * np.where(codes == 0, 1, -1)[:, None], 0.2 * pattern
    interaction = 0.2 * np.where(codes == 0, 1, -1)[:, None] * pattern
    added = (group, condition, interaction)[effect]
    name = ("mixed_between", "mixed_within", "mixed_interaction")[effect]
    design, size, n = OF_R[name]
    design = FactorialEffect((3,), () if effect == 0 else (0,), 2, effect != 1, 0.6)
    agrees(
        lambda random: mixed_anova(people(random, (24, 3), 0.6) + added, codes, "group", ["condition"])[effect].p,
        design.power(size, n),
    )


def test_an_interaction_of_two_within_factors_has_the_power_that_is_said() -> None:
    pattern = 0.2 * np.array([[1], [-1]]) * np.array([1, 0, -1]) * np.sqrt(1.5)
    agrees(
        lambda random: rm_anova(people(random, (18, 2, 3), 0.5) + pattern, ["a", "b"])[2].p,
        OF_R["within_2x3_interaction"][0].power(0.2, 18),
    )


def test_equivalence_has_the_power_that_is_said() -> None:
    agrees(
        lambda random: tost(random.normal(0.2, 1, 20), np.zeros(20), (-0.6, 0.6)).p,
        Equivalence(0.6).power(0.2, 20),
    )


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 999), n=st.integers(2, 12), m=st.integers(2, 12), shift=st.floats(0, 2))
def test_the_fast_tests_of_groups_are_the_studys(seed: int, n: int, m: int, shift: float) -> None:
    random = np.random.default_rng(seed)
    groups = [random.normal(shift * at, 1 + at, (3, size)) for at, size in enumerate((n, m, 5))]
    studies = [[group[study] for group in groups] for study in range(3)]
    assert anova_welch_p(groups) == pytest.approx([anova_welch(study).p for study in studies])
    assert anova_welch_p(groups[:2]) == pytest.approx([t_welch(study[0], study[1]).p for study in studies])
    assert kruskal_p(groups) == pytest.approx([kruskal_wallis(study).p for study in studies])
    for alpha in (0.01, 0.05, 0.3):
        slow = [(mann_whitney(study[0], study[1]).p or 0) < alpha for study in studies]
        assert list(mann_whitney_significant(groups[0], groups[1], alpha)) == slow


def test_the_critical_values_of_u_are_the_tables() -> None:
    """Mann and Whitney's tables, two-sided at .05, as in Siegel (1956), table K."""
    table = {(4, 4): 0, (5, 5): 2, (5, 8): 6, (8, 8): 13, (9, 12): 26, (10, 10): 23, (12, 15): 49, (20, 20): 127}
    assert {sizes: critical_u(*sizes, 0.05) for sizes in table} == table
    assert critical_u(3, 3, 0.05) == -1


def test_simulation_and_closed_form_agree() -> None:
    for design, closed, effect in (
        (Groups("t_welch", (1, 2), (1, 2)), TwoGroups(sd_ratio=2, size_ratio=2).power(0.7, 12), effect_of(0.7)),
        (Groups("anova_welch", (1, 2, 3), (1, 1, 1)), SeveralGroups(3, sds=(1, 2, 3)).power(0.4, 15), 0.4),
    ):
        low, high = simulate_groups(design, effect, 12 if len(design.sds) == 2 else 15, 4000, 3).interval(0.999)
        assert low <= closed <= high


def test_ranks_detect_a_little_less_than_means() -> None:
    """Their efficiency beside t is 3/π of normal values."""
    by_t = detectable(TwoGroups(), 20, 0.8)
    found = detectable_by_simulation(Groups("mann_whitney"), 20, 0.8, 2000, 1)
    assert by_t is not None
    assert found is not None
    effect, low, high = found
    assert low < effect < high
    assert low < effect_of(by_t) * np.sqrt(np.pi / 3) < high
    assert detectable_by_simulation(Groups("mann_whitney"), 3, 0.8, 200, 1) is None
    assert set(TESTS) == {"t_welch", "mann_whitney", "anova_welch", "kruskal"}
    assert Groups("kruskal").method == "simulation of normal values, kruskal"
