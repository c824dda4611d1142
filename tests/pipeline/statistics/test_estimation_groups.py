"""Bootstrap and permutation of two groups: against R, and by themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.estimation_groups import ALL_ALIKE, TOO_FEW_IN_A_GROUP, bootstrap, permutation
from tests.pipeline import r_reference

EXPECTED = r_reference.expected("estimation_groups")
CASES = [name for name in EXPECTED if name != "versions"]


def groups(case: str) -> list[FloatArray]:
    rows = [row for row in r_reference.rows("estimation_groups") if row["case"] == case]
    return [np.array([float(row["value"]) for row in rows if row["group"] == group]) for group in "12"]


@pytest.mark.parametrize("case", CASES)
def test_bootstrap_against_rs_boot(case: str) -> None:
    """Two generators, and two jackknifes of the acceleration: bounds differ by a few hundredths of the width."""
    first, second = groups(case)
    low, high = EXPECTED[case]["bca_difference"]
    found = bootstrap(first, second, seed=1)
    assert found["bootstrap_ci_difference"] == pytest.approx([low, high], abs=0.05 * (high - low))
    assert found == bootstrap(first, second, seed=1)
    assert found["bootstrap_ci_difference"] != bootstrap(first, second, seed=2)["bootstrap_ci_difference"]


@pytest.mark.parametrize("case", CASES)
def test_permutation_over_all_splits(case: str) -> None:
    first, second = groups(case)
    found = permutation(first, second, seed=0)
    assert found["permutation_p"] == pytest.approx(EXPECTED[case]["permutation_p"], rel=1e-9)
    assert (found["permutation_exact"], found["permutation_count"]) == (True, EXPECTED[case]["splits"])


def test_many_splits_are_drawn_by_the_seed_and_near_the_test_itself() -> None:
    """Both groups are normal with one spread, where the permutation p is close to Welch's."""
    random = np.random.default_rng(3)
    first, second = random.normal(0, 1, 30), random.normal(0.6, 1, 30)
    found = permutation(first, second, seed=1)
    assert not found["permutation_exact"]
    assert found == permutation(first, second, seed=1)
    assert found["permutation_p"] == pytest.approx(stats.ttest_ind(first, second, equal_var=False).pvalue, abs=0.003)


def test_a_common_offset_and_scale_change_nothing() -> None:
    first, second = np.array([1.0, 2, 4, 7, 9]), np.array([5.0, 8, 9, 12, 13, 20])
    plain, far = permutation(first, second, 1), permutation(first * 1e80, second * 1e80, 1)
    assert plain == far == permutation(first + 2.0**40, second + 2.0**40, 1)
    low, high = bootstrap(first, second, 1)["bootstrap_ci_difference"]
    assert bootstrap(first * 2.0**200, second * 2.0**200, 1)["bootstrap_ci_difference"] == [
        low * 2.0**200,
        high * 2.0**200,
    ]


def test_what_cannot_be_resampled_is_said() -> None:
    assert bootstrap(np.arange(4.0), np.arange(9.0), 1)["no_bootstrap"] == TOO_FEW_IN_A_GROUP
    assert bootstrap(np.ones(5), np.zeros(5), 1)["no_bootstrap"] == ALL_ALIKE
    assert permutation(np.ones(1), np.zeros(5), 1)["permutation_p"] is None
    assert permutation(np.ones(4), np.zeros(4), 1)["permutation_p"] == pytest.approx(2 / 70)
