"""Mixed models, crossover and aligned ranks: against R, and against slower mathematics."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, stats

from pipeline.statistics import ALIASED, NO_ERROR, ONE_ORDER, TOO_FEW_VALUES
from pipeline.statistics.art import art_anova
from pipeline.statistics.bayes import bayes_t
from pipeline.statistics.crossover import crossover
from pipeline.statistics.diagnostics import differences, far_out, normality
from pipeline.statistics.equivalence import tost
from pipeline.statistics.mixed import Column, Covariate, Factor, mixed_model
from pipeline.statistics.paired import t_paired
from pipeline.statistics.random_intercept import Rows, fit
from pipeline.statistics.result import Result
from pipeline.statistics.satterthwaite import degrees_of_freedom
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.reference import (
    CASES,
    MODEL,
    SATTERTHWAITE,
    TASKS,
    compared,
    expected,
    same,
    study_of,
    the,
    with_key,
)

Folder = Callable[..., Path]

# Against R --------------------------------------------------------------------------------------------------------

MODELS = {
    "lmm_all_rows_condition": "fixed: [condition]",
    "lmm_condition_period": "fixed: [condition, period]",
    "lmm_condition_period_factor": "fixed: [condition, factor(period)]",
    "lmm_condition_period_carryover": "fixed: [condition, factor(period), carry_over]",
}
TERMS = {"period_f": "period", "carry": "carry_over"}
"""What R's formulas call our terms."""


def of_models(case: str, task: str) -> dict[str, Any]:
    """What R computes of a case and one of its tasks; of some cases it was asked for models alone."""
    reference = expected(case)
    return {**reference, **reference.get("tasks", {}).get(task, {})}


def fitted_by_r() -> list[tuple[str, str, str]]:
    """Every case, task and model of which R has estimates."""
    found = []
    for case, task in [*TASKS, *((case, "main") for case in with_key("lmm_condition_period"))]:
        reference = of_models(case, task)
        found += [(case, task, name) for name in MODELS if "fixed" in reference.get(name, ())]
    return [one for one in found if not one[0].startswith(("all_zero", "constant_all"))]


@pytest.mark.parametrize(("case", "task", "model"), fitted_by_r())
def test_mixed_models_against_lmertest(
    folder: Folder, steadyhand: Steadyhand, case: str, task: str, model: str
) -> None:
    reference = of_models(case, task)
    wanted = reference[model]
    conditions = reference.get("conditions", reference["levels_order"]["condition"])
    rows = compared(steadyhand, study_of(folder, case, task, conditions, [f"test: mixed_model, {MODELS[model]}"]))
    told = rows[0]["details"]
    same(-2 * told["log_likelihood"], wanted["reml_criterion"], MODEL)
    same(told["variance_participant"], wanted["var_participant"], MODEL)
    same(told["variance_residual"], wanted["var_residual"], MODEL)
    assert told["singular"] == wanted["singular"]
    assert (told["n_observations"], rows[0]["n"]) == (wanted["n_obs"], wanted["n_groups"])
    for term, test in wanted["anova_type3_satterthwaite"].items():
        row = next(row for row in rows if row["effect"] == TERMS.get(term, term))
        same(row["statistic"] ** (2 if row["statistic_name"] == "t" else 1), test["F"], MODEL)
        same(row["df2"], test["df2"], SATTERTHWAITE)
        same(row["p"], test["p"], SATTERTHWAITE)
    _treatment_contrasts(rows, wanted["fixed"], conditions[0])


TWO_WAY = [case for case in with_key("tasks") if "lmm_two_way" in of_models(case, "mean_over_tasks")]


@pytest.mark.parametrize("case", TWO_WAY)
def test_a_two_way_model_with_one_random_intercept_against_lmertest(case: str) -> None:
    """R's model has (1 | participant) alone; a study's has (1 | participant:condition) too, with cases of its own."""
    wanted = of_models(case, "mean_over_tasks")["lmm_two_way"]
    data = list(csv.DictReader((CASES / case / "data.csv").read_text().splitlines()))
    values = np.array([float(row["value"]) for row in data])

    def factor(name: str) -> Factor:
        levels = tuple(expected(case)["levels_order"][name])
        return Factor(levels, np.array([levels.index(row[name]) for row in data], dtype=np.int64))

    columns = {name: factor(name) for name in ("condition", "task")}
    people = [row["participant"] for row in data]
    found = mixed_model(values, people, columns, ["condition", "task", "condition:task"])
    same(found[0].details["variance_participant"], wanted["var_participant"], MODEL)
    assert found[0].details["singular"] == wanted["singular"]
    for term, test in wanted["anova_type3_satterthwaite"].items():
        row = next(one for one in found if one.effect == term)
        assert row.statistic is not None
        same(row.statistic ** (2 if row.statistic_name == "t" else 1), test["F"], MODEL)
        same(row.df2, test["df2"], SATTERTHWAITE)
        same(row.p, test["p"], SATTERTHWAITE)


@pytest.mark.parametrize("case", with_key("lmm_condition_period"))
def test_there_are_cases_whose_contrasts_have_unequal_degrees_of_freedom(case: str) -> None:
    """Where all of them are alike, any average of them passes for that of Fai and Cornelius (1996)."""
    single = expected(case)["lmm_condition_period"]["df_of_single_directions"]
    assert max(single) > 1.5 * min(single)


def _treatment_contrasts(rows: list[dict[str, Any]], fixed: dict[str, Any], baseline: str) -> None:
    """R's coefficients are another level minus the first; a contrast here is first minus second."""
    periods = [int(name.removeprefix("period_f")) for name in fixed if name.startswith("period_f")]
    firsts = {"condition": baseline, "carry": baseline, "period_f": str(min(periods, default=1) - 1)}
    for coefficient, wanted in fixed.items():
        term = next((term for term in firsts if coefficient.startswith(term)), None)
        if term is not None:
            contrast = f"{firsts[term]} - {coefficient.removeprefix(term)}"
            row, sign = the(rows, effect=TERMS.get(term, term), contrast=contrast), -1
        elif coefficient == "period":
            row, sign = the(rows, effect="period"), 1
        else:
            continue  # the intercept
        same(row["effect_size"], sign * wanted["estimate"], MODEL)
        same(row["details"]["se"], wanted["se"], MODEL)
        same(row["statistic"], sign * wanted["t"], MODEL)
        same(row["df2"], wanted["df_satterthwaite"], SATTERTHWAITE)
        same(row["p"], wanted["p"], SATTERTHWAITE)


@pytest.mark.parametrize("case", [case for case, task in TASKS if "crossover" in expected(case)["tasks"][task]])
def test_crossover_against_r(folder: Folder, steadyhand: Steadyhand, case: str) -> None:
    task = next(iter(expected(case)["tasks"].values()))
    wanted = task["crossover"]
    rows = compared(steadyhand, study_of(folder, case, "main", task["conditions"], ["test: crossover"]))
    for effect, test in (
        ("treatment", "treatment_test"),
        ("period", "period_test"),
        ("carry-over", "carryover_test_on_sums"),
    ):
        row = the(rows, effect=effect)
        for ours, theirs in (("statistic", "t"), ("df2", "df"), ("p", "p")):
            same(row[ours], wanted[test][theirs])
        same(row["ci_low"], wanted[test]["ci95"][0])
        same(row["ci_high"], wanted[test]["ci95"][1])
        assert row["details"]["sequences"] == wanted["sequences"]
    same(the(rows, effect="treatment")["effect_size"], wanted["treatment_effect_adjusted"])
    same(the(rows, effect="period")["effect_size"], wanted["period_effect_p1_minus_p2"])


# Against slower mathematics ---------------------------------------------------------------------------------------


def unbalanced(seed: int, spread: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values, design (intercept, two levels, a covariate) and participants, with a third of the cells gone."""
    random = np.random.default_rng(seed)
    people, level = np.repeat(np.arange(7), 3), np.tile(np.arange(3), 7)
    kept = random.random(21) > 0.3
    kept[:6] = True
    covariate = random.normal(size=21)
    values = 5 + level + 0.5 * covariate + spread * random.normal(size=7)[people] + random.normal(size=21)
    design = np.column_stack([np.ones(21), level == 1, level == 2, covariate]).astype(float)
    _, people = np.unique(people[kept], return_inverse=True)
    return values[kept], design[kept], people


def dense_criterion(variances: np.ndarray, values: np.ndarray, design: np.ndarray, people: np.ndarray) -> float:
    """−2 log restricted likelihood of σ_e², σ_b² with the matrices written out."""
    covariance = variances[0] * np.eye(len(values)) + variances[1] * (people[:, None] == people)
    inverse = np.linalg.inv(covariance)
    inner = design.T @ inverse @ design
    residual = values - design @ np.linalg.solve(inner, design.T @ inverse @ values)
    free = len(values) - design.shape[1]
    determinants = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
    return float(free * np.log(2 * np.pi) + determinants + residual @ inverse @ residual)


@pytest.mark.parametrize("seed", range(6))
def test_the_random_intercept_by_matrices_written_out_and_differences_for_derivatives(seed: int) -> None:
    values, design, people = unbalanced(seed, 3.0)
    found = fit(Rows(values, design, people))
    start = np.array([found.variance_residual, found.variances["participant"]])

    def criterion(logs: np.ndarray) -> float:
        return dense_criterion(np.exp(logs), values, design, people)

    lowest: Any = optimize.minimize(
        criterion,
        list(np.log(start * 1.3)),
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-12},
    )
    assert np.exp(lowest.x) == pytest.approx(start, rel=1e-4)
    assert -2 * found.log_likelihood == pytest.approx(lowest.fun, rel=1e-9)

    def variance(at: np.ndarray) -> float:
        covariance = at[0] * np.eye(len(values)) + at[1] * (people[:, None] == people)
        return float(np.linalg.inv(design.T @ np.linalg.inv(covariance) @ design)[1, 1])

    step = 1e-4 * start
    slope = np.array([(variance(start + h) - variance(start - h)) / (2 * h.sum()) for h in np.diag(step)])
    curvature = np.empty((2, 2))
    for i, a in enumerate(np.diag(step)):
        for j, b in enumerate(np.diag(step)):
            corners = [dense_criterion(start + s * a + r * b, values, design, people) for s in (1, -1) for r in (1, -1)]
            curvature[i, j] = (corners[0] - corners[1] - corners[2] + corners[3]) / (4 * a.sum() * b.sum())
    df = 2 * variance(start) ** 2 / (slope @ (2 * np.linalg.inv(curvature)) @ slope)
    assert degrees_of_freedom(found, np.eye(4)[1]) == pytest.approx(df, rel=1e-3)
    assert found.covariance[1, 1] == pytest.approx(variance(start))


@pytest.mark.parametrize("seed", range(4))
def test_estimates_are_those_of_statsmodels(seed: int) -> None:
    """Its estimates are right where its optimiser arrives; its p, from the normal distribution, are not used."""
    from statsmodels.regression.mixed_linear_model import MixedLM

    values, design, people = unbalanced(seed + 20, 2.0)
    found = fit(Rows(values, design, people))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its optimiser, which tries values at the boundary
        theirs = MixedLM(values, design, people).fit(reml=True, method=["powell"])
    assert found.coefficients == pytest.approx(theirs.fe_params, rel=1e-3, abs=1e-4)
    assert found.variance_residual == pytest.approx(theirs.scale, rel=1e-2)
    # Never worse than where theirs stopped.
    assert -2 * found.log_likelihood <= -2 * theirs.llf + 1e-9


def test_without_variance_between_participants_the_fit_is_singular_and_says_so() -> None:
    """As lmerTest has it, degrees of freedom are then those of the rows alone, and t that of least squares."""
    random = np.random.default_rng(5)
    values = random.normal(size=24)
    values -= np.repeat(values.reshape(8, 3).mean(axis=1), 3)  # no participant differs from another
    condition = Factor(("a", "b", "c"), np.tile(np.arange(3), 8))
    people = [f"P{index}" for index in np.repeat(np.arange(8), 3)]
    whole, *_ = mixed_model(values, people, {"condition": condition}, ["condition"])
    assert whole.details["singular"] is True
    assert "singular fit" in whole.method
    assert whole.df2 == pytest.approx(21)
    by_level = values.reshape(8, 3).T
    assert whole.statistic == pytest.approx(stats.f_oneway(*by_level).statistic)


def columns_of(levels: np.ndarray) -> dict[str, Column]:
    return {"condition": Factor(("a", "b"), levels)}


def test_what_a_mixed_model_cannot_tell_it_says() -> None:
    people, levels = list("PPQQRR"), np.tile([0, 1], 3)
    random = np.random.default_rng(1).normal(size=6)
    period = Covariate(levels + 1.0)
    (condition, _) = mixed_model(random, people, {**columns_of(levels), "period": period}, ["condition", "period"])
    assert condition.status == ALIASED
    whole = mixed_model(random[:2], people[:2], columns_of(levels[:2]), ["condition"])
    assert whole[0].status == "undefined: only one participant is complete"
    (exact,) = mixed_model(np.array([1.0, 2, 4, 5, 8, 9]), people, columns_of(levels), ["condition"])
    assert exact.status == NO_ERROR
    (few,) = mixed_model(random[:3], list("PPQ"), columns_of(levels[:3]), ["condition"])
    assert few.status == TOO_FEW_VALUES


def test_a_balanced_mixed_model_is_the_paired_t_test() -> None:
    data = np.random.default_rng(4).normal(size=(9, 2)) + np.random.default_rng(5).normal(0, 2, (9, 1))
    people = [f"P{index}" for index in np.repeat(np.arange(9), 2)]
    (found,) = mixed_model(data.ravel(), people, columns_of(np.tile([0, 1], 9)), ["condition"])
    t = t_paired(data[:, 0], data[:, 1])
    assert found.contrast == "a - b"
    assert t.statistic is not None
    for name in ("statistic", "df2", "p"):
        assert getattr(found, name) == pytest.approx(getattr(t, name), rel=1e-8)
    assert (found.ci_low, found.ci_high) == pytest.approx(t.details["ci_difference"])


def test_a_crossover_is_a_mixed_model_with_periods() -> None:
    random = np.random.default_rng(2)
    early = np.arange(11) % 2 == 0
    data = random.normal(size=(11, 2)) + random.normal(0, 2, (11, 1))
    treatment, period, _ = crossover(data, list(early), ("a", "b"))
    periods = np.where(early[:, None], [1.0, 2.0], [2.0, 1.0]).ravel()
    columns: dict[str, Column] = {**columns_of(np.tile([0, 1], 11)), "period": Covariate(periods)}
    people = [f"P{index}" for index in np.repeat(np.arange(11), 2)]
    condition, slope = mixed_model(data.ravel(), people, columns, ["condition", "period"])
    assert treatment.effect_size == pytest.approx(condition.effect_size)
    assert treatment.p == pytest.approx(condition.p, rel=1e-6)
    assert period.effect_size == pytest.approx(-(slope.effect_size or 0))
    assert crossover(data, [True] * 11, ("a", "b"))[0].status == ONE_ORDER


# Laws -------------------------------------------------------------------------------------------------------------

tables = st.lists(st.tuples(*[st.integers(-30, 30)] * 3), min_size=4, max_size=8).map(
    lambda rows: np.array(rows, dtype=float)
)


def modelled(data: np.ndarray, people: list[str] | None = None) -> Result:
    """The effect of three conditions in a mixed model."""
    names = people or [f"P{index}" for index in range(len(data))]
    codes = np.tile(np.arange(3), len(data))
    found = mixed_model(
        data.ravel(),
        [name for name in names for _ in range(3)],
        {"condition": Factor(tuple("abc"), codes)},
        ["condition"],
    )
    return found[0]


@settings(deadline=None, max_examples=30)
@given(data=tables, scale=st.sampled_from([0.001, 0.1, 7.0, 1e6]), shift=st.integers(-1000, 1000))
def test_units_and_the_order_of_participants_do_not_matter(data: np.ndarray, scale: float, shift: int) -> None:
    other = (data[::-1] + shift) * scale
    for test in (modelled, lambda values: art_anova(values, ["condition"])[0]):
        one, two = test(data), test(other)
        assert one.status == two.status
        for name in ("statistic", "df2", "p", "effect_size"):
            before = getattr(one, name)
            assert getattr(two, name) == (None if before is None else pytest.approx(before, rel=1e-5, abs=1e-7))


@settings(deadline=None, max_examples=40)
@given(data=tables)
def test_swapping_two_conditions_flips_signs_and_keeps_p(data: np.ndarray) -> None:
    first, second = data[:, 0], data[:, 1]
    one, two = tost(first, second, (-3, 5)), tost(second, first, (-5, 3))
    assert (one.status, one.p) == (two.status, None if two.p is None else pytest.approx(two.p))
    if one.statistic is not None and two.statistic is not None:
        assert abs(one.statistic) == pytest.approx(abs(two.statistic))
        if one.details["p_lower"] != pytest.approx(one.details["p_upper"]):  # else both sides are the weaker one
            assert one.statistic == pytest.approx(-two.statistic)
        assert one.details["p_lower"] == pytest.approx(two.details["p_upper"])
    factors = bayes_t(first, second), bayes_t(second, first)
    if factors[0].effect_size is not None:
        assert factors[0].statistic == pytest.approx(factors[1].statistic)
        assert factors[0].effect_size == pytest.approx(-(factors[1].effect_size or 0))


@settings(deadline=None, max_examples=40)
@given(data=tables, constant=st.integers(-50, 50))
def test_an_aligned_effect_leaves_nothing_of_the_others(data: np.ndarray, constant: int) -> None:
    """Adding to every value of one level of the other factor changes no rank of the first one's test."""
    one = np.stack([data, data[:, ::-1]], axis=2)
    two = one + np.array([0, constant])
    for before, after in zip(art_anova(one, ["a", "b"]), art_anova(two, ["a", "b"]), strict=True):
        if before.effect != "b" and before.statistic is not None:
            assert after.statistic == pytest.approx(before.statistic, rel=1e-9)


# Diagnostics ------------------------------------------------------------------------------------------------------


def test_outliers_by_hand() -> None:
    """Median 3, median deviation 1: 0.6745 · 6 / 1 = 4.05 is beyond 3.5, and 0.6745 · 5 = 3.37 is not."""
    assert far_out(np.array([1.0, 2, 3, 4, 9])) == [4]
    assert far_out(np.array([1.0, 2, 3, 4, 8])) == []
    assert far_out(np.array([5.0, 5, 5, 5, 900])) is None
    told = differences(np.array([1.0, 2, 3, 4, 9]), np.zeros(5), ["A", "B", "C", "D", "E"])
    assert told["outliers"] == ["E"]
    assert "Iglewicz and Hoaglin 1993" in told["outlier_rule"]


def test_normality_needs_three_values_that_differ() -> None:
    assert normality(np.array([1.0, 2.0])) == {"shapiro_w": None, "shapiro_p": None}
    assert normality(np.ones(9))["shapiro_p"] is None
    assert normality(np.arange(5001.0))["shapiro_p"] is None
    assert normality(np.arange(9.0))["shapiro_w"] == pytest.approx(stats.shapiro(np.arange(9.0)).statistic)


def test_every_case_with_a_model_of_its_own_is_met() -> None:
    assert set(TWO_WAY) == set(with_key("lmm_two_way"))
