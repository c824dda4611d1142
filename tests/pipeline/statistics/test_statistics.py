"""Statistics against R, through the path a study takes, and against laws that must hold."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics import STATUSES
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.effect_size import hedges_correction, noncentral_t_cdf, partial_eta_squared_interval
from pipeline.statistics.friedman import friedman
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.paired import t_paired
from pipeline.statistics.wilcoxon import hodges_lehmann, signed_rank_p, wilcoxon
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.reference import (
    BAYES,
    BOUND,
    SHAPIRO,
    TASKS,
    compared,
    expected,
    same,
    study_of,
    the,
    with_key,
)

Folder = Callable[..., Path]

TESTS = (
    "test: rm_anova, adjust: holm",
    "test: friedman, adjust: holm",
    "test: t_paired, adjust: holm",
    "test: wilcoxon, adjust: holm",
    "test: wilcoxon, zeros: pratt",
    "test: bayes_t",
    "test: art_anova",
    "test: mixed_model",
    "test: tost, bounds: [-5, 5]",
)

DEGENERATE = {
    "all_zero_diff_n8": dict.fromkeys(
        ("rm_anova", "friedman", "t_paired", "wilcoxon", "bayes_t", "art_anova", "mixed_model", "tost"),
        "undefined: all differences are zero",
    ),
    "constant_all_3cond_n6": {
        **dict.fromkeys(("t_paired", "wilcoxon", "bayes_t", "tost"), "undefined: all differences are zero"),
        **dict.fromkeys(("rm_anova", "friedman", "art_anova", "mixed_model"), "undefined: no value varies"),
    },
    "no_complete_case_n6": {
        **dict.fromkeys(
            ("rm_anova", "friedman", "t_paired", "wilcoxon", "bayes_t", "art_anova", "tost"),
            "undefined: each participant met one condition; write factors: {condition: between} and test: t_welch,"
            " mann_whitney, anova_welch or kruskal",
        ),
        "mixed_model": (
            "undefined: nobody has values in two conditions, so the effect cannot be told from the participants"
        ),
    },
}
"""What the hand-written policy of each case means, in our words."""

R_STOPPED_EARLY = 0.202439052155873
"""A bound of partial η² at which the noncentral F (0.0659; 1, 11) is .0506 where .05 is meant; ours is at .0500000."""


@pytest.mark.parametrize(("case", "task"), TASKS)
def test_against_r(folder: Folder, steadyhand: Steadyhand, case: str, task: str) -> None:
    reference = expected(case)["tasks"][task]
    rows = compared(steadyhand, study_of(folder, case, task, reference["conditions"], TESTS))
    of: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        assert row["status"] in STATUSES
        of.setdefault(row["test"], []).append(row)
        if row["test"] != "mixed_model":
            assert row["n"] == reference["n_complete"]
    _descriptives(steadyhand.results()["descriptives"], reference)
    if case in DEGENERATE:
        for row in rows:
            assert (row["p"], row["statistic"], row["effect_size"]) == (None, None, None)
            if row["contrast"] is None or row["test"] not in ("rm_anova", "mixed_model"):
                assert row["status"] == DEGENERATE[case][row["test"]]
        return
    _anova(of["rm_anova"][0], reference["rm_anova"]["condition"])
    if "friedman" in reference:
        _friedman(of["friedman"][0], reference["friedman"])
    if "paired" in reference:
        _paired(of["t_paired"][0], reference["paired"])
        same(of["bayes_t"][0]["statistic"], reference["paired"]["bayes_factor_jzs"]["bf10_r0.707"], BAYES)
        dropped = next(row for row in of["wilcoxon"] if "dropped" in row["method"])
        _wilcoxon(dropped, reference["wilcoxon"], "exact_enumeration_zeros_dropped", "zeros_dropped")
        pratt = next(row for row in of["wilcoxon"] if "Pratt" in row["method"])
        _wilcoxon(pratt, reference["wilcoxon"], "exact_enumeration_pratt", "pratt_denominator")
    if "pairwise" in reference:
        _pairwise(of, reference["pairwise"])
        same(of["rm_anova"][0]["details"]["residual_shapiro_w"], reference["residual_shapiro"]["W"], SHAPIRO)
        same(of["rm_anova"][0]["details"]["residual_shapiro_p"], reference["residual_shapiro"]["p"], SHAPIRO)


def _descriptives(rows: list[dict[str, Any]], reference: dict[str, Any]) -> None:
    for row in rows:
        wanted = reference["descriptives_all_available"][row["condition"]]
        for name in ("n", "mean", "sd", "median"):
            same(row[name], wanted[name])
        if isinstance(wanted["ci95_t"], list) and wanted["n"] > 1:
            same(row["ci_low"], wanted["ci95_t"][0])
            same(row["ci_high"], wanted["ci95_t"][1])


def _anova(row: dict[str, Any], wanted: dict[str, Any]) -> None:
    same(row["statistic"], wanted["F"])
    same(row["p"], wanted["p"])
    same(row["effect_size"], wanted["generalized_eta2"])
    same(row["details"]["partial_eta_squared"], wanted["partial_eta2"])
    bounds = {"partial_eta_squared_ci": "partial_eta2_ci95", "partial_eta_squared_ci90": "partial_eta2_ci90"}
    for ours, theirs in bounds.items():
        for found, bound in zip(row["details"][ours], wanted[theirs], strict=True):
            if bound != R_STOPPED_EARLY:
                same(found, bound, 1e-4)
    assert row["ci_low"] - 1e-12 <= row["effect_size"] <= row["ci_high"] + 1e-12
    names = {
        "mauchly_w": "mauchly_W",
        "mauchly_p": "mauchly_p",
        "epsilon_gg": "gg_eps",
        "epsilon_hf": "hf_eps",
        "p_gg": "p_gg",
        "p_hf": "p_hf",
    }
    for ours, theirs in names.items():
        if "sphericity" in wanted:
            same(row["details"][ours], wanted["sphericity"].get(theirs))
        else:
            assert row["details"][ours] is None


def _friedman(row: dict[str, Any], wanted: dict[str, Any]) -> None:
    same(row["statistic"], wanted["friedman"]["chi2"])
    same(row["details"]["chi2_p"], wanted["friedman"]["p"])  # R's; ours is exact where it is cheap
    same(row["effect_size"], wanted["kendall_W"])
    same(row["details"]["iman_davenport_f"], wanted["iman_davenport"]["F"])
    same(row["details"]["iman_davenport_p"], wanted["iman_davenport"]["p"])


def _paired(row: dict[str, Any], wanted: dict[str, Any]) -> None:
    same(row["statistic"], wanted["t_test"]["t"])
    same(row["df2"], wanted["t_test"]["df"])
    same(row["p"], wanted["t_test"]["p"])
    same(row["effect_size"], wanted["cohen_dz"]["estimate"])
    same(row["ci_low"], wanted["cohen_dz"]["ci95_noncentral_t"][0], BOUND)
    same(row["ci_high"], wanted["cohen_dz"]["ci95_noncentral_t"][1], BOUND)
    same(row["details"]["d_av"], wanted["cohen_dav_cumming_sqrt_mean_var"]["estimate"])
    same(row["mean_difference"], wanted["mean_diff"])
    same(row["reduction"], wanted["percent_change_from_1"] / 100)
    for found, bound in zip(row["details"]["ci_difference"], wanted["t_test"]["ci95"], strict=True):
        same(found, bound)
    if row["n"] > 2:
        same(row["details"]["hedges_gz"], wanted["hedges_gz"]["estimate_exact_J"])
        same(row["details"]["shapiro_w"], wanted["shapiro_diff"]["W"], SHAPIRO)
        same(row["details"]["shapiro_p"], wanted["shapiro_diff"]["p"], SHAPIRO)
    else:
        assert row["details"]["hedges_gz"] is None
        assert row["details"]["shapiro_w"] is None


def _wilcoxon(row: dict[str, Any], wanted: dict[str, Any], exact: str, biserial: str) -> None:
    if exact in wanted:
        same(row["statistic"], wanted[exact]["W_plus"])
        same(row["p"], wanted[exact]["p_two_sided"])
        same(row["details"]["w_minus"], wanted[exact]["W_minus"])
    same(row["effect_size"], wanted["rank_biserial"].get(biserial))
    same(row["details"]["hodges_lehmann"], wanted["hodges_lehmann"]["walsh_median_all"])
    interval = wanted["hodges_lehmann"]["walsh_exact_ci95_all"]
    if interval["attainable"]:
        same(row["details"]["hodges_lehmann_ci"][0], interval["ci"][0])
        same(row["details"]["hodges_lehmann_ci"][1], interval["ci"][1])
    else:
        assert row["details"]["hodges_lehmann_ci"] is None


def _pairwise(of: dict[str, list[dict[str, Any]]], wanted: dict[str, Any]) -> None:
    ranked = [row for row in of["wilcoxon"] if "dropped" in row["method"]]
    for index, pair in enumerate(wanted["comparisons"]):
        name = f"{pair['a']} - {pair['b']}"
        t = next(row for row in of["t_paired"] if row["contrast"] == name)
        w = next(row for row in ranked if row["contrast"] == name)
        same(t["p"], pair["p_t"])
        same(t["effect_size"], pair["dz"])
        follow_up = the(of["rm_anova"], contrast=name)
        same(follow_up["statistic"], pair["t"])
        same(follow_up["p"], pair["p_t"])
        same(follow_up["effect_size"], pair["dz"])
        same(follow_up["p_adjusted"], wanted["adjusted_t"]["holm"][index])
        same(w["p"], pair["p_wilcoxon_exact_zeros_dropped"])
        same(t["p_adjusted"], wanted["adjusted_t"]["holm"][index])
        same(w["p_adjusted"], wanted["adjusted_wilcoxon"]["holm"][index])


@pytest.mark.parametrize("case", with_key("two_way_rm_anova"))
def test_two_factors_against_r(folder: Folder, steadyhand: Steadyhand, case: str) -> None:
    reference = expected(case)
    tests = [f"test: {test}, within: [condition, task], follow_up: none" for test in ("rm_anova",)]
    tests.append("test: art_anova, within: [condition, task]")
    conditions = reference["levels_order"]["condition"]
    rows = compared(steadyhand, study_of(folder, case, "mean_over_tasks", conditions, tests))
    for effect, wanted in reference["two_way_rm_anova"].items():
        _anova(the(rows, test="rm_anova", effect=effect), wanted)
    for effect, wanted in reference["art"].items():
        row = the(rows, test="art_anova", effect=effect)
        for ours, theirs in (("statistic", "F"), ("df1", "df1"), ("df2", "df2"), ("p", "p")):
            same(row[ours], wanted["aov_error_strata"][theirs])
    assert {row["effect"] for row in rows} == set(reference["two_way_rm_anova"])


def test_two_participants_and_three_conditions_have_no_huynh_feldt(folder: Folder, steadyhand: Steadyhand) -> None:
    """With two people there is one contrast: ε of Huynh and Feldt is 0 / 0."""
    rows = "P1,a,m,1\nP1,b,m,5\nP1,c,m,4\nP2,a,m,2\nP2,b,m,3\nP2,c,m,9\n"
    settings_text = "conditions: [a, b, c]\nmeasures: m.csv\ncomparisons: [{measure: m, test: rm_anova}]\n"
    study = folder(settings_text, **{"m.csv": f"participant,condition,measure,value\n{rows}"})
    found = compared(steadyhand, study)[0]
    assert found["details"]["epsilon_hf"] is None
    assert found["details"]["p_hf"] is None
    assert found["details"]["epsilon_gg"] == pytest.approx(0.5)


def test_the_order_of_rows_does_not_matter(folder: Folder, steadyhand: Steadyhand) -> None:
    """Nor how an id is written in Unicode."""
    tests = [*TESTS, "test: mixed_model, fixed: [condition, factor(period), carry_over]"]
    study = study_of(folder, "williams_4cond_n12", "main", ["A", "B", "D", "C"], tests)
    before = [*compared(steadyhand, study), *steadyhand.results()["design_check"]]
    path = study / "measures.csv"
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    np.random.default_rng(0).shuffle(rows)
    rows = [
        row.replace("P01", "Pé1") if index % 2 else row.replace("P01", "Pe\u03011") for index, row in enumerate(rows)
    ]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    after = [*compared(steadyhand, study), *steadyhand.results()["design_check"]]
    for one, two in zip(before, after, strict=True):
        for name, value in one.items():
            if isinstance(value, float):
                assert two[name] == pytest.approx(value, rel=1e-9, abs=1e-12), name
            elif name != "details":
                assert two[name] == value, name


# Laws -----------------------------------------------------------------------------------------------------------

values = st.lists(st.tuples(*[st.integers(-50, 50)] * 3), min_size=3, max_size=9).map(
    lambda rows: np.array(rows, dtype=float)
)


@settings(deadline=None, max_examples=60)
@given(data=values, scale=st.sampled_from([0.001, 0.1, 7.0, 1e6]), shift=st.integers(-1000, 1000))
def test_units_and_order_of_participants_do_not_matter(data: np.ndarray, scale: float, shift: int) -> None:
    other = (data[::-1] + shift) * scale
    for test in (lambda v: rm_anova(v, ["condition"])[0], friedman):
        one, two = test(data), test(other)
        assert one.status == two.status
        for name in ("statistic", "p", "effect_size"):
            before = getattr(one, name)
            assert getattr(two, name) == (None if before is None else pytest.approx(before, rel=1e-6, abs=1e-9))


@settings(deadline=None, max_examples=60)
@given(data=values)
def test_swapping_two_conditions_flips_signs_and_keeps_p(data: np.ndarray) -> None:
    first, second = data[:, 0], data[:, 1]
    for test in (t_paired, wilcoxon):
        one, two = test(first, second), test(second, first)
        assert one.status == two.status
        if one.effect_size is not None:
            assert two.p == pytest.approx(one.p)
            assert two.effect_size == pytest.approx(-one.effect_size)


@settings(deadline=None, max_examples=40)
@given(ranks=st.lists(st.integers(2, 12).map(lambda r: r / 2), min_size=1, max_size=8), data=st.data())
def test_signed_rank_p_by_writing_out_every_sign(ranks: list[float], data: st.DataObject) -> None:
    signs = data.draw(st.lists(st.booleans(), min_size=len(ranks), max_size=len(ranks)))
    w = sum(rank for rank, positive in zip(ranks, signs, strict=True) if positive)
    every = [sum(r for r, s in zip(ranks, chosen, strict=True) if s) for chosen in product([0, 1], repeat=len(ranks))]
    low = sum(value <= w for value in every) / len(every)
    high = sum(value >= w for value in every) / len(every)
    assert signed_rank_p(np.array(ranks), w) == pytest.approx(min(1.0, 2 * min(low, high)))


def test_signed_rank_p_agrees_with_scipys_exact_one_at_larger_n() -> None:
    differences = np.random.default_rng(0).normal(0.3, 1, 40)
    assert wilcoxon(differences, np.zeros(40)).p == pytest.approx(stats.wilcoxon(differences, method="exact").pvalue)


@pytest.mark.parametrize("n", [255, 257, 400])
def test_many_pairs_are_as_exact_as_few(n: int) -> None:
    """Where Fourier transforms take over, against counting in whole numbers, also far out in the tail."""
    for ranks in (list(range(1, n + 1)), [1 + index // 3 for index in range(n)]):
        total, half = sum(ranks), sum(ranks) // 2
        ways = [1] + [0] * half
        for rank in ranks:
            for at in range(half, rank - 1, -1):
                ways[at] += ways[at - rank]
        for w in (half - 5, round(0.42 * total), round(0.2 * total), 3):
            wanted = min(Fraction(1), 2 * Fraction(sum(ways[: w + 1]), 2**n))
            assert signed_rank_p(np.array(ranks, dtype=float), w) == pytest.approx(float(wanted), rel=1e-9)


def test_beyond_three_thousand_pairs_the_method_says_that_it_is_asymptotic() -> None:
    differences = np.random.default_rng(3).normal(0.03, 1, 3001)
    many = wilcoxon(differences, np.zeros(3001))
    assert many.method == "asymptotic (over 3000 pairs), tie-corrected, midranks, zeros dropped"
    assert many.p == pytest.approx(stats.wilcoxon(differences, method="approx").pvalue)
    assert many.details["hodges_lehmann"] is None
    assert wilcoxon(differences[:100], np.zeros(100)).method == "exact, midranks, zeros dropped"


def test_the_interval_of_kendalls_w_by_leaving_out_one_participant_after_the_other() -> None:
    data = np.random.default_rng(8).normal(size=(9, 4)) + np.array([0, 0.5, 1, 1.5])
    ranks = stats.rankdata(data, axis=1)

    def agreement(rows: np.ndarray) -> float:
        n, k = rows.shape
        w = 12 * np.sum((rows.sum(axis=0) - n * (k + 1) / 2) ** 2) / (n**2 * (k**3 - k))
        return float((n * w - 1) / (n - 1))

    whole = agreement(ranks)
    pseudo = [9 * whole - 8 * agreement(np.delete(ranks, row, axis=0)) for row in range(9)]
    margin = stats.t.ppf(0.975, 8) * stats.sem(pseudo) / (1 - whole**2)
    found = friedman(data)
    for bound, sign in ((found.ci_low, -1), (found.ci_high, 1)):
        rho = np.tanh(np.arctanh(whole) + sign * margin)
        assert bound == pytest.approx(np.clip((1 + 8 * rho) / 9, 0, 1))
    assert friedman(np.tile([1.0, 2, 3], (5, 1))).ci_low is None


def test_round_off_breaks_neither_ties_nor_zeros() -> None:
    """0.3 − 0.2 and 0.2 − 0.1 are one difference, and 0.1 + 0.2 − 0.3 is none."""
    first, second = np.array([0.3, 0.2, 0.1 + 0.2, 0.9]), np.array([0.2, 0.1, 0.3, 0.2])
    found = wilcoxon(first, second)
    assert (found.details["n_zero"], found.details["w_plus"]) == (1, 6.0)
    assert found.p == pytest.approx(0.25)


def test_f_of_two_conditions_is_the_square_of_t() -> None:
    data = np.random.default_rng(1).normal(size=(11, 2))
    f, t = rm_anova(data, ["condition"])[0], t_paired(data[:, 0], data[:, 1])
    assert t.statistic is not None
    assert f.statistic == pytest.approx(t.statistic**2)
    assert f.p == pytest.approx(t.p)


def test_the_noncentral_t_agrees_with_scipy_where_scipy_has_it() -> None:
    for t, df, shift in ((2.2, 11, 1.0), (0.3, 2, -1.5), (7.0, 30, 5.0), (-1.0, 1, 0.5)):
        assert noncentral_t_cdf(t, df, shift) == pytest.approx(float(stats.nct.cdf(t, df, shift)), abs=1e-9)


def test_the_interval_of_partial_eta_squared_leaves_out_its_tails() -> None:
    """P(F ≤ f) at the bounds is what the level leaves, also where R's search stops early."""
    for f, df1, df2 in ((0.0658682634730562, 1, 11), (5.45, 1, 11), (15.3, 3, 33)):
        low, high = partial_eta_squared_interval(f, df1, df2, 0.9)
        assert low is not None
        assert high is not None
        assert stats.ncf.cdf(f, df1, df2, high / (1 - high) * df2) == pytest.approx(0.05, rel=1e-9)
        if low > 0:
            assert stats.ncf.cdf(f, df1, df2, low / (1 - low) * df2) == pytest.approx(0.95, rel=1e-9)


def test_hedges_correction_by_its_gamma_functions() -> None:
    from math import gamma, sqrt

    assert hedges_correction(11) == pytest.approx(gamma(5.5) / (sqrt(5.5) * gamma(5)))
    assert hedges_correction(1) is None


def test_hodges_lehmann_interval_needs_six_pairs_for_95_percent() -> None:
    assert hodges_lehmann(np.array([1.0, 2, 3, 4, 5]))[1] is None
    assert hodges_lehmann(np.array([1.0, 2, 3, 4, 5, 6]))[1] == (1.0, 6.0)


def test_adjusted_p_values_by_hand() -> None:
    p = [0.01, None, 0.04, 0.03]
    assert adjusted(p, "holm") == [pytest.approx(0.03), None, pytest.approx(0.06), pytest.approx(0.06)]
    assert adjusted(p, "bonferroni") == [pytest.approx(0.03), None, pytest.approx(0.12), pytest.approx(0.09)]
    assert adjusted(p, "benjamini_hochberg") == [pytest.approx(0.03), None, pytest.approx(0.04), pytest.approx(0.04)]
    assert adjusted(p, "none") == [None] * 4


@given(p=st.lists(st.none() | st.floats(0, 1), max_size=12))
def test_adjusting_keeps_the_order_of_p_and_lowers_none(p: list[float | None]) -> None:
    for method in ("holm", "bonferroni", "benjamini_hochberg"):
        found = [(one, changed) for one, changed in zip(p, adjusted(p, method), strict=True) if one is not None]
        assert all(changed is not None and one <= changed <= 1 for one, changed in found)
        ordered = [changed for _, changed in sorted(found, key=lambda pair: pair[0])]
        assert ordered == sorted(ordered, key=lambda changed: changed or 0.0)


def test_a_constant_difference_has_no_error_to_test_against() -> None:
    first = np.array([1.0, 5.0, 2.5, 3.0])
    for result in (t_paired(first + 0.1, first), rm_anova(np.column_stack([first + 0.1, first]), ["condition"])[0]):
        assert result.status == "undefined: all differences are equal, so there is no error to test against"
        assert result.p is None
