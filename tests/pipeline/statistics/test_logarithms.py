"""Ratios of geometric means against R, and against what a ratio must do."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.statistics import ALL_ZERO, NO_ERROR, NO_LOGARITHMS, OK
from pipeline.statistics.logarithms import (
    as_ratio,
    geometric_mean,
    ratio_follow_ups,
    rm_anova_of_logarithms,
    t_paired_ratio,
    t_welch_ratio,
)
from pipeline.statistics.mixed import Factor, mixed_model
from pipeline.statistics.result import Result
from tests.pipeline.statistics.r_cases import close, expected
from tests.pipeline.statistics.test_art_contrasts import FACTORS, arranged

CASE = "log_3x2_n10"


def like(found: Result, wanted: dict[str, Any]) -> None:
    assert found.effect_size_name == "ratio of geometric means"
    assert found.method.endswith(", of the logarithms")
    close(
        [found.statistic, found.df2, found.p, found.effect_size], [wanted[name] for name in ("t", "df", "p", "ratio")]
    )
    close([found.ci_low, found.ci_high], wanted["ci"])


def test_ratios_against_r() -> None:
    values, at = arranged(CASE)
    wanted = expected(CASE)
    like(t_paired_ratio(values[:, 0, 0], values[:, 1, 0]), wanted["paired"])
    like(t_welch_ratio(values[:6, 0, 0], values[:, 2, 1]), wanted["welch"])
    pairs = [one for one in ratio_follow_ups(values, FACTORS, at) if one.result.effect == "condition"]
    for one, theirs in zip(pairs, wanted["condition_pairs"], strict=True):
        like(one.result, theirs)
        assert np.exp(np.mean(np.log(one.pair.first / one.pair.second))) == pytest.approx(theirs["ratio"])
    assert [one.result.contrast for one in pairs] == ["A - B", "A - C", "B - C"]
    close(list(geometric_mean(values[:, 0, 0]).values()), wanted["geometric_mean"])


def test_the_analysis_of_logarithms_against_afex() -> None:
    values, _ = arranged(CASE)
    for found in rm_anova_of_logarithms(values, FACTORS):
        theirs = expected(CASE)["rm_anova_log"][found.effect]
        close([found.statistic, found.p, found.effect_size], [theirs[name] for name in ("F", "p", "ges")])
        assert found.method.endswith(", of the logarithms")


positive = st.lists(st.tuples(st.integers(1, 500), st.integers(1, 500)), min_size=3, max_size=9).map(
    lambda rows: np.array(rows, dtype=float)
)


@settings(deadline=None, max_examples=40)
@given(data=positive, scale=st.sampled_from([1e-90, 0.01, 7.0, 1e95]))
def test_units_do_not_matter_and_swapping_inverts(data: np.ndarray, scale: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one = t_paired_ratio(data[:, 0], data[:, 1])
        swapped, scaled = t_paired_ratio(data[:, 1], data[:, 0]), t_paired_ratio(*(data * scale).T)
    assert one.status == swapped.status == scaled.status
    if one.status == OK and one.effect_size is not None and one.ci_low is not None:
        assert swapped.effect_size == pytest.approx(1 / one.effect_size)
        assert scaled.effect_size == pytest.approx(one.effect_size, rel=1e-6)
        if swapped.ci_high is not None:
            assert swapped.ci_high == pytest.approx(1 / one.ci_low)
        assert [swapped.p, scaled.p] == pytest.approx([one.p, one.p], rel=1e-5)


@pytest.mark.parametrize("lowest", [0.0, -1.0])
def test_a_value_without_logarithm_is_said(lowest: float) -> None:
    first, second = np.array([1.0, 2, 3]), np.array([2.0, lowest, 5])
    values, at = np.stack([first, second, first], axis=1), [list("abc")]
    found = [
        t_paired_ratio(first, second),
        t_welch_ratio(first, second),
        *rm_anova_of_logarithms(values, ["condition"]),
        *(one.result for one in ratio_follow_ups(values, ["condition"], at)),
    ]
    assert len(found) == 6
    for result in found:
        assert (result.status, result.p, result.effect_size) == (NO_LOGARITHMS, None, None)
        assert result.n in (3, 6)
    assert found[-1].contrast == "b - c"
    assert set(geometric_mean(second).values()) == {None}


def test_constant_ratios_and_equal_values_are_told_apart() -> None:
    values = np.array([1.0, 2, 7])
    assert t_paired_ratio(values * 3, values).status == NO_ERROR
    assert t_paired_ratio(values, values).status == ALL_ZERO


def test_an_estimate_of_a_mixed_model_of_logarithms_is_a_ratio() -> None:
    random = np.random.default_rng(1)
    values = np.exp(random.normal(0, 3, (8, 1)) + random.normal(size=(8, 2)))
    people, condition = [str(code) for code in np.repeat(np.arange(8), 2)], Factor(("a", "b"), np.tile([0, 1], 8))
    (model,) = mixed_model(np.log(values).ravel(), people, {"condition": condition}, ["condition"])
    paired, found = t_paired_ratio(values[:, 0], values[:, 1]), as_ratio(model)
    assert [found.effect_size, found.ci_low] == pytest.approx([paired.effect_size, paired.ci_low])
    assert paired.details["log_ratio"] == pytest.approx(np.log(paired.effect_size or 1))
    assert len(paired.details["cohen_dz_ci"]) == 2


def test_bounds_beyond_the_largest_number_are_not_infinite() -> None:
    found = t_paired_ratio(np.array([1e300, 1e-300, 1.0]), np.array([1e-300, 1e10, 3.0]))
    assert found.status == OK
    assert found.ci_high is None
    assert found.details["log_ratio_ci"][1] > np.log(np.finfo(float).max)
