"""Statistics against R, through the path a study takes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.statistics import STATUSES
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
