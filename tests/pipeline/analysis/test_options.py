"""Options of an entry under `comparisons`, each through a study folder to its row and its words."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.statistics.multiplicity import METHODS, adjusted
from pipeline.statistics.tukey import tukey_kramer
from pipeline.study.statistical_tests import ADJUSTMENTS
from tests.pipeline.helpers import Steadyhand, run

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print", "one_cache")

Row = dict[str, Any]
Values = Mapping[str, Mapping[str, Sequence[float]]]
"""Of each measure, by condition: a value for each participant."""

TIMES: Values = {
    "time_s": {
        "A": [12.1, 15.4, 9.8, 22.6, 14.0, 11.7, 35.2, 13.3, 10.9, 18.8],
        "B": [10.2, 12.9, 9.1, 15.3, 12.2, 11.9, 24.0, 10.8, 9.9, 14.1],
    },
    "errors": {"A": [3, 4, 2, 6, 3, 2, 5, 4, 3, 4], "B": [2, 4, 1, 4, 3, 2, 3, 3, 3, 2]},
    "strain": {"A": [5, 6, 5, 7, 6, 5, 7, 6, 4, 6], "B": [4, 6, 5, 6, 6, 4, 5, 6, 4, 5]},
    "doubt": {"A": [2, 3, 2, 4, 3, 2, 3, 3, 2, 3], "B": [2, 2, 3, 3, 3, 3, 3, 2, 2, 2]},
}


def study(
    folder: Path,
    values: Values,
    comparisons: Sequence[str],
    settings: str = "",
    people: str = "",
    apart: bool = False,
) -> Path:
    """A study folder of measures, with `people` as participants.csv; `apart`: each participant met one condition."""
    folder.mkdir()
    conditions = list(next(iter(values.values())))
    lines = ["participant,condition,measure,value"]
    for measure, cells in values.items():
        for condition, of_people in cells.items():
            named = f"{condition}-" if apart else "P"
            lines += [f"{named}{at + 1:02},{condition},{measure},{value}" for at, value in enumerate(of_people)]
    (folder / "measures.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    if people:
        (folder / "participants.csv").write_text(people, encoding="utf-8")
        settings += "participants: participants.csv\n"
    entries = "".join(f"  - {{{entry}}}\n" for entry in comparisons)
    text = f"conditions: [{', '.join(conditions)}]\nmeasures: measures.csv\n{settings}comparisons:\n{entries}"
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    return folder


def compared(steadyhand: Steadyhand, folder: Path) -> list[Row]:
    ran = steadyhand("compare", folder)
    assert ran.code == 0, ran.err
    rows: list[Row] = steadyhand.results()["comparisons"]
    return rows


def read(steadyhand: Steadyhand, folder: Path) -> str:
    """The words of the report, without its marks."""
    ran = steadyhand("report", folder, "--format", "html,json,bib")
    assert ran.code == 0, ran.err
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    page = re.sub(r"<(script|style|svg)\b.*?</\1>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", page)))


def test_every_adjustment_that_can_be_computed_can_be_asked_for(tmp_path: Path, steadyhand: Steadyhand) -> None:
    assert set(ADJUSTMENTS) == set(METHODS)
    entries = [f"measure: [{', '.join(TIMES)}], test: t_paired, adjust: {name}, family: {name}" for name in METHODS]
    rows = compared(steadyhand, study(tmp_path / "study", TIMES, entries))
    for name in METHODS:
        family = [row for row in rows if row["adjust"] == name]
        assert len(family) == 4
        assert [row["p_adjusted"] for row in family] == adjusted([row["p"] for row in family], name)


def test_an_adjustment_is_named_cited_and_explained(tmp_path: Path, steadyhand: Steadyhand) -> None:
    entry = f"measure: [{', '.join(TIMES)}], test: t_paired, adjust: hommel"
    page = read(steadyhand, study(tmp_path / "study", TIMES, [entry]))
    assert "Hommel-adjusted p = " in page
    assert "p values are adjusted by Hommel over 4 tests" in page.replace("P values", "p values")
    assert "never to more than Hochberg's" in page
    assert "hommel1988" in (steadyhand.out / "references.bib").read_text(encoding="utf-8")


def test_an_unknown_adjustment_is_answered_with_what_was_meant(tmp_path: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", study(tmp_path / "study", TIMES, ["measure: doubt, test: t_paired, adjust: homel"]))
    assert ran.code == 2
    assert "hommel" in ran.err


def test_the_effect_size_of_welchs_t_does_not_contradict_its_p(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """Groups of 4 and 12 that spread unlike: d_s, which takes them as alike, has an interval without 0 at p = .22."""
    values: Values = {"m": {"A": [1, 9, 14, 22], "B": [4, 5, 4, 6, 5, 4, 5, 6, 4, 5, 6, 4]}}
    entry = "measure: m, test: t_welch, between: condition"
    page = read(steadyhand, study(tmp_path / "study", values, [entry], apart=True))
    (row,) = steadyhand.results()["comparisons"]
    assert row["p"] > 0.05
    assert row["effect_size_name"] == "Cohen's d_av"
    assert row["ci_low"] < 0 < row["ci_high"]
    assert row["details"]["cohen_ds_ci"][0] > 0
    assert "dav = " in page  # its index is typeset
    assert "delacre2021" in (steadyhand.out / "references.bib").read_text(encoding="utf-8")


def test_bootstrap_intervals_and_permutation_p_stand_beside_the_test(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """Ten differences, of which 4 of the 1024 ways to exchange the conditions have a mean as far from zero."""
    options = "bootstrap: true, permutation: true"
    entries = [f"measure: time_s, test: {test}, {options}" for test in ("t_paired", "wilcoxon")]
    page = read(steadyhand, study(tmp_path / "study", TIMES, entries))
    paired, ranked = steadyhand.results()["comparisons"]
    first, second = (np.array(TIMES["time_s"][name]) for name in "AB")
    signs = np.array(list(product((1, -1), repeat=10)))
    as_far = np.abs(signs @ (first - second)) >= abs(np.sum(first - second)) - 1e-9
    assert paired["details"]["permutation_p"] == ranked["details"]["permutation_p"] == np.mean(as_far)
    low, high = paired["details"]["bootstrap_ci_difference"]
    assert 0 < low < paired["mean_difference"] < high
    assert paired["details"]["bootstrap_seed"] == 1
    assert "exact permutation p = .004, mean difference = 3.34, bootstrap 95 % CI [" in page
    assert "BCa bootstrap intervals of the mean difference (9,999 resamples of participants, seed 1)" in page
    assert "permutation p values of the mean difference (conditions exchanged within participants, all" in page
    bibliography = (steadyhand.out / "references.bib").read_text(encoding="utf-8")
    assert "efron1987" in bibliography
    assert "pitman1937" in bibliography


def test_groups_have_bootstrap_intervals_and_permutation_p_values_too(tmp_path: Path, steadyhand: Steadyhand) -> None:
    values: Values = {"time_s": {"A": [12.1, 15.4, 9.8, 22.6, 14.0, 11.7], "B": [10.2, 8.9, 9.1, 11.3, 10.2, 9.9, 8]}}
    options = "between: condition, bootstrap: true, permutation: true"
    entries = [f"measure: time_s, test: {test}, {options}" for test in ("t_welch", "mann_whitney")]
    page = read(steadyhand, study(tmp_path / "study", values, entries, apart=True))
    welch, ranked = steadyhand.results()["comparisons"]
    low, high = welch["details"]["bootstrap_ci_difference"]
    assert 0 < low < welch["mean_difference"] < high
    assert (welch["details"]["permutation_exact"], welch["details"]["permutation_count"]) == (True, math.comb(13, 6))
    assert welch["details"]["permutation_p"] == ranked["details"]["permutation_p"] < 0.05
    assert "(9,999 resamples of participants within their groups, seed 1)" in page
    assert "permutation p values of Welch's t (participants exchanged between groups, all" in page
    assert "janssen1997" in (steadyhand.out / "references.bib").read_text(encoding="utf-8")


def test_a_test_that_cannot_be_resampled_says_which_can(tmp_path: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", study(tmp_path / "study", TIMES, ["measure: time_s, test: rm_anova, bootstrap: true"]))
    assert ran.code == 2
    assert "rm_anova does not take bootstrap; it is for t_paired, wilcoxon, t_welch and mann_whitney" in ran.err


def test_the_seed_is_the_only_chance(tmp_path: Path, steadyhand: Steadyhand) -> None:
    entries = [f"measure: time_s, test: t_paired, bootstrap: true{seed}" for seed in ("", ", seed: 1", ", seed: 2")]
    rows = compared(steadyhand, study(tmp_path / "study", TIMES, entries))
    default, same, other = (row["details"]["bootstrap_ci_difference"] for row in rows)
    assert default == same
    assert default != other


def test_an_expected_direction_has_a_one_sided_bayes_factor_and_p_stays_two_sided(
    tmp_path: Path, steadyhand: Steadyhand
) -> None:
    """BayesFactor 0.9.12-4.4 in R: ttestBF(A, B, paired = TRUE, nullInterval = c(0, Inf), rscale = 0.707)."""
    entries = [
        f"measure: time_s, test: {test}, direction: {side}"
        for test, side in (("t_paired", "greater"), ("t_paired", "less"), ("bayes_t", "greater"), ("wilcoxon", "less"))
    ]
    page = read(steadyhand, study(tmp_path / "study", TIMES, entries))
    expected, against, bayes, ranked = steadyhand.results()["comparisons"]
    assert expected["details"]["one_sided_bf"] == pytest.approx(BF_PLUS, rel=1e-6)
    assert against["details"]["one_sided_bf"] == pytest.approx(BF_MINUS, rel=1e-6)
    assert bayes["details"]["one_sided_bf"] == expected["details"]["one_sided_bf"]
    assert expected["p"] == against["p"]
    assert "one_sided_bf" not in ranked["details"]
    assert f"one-sided BF₊₀ = {BF_PLUS:.2f} (p is two-sided)" in page
    assert "p two-sided although a direction was expected" in page
    assert "one-sided JZS Bayes factors of the expected direction (Cauchy prior of scale 0.707 on" in page
    assert "morey2014" in (steadyhand.out / "references.bib").read_text(encoding="utf-8")


def test_too_few_to_resample_is_said(tmp_path: Path, steadyhand: Steadyhand) -> None:
    values: Values = {"m": {"A": [1, 2, 5], "B": [3, 1, 9]}}
    page = read(steadyhand, study(tmp_path / "study", values, ["measure: m, test: t_paired, bootstrap: true"]))
    assert page.count("no bootstrap: it needs 5 participants") >= 2


def test_a_seed_without_chance_is_an_error(tmp_path: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", study(tmp_path / "study", TIMES, ["measure: doubt, test: t_paired, seed: 3"]))
    assert ran.code == 2
    assert "add bootstrap: true, or leave it out" in ran.err


THREE: Values = {"time_s": {**TIMES["time_s"], "C": [11.0, 15.0, 9.9, 19.0, 13.2, 12.0, 30.0, 12.5, 10.1, 17.0]}}
LOGS: Values = {"time_s": {name: [math.log(value) for value in values] for name, values in THREE["time_s"].items()}}
PEOPLE = "participant,group\n" + "".join(f"P{at + 1:02},{'young' if at < 4 else 'old'}\n" for at in range(10))
BF_PLUS, BF_MINUS = 9.109517942761954, 0.110446381828998
FIGURES = ("statistic", "df1", "df2", "p")


@pytest.mark.parametrize(
    ("test", "options"),
    [
        ("t_paired", ""),
        ("rm_anova", ""),
        ("mixed_model", ""),
        ("t_welch", ", between: condition"),
        ("mixed_anova", ", between: group"),
    ],
)
def test_a_test_of_logarithms_is_that_of_values_that_are_logarithms(
    tmp_path: Path, steadyhand: Steadyhand, test: str, options: str
) -> None:
    entry = f"measure: time_s, test: {test}{options}"
    how: Row = {"apart": True} if test == "t_welch" else {"settings": "factors: {group: between}\n", "people": PEOPLE}
    wanted = compared(steadyhand, study(tmp_path / "logs", LOGS, [entry], **how))
    rows = compared(steadyhand, study(tmp_path / "values", THREE, [f"{entry}, transform: log"], **how))
    assert len(rows) == len(wanted)
    pairs = 0
    for row, plain in zip(rows, wanted, strict=True):
        assert (row["effect"], row["contrast"], row["n"]) == (plain["effect"], plain["contrast"], plain["n"])
        for name in FIGURES:
            assert row[name] == (None if plain[name] is None else pytest.approx(plain[name], rel=1e-6))
        assert row["method"].startswith(plain["method"])
        assert row["mean_difference"] is None
        if row["contrast"] is not None:
            pairs += 1
            of_plain = plain["details"]
            difference = plain["effect_size"] if test == "mixed_model" else sum(of_plain["ci_difference"]) / 2
            assert row["effect_size_name"] == "ratio of geometric means"
            assert row["effect_size"] == pytest.approx(math.exp(difference))
            assert row["details"]["ratio_to_first"] == pytest.approx(math.exp(-difference))
            low, high = row["details"]["ratio_to_first_ci"]
            assert [low, high] == pytest.approx([1 / row["ci_high"], 1 / row["ci_low"]])
            assert row["details"]["first"] == row["contrast"].split(" - ")[0]
            assert row["reduction"] == pytest.approx(1 - math.exp(-difference))
    assert pairs


def test_a_ratio_is_said_relative_to_the_baseline(tmp_path: Path, steadyhand: Steadyhand) -> None:
    tests = ("t_paired", "rm_anova", "mixed_model")
    entries = [f"measure: time_s, test: {test}, transform: log" for test in tests]
    page = read(steadyhand, study(tmp_path / "study", {"time_s": TIMES["time_s"]}, entries))
    logs = np.log([TIMES["time_s"][name] for name in "AB"])
    ratio = np.exp(np.mean(logs[1]) - np.mean(logs[0]))
    phrase = f"geometric mean {ratio:.2f} times that of A"
    assert f"Time was lower with B than with A: its {phrase} [0.75, 0.91] (p = .0013, n = 10)." in page
    assert page.count(f"Time was significantly lower with B than with A ({phrase}, 95 % CI [0.75, 0.91];") == 3
    assert f"rm ANOVA of logarithms: F(1, 9) = 21.07, p = .0013, η²G = .08 [.01, .19], n = 10, {phrase}" in page
    assert "paired t test of the logarithms, t(9) = 4.59, p = .001, n = 10." in page
    assert "of the natural logarithms of the participants' means, read as ratios of geometric means" in page
    assert "Skewed values" not in page
    assert "bland1996" in (steadyhand.out / "references.bib").read_text(encoding="utf-8")


def test_a_value_without_a_logarithm_is_said_with_the_remedy(tmp_path: Path, steadyhand: Steadyhand) -> None:
    times = {**TIMES["time_s"], "B": [0, *TIMES["time_s"]["B"][1:]]}
    names = ("t_paired", "rm_anova", "mixed_model", "t_welch, between: group", "mixed_anova, between: group")
    entries = [f"measure: time_s, test: {name}, transform: log" for name in names]
    folder = study(tmp_path / "study", {"time_s": times}, entries, "factors: {group: between}\n", PEOPLE)
    page = read(steadyhand, folder)
    # Each of the groups' values is the mean of two conditions, which is above zero.
    undefined = [row for row in steadyhand.results()["comparisons"] if row["test"] != "t_welch"]
    assert len(undefined) >= 4
    for row in undefined:
        assert row["status"] == "undefined: transform log needs values above zero; leave it out, or use a rank test"
        assert (row["statistic"], row["p"], row["effect_size"]) == (None, None, None)
    assert "undefined: transform log needs values above zero; leave it out, or use a rank test" in page


def test_bootstrap_intervals_of_logarithms_are_of_the_ratio(tmp_path: Path, steadyhand: Steadyhand) -> None:
    entry = "measure: time_s, test: t_paired, bootstrap: true, permutation: true"
    of_logs = {"time_s": {name: LOGS["time_s"][name] for name in "AB"}}
    (plain,) = compared(steadyhand, study(tmp_path / "logs", of_logs, [entry]))
    page = read(steadyhand, study(tmp_path / "values", {"time_s": TIMES["time_s"]}, [f"{entry}, transform: log"]))
    (row,) = steadyhand.results()["comparisons"]
    low, high = plain["details"]["bootstrap_ci_difference"]
    assert row["details"]["bootstrap_ci_ratio_to_first"] == pytest.approx([math.exp(-high), math.exp(-low)])
    assert row["details"]["permutation_p"] == plain["details"]["permutation_p"]
    assert "bootstrap 95 % CI of the ratio [" in page


def test_skewed_times_are_cautioned_of_and_other_scales_are_not(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """A time's zero means none; a score's may not, and its ratio would mean nothing."""
    values: Values = {"time_s": TIMES["time_s"], "score": TIMES["time_s"], "calm_s": {"A": [3, 4, 5], "B": [4, 6, 5]}}
    page = read(steadyhand, study(tmp_path / "study", values, ["measure: [time_s, score, calm_s], test: t_paired"]))
    assert "Skewed values in Time (s): see whether a test of the logarithms (“transform: log” in study.yaml)" in page
    shape = [row for row in steadyhand.results()["design_check"] if row["what"] == "shape of values"]
    assert [row["measure"] for row in shape] == ["time_s"]
    assert "paired t with transform: log would compare geometric means" in shape[0]["remark"]


def test_a_rank_test_takes_no_transform(tmp_path: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", study(tmp_path / "study", TIMES, ["measure: doubt, test: wilcoxon, transform: log"]))
    assert ran.code == 2
    assert "wilcoxon does not take transform; it is for rm_anova, t_paired" in ran.err


def test_other_programs_are_given_the_logarithms(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What differs is named: no figure of a test of logarithms is set beside one of the plain values."""
    tests = ("t_paired", "rm_anova", "mixed_model", "t_welch, between: group")
    entries = [f"measure: time_s, test: {test}, transform: log" for test in tests]
    folder = study(tmp_path / "study", THREE, entries, "factors: {group: between}\n", PEOPLE)
    words = ("--cache", str(tmp_path / "cache"), "--against", "scipy,pingouin,statsmodels")
    ran = run(capsys, monkeypatch, "check", folder, *words)
    assert "scipy.stats.ttest_rel(x, y) agrees: t, df2, p, interval from, interval to" in ran.out
    assert "scipy.stats.ttest_ind(x, y, equal_var=False) agrees: t, df2, p" in ran.out
    assert "NO KNOWN REASON" not in ran.out


GROUPS: Values = {
    "time_s": {
        "mouse": [11.0, 10.2, 12.5, 9.8, 13.1, 11.7, 10.9],
        "touch": [8.1, 9.4, 7.9, 8.8, 10.2, 9.1],
        "gaze": [14.2, 12.9, 25.8, 13.3, 16.0],
    }
}


def test_tukeys_pairs_follow_up_groups_and_are_named_cited_and_cautioned(
    tmp_path: Path, steadyhand: Steadyhand
) -> None:
    entry = "measure: time_s, test: anova_welch, follow_up: tukey"
    declared = "factors: {condition: between}\n"
    page = read(steadyhand, study(tmp_path / "study", GROUPS, [entry], declared, apart=True))
    rows = [row for row in steadyhand.results()["comparisons"] if row["contrast"] is not None]
    expected = tukey_kramer([np.array(values) for values in GROUPS["time_s"].values()], [*GROUPS["time_s"]])
    assert [row["p"] for row in rows] == [one.p for one in expected]
    assert {row["adjust"] for row in rows} == {"none"}
    assert {row["p_adjusted"] for row in rows} == {None}
    assert "follow-up, Tukey and Kramer's test" in page
    assert "followed up pair by pair with Tukey and Kramer's test, whose p values hold for all pairs of a" in page
    assert "Tukey and Kramer's pairs assume both." in page
    assert "Groups spread differently (Levene's test) in Time (s)" in page
    assert "p and intervals of pairs of groups: over all pairs of a measure, effect sizes not;" in page
    assert "p values are not adjusted, but those of pairs of groups hold for all pairs" in page.replace(
        "P values", "p values"
    )
    bibliography = (steadyhand.out / "references.bib").read_text(encoding="utf-8")
    assert "kramer1956" in bibliography
    assert "games1976" not in bibliography


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        (
            "test: rm_anova, follow_up: tukey",
            "rm_anova is not followed up by tukey: within participants all pairs would",
        ),
        ("test: mixed_anova, follow_up: tukey", "its pairs within participants would need sphericity"),
        (
            "test: kruskal, follow_up: tukey",
            "kruskal is not followed up by tukey, whose p is of groups of measurements",
        ),
        ("test: t_paired, adjust: tukey", "tukey adjusts no p values that are there: it is a test of every two groups"),
        ("test: anova_welch, follow_up: tukay", 'did you mean "tukey"?'),
    ],
)
def test_tukey_is_refused_where_it_is_wrong(entry: str, why: str, tmp_path: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", study(tmp_path / "study", TIMES, [f"measure: doubt, {entry}"]))
    assert ran.code == 2
    assert why in ran.err


PERFECT: Values = {"time_s": {"A": [1.0, 2.0, 3.0, 4.0], "B": [2.0, 3.0, 4.0, 5.0], "C": [3.0, 4.0, 5.0, 6.0]}}


def test_an_effect_size_without_an_interval_says_why(tmp_path: Path, steadyhand: Steadyhand) -> None:
    page = read(steadyhand, study(tmp_path / "study", PERFECT, ["measure: time_s, test: friedman"]))
    assert "W = 1.00 (no interval: leaving out one participant after the other shows no spread to judge by)" in page


def test_a_model_says_that_its_estimate_is_all_it_has(tmp_path: Path, steadyhand: Steadyhand) -> None:
    page = read(steadyhand, study(tmp_path / "study", TIMES, ["measure: time_s, test: mixed_model"]))
    assert "Effect size –: a model has none but its estimate, which is the difference." in page
    paired = read(steadyhand, study(tmp_path / "paired", TIMES, ["measure: time_s, test: t_paired"]))
    assert "Effect size –" not in paired


def test_why_a_line_has_no_means_is_said(tmp_path: Path, steadyhand: Steadyhand) -> None:
    entry = ["measure: time_s, test: t_paired"]
    one_lacks_b: Values = {"time_s": {"A": TIMES["time_s"]["A"], "B": TIMES["time_s"]["B"][:-1]}}
    page = read(steadyhand, study(tmp_path / "study", one_lacks_b, entry))
    assert "Means –: those in the tables need not agree with the difference, which is of other participants," in page
    whole = read(steadyhand, study(tmp_path / "whole", TIMES, entry))
    assert "Means –" not in whole
