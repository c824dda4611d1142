"""Mixed analysis of variance: against R with groups of any sizes, against pingouin with equal ones, against laws."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics import (
    ALL_ZERO,
    EMPTY_GROUP,
    EQUAL_IN_GROUPS,
    NO_VARIATION,
    OK,
    STATUSES,
    TOO_FEW_VALUES,
)
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.mixed_anova import follow_ups, mixed_anova, t_in_groups
from pipeline.statistics.paired import t_paired
from tests.pipeline.statistics.r_cases import close, expected, levels, rows, with_key

CASES = with_key("effects")


def arranged(case: str) -> tuple[np.ndarray, np.ndarray, list[str], list[list[str]]]:
    """Values (n, k₁[, k₂]), groups (n,), the factors and their levels."""
    factors = ["condition", "task"] if len(levels(case, "task")) > 1 else ["condition"]
    at = [levels(case, name) for name in factors]
    table = pd.DataFrame(rows(case))
    people = table.drop_duplicates("participant")
    index = {name: number for number, name in enumerate(people["participant"])}
    values = np.full((len(people), *map(len, at)), np.nan)
    for row in rows(case):
        place = [names.index(row[name]) for name, names in zip(factors, at, strict=True)]
        values[(index[row["participant"]], *place)] = float(row["value"])
    codes = np.array([levels(case, "group").index(name) for name in people["group"]])
    return values, codes, factors, at


# Against R --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_effects_against_afex(case: str) -> None:
    values, codes, factors, _ = arranged(case)
    wanted = expected(case)["effects"]
    found = {result.effect: result for result in mixed_anova(values, codes, "group", factors)}
    assert list(found) == list(wanted)
    for effect, theirs in wanted.items():
        ours, details = found[effect], found[effect].details
        close([ours.statistic, ours.df1, ours.df2, ours.p], [theirs[name] for name in ("F", "df1", "df2", "p")])
        close([ours.effect_size, details["partial_eta_squared"]], [theirs["generalized_eta2"], theirs["partial_eta2"]])
        close(details["partial_eta_squared_ci"], theirs["partial_eta2_ci"], 1e-4)
        assert (ours.ci_low or 0) <= (ours.effect_size or 0) <= (ours.ci_high or 0)
        for name in ("mauchly_w", "mauchly_p", "epsilon_gg", "p_gg", "epsilon_hf", "p_hf"):
            if name in theirs:
                close(details[name], theirs[name])
            else:
                assert details[name] is None
    theirs = expected(case)["brown_forsythe_of_means"]
    details = found["group"].details
    close([details["brown_forsythe_f"], details["brown_forsythe_p"]], [theirs["F"], theirs["p"]])
    assert details["n_groups"] == [int(np.sum(codes == code)) for code in range(codes.max() + 1)]


@pytest.mark.parametrize("case", CASES)
def test_follow_ups_against_emmeans_and_t_tests(case: str) -> None:
    values, codes, factors, at = arranged(case)
    wanted, names = expected(case), levels(case, "group")
    found = follow_ups(values, codes, ("group", names), factors, at)
    of: dict[str, list[Any]] = {}
    for one in found:
        assert one.result.contrast == one.pair.contrast
        of.setdefault(one.result.effect, []).append(one.result)
    conditions = [one for one in of.get("condition", []) if one.effect == "condition"]
    if len(at[0]) > 2:
        assert [one.contrast for one in conditions] == [pair["contrast"] for pair in wanted["condition_pairs"]]
        pooled = list(zip(conditions, wanted["condition_pairs"], strict=True))
    else:
        assert conditions == []
        row = next(row for row in mixed_anova(values, codes, "group", factors) if row.effect == "condition")
        close(row.details["difference"], wanted["condition_pairs"][0]["estimate"])
        pooled = []
    if wanted["condition_at_task"] is not None:
        simple = of["condition:task"]
        assert [one.contrast for one in simple] == [
            f"{pair['contrast']} | {pair['task']}" for pair in wanted["condition_at_task"]
        ]
        pooled += list(zip(simple, wanted["condition_at_task"], strict=True))
    for ours, theirs in pooled:
        close([ours.statistic, ours.df2, ours.p], [theirs[name] for name in ("t.ratio", "df", "p.value")])
        close(ours.details["difference"], theirs["estimate"])
    simple = of["group:condition"]
    if wanted["within_groups"] is not None:
        theirs = [pair for one in wanted["within_groups"] for pair in one["pairs"]]
        theirs += [pair for one in wanted["between_groups"] for pair in one["pairs"]]
        for one, pair in zip(simple, theirs, strict=True):
            close([one.statistic, one.df2, one.p], [pair[name] for name in ("t", "df", "p")])
        assert simple[0].contrast == f"{at[0][0]} - {at[0][1]} | {names[0]}"
        assert simple[-1].contrast == f"{names[-2]} - {names[-1]} | {at[0][-1]}"
    if len(names) > 2:
        for one, pair in zip(of["group"], wanted["groups"], strict=True):
            close([one.statistic, one.df2, one.p], [pair[name] for name in ("t", "df", "p")])
    else:
        assert "group" not in of


def test_follow_ups_of_two_within_factors_name_where_they_are() -> None:
    values, codes, factors, at = arranged("mixed_2x3_of_5_7_and_6")
    found = follow_ups(values, codes, ("group", levels("mixed_2x3_of_5_7_and_6", "group")), factors, at)
    names = [(one.result.effect, one.result.contrast, one.pair.paired) for one in found]
    assert len(names) == len(set(names))
    for wanted in (
        ("group", "low - middle", False),
        ("task", "near - mid", True),
        ("condition:task", "A - B | near", True),
        ("group:condition", "A - B | low", True),
        ("group:task", "low - high | far", False),
        ("group:condition:task", "A - B | near, low", True),
        ("group:condition:task", "low - high | B, far", False),
    ):
        assert wanted in names
    cell = next(one for one in found if one.pair.contrast == "low - high | B, far").pair
    assert cell.first == pytest.approx(values[codes == 0][:, 1, 2])


# Laws -------------------------------------------------------------------------------------------------------------


def test_of_equal_groups_it_is_pingouins_and_of_unequal_ones_not() -> None:
    """Why the sums of squares are our own: pingouin's within-effect weights the groups by their size."""
    import pingouin

    def theirs(values: np.ndarray, codes: np.ndarray) -> dict[str, float]:
        n, k = values.shape
        table = pd.DataFrame(
            {
                "value": values.ravel(),
                "person": np.repeat(np.arange(n), k),
                "condition": np.tile(np.arange(k), n),
                "group": np.repeat(codes, k),
            }
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = pingouin.mixed_anova(table, dv="value", within="condition", between="group", subject="person")
        return dict(zip(("group", "condition", "group:condition"), found["F"], strict=True))

    values, codes, factors, _ = arranged("mixed_3_of_8_and_7")
    equal = np.concatenate([values[:7], values[8:]]), np.repeat([0, 1], 7)
    for ours in mixed_anova(*equal, "group", factors):
        assert ours.statistic == pytest.approx(theirs(*equal)[ours.effect])
    unequal = {ours.effect: ours.statistic for ours in mixed_anova(values, codes, "group", factors)}
    assert unequal["group"] == pytest.approx(theirs(values, codes)["group"])
    assert unequal["condition"] != pytest.approx(theirs(values, codes)["condition"], rel=0.01)


designs = st.tuples(
    st.lists(st.tuples(*[st.integers(-30, 30)] * 3), min_size=5, max_size=9).map(lambda v: np.array(v, dtype=float)),
    st.integers(1, 3),
)
FIGURES = ("statistic", "df1", "df2", "p", "effect_size", "ci_low", "ci_high")


def figures(results: list[Any]) -> list[dict[str, float]]:
    return [
        {name: getattr(one, name) for name in FIGURES if getattr(one, name) is not None}
        | {name: one.details[name] for name in ("p_gg", "p_hf") if one.details.get(name) is not None}
        for one in results
    ]


@settings(deadline=None, max_examples=30)
@given(
    design=designs, scale=st.sampled_from([0.001, 7.0, 1e6]), shift=st.integers(-1000, 1000), seed=st.integers(0, 99)
)
def test_units_and_the_order_of_participants_and_levels_do_not_matter(
    design: tuple[np.ndarray, int], scale: float, shift: int, seed: int
) -> None:
    values, cut = design
    codes = (np.arange(len(values)) >= cut).astype(int)
    order = np.random.default_rng(seed).permutation(len(values))
    one = mixed_anova(values, codes, "group", ["condition"])
    two = mixed_anova((values[order][:, ::-1] + shift) * scale, 1 - codes[order], "group", ["condition"])
    assert [result.status for result in one] == [result.status for result in two]
    for before, after in zip(figures(one), figures(two), strict=True):
        assert after == pytest.approx(before, rel=1e-5, abs=1e-7)


def student(first: np.ndarray, second: np.ndarray) -> float:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where one group is constant SciPy doubts its own precision
        return float(stats.ttest_ind(first, second).pvalue)


@settings(deadline=None, max_examples=30)
@given(design=designs)
def test_of_two_groups_and_two_conditions_every_f_is_the_square_of_a_t(design: tuple[np.ndarray, int]) -> None:
    values, cut = design[0][:, :2], design[1] + 1
    codes = (np.arange(len(values)) >= cut).astype(int)
    group, condition, interaction = mixed_anova(values, codes, "group", ["condition"])
    differences, means = values[:, 0] - values[:, 1], values.mean(axis=1)
    pooled = t_in_groups(values[:, 0], values[:, 1], codes)
    if condition.status == OK and pooled.statistic is not None:
        assert condition.statistic == pytest.approx(pooled.statistic**2)
        assert interaction.p == pytest.approx(student(differences[:cut], differences[cut:]))
    if group.status == OK:
        assert group.p == pytest.approx(student(means[:cut], means[cut:]))


def test_of_one_group_the_pooled_t_is_the_paired_t() -> None:
    values = np.random.default_rng(2).normal(size=(9, 2))
    one, other = t_in_groups(values[:, 0], values[:, 1], np.zeros(9, dtype=int)), t_paired(values[:, 0], values[:, 1])
    assert figures([one]) == [pytest.approx(figures([other])[0])]
    assert one.details["hedges_gz"] == pytest.approx(other.details["hedges_gz"])


def test_interactions_with_equal_groups_of_one_pattern_vanish_and_leave_rm_anova() -> None:
    """Two groups that differ by a constant: the within-effects are those of one, but for degrees of freedom."""
    half = np.random.default_rng(4).normal(size=(6, 2, 3))
    values, codes = np.concatenate([half, half + 5]), np.repeat([0, 1], 6)
    found = {result.effect: result for result in mixed_anova(values, codes, "group", ["condition", "task"])}
    for result in rm_anova(half, ["condition", "task"]):
        assert found[result.effect].statistic == pytest.approx(2 * (result.statistic or 0))
        assert found[f"group:{result.effect}"].statistic == pytest.approx(0, abs=1e-12)


# What cannot be tested --------------------------------------------------------------------------------------------


def statuses(values: np.ndarray, codes: list[int]) -> list[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = mixed_anova(values, np.array(codes, dtype=int), "group", ["condition"])
        follow_ups(values, np.array(codes, dtype=int), ("group", "xyz"), ["condition"], [list("abc")])
    for result in found:
        assert result.status in STATUSES
        assert (result.p is None) == (result.status != OK)
    return [result.status for result in found]


def test_degenerate_designs_have_a_status() -> None:
    values = np.random.default_rng(1).normal(size=(6, 3))
    assert statuses(values, [0, 0, 0, 2, 2, 2]) == [EMPTY_GROUP] * 3
    assert statuses(values[:3], [0, 1, 2]) == [TOO_FEW_VALUES] * 3
    assert statuses(np.ones((6, 3)), [0, 0, 0, 1, 1, 1]) == [NO_VARIATION] * 3
    constant = np.repeat(values[:, :1], 3, axis=1)
    assert statuses(constant, [0, 0, 0, 1, 1, 1]) == [OK, ALL_ZERO, ALL_ZERO]
    assert statuses(values - values.mean(axis=1, keepdims=True), [0, 0, 0, 1, 1, 1]) == [EQUAL_IN_GROUPS, OK, OK]
    assert statuses(values, [0, 1, 1, 1, 1, 1]) == [OK] * 3
    assert statuses(values, [0, 1, 2, 2, 1, 1]) == [OK] * 3
    assert statuses(values[:0], []) != [OK] * 3


@pytest.mark.parametrize("size", [1e95, 1e-90, 1e300, 1e-300])
def test_giant_and_tiny_values_are_values(size: float) -> None:
    values, codes, factors, _ = arranged("mixed_3_of_8_and_7")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scaled = mixed_anova(values * size, codes, "group", factors)
        plain = mixed_anova(values, codes, "group", factors)
        assert rm_anova(values * size, factors)[0].p == pytest.approx(rm_anova(values, factors)[0].p)
    for one, other in zip(figures(scaled), figures(plain), strict=True):
        assert one == pytest.approx(other)
