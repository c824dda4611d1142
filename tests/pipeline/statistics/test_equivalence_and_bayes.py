"""Equivalence and Bayes factors: against R, and against slower mathematics."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from pipeline.statistics.bayes import bayes_t, log_bayes_factor
from pipeline.statistics.equivalence import tost
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.reference import (
    TASKS,
    expected,
    same,
    study_of,
)

Folder = Callable[..., Path]


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(400)
PAIRED = [
    (case, task)
    for case, task in TASKS
    if isinstance(expected(case)["tasks"][task].get("paired", {}).get("t_test", {}).get("t"), float)
]


@pytest.mark.parametrize(("case", "task"), PAIRED)
def test_tost_against_rs_one_sided_t_tests(folder: Folder, case: str, task: str) -> None:
    """t.test(alternative = "greater") is the side of a bound at 0, and its 95 % limit the bound at which p is .05;
    the limits of the two-sided 95 % interval are those at which it is .025. A study's bounds have 0 between them, so
    that these are the function's alone."""
    reference = expected(case)["tasks"][task]
    one_sided, interval = reference["paired"]["t_test_one_sided_greater"], reference["paired"]["t_test"]["ci95"]
    limit, far = one_sided["ci95_lower"], 1000 * max(map(abs, interval))
    sides = [(0.0, far), (limit, far), (interval[0], far), (-far, interval[1]), (interval[0], interval[1])]
    path = study_of(folder, case, task, reference["conditions"], []) / "measures.csv"
    measured = pd.read_csv(path).pivot_table(index="participant", columns="condition", values="value")
    first, second = (measured[name].to_numpy(np.float64) for name in reference["conditions"])
    results = [tost(first, second, bounds) for bounds in sides]
    for result, p in zip(results, (one_sided["p"], 0.05, 0.025, 0.025, 0.025), strict=True):
        same(result.p, p)
        assert result.p == max(result.details["p_lower"], result.details["p_upper"])
    same(results[0].statistic, reference["paired"]["t_test"]["t"])
    same(results[0].details["ci90_difference"][0], limit)


def test_bounds_of_a_study_have_no_difference_between_them(folder: Folder, steadyhand: Steadyhand) -> None:
    """A difference between 2 and 5 is no equivalence, whatever its p."""
    case, task = PAIRED[0]
    conditions = expected(case)["tasks"][task]["conditions"]
    ran = steadyhand("compare", study_of(folder, case, task, conditions, ["test: tost, bounds: [2, 5]"]))
    assert ran.code == 2
    assert "bounds must have 0, no difference, between them, found [2.0, 5.0]" in ran.err


def test_the_bayes_factor_of_rs_sleep_data_is_the_printed_one() -> None:
    """17.25888, as BayesFactor prints it for ttestBF(…, paired = TRUE) of Student's data; its scale is √2/2."""
    one = np.array([0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0])
    other = np.array([1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4])
    found = bayes_t(one, other, prior_scale=2**-0.5)
    assert found.statistic == pytest.approx(17.25888, abs=5e-6)
    assert found.details["bf10"] == found.statistic
    assert found.p is None


# Against slower mathematics ---------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=25)
@given(t=st.floats(-12, 12), n=st.integers(3, 60), scale=st.floats(0.2, 2))
def test_bayes_factors_by_integrating_over_the_effect_size(t: float, n: int, scale: float) -> None:
    """The same prior seen the other way: d_z is Cauchy, and t noncentral with δ = d_z √n, a normal over a χ."""
    df = n - 1
    low, high = stats.chi.ppf(1e-15, df), stats.chi.isf(1e-15, df)
    s = ((_NODES + 1) / 2 * (high - low) + low) / np.sqrt(df)
    weights = _WEIGHTS * (high - low) / 2 * stats.chi.pdf(s * np.sqrt(df), df) * s
    reach = 9 + abs(t) * s.max()
    shift = np.linspace(-reach, reach, 6001)
    density = np.exp(-((t * s - shift[:, None]) ** 2) / 2) / np.sqrt(2 * np.pi) @ weights
    marginal = integrate.trapezoid(density * stats.cauchy.pdf(shift / np.sqrt(n), scale=scale) / np.sqrt(n), shift)
    assert np.exp(log_bayes_factor(t, n, scale)) == pytest.approx(marginal / stats.t.pdf(t, df), rel=1e-6)
