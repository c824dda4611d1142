"""Bootstrap, permutation, intervals within participants and one-sided Bayes factors: against R, and their laws."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from pipeline.statistics.bayes import bayes_t, log_bayes_factor, log_shares
from pipeline.statistics.estimation import bootstrap, permutation, within_intervals
from pipeline.statistics.paired import t_paired
from tests.pipeline import r_reference

ESTIMATION, BAYES = r_reference.expected("estimation"), r_reference.expected("bayes_one_sided")
PAIRS = [name for name in ESTIMATION if name not in ("versions", "three_conditions")]


def values(case: str) -> np.ndarray:
    rows = [row for row in r_reference.rows("estimation") if row["case"] == case]
    return r_reference.matrix(rows, "condition", "value")


@pytest.mark.parametrize("case", PAIRS)
def test_bootstrap_against_rs_boot(case: str) -> None:
    """Two generators: bounds differ by the Monte Carlo error of some 10,000 resamples, 3 % of the width.

    Of whole numbers a resample's mean is often the mean found; R counts none of these as below it, SciPy half of them,
    which moves a bound to the next possible mean.
    """
    room = 0.1001 if case == "whole_n10" else 0.0
    wanted, (first, second) = ESTIMATION[case], values(case).T
    found = bootstrap(first, second, seed=1)
    for name, theirs in (("bootstrap_ci_difference", "bca_difference"), ("bootstrap_ci_dz", "bca_dz")):
        low, high = wanted[theirs]
        assert found[name] == pytest.approx([low, high], abs=0.03 * (high - low) + room)
    assert found == bootstrap(first, second, seed=1)
    assert found["bootstrap_ci_dz"] != bootstrap(first, second, seed=2)["bootstrap_ci_dz"]


@pytest.mark.parametrize("case", PAIRS)
def test_permutation_against_exact_rank_tests(case: str) -> None:
    first, second = values(case).T
    found = permutation(first, second, seed=0)
    assert found["permutation_p"] == pytest.approx(ESTIMATION[case]["permutation_p"], rel=1e-9)
    assert found["permutation_exact"]
    assert found["permutation_count"] == 2 ** len(first)
    assert found["permutation_p_error"] is None


@pytest.mark.parametrize("case", [*PAIRS, "three_conditions"])
def test_cousineau_morey_written_out_in_r(case: str) -> None:
    for found, wanted in zip(within_intervals(values(case)), ESTIMATION[case]["morey"], strict=True):
        assert found == pytest.approx(wanted, rel=1e-9)


def test_of_two_conditions_the_intervals_show_what_the_paired_t_test_rests_on() -> None:
    """Their half-width is 1/√2 of that of the difference, whatever participants differ in (Morey 2008)."""
    data = values("normal_n12") + 100 * np.arange(12.0)[:, None]
    (low, high), _ = (interval for interval in within_intervals(data) if interval is not None)
    of_difference = t_paired(*data.T).details["ci_difference"]
    assert (high - low) * np.sqrt(2) == pytest.approx(of_difference[1] - of_difference[0])


def test_there_is_no_interval_within_one_participant_or_one_condition() -> None:
    assert within_intervals(np.ones((1, 3))) == [None] * 3
    assert within_intervals(np.arange(4.0)[:, None]) == [None]


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(-9, 12), min_size=2, max_size=9).filter(any))
def test_permutation_by_writing_out_every_sign(differences: list[int]) -> None:
    sums = [
        abs(sum(s * d for s, d in zip(signs, differences, strict=True)))
        for signs in product([1, -1], repeat=len(differences))
    ]
    share = sum(one >= abs(sum(differences)) for one in sums) / len(sums)
    for unit in (1.0, 0.1):
        found = permutation(np.array(differences) * unit, np.zeros(len(differences)), seed=0)
        assert found["permutation_p"] == pytest.approx(share)


def test_where_drawing_takes_over_the_two_agree() -> None:
    """SciPy's own way, on the most participants whose signs are counted."""
    values = np.round(np.random.default_rng(2).normal(0.3, 1, 40), 2)
    exact = permutation(values, np.zeros(40), seed=0)
    drawn = stats.permutation_test(
        (values,), np.mean, permutation_type="samples", vectorized=True, n_resamples=50_000, batch=10_000, rng=1
    )
    assert exact["permutation_exact"]
    assert drawn.pvalue == pytest.approx(exact["permutation_p"], abs=0.005)


def test_many_participants_are_drawn_from_and_the_error_is_said() -> None:
    random = np.random.default_rng(5)
    first, second = random.normal(0.3, 1, 60), np.zeros(60)
    found = permutation(first, second, seed=3)
    assert not found["permutation_exact"]
    assert found["permutation_count"] == 99_999
    assert found == permutation(first, second, seed=3)
    p, error = found["permutation_p"], found["permutation_p_error"]
    assert error == pytest.approx(np.sqrt(p * (1 - p) / 99_999))
    assert abs(p - permutation(first, second, seed=4)["permutation_p"]) < 5 * error
    assert p == pytest.approx(t_paired(first, second).p, abs=0.01)


@pytest.mark.parametrize(
    ("differences", "reason"),
    [
        ([1.0, 2, 3, 5], "no bootstrap: it needs 5 participants"),
        ([2.0] * 8, "no bootstrap: all differences are equal"),
        ([], "no bootstrap: it needs 5 participants"),
    ],
)
def test_differences_that_cannot_be_resampled_say_why(differences: list[float], reason: str) -> None:
    found = bootstrap(np.array(differences), np.zeros(len(differences)), seed=0)
    assert found["no_bootstrap"] == reason
    assert found["bootstrap_ci_difference"] is None
    assert found["bootstrap_ci_dz"] is None


@settings(deadline=None, max_examples=25)
@given(st.lists(st.integers(-3, 4), min_size=0, max_size=12), st.sampled_from([1.0, 0.1, 1e95, 1e-90]))
def test_any_differences_have_figures_or_a_reason(differences: list[int], size: float) -> None:
    first, second = np.array(differences, dtype=float) * size, np.zeros(len(differences))
    found = bootstrap(first, second, seed=0)
    for name in ("bootstrap_ci_difference", "bootstrap_ci_dz"):
        assert found[name] is None or np.isfinite(found[name]).all()
        assert found[name] is not None or "no_bootstrap" in found
    p = permutation(first, second, seed=0)["permutation_p"]
    assert (p is None) == (not differences)
    assert p is None or 0 < p <= 1


# Bayes factors ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [0.707, 1.0])
@pytest.mark.parametrize("case", [name for name in BAYES if name != "versions"])
def test_one_sided_bayes_factors_against_bayes_factor(case: str, scale: float) -> None:
    """To 1e-3, as exactly as the package integrates. Of a large t it takes an approximation, off by a factor of 5."""
    wanted = BAYES[case][f"r{scale:g}"]
    first = np.array([float(row["difference"]) for row in r_reference.rows("bayes_one_sided") if row["case"] == case])
    zero = np.zeros(len(first))
    found = bayes_t(first, zero, scale)
    for name in ("bf10", "bf_plus0", "bf_minus0"):
        if (case, name) != ("strong_n20", "bf_minus0"):
            assert found.details[name] == pytest.approx(wanted[name], rel=1e-3)
    assert bayes_t(first, zero, scale, alternative="greater").statistic == found.details["bf_plus0"]
    less = bayes_t(first, zero, scale, alternative="less")
    assert (less.statistic_name, less.statistic) == ("BF-0", found.details["bf_minus0"])


@pytest.mark.parametrize(("t", "n"), [(0.0, 5), (1.3, 12), (-2.4, 9), (4.0, 20), (13.9, 20)])
def test_one_sided_bayes_factors_by_quadrature_over_the_effect(t: float, n: int) -> None:
    """∫ 2·Cauchy(δ) · noncentral t(t; δ√n) dδ over one side, over the central t."""
    above, below = log_shares(t, n, 0.707)
    for side, share in ((1, above), (-1, below)):
        marginal = integrate.quad(
            lambda d, side=side: 2 * stats.cauchy.pdf(d, scale=0.707) * stats.nct.pdf(side * t, n - 1, d * np.sqrt(n)),
            0,
            np.inf,
            limit=400,
            epsabs=0,
        )[0]
        factor = np.exp(log_bayes_factor(t, n, 0.707) + np.log(2) + share)
        assert factor == pytest.approx(marginal / stats.t.pdf(t, n - 1), rel=1e-5)


@given(t=st.floats(-60, 60), n=st.integers(2, 60))
def test_the_two_sides_make_the_whole(t: float, n: int) -> None:
    above, below = log_shares(t, n, 0.707)
    assert np.exp(above) + np.exp(below) == pytest.approx(1)
    mirrored = log_shares(-t, n, 0.707)
    assert mirrored == pytest.approx((below, above), rel=1e-9, abs=1e-9)
    assert (above > below) == (t > 0) or abs(t) < 1e-9


def test_a_bayes_factor_beyond_the_largest_number_keeps_its_logarithm() -> None:
    first: Any = 1000 + np.random.default_rng(0).normal(0, 0.001, 60)
    found = bayes_t(first, np.zeros(60), alternative="greater")
    assert found.statistic is None
    assert found.details["log_bf_plus0"] > 700
    assert 0 < found.details["bf_minus0"] < 1
