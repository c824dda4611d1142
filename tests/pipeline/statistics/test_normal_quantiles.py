"""Values beside normal ones: the places and the band of Q-Q plots, and the residuals that they are drawn of."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics import residuals
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.diagnostics import normality
from pipeline.statistics.mixed import Factor, cells_of, mixed_model
from pipeline.statistics.mixed_anova import mixed_anova
from pipeline.statistics.normal_quantiles import normal_quantiles

VALUES = np.array([3.1, 8.7, 4.4, 2.0, 5.5, 4.9, 3.8, 6.1])


def test_places_are_medians_of_ordered_normal_values() -> None:
    """Filliben (1975), table of n = 3, from the medians 1 - 0.5^(1/3), 0.5 and 0.5^(1/3) of ordered uniform values."""
    found = normal_quantiles(np.array([2.0, 9.0, 1.0]))
    assert found is not None
    ends = stats.norm.ppf(0.5 ** (1 / 3))
    assert found.quantiles == pytest.approx([0.0, ends, -ends], abs=1e-12)


@pytest.mark.parametrize("n", [3, 10, 47, 1000])
def test_places_are_the_quantiles_of_scipys_distributions(n: int) -> None:
    found = normal_quantiles(np.sqrt(np.arange(n, dtype=np.float64)))
    assert found is not None
    ranks = np.arange(1, n + 1)
    low, middle, high = (stats.norm.ppf(stats.beta.ppf(share, ranks, n + 1 - ranks)) for share in (0.025, 0.5, 0.975))
    variance = ((high - low) / 2 / stats.norm.ppf(0.975)) ** 2
    shorter = np.sqrt(np.maximum(0.0, 1 - (1 + middle**2 / 2) / (n * variance)))
    assert np.array_equal(found.quantiles, middle)
    assert found.low == pytest.approx(middle + shorter * (low - middle), rel=1e-14)
    assert found.high == pytest.approx(middle + shorter * (high - middle), rel=1e-14)


@pytest.mark.parametrize("n", [6, 12, 36, 150])
def test_about_95_of_100_normal_values_lie_in_the_band(n: int) -> None:
    """The band is that of a value's rank, the same for every sample: so all of them are looked at beside one."""
    drawn = np.sort(np.random.default_rng(n).normal(size=(4000, n)))
    band = normal_quantiles(drawn[0])
    assert band is not None
    standardised = (drawn - drawn.mean(axis=1, keepdims=True)) / drawn.std(axis=1, ddof=1, keepdims=True)
    for values, expected in zip(drawn[:200], standardised, strict=False):
        found = normal_quantiles(values)
        assert found is not None
        assert found.standardised == pytest.approx(expected, abs=1e-12)
        np.testing.assert_array_equal([found.low, found.high], [band.low, band.high])
    outside = np.sum((standardised < band.low) | (standardised > band.high))
    assert 0.02 < outside / drawn.size < 0.055


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
def test_neither_unit_nor_origin_matters(origin: float, unit: float) -> None:
    one, other = normal_quantiles(VALUES), normal_quantiles(origin + unit * 1e3 * VALUES)
    assert one is not None
    assert other is not None
    for before, after in zip(vars(one).values(), vars(other).values(), strict=True):
        assert after == pytest.approx(before, abs=1e-6)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0], [4.0, 4.0, 4.0, 4.0], [0.1 + 0.2, 0.3, 0.3]])
def test_too_few_values_or_none_that_vary_are_beside_nothing(values: list[float]) -> None:
    assert normal_quantiles(np.array(values)) is None


def test_equal_values_stay_in_one_place_and_extremes_do_not_overflow() -> None:
    found = normal_quantiles(np.array([1e300, 2e300, 2e300, 3e300, 9e300]))
    assert found is not None
    assert found.standardised[1] == found.standardised[2]
    assert np.isfinite(list(vars(found).values())).all()


def test_residuals_of_an_analysis_are_those_whose_shapiro_it_reports() -> None:
    values = np.random.default_rng(3).gamma(2.0, size=(9, 3))
    (row,) = rm_anova(values, ["condition"])
    left = residuals.of_effect(values, (0,))
    assert left.shape == (9, 3)
    assert normality(left.ravel(), "residual_")["residual_shapiro_w"] == pytest.approx(
        row.details["residual_shapiro_w"], rel=1e-9
    )


def test_residuals_within_groups_are_those_whose_shapiro_the_mixed_analysis_reports() -> None:
    values, codes = np.random.default_rng(4).gamma(2.0, size=(9, 3)), np.array([0, 0, 0, 0, 1, 1, 1, 1, 1])
    row = mixed_anova(values, codes, "group", ["condition"])[1]
    left = residuals.of_effect(values, (0,), codes)
    assert normality(left.ravel(), "residual_")["residual_shapiro_w"] == pytest.approx(
        row.details["residual_shapiro_w"], rel=1e-9
    )


def test_one_contrast_gives_one_number_of_each_participant() -> None:
    values = np.random.default_rng(5).normal(size=(7, 2, 3))
    differences = values[:, 0].mean(axis=1) - values[:, 1].mean(axis=1)
    of_two_levels = residuals.of_effect(values, (0,))
    assert of_two_levels.shape == (7, 1)
    assert 2 * of_two_levels[:, 0] == pytest.approx(differences - differences.mean())
    assert residuals.of_effect(values, (1,)).shape == (7, 3)
    assert residuals.of_effect(values, (0, 1)).shape == (7, 6)


def test_residuals_of_a_mixed_model_are_those_of_statsmodels() -> None:
    """statsmodels' `resid` takes off the predicted intercepts too; both fit by REML."""
    import statsmodels.formula.api as smf

    rng = np.random.default_rng(6)
    people = np.repeat([f"P{at}" for at in range(14)], 3)
    codes = np.tile([0, 1, 2], 14)
    values = 5 + codes * 0.8 + np.repeat(rng.normal(size=14), 3) + rng.normal(size=42)
    kept = np.arange(42) != 7
    people, codes, values = people[kept], codes[kept], values[kept]
    condition = Factor(("a", "b", "c"), codes)
    found = residuals.of_mixed_model(values, list(people), {"condition": condition}, ["condition"])
    table = pd.DataFrame({"y": values, "who": people, "condition": codes})
    fitted = smf.mixedlm("y ~ C(condition)", table, groups="who").fit()
    assert found == pytest.approx(fitted.resid.to_numpy(), abs=1e-4)


def test_residuals_of_two_intercepts_solve_hendersons_equations() -> None:
    """At the estimated variances the residuals are σ²V⁻¹(y − Xβ), with V of all random intercepts together."""
    rng = np.random.default_rng(7)
    people, codes = np.repeat([f"P{at}" for at in range(8)], 6), np.tile([0, 0, 0, 1, 1, 1], 8)
    cell = np.repeat(rng.normal(size=16), 3)
    values = codes * 0.5 + np.repeat(rng.normal(size=8), 6) + cell + rng.normal(size=48)
    condition = Factor(("a", "b"), codes)
    random = {"participant:condition": cells_of(list(people), condition)}
    (row,) = mixed_model(values, list(people), {"condition": condition}, ["condition"], random)
    found = residuals.of_mixed_model(values, list(people), {"condition": condition}, ["condition"], random)
    variances, residual = row.details["variances"], row.details["variance_residual"]
    cells = random["participant:condition"]
    total = residual * np.eye(48) + variances["participant"] * (people[:, None] == people)
    total = total + variances["participant:condition"] * (cells[:, None] == cells)
    design = np.column_stack([np.ones(48), codes])
    inverse = np.linalg.inv(total)
    coefficients = np.linalg.solve(design.T @ inverse @ design, design.T @ inverse @ values)
    assert found == pytest.approx(residual * inverse @ (values - design @ coefficients), abs=1e-8)


def test_without_a_fit_there_are_no_residuals() -> None:
    condition = Factor(("a", "b"), np.array([0, 1]))
    assert residuals.of_mixed_model(np.array([1.0, 2.0]), ["P", "P"], {"condition": condition}, ["condition"]) is None
