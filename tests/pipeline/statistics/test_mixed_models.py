"""Mixed models with several random intercepts: against lmerTest, against matrices written out, against laws."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize

from pipeline.statistics import NO_RESIDUAL, OK, STATUSES, variance_components
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.mixed import Column, Covariate, Factor, cells_of, mixed_model
from pipeline.statistics.result import Result
from pipeline.statistics.satterthwaite import degrees_of_freedom
from pipeline.statistics.variance_components import Problem, distinct
from tests.pipeline.statistics.r_cases import close, expected, levels, rows, with_key

MODEL = 1e-5  # estimates, at which R's optimiser stops
SATTERTHWAITE = 1e-3  # degrees of freedom and p: R differentiates numerically


def columns_of(case: str) -> dict[str, Factor]:
    """The factors of a case."""
    names = ("condition", "target")
    at = {name: levels(case, name) for name in names}
    return {
        name: Factor(tuple(at[name]), np.array([at[name].index(row[name]) for row in rows(case)])) for name in names
    }


def modelled(case: str, formula: str) -> list[Result]:
    """What R's formula asks."""
    factors = columns_of(case)
    fixed = [part.strip() for part in formula.split("~")[1].split(" + ") if "|" not in part]
    terms = ["condition", "target", "condition:target"] if "condition * target" in fixed else fixed
    participants = [row["participant"] for row in rows(case)]
    intercepts = {
        "participant:condition": cells_of(participants, factors["condition"]),
        "target": factors["target"].codes,
    }
    random = {name: codes for name, codes in intercepts.items() if f"| {name})" in formula}
    columns: dict[str, Column] = {name: factor for name, factor in factors.items() if name in terms}
    return mixed_model(np.array([float(row["value"]) for row in rows(case)]), participants, columns, terms, random)


MODELS = [(case, model["formula"]) for case in with_key("models") for model in expected(case)["models"]]


@pytest.mark.parametrize(("case", "formula"), MODELS)
def test_against_lmertest(case: str, formula: str) -> None:
    wanted = next(model for model in expected(case)["models"] if model["formula"] == formula)
    found = modelled(case, formula)
    details = found[0].details
    close(-2 * details["log_likelihood"], wanted["reml_criterion"], MODEL)
    close(details["variance_residual"], wanted["variances"]["Residual"], MODEL)
    for name, variance in details["variances"].items():
        assert variance == pytest.approx(wanted["variances"][name], rel=MODEL, abs=1e-12)
    assert details["singular"] == wanted["singular"]
    for term, theirs in wanted["anova"].items():
        row = next(row for row in found if row.effect == term)
        close(row.statistic if row.statistic_name == "F" else (row.statistic or 0) ** 2, theirs["F"], MODEL)
        close(row.df2, theirs["df2"], SATTERTHWAITE)
        close(row.p, theirs["p"], SATTERTHWAITE)
    first = levels(case, "condition")[0]
    for name, theirs in wanted["fixed"].items():
        if name.startswith("condition") and ":" not in name and "*" not in formula:
            contrast = f"{first} - {name.removeprefix('condition')}"
            row = next(row for row in found if row.contrast == contrast)
            close([row.effect_size, row.details["se"]], [-theirs["estimate"], theirs["se"]], MODEL)
            close([row.df2, row.p], [theirs["df"], theirs["p"]], SATTERTHWAITE)


def test_the_method_says_what_was_fitted() -> None:
    whole = "value ~ condition + (1 | participant) + (1 | participant:condition) + (1 | target)"
    plain = modelled("models_balanced", whole)[0].method
    intercepts = "(1 | participant) + (1 | participant:condition) + (1 | target)"
    assert plain == f"linear mixed model, {intercepts}, REML, Satterthwaite degrees of freedom"
    singular = modelled("models_singular", whole)[0]
    assert singular.status == OK
    assert singular.method.endswith(
        "; singular fit, estimated as zero and left out: (1 | participant:condition) + (1 | target)"
    )


def test_a_random_intercept_that_is_fixed_as_well_is_left_out() -> None:
    both = "value ~ condition + target + (1 | participant) + (1 | participant:condition) + (1 | target)"
    found = modelled("models_unbalanced", both)
    assert found[0].method.endswith("; left out, as these data cannot tell its variance: (1 | target)")
    alone = modelled("models_unbalanced", both.removesuffix(" + (1 | target)"))
    assert found[0].p == pytest.approx(alone[0].p)


# Against slower mathematics ---------------------------------------------------------------------------------------


def problem(seed: int, count: int = 45) -> Problem:
    random = np.random.default_rng(seed)
    people, condition, target = random.integers(0, 6, count), random.integers(0, 2, count), random.integers(0, 4, count)
    design = np.column_stack([np.ones(count), condition, random.normal(size=count)])
    values = 2 * random.normal(size=6)[people] + 1.5 * random.normal(size=12)[2 * people + condition]
    values += random.normal(size=4)[target] + random.normal(size=count) + condition
    groupings = {"participant": people, "participant:condition": 2 * people + condition, "target": target}
    return Problem(values, design, groupings)


def dense_criterion(variances: Sequence[float], at: Problem) -> float:
    """−2 log restricted likelihood with the matrices written out."""
    covariance = variances[0] * np.eye(len(at.values))
    for variance, codes in zip(variances[1:], at.groupings.values(), strict=True):
        covariance += variance * (codes[:, None] == codes)
    inverse = np.linalg.inv(covariance)
    inner = at.design.T @ inverse @ at.design
    residual = at.values - at.design @ np.linalg.solve(inner, at.design.T @ inverse @ at.values)
    determinants = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
    return float(at.free * np.log(2 * np.pi) + determinants + residual @ inverse @ residual)


def dense_variance(variances: np.ndarray, at: Problem) -> float:
    """Of the second coefficient."""
    covariance = variances[0] * np.eye(len(at.values))
    for variance, codes in zip(variances[1:], at.groupings.values(), strict=True):
        covariance += variance * (codes[:, None] == codes)
    return float(np.linalg.inv(at.design.T @ np.linalg.inv(covariance) @ at.design)[1, 1])


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_fit_by_matrices_written_out_and_differences_for_derivatives(seed: int) -> None:
    at = problem(seed)
    found = variance_components.fit(at)
    assert found is not None
    assert not found.zero
    start = np.array([found.variance_residual, *found.variances.values()])

    def criterion(logs: np.ndarray) -> float:
        return dense_criterion(list(np.exp(logs)), at)

    lowest: Any = optimize.minimize(
        criterion,
        list(np.log(start * 1.2)),
        method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-11, "maxiter": 4000, "maxfev": 4000},
    )
    assert np.exp(lowest.x) == pytest.approx(start, rel=1e-3)
    assert -2 * found.log_likelihood == pytest.approx(lowest.fun, rel=1e-8)
    assert found.covariance[1, 1] == pytest.approx(dense_variance(start, at))
    steps = np.diag(1e-4 * start)
    slope = np.array([(dense_variance(start + h, at) - dense_variance(start - h, at)) / (2 * h.sum()) for h in steps])
    assert [matrix[1, 1] for matrix in found.derivatives] == pytest.approx(list(slope), rel=1e-5)
    curvature = np.empty((len(start), len(start)))
    for i, a in enumerate(steps):
        for j, b in enumerate(steps):
            corners = [dense_criterion(list(start + s * a + r * b), at) for s in (1, -1) for r in (1, -1)]
            curvature[i, j] = (corners[0] - corners[1] - corners[2] + corners[3]) / (4 * a.sum() * b.sum())
    df = 2 * dense_variance(start, at) ** 2 / (slope @ (2 * np.linalg.inv(curvature)) @ slope)
    assert degrees_of_freedom(found, np.eye(3)[1]) == pytest.approx(df, rel=1e-3)


def test_in_a_balanced_design_conditions_are_tested_as_by_the_analysis_of_variance() -> None:
    """With (1 | participant:condition) F and its degrees of freedom are rm_anova's of participants' means; without it
    the rows of a cell count as independent, and F of two conditions is four times as large here."""
    random = np.random.default_rng(12)
    values = random.normal(0, 2, (9, 1, 1)) + random.normal(0, 1.5, (9, 3, 1)) + random.normal(0, 1, (9, 3, 8))
    people = [f"P{index}" for index in np.repeat(np.arange(9), 24)]
    condition = Factor(tuple("abc"), np.tile(np.repeat(np.arange(3), 8), 9))
    cells = {"participant:condition": cells_of(people, condition)}
    whole = mixed_model(values.ravel(), people, {"condition": condition}, ["condition"], cells)[0]
    wanted = rm_anova(values.mean(axis=2), ["condition"])[0]
    for name in ("statistic", "df1", "df2", "p"):
        assert getattr(whole, name) == pytest.approx(getattr(wanted, name), rel=1e-7)
    without = mixed_model(values.ravel(), people, {"condition": condition}, ["condition"])[0]
    assert (without.statistic or 0) > 2 * (whole.statistic or 0)


def test_one_row_a_cell_leaves_nothing_for_cells_to_vary_in() -> None:
    values = np.random.default_rng(1).normal(size=20) + np.repeat(np.random.default_rng(2).normal(0, 2, 10), 2)
    people, condition = [str(index) for index in np.repeat(np.arange(10), 2)], Factor(("a", "b"), np.tile([0, 1], 10))
    cells = {"participant:condition": cells_of(people, condition)}
    (with_cells,) = mixed_model(values, people, {"condition": condition}, ["condition"], cells)
    (without,) = mixed_model(values, people, {"condition": condition}, ["condition"])
    assert with_cells.p == without.p
    assert "left out, as these data cannot tell its variance: (1 | participant:condition)" in with_cells.method


# Laws -------------------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=15)
@given(
    seed=st.integers(0, 10_000),
    scale=st.sampled_from([1e-90, 0.001, 7.0, 1e95]),
    shift=st.sampled_from([0.0, 1.0, 1e4]),
)
def test_units_and_the_order_of_rows_do_not_matter(seed: int, scale: float, shift: float) -> None:
    at = problem(seed)
    people = [f"P{code}" for code in at.groupings["participant"]]
    random = {name: codes for name, codes in at.groupings.items() if name != "participant"}
    condition, covariate = Factor(("a", "b"), at.design[:, 1].astype(int)), Covariate(at.design[:, 2])
    columns: dict[str, Column] = {"condition": condition, "size": covariate}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one = mixed_model(at.values, people, columns, ["condition", "size"], random)
        order = np.random.default_rng(seed).permutation(len(people))
        two = mixed_model(
            (at.values[order] + shift) * scale,
            [people[index] for index in order],
            {"condition": Factor(("a", "b"), condition.codes[order]), "size": Covariate(covariate.values[order])},
            ["condition", "size"],
            {name: codes[order] for name, codes in random.items()},
        )
    for before, after in zip(one, two, strict=True):
        assert after.status == before.status == OK
        assert (after.df2, after.p) == pytest.approx((before.df2, before.p), rel=1e-5, abs=1e-9)
        assert after.effect_size == pytest.approx((before.effect_size or 0) * scale, rel=1e-6)
        assert after.details["se"] == pytest.approx(before.details["se"] * scale, rel=1e-6)


@settings(deadline=None, max_examples=25)
@given(
    values=st.lists(st.integers(-3, 3), min_size=24, max_size=24),
    seed=st.integers(0, 99),
)
def test_any_small_integers_have_a_fit_or_a_status(values: list[int], seed: int) -> None:
    random = np.random.default_rng(seed)
    people = [str(code) for code in np.repeat(np.arange(4), 6)]
    condition, target = Factor(("a", "b"), np.tile(np.repeat([0, 1], 3), 4)), random.integers(0, 3, 24)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (found,) = mixed_model(
            np.array(values, dtype=float),
            people,
            {"condition": condition},
            ["condition"],
            {"participant:condition": cells_of(people, condition), "target": target},
        )
    assert (
        found.status in STATUSES
    )  # of a handful of small whole numbers the likelihood may be flat: NOT_CONVERGED says so
    assert (found.p is None) == (found.status != OK)


def test_rows_of_a_cell_that_never_differ_leave_no_residual() -> None:
    cells = np.random.default_rng(5).normal(size=(6, 2, 1))
    people, condition = (
        [str(code) for code in np.repeat(np.arange(6), 6)],
        Factor(("a", "b"), np.tile([0, 0, 0, 1, 1, 1], 6)),
    )
    (found,) = mixed_model(
        np.broadcast_to(cells, (6, 2, 3)).ravel(),
        people,
        {"condition": condition},
        ["condition"],
        {"participant:condition": cells_of(people, condition)},
    )
    assert found.status == NO_RESIDUAL


def test_intercepts_that_are_one_are_told_apart_by_none() -> None:
    at = problem(1)
    twice = Problem(at.values, at.design, {**at.groupings, "again": at.groupings["target"] + 5})
    assert distinct(twice)[1] == ["again"]
