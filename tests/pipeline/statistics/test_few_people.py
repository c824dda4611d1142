"""What two or three people can tell, and what they cannot."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.statistics import ONE_ORDER, TOO_FEW_VALUES
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.crossover import crossover
from pipeline.statistics.mixed import Column, Covariate, Factor, mixed_model


def test_three_people_in_three_conditions_have_mauchlys_test() -> None:
    """Of a − b they differ by 2, 0, −2 and of a + b − 2c by 6, −12, 6 from the mean.

    Over √2 and √6 these are orthonormal contrasts; their variances are 2 and 18, and they are uncorrelated, so that
    W = 2 · 18 / ((2 + 18) / 2)² = .36, and ε = (2 + 18)² / (2 · (2² + 18²)) = 400 / 656. With two contrasts and two
    degrees of freedom ρ is 1/2, and χ² of two degrees of freedom gives p = exp(ln(W) / 2) = .6.
    """
    apart = np.array([[4.0, 2.0, 0.0], [-6.0, -6.0, 0.0], [2.0, 4.0, 0.0]])
    found = rm_anova(apart + np.array([10.0, 12.0, 15.0]), ["condition"])[0].details
    assert found["mauchly_w"] == pytest.approx(0.36)
    assert found["mauchly_p"] == pytest.approx(0.6)
    assert found["epsilon_gg"] == pytest.approx(400 / 656)


def test_two_people_in_three_conditions_have_none() -> None:
    found = rm_anova(np.array([[1.0, 5.0, 4.0], [2.0, 3.0, 9.0]]), ["condition"])[0].details
    assert (found["mauchly_w"], found["mauchly_p"]) == (None, None)


def test_one_person_of_each_order_leaves_nothing_to_judge_a_crossover_by() -> None:
    values = np.array([[3.0, 1.0], [7.0, 4.0], [2.0, 2.5]])
    assert [row.status for row in crossover(values[:2], [True, False], ("a", "b"))] == [TOO_FEW_VALUES] * 3
    whole = crossover(values, [True, False, False], ("a", "b"))
    assert [(row.status, row.df2) for row in whole] == [("ok", 1.0)] * 3


@pytest.mark.parametrize("first_came_first", [True, False])
def test_whoever_all_met_the_conditions_in_one_order_are_no_crossover(first_came_first: bool) -> None:
    values = np.random.default_rng(0).normal(size=(4, 2))
    assert [row.status for row in crossover(values, [first_came_first] * 4, ("a", "b"))] == [ONE_ORDER] * 3


def test_what_explains_all_that_differs_between_people_leaves_no_variance_between_them() -> None:
    """Two people of two ages: a line over age meets both of their means, whatever they are. Three do not lie on one."""
    random = np.random.default_rng(2)

    def statuses(ages: list[float]) -> list[str]:
        people = np.repeat(np.arange(len(ages)), 6)
        columns: dict[str, Column] = {
            "condition": Factor(("a", "b"), np.tile([0, 1], 3 * len(ages))),
            "age": Covariate(np.array(ages)[people]),
        }
        values, names = random.normal(size=len(people)), [f"P{person}" for person in people]
        return [row.status for row in mixed_model(values, names, columns, list(columns))]

    assert statuses([20.0, 31.0]) == [TOO_FEW_VALUES] * 2
    assert statuses([20.0, 31.0, 44.0]) == ["ok"] * 2
