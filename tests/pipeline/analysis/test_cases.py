"""Small invented studies on which a rule around the tests can go wrong, each through its study folder."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.pipeline.helpers import Steadyhand

CASES = Path(__file__).resolve().parents[2] / "data" / "cases"

Results = Callable[[str], dict[str, Any]]


@pytest.fixture
def results(tmp_path: Path, steadyhand: Steadyhand) -> Results:
    """What `steadyhand compare` writes of a case."""

    def of(case: str) -> dict[str, Any]:
        study = tmp_path / case
        shutil.copytree(CASES / case, study)
        assert steadyhand("compare", study).code == 0
        return steadyhand.results()

    return of


def rows(found: dict[str, Any], test: str, effect: str = "condition") -> list[dict[str, Any]]:
    return [row for row in found["comparisons"] if row["test"] == test and row["effect"] == effect]


def test_the_p_that_is_adjusted_is_the_p_that_is_judged_by(results: Results) -> None:
    """Holm of two Greenhouse-Geisser p values: twice the smaller, .0482."""
    time = next(row for row in rows(results("gg_holm"), "rm_anova") if row["measure"] == "time")
    assert time["details"]["p_gg"] == pytest.approx(0.0482, abs=5e-5)
    assert time["p_adjusted"] == pytest.approx(2 * time["details"]["p_gg"], rel=1e-12)


def test_who_lacks_a_cell_of_a_further_factor_is_not_averaged_over_the_rest(results: Results) -> None:
    """Three people lack the hard task with B. Of the complete ones p = .14; averaged over what is left it was .046."""
    found = results("confound")
    (paired,) = rows(found, "t_paired")
    assert (paired["n"], round(paired["p"], 2)) == (7, 0.14)
    whole = [row["p"] for row in rows(found, "rm_anova") if row["contrast"] is None]
    assert whole == pytest.approx([paired["p"]] * 2)
    of_condition_alone = rows(found, "mixed_model")[0]
    assert of_condition_alone["p"] > 0.1
    described = {row["condition"]: row["n"] for row in found["descriptives"]}
    assert described == {"A": 10, "B": 7}  # nobody's mean of B is over the easy task alone
    remarks = [row["remark"] for row in found["design_check"] if row["remark"]]
    assert any("P01 (B × hard), P02 (B × hard) and P03 (B × hard)" in remark for remark in remarks)


def test_available_cells_are_averaged_where_that_is_asked_for(tmp_path: Path, steadyhand: Steadyhand) -> None:
    study = tmp_path / "confound"
    shutil.copytree(CASES / "confound", study)
    (study / "study.yaml").write_text(
        "conditions: [A, B]\nmeasures: measures.csv\ncomparisons: [{measure: m, test: t_paired, missing: available}]\n",
        encoding="utf-8",
    )
    assert steadyhand("compare", study).code == 0
    (row,) = steadyhand.results()["comparisons"]
    assert row["n"] == 10
    assert row["p"] == pytest.approx(0.046, abs=5e-4)


def test_a_misspelt_level_is_named_and_leaves_the_others_in(results: Results) -> None:
    found = results("case_level")
    assert rows(found, "rm_anova")[0]["n"] == 11
    reasons = {row["participant"]: row["reason"] for row in found["exclusions"] if "Easy" in row["reason"]}
    assert reasons == {"P01": 'rm_anova: only P01 has target "Easy", which is not used; check its spelling'}


def test_one_condition_each_names_the_key_that_serves(tmp_path: Path, steadyhand: Steadyhand) -> None:
    study = tmp_path / "between"
    study.mkdir()
    rows = "".join(f"P{at:02},{'ab'[at % 2]},time_s,{10 + at}\n" for at in range(12))
    (study / "measures.csv").write_text(f"participant,condition,measure,value\n{rows}", encoding="utf-8")
    settings = "conditions: [a, b]\nmeasures: measures.csv\ncomparisons: [{measure: time_s, test: t_paired}]\n"
    (study / "study.yaml").write_text(settings, encoding="utf-8")
    ran = steadyhand("compare", study)
    key = "write factors: {condition: between} and test: t_welch, mann_whitney, anova_welch or kruskal"
    assert f"each participant met one condition; {key}" in ran.out
    assert steadyhand.results()["design_check"][0]["remark"].endswith(key)
    mended = settings.replace("t_paired", "t_welch") + "factors: {condition: between}\n"
    (study / "study.yaml").write_text(mended, encoding="utf-8")
    assert steadyhand("compare", study).code == 0
    assert [row["n"] for row in steadyhand.results()["comparisons"]] == [12]


def test_ids_that_look_alike_are_named(results: Results) -> None:
    found = [
        row["reason"] for row in results("idvariants")["exclusions"] if row["what"] == "participants with similar ids"
    ]
    assert [reason.partition(" differ")[0] for reason in found] == [
        '"P02" and "P2"',
        '"P1" and "p1"',
        '"P4" and "P4\u200b"',
    ]


def test_a_column_that_tells_groups_apart_is_no_factor_within(tmp_path: Path, steadyhand: Steadyhand) -> None:
    shutil.copytree(CASES / "between", tmp_path / "between")
    ran = steadyhand("compare", tmp_path / "between")
    assert ran.code == 2
    assert '"group" of "m" does not vary within participants' in ran.err
    assert "mixed_anova" in ran.err


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_a_family_may_span_measures_and_entries(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """Three tests in two entries, one of them of two measures: Holm's factors are 3, 2 and 1."""
    study = tmp_path / "family2"
    shutil.copytree(CASES / "family2", study)
    (study / "study.yaml").write_text(
        "conditions: [A, B]\nmeasures: measures.csv\ncomparisons:\n"
        "  - {measure: [time, error], test: t_paired, adjust: holm, family: main}\n"
        "  - {measure: time, test: wilcoxon, adjust: holm, family: main}\n",
        encoding="utf-8",
    )
    assert steadyhand("report", study).code == 0
    found = steadyhand.results()["comparisons"]
    ranked = sorted(found, key=lambda row: float(row["p"]))
    expected, largest = [], 0.0
    for factor, row in zip((3, 2, 1), ranked, strict=True):
        largest = max(largest, factor * row["p"])
        expected.append(min(1.0, largest))
    assert [row["p_adjusted"] for row in ranked] == pytest.approx(expected)
    assert {(row["details"]["family"], row["details"]["family_size"]) for row in found} == {("main", 3)}
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert "by Holm over the 3 tests of the family &#34;main&#34;" in page


def test_a_family_is_adjusted_in_one_way(tmp_path: Path, steadyhand: Steadyhand) -> None:
    study = tmp_path / "family2"
    shutil.copytree(CASES / "family2", study)
    (study / "study.yaml").write_text(
        "conditions: [A, B]\nmeasures: measures.csv\ncomparisons:\n"
        "  - {measure: time, test: t_paired, adjust: holm, family: main}\n"
        "  - {measure: error, test: t_paired, adjust: bonferroni, family: main}\n",
        encoding="utf-8",
    )
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert 'family "main" is adjusted by holm and bonferroni; keep one' in ran.err


def test_no_percentage_of_a_scale_without_a_zero(results: Results, steadyhand: Steadyhand) -> None:
    """From −0.6 to 1.4 is no reduction by 309.8 %."""
    found = results("ueq")["comparisons"]
    assert [row["reduction"] for row in found] == [None, None]
    assert [row["mean_difference"] < 0 for row in found] == [True, True]


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_the_direction_is_that_of_the_difference(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """Means of −0.50 and 0.39: higher by 0.89, and no percentage."""
    shutil.copytree(CASES / "signed", tmp_path / "signed")
    ran = steadyhand("report", tmp_path / "signed")
    assert ran.code == 0
    assert re.search(r"−0\.50 → 0\.39 +−0\.89 \[.*\]; fusion higher ", ran.out)
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert "0.89 higher with fusion than with kinect" in page
    assert "176.7" not in page
    assert json.loads((steadyhand.out / "results.json").read_text())["comparisons"][0]["reduction"] is None


TLX = ("mental", "physical", "temporal", "performance", "effort", "frustration")


def questionnaire(folder: Path, settings: str, rows: list[str]) -> Path:
    folder.mkdir()
    (folder / "study.yaml").write_text(f"conditions: [A, B]\nquestionnaires: q.csv\n{settings}", encoding="utf-8")
    header = "participant,condition,questionnaire,scale,rating\n"
    (folder / "q.csv").write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
    return folder


def test_a_sus_is_scored_by_its_rule(results: Results) -> None:
    """(odd − 1, 5 − even) × 2.5: A 82.8, B 52.2, the opposite of the sums."""
    found = results("sus")
    means = {row["condition"]: row["mean"] for row in found["descriptives"] if row["measure"] == "sus/score"}
    assert {name: round(mean, 1) for name, mean in means.items()} == {"A": 82.8, "B": 52.2}
    (row,) = found["comparisons"]
    assert (row["measure"], round(row["statistic"], 1), row["df2"]) == ("sus/score", 15.4, 7)
    assert {row["measure"] for row in found["descriptives"]} == {"sus/score"}
    assert [row["items"] for row in found["reliability"]] == [10]


def test_a_raw_tlx_needs_its_range_and_is_a_mean_from_0_to_100(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """Hart 2006: the raw TLX is the mean of the six ratings; on a sheet from 0 to 20 a 5 is a quarter of the way."""
    rows = [f"P{p},{c},nasa_tlx,{s},{5 * (1 + (c == 'B'))}" for p in (1, 2, 3) for c in "AB" for s in TLX]
    ask = "comparisons: [{measure: nasa_tlx/raw_tlx, test: t_paired}]\n"
    ran = steadyhand("compare", questionnaire(tmp_path / "a", f"scoring: {{nasa_tlx: raw_tlx}}\n{ask}", rows))
    assert ran.code == 2
    assert "rule raw_tlx needs range, the lowest and the highest answer" in ran.err
    scoring = "scoring: {nasa_tlx: {rule: raw_tlx, range: [0, 20]}}\n"
    assert steadyhand("compare", questionnaire(tmp_path / "b", scoring + ask, rows)).code == 0
    found = steadyhand.results()["descriptives"]
    means = {(row["measure"], row["condition"]): row["mean"] for row in found}
    assert (means["nasa_tlx/raw_tlx", "A"], means["nasa_tlx/raw_tlx", "B"]) == (25.0, 50.0)
    assert means["nasa_tlx/total", "A"] == 30.0  # the plain sum stays, and says so by its label


def test_an_answer_out_of_range_or_missing_is_named_and_leaves_out_that_score(
    tmp_path: Path, steadyhand: Steadyhand
) -> None:
    rows = [f"P{p},{c},sus,q{i},{3 + (p + i) % 2}" for p in (1, 2, 3, 4) for c in "AB" for i in range(1, 11)]
    rows = [row.replace("P1,A,sus,q3,3", "P1,A,sus,q3,7").replace("P1,A,sus,q3,4", "P1,A,sus,q3,7") for row in rows]
    rows = [row for row in rows if not row.startswith("P2,B,sus,q7,")]
    study = questionnaire(tmp_path / "a", "comparisons: [{measure: sus/score, test: wilcoxon}]\n", rows)
    assert steadyhand("compare", study).code == 0
    found = steadyhand.results()
    assert found["comparisons"][0]["n"] == 2
    reasons = {row["participant"]: row["reason"] for row in found["exclusions"] if row["what"] == "score undefined"}
    assert reasons == {
        "P1": "q3 is 7, outside 1 to 5; state the range under scoring",
        "P2": "q7 is missing",
    }


IPQ = ["g1", *(f"{of}{i}" for of, n in (("sp", 5), ("inv", 4), ("real", 4)) for i in range(1, n + 1))]


def test_answers_that_run_on_another_range_are_one_hint_and_no_score(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """The IPQ's rule takes 0 to 6. Of answers from 1 to 7 those from 1 to 6 would give scores too, each off by one."""
    rows = [f"P{p},{c},ipq,{s},{1 + (p + at) % 7}" for p in range(8) for c in "AB" for at, s in enumerate(IPQ)]
    ask = "comparisons: [{measure: ipq/*, test: t_paired}]\n"
    ran = steadyhand("compare", questionnaire(tmp_path / "a", ask, rows))
    assert ran.code == 2
    key = "state scoring: {ipq: {rule: ipq, range: [1, 7]}}"
    assert 'nobody has a score of "ipq/*": answers seem to run from 1 to 7, and rule ipq takes 0 to 6' in ran.err
    assert key in ran.err
    assert steadyhand("compare", questionnaire(tmp_path / "b", "", rows)).code == 0
    found = steadyhand.results()
    ranges = [row for row in found["checks"] if row["check"].startswith("range of the scale")]
    assert [(row["check"], row["found"], row["expected"]) for row in ranges] == [
        ("range of the scale: ipq", "1 to 7", "0 to 6")
    ]
    assert key in ranges[0]["message"]
    assert {row["measure"] for row in found["descriptives"]} == set()
    mended = f"scoring: {{ipq: {{rule: ipq, range: [1, 7]}}}}\n{ask}"
    assert steadyhand("compare", questionnaire(tmp_path / "c", mended, rows)).code == 0
    scores = {row["measure"]: row["n"] for row in steadyhand.results()["descriptives"]}
    assert scores["ipq/general_presence"] == 8


def test_who_has_no_score_at_all_is_no_participant_that_vanishes(tmp_path: Path, steadyhand: Steadyhand) -> None:
    rows = [f"P{p},{c},sus,q{i},{3 + (p + i) % 2}" for p in range(8) for c in "AB" for i in range(1, 11)]
    rows = [re.sub(r"^(P1,.,sus,q2),.*", r"\1,9", row) for row in rows]
    assert steadyhand("compare", questionnaire(tmp_path / "a", "", rows)).code == 0
    assert steadyhand.results()["study"]["participants"] == {"n": 7, "listed": 8}


def test_half_of_an_instrument_is_not_scored_and_said(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """Five items of the SUS have no score; the even ones are worded negatively, so that higher is not better."""
    rows = [f"P{p},{c},sus,q{i},{1 + (p + i + (c == 'B')) % 5}" for p in range(8) for c in "AB" for i in range(1, 6)]
    study = questionnaire(tmp_path / "a", "comparisons: [{measure: sus/*, test: t_paired}]\n", rows)
    ran = steadyhand("compare", study)
    assert ran.code == 0
    (row,) = (row for row in steadyhand.results()["checks"] if row["check"].startswith("items of the questionnaire"))
    assert "has 5 of 10 items (q6, q7, q8, … missing), so no score is made of them" in row["message"]
    assert "(better)" not in ran.out
    assert "(worse)" not in ran.out


def test_answers_coded_around_zero_name_the_range_to_state(tmp_path: Path, steadyhand: Steadyhand) -> None:
    rows = [f"P{p},{c},ueq_s,q{i},{(p + 2 * i) % 7 - 3}" for p in range(8) for c in "AB" for i in range(1, 9)]
    ask = "comparisons: [{measure: ueq_s/*, test: t_paired}]\n"
    ran = steadyhand("compare", questionnaire(tmp_path / "a", ask, rows))
    assert ran.code == 2
    assert "state scoring: {ueq_s: {rule: ueq_s, range: [-3, 3]}}" in ran.err


def test_an_instrument_without_a_rule_has_no_total(tmp_path: Path, steadyhand: Steadyhand) -> None:
    rows = [f"P{p},{c},mine,q{i},{p + i}" for p in (1, 2, 3) for c in "AB" for i in (1, 2)]
    study = questionnaire(tmp_path / "a", "comparisons: [{measure: mine/total, test: wilcoxon}]\n", rows)
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert '"mine" has no total because nothing says how it is scored; state scoring: {mine:' in ran.err


def test_a_rule_of_ones_own_turns_its_reversed_items(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """On 1 to 7 a reversed 6 counts 2: the mean of 5 and 2 is 3.5."""
    rows = [f"P{p},{c},mine,{item},{value}" for p in (1, 2) for c in "AB" for item, value in (("q1", 5), ("q2", 6))]
    scoring = "scoring: {mine: {rule: mean, range: [1, 7], reversed: [q2]}}\n"
    ask = "comparisons: [{measure: mine/score, test: wilcoxon}]\n"
    assert steadyhand("compare", questionnaire(tmp_path / "a", scoring + ask, rows)).code == 0
    assert {row["mean"] for row in steadyhand.results()["descriptives"]} == {3.5}
    wrong = scoring.replace("[q2]", "[q3]")
    ran = steadyhand("compare", questionnaire(tmp_path / "b", wrong + ask, rows))
    assert ran.code == 2
    assert 'scoring.mine.reversed: there is no item "q3"' in ran.err


def test_rows_of_one_condition_do_not_count_as_if_it_had_been_met_anew(results: Results) -> None:
    """lmerTest, (1 | participant) + (1 | participant:condition): F(1, 11) = 0.73, p = .41."""
    found = results("mm_slope")
    model = rows(found, "mixed_model")[0]
    assert (round(model["statistic"] ** 2, 2), round(model["df2"], 3), round(model["p"], 2)) == (0.73, 11, 0.41)
    assert model["p"] == pytest.approx(rows(found, "rm_anova")[0]["p"], rel=1e-6)


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_aligned_ranks_of_cells_that_spread_unlike_are_cautioned_of(tmp_path: Path, steadyhand: Steadyhand) -> None:
    shutil.copytree(CASES / "art", tmp_path / "art")
    assert steadyhand("report", tmp_path / "art").code == 0
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert "can find effects that do not exist" in page


def test_friedmans_p_of_two_conditions_is_exact(results: Results) -> None:
    """Five people of one mind: 2 · 2⁻⁵."""
    assert rows(results("friedman2"), "friedman")[0]["p"] == 0.0625


def test_digits_count_by_each_pairs_own_size(results: Results) -> None:
    epoch = results("epoch_us")
    (paired,), (anova,) = rows(epoch, "t_paired"), rows(epoch, "rm_anova")
    assert paired["statistic"] == pytest.approx(13.387, abs=5e-4)
    assert anova["statistic"] == pytest.approx(paired["statistic"] ** 2, rel=1e-9)


def test_one_giant_value_does_not_level_the_others(results: Results) -> None:
    assert rows(results("giant_outlier"), "wilcoxon")[0]["p"] == 0.03125


@pytest.mark.parametrize("case", ["huge", "n2big"])
def test_extreme_values_have_figures_or_a_reason(results: Results, case: str) -> None:
    for row in results(case)["comparisons"]:
        assert row["status"] != "ok" or row["statistic"] is not None
        if row["test"] == "t_paired":
            assert (row["ci_low"] is None) == (row["ci_high"] is None)


def test_outcomes_of_0_and_1_are_named(results: Results) -> None:
    remarks = [row["remark"] for row in results("errors")["design_check"] if row["what"] == "kind of values"]
    assert len(remarks) == 1
    assert "McNemar's or Cochran's test, or a logistic model" in remarks[0]
