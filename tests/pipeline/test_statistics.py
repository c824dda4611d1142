"""Statistics against R, through the path a study takes, and against laws that must hold."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
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
from pipeline.statistics.effect_size import hedges_correction, noncentral_t_cdf
from pipeline.statistics.multiplicity import adjusted
from pipeline.statistics.paired import t_paired
from pipeline.statistics.rank import friedman, hodges_lehmann, signed_rank_p, wilcoxon
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]
CASES = Path(__file__).resolve().parents[1] / "data" / "statistics"
"""Data and what R 4.2.2 computes of them (afex, car, coin, effectsize; versions inside each file)."""

RELATIVE = 1e-6  # closed forms, as the references state
SHAPIRO = 1e-4
BOUND = 1e-5  # R finds the bounds of d_z by a search that stops there


def study_of(folder: Folder, case: str, task: str, conditions: list[str]) -> Path:
    """A study folder with one task's values, or all of them where the tasks are averaged."""
    rows = list(csv.DictReader((CASES / case / "data.csv").read_text().splitlines()))
    lines = ["participant,condition,measure,task,value"]
    for row in rows:
        if task in ("mean_over_tasks", row["task"]) and row["condition"] in conditions:
            lines.append(f"{row['participant']},{row['condition']},m,{row['task']},{row['value']}")
    tests = ["rm_anova", "friedman", "t_paired", "wilcoxon"]
    comparisons = [f"  - {{measure: m, test: {test}, adjust: holm}}" for test in tests]
    comparisons.append("  - {measure: m, test: wilcoxon, zeros: pratt}")
    text = f"conditions: {json.dumps(conditions)}\nmeasures: measures.csv\ncomparisons:\n" + "\n".join(comparisons)
    return folder(text + "\n", **{"measures.csv": "\n".join(lines) + "\n"})


def expected(case: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((CASES / case / "expected.json").read_text())
    return content


TASKS = [
    (path.parent.name, task)
    for path in sorted(CASES.glob("*/expected.json"))
    for task in json.loads(path.read_text())["tasks"]
]


def same(found: Any, wanted: Any, tolerance: float = RELATIVE) -> None:
    """Equal within the tolerance, wherever R has a number."""
    if isinstance(wanted, int | float):
        assert found == pytest.approx(wanted, rel=tolerance, abs=1e-9)


@pytest.mark.parametrize(("case", "task"), TASKS)
def test_against_r(folder: Folder, steadyhand: Steadyhand, case: str, task: str) -> None:
    reference = expected(case)["tasks"][task]
    conditions = list(reference["conditions"])
    ran = steadyhand("compare", study_of(folder, case, task, conditions))
    assert ran.code == 0, ran.err
    rows = steadyhand.results()["comparisons"]
    of: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        assert row["status"] in STATUSES
        of.setdefault(row["test"], []).append(row)
        assert row["n"] == reference["n_complete"]
    _descriptives(steadyhand.results()["descriptives"], reference)
    if case in ("all_zero_diff_n8", "constant_all_3cond_n6", "no_complete_case_n6"):
        assert all(row["status"] != "ok" and row["p"] is None and row["statistic"] is None for row in rows)
        return
    _anova(of["rm_anova"][0], reference["rm_anova"]["condition"])
    if "friedman" in reference:
        _friedman(of["friedman"][0], reference["friedman"])
    if "paired" in reference:
        _paired(of["t_paired"][0], reference["paired"])
        dropped = next(row for row in of["wilcoxon"] if "dropped" in row["method"])
        _wilcoxon(dropped, reference["wilcoxon"], "exact_enumeration_zeros_dropped", "zeros_dropped")
        pratt = next(row for row in of["wilcoxon"] if "Pratt" in row["method"])
        _wilcoxon(pratt, reference["wilcoxon"], "exact_enumeration_pratt", "pratt_denominator")
    if "pairwise" in reference:
        _pairwise(of, reference["pairwise"])


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
    for found, bound in zip(row["details"]["partial_eta_squared_ci"], wanted["partial_eta2_ci95"], strict=True):
        same(found, bound, 1e-4)
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
    same(row["p"], wanted["friedman"]["p"])
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
        same(w["p"], pair["p_wilcoxon_exact_zeros_dropped"])
        same(t["p_adjusted"], wanted["adjusted_t"]["holm"][index])
        same(w["p_adjusted"], wanted["adjusted_wilcoxon"]["holm"][index])


@pytest.mark.parametrize(
    "case",
    [
        path.parent.name
        for path in sorted(CASES.glob("*/expected.json"))
        if "two_way_rm_anova" in json.loads(path.read_text())
    ],
)
def test_two_factors_against_r(folder: Folder, steadyhand: Steadyhand, case: str) -> None:
    reference = expected(case)
    text = (CASES / case / "data.csv").read_text().splitlines()
    rows = list(csv.DictReader(text))
    lines = ["participant,condition,measure,task,value"]
    lines += [f"{r['participant']},{r['condition']},m,{r['task']},{r['value']}" for r in rows]
    conditions = json.dumps(reference["levels_order"]["condition"])
    comparison = "{measure: m, test: rm_anova, within: [condition, task]}"
    settings_text = f"conditions: {conditions}\nmeasures: measures.csv\ncomparisons: [{comparison}]\n"
    ran = steadyhand("compare", folder(settings_text, **{"measures.csv": "\n".join(lines) + "\n"}))
    assert ran.code == 0, ran.err
    found = {row["effect"]: row for row in steadyhand.results()["comparisons"]}
    assert set(found) == set(reference["two_way_rm_anova"])
    for effect, wanted in reference["two_way_rm_anova"].items():
        _anova(found[effect], wanted)


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


def test_a_constant_difference_has_no_error_to_test_against() -> None:
    first = np.array([1.0, 5.0, 2.5, 3.0])
    for result in (t_paired(first + 0.1, first), rm_anova(np.column_stack([first + 0.1, first]), ["condition"])[0]):
        assert result.status == "undefined: all differences are equal, so there is no error to test against"
        assert result.p is None
