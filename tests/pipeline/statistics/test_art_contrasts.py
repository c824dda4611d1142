"""ART-C contrasts against R by hand, laws of alignment, and what says when ranks are not to be believed."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics import ALL_ZERO, NO_VARIATION, ONE_COMPLETE, STATUSES
from pipeline.statistics.art import art_anova, art_contrasts
from pipeline.statistics.paired import t_paired
from pipeline.statistics.shape import cell_shape
from tests.pipeline.statistics.r_cases import close, expected, levels, rows, with_key

FACTORS = ["condition", "task"]


def arranged(case: str) -> tuple[np.ndarray, list[list[str]]]:
    """Values (n, conditions, tasks) and the levels."""
    at = [levels(case, name) for name in FACTORS]
    people = levels(case, "participant")
    values = np.full((len(people), *map(len, at)), np.nan)
    for row in rows(case):
        values[people.index(row["participant"]), at[0].index(row["condition"]), at[1].index(row["task"])] = float(
            row["value"]
        )
    return values, at


@pytest.mark.parametrize("case", with_key("art_contrasts"))
def test_contrasts_against_r(case: str) -> None:
    values, at = arranged(case)
    found = [one.result for one in art_contrasts(values, FACTORS, at)]
    wanted = expected(case)["art_contrasts"]
    assert [(one.effect, one.contrast) for one in found] == [(one["effect"], one["contrast"]) for one in wanted]
    for ours, theirs in zip(found, wanted, strict=True):
        close([ours.statistic, ours.df2, ours.p, ours.effect_size], [theirs[name] for name in ("t", "df", "p", "dz")])
        assert ours.effect_size_name == "Cohen's d_z of aligned ranks"
        assert ours.method.startswith("ART-C contrast")


@settings(deadline=None, max_examples=30)
@given(
    data=st.lists(st.tuples(*[st.integers(-30, 30)] * 3), min_size=4, max_size=8),
    constant=st.integers(-50, 50),
)
def test_what_another_factor_adds_changes_no_contrast(data: list[tuple[int, ...]], constant: int) -> None:
    plain = np.array(data, dtype=float)
    one = np.stack([plain, plain[:, ::-1]], axis=2)
    two = one + np.array([0, constant])
    at = [list("abc"), list("xy")]
    for before, after in zip(art_contrasts(one, FACTORS, at), art_contrasts(two, FACTORS, at), strict=True):
        if before.result.effect != "condition":
            continue  # the simple effects are ranked together with the other factor's, which did change
        # Where nothing varied, the reason is another once the other factor does.
        assert (before.result.status == "ok") == (after.result.status == "ok")
        if before.result.statistic is not None:
            assert after.result.statistic == pytest.approx(before.result.statistic, rel=1e-9)


def test_of_one_factor_ranks_are_those_of_the_analysis() -> None:
    values = np.random.default_rng(3).normal(size=(8, 3))
    ranks = stats.rankdata(values).reshape(values.shape)
    found = art_contrasts(values, ["condition"], [list("abc")])
    assert found[0].result.p == pytest.approx(t_paired(ranks[:, 0], ranks[:, 1]).p)
    assert found[0].pair.first == pytest.approx(values[:, 0])


def test_what_cannot_be_ranked_has_a_status() -> None:
    at = [list("abc")]

    def status(values: np.ndarray) -> set[str]:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return {one.result.status for one in art_contrasts(values, ["condition"], at)}

    assert status(np.ones((5, 3))) == {NO_VARIATION}
    assert status(np.repeat(np.arange(5.0)[:, None], 3, axis=1)) == {ALL_ZERO}
    assert status(np.array([[1.0, 2, 3]])) == {ONE_COMPLETE}
    assert status(np.zeros((0, 3))) <= set(STATUSES)


@pytest.mark.parametrize("size", [1e95, 1e-90, 1e300])
def test_giant_and_tiny_values_are_values(size: float) -> None:
    values, at = arranged("artc_3x2_n11")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for one, other in zip(
            art_contrasts(values * size, FACTORS, at), art_contrasts(values, FACTORS, at), strict=True
        ):
            assert one.result.p == pytest.approx(other.result.p)
        for plain, scaled in zip(art_anova(values, FACTORS), art_anova(values * size, FACTORS), strict=True):
            assert scaled.p == pytest.approx(plain.p)
        shape = cell_shape(values * size)
    assert shape["skewness"] == pytest.approx(cell_shape(values)["skewness"])


# Shape ------------------------------------------------------------------------------------------------------------


def lognormal(seed: int, ratio: float, spread: float = 0.3) -> np.ndarray:
    """20 people, 3 × 2 cells; the second factor makes values `ratio` times as large."""
    random = np.random.default_rng(seed)
    logs = random.normal(0, spread, (20, 1, 1)) + random.normal(0, spread, (20, 3, 2))
    values: np.ndarray = np.exp(3 + logs + np.array([0, np.log(ratio)]))
    return values


def test_a_strong_factor_of_skewed_times_is_seen_and_logarithms_take_it_away() -> None:
    strong = cell_shape(lognormal(1, 6.0))
    assert strong["spreads_differ"] is True
    assert strong["log_spreads_differ"] is False
    assert cell_shape(lognormal(1, 1.0))["spreads_differ"] is False
    skewed = cell_shape(lognormal(2, 1.0, 1.0))
    assert (skewed["skewed"], skewed["log_skewed"]) == (True, False)
    plain = cell_shape(np.random.default_rng(1).normal(size=(20, 3)))
    assert (plain["skewed"], plain["spreads_differ"], plain["log_skewness"]) == (False, False, None)


def test_the_figures_of_a_shape_by_hand() -> None:
    values = np.array([[1.0, 2.0], [2.0, 6.0], [6.0, 4.0]])
    apart = (values - values.mean(axis=0)).ravel()
    shape = cell_shape(values)
    assert shape["skewness"] == pytest.approx(stats.skew(apart, bias=False))
    assert shape["spread_ratio"] == pytest.approx(np.sqrt(7) / 2)
    assert shape["spread_p"] == pytest.approx(stats.levene(*values.T, center="median").pvalue)
    assert set(cell_shape(np.ones((4, 2))).values()) == {None}
    assert set(cell_shape(np.zeros((0, 2))).values()) == {None}
