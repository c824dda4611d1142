"""`steadyhand audit`: what of printed figures is called a contradiction, a remark or an agreement."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import AGREEMENT, CONTRADICTION, REMARK, UNCHECKED
from pipeline.study.printed import load_publication
from tests.pipeline.analysis.audit.printed import FENG, audited, file, of_measure, of_test
from tests.pipeline.helpers import run


def test_the_paper_contradicts_itself_twice() -> None:
    """The Kinect means force a total of 621, and p = .0508 is not below .05; all else agrees, but for a remark.

    A mean age in whole years says nothing of twelve people: every such mean is possible.
    """
    findings = audit(load_publication(FENG))
    contradictions = [
        (found.check, found.printed, found.follows) for found in findings if found.verdict == CONTRADICTION
    ]
    assert contradictions == [("total", "619", "621"), ("claim", "p = 0.0508, called significant", "not significant")]
    others = [found for found in findings if found.verdict not in (CONTRADICTION, AGREEMENT)]
    assert [(found.verdict, found.check) for found in others] == [(UNCHECKED, "GRIM"), (REMARK, "multiplicity")]
    assert others[1].follows == "0 of 4 after Holm"
    assert {"RMSE", "reduction", "GRIMMER", "Wilcoxon", "recomputed p"} <= {found.check for found in findings}


def test_what_is_printed_and_the_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = run(capsys, monkeypatch, "audit", FENG)
    assert ran.code == 3
    assert ran.out.index("contradiction") < ran.out.index("remark") < ran.out.index("agreement")
    assert "2 contradictions, 1 remark, 45 agreements and 1 that cannot be checked" in ran.out
    fine = file(
        tmp_path, "source: '[red]a\\x1b'\nmeasures: [{name: m, tests: [{z: 1.96, p: .05}]}]\n".replace("'", '"')
    )
    ran = run(capsys, monkeypatch, "audit", fine)
    assert ran.code == 0
    assert "[red]a\u25a1: 0 contradictions" in ran.out
    assert run(capsys, monkeypatch, "audit", tmp_path / "none.yaml").code == 2


def test_json_holds_every_finding(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    ran = run(capsys, monkeypatch, "audit", FENG, "--json")
    assert ran.code == 3
    content = json.loads(ran.out)
    assert content["counts"] == {CONTRADICTION: 2, REMARK: 1, UNCHECKED: 1, AGREEMENT: 45}
    assert len(content["findings"]) == 49
    assert {tuple(found) for found in content["findings"]} == {
        ("check", "what", "printed", "follows", "verdict", "explanation")
    }


@pytest.mark.parametrize(
    "test",
    [  # the decision errors in the tests of the R package statcheck (Nuijten et al. 2016)
        "t: 2.20, df: 28, p: .06",
        "t: 1.20, df: 28, p: .03",
        "F: 22.20, df: [2, 28], p: .06",
        "F: 2.20, df: [2, 28], p: .03",
        "r: .22, df: 28, p: .03",
        "r: .52, df: 28, p: .06",
        "chi2: 2.20, df: 28, p: .03",
        "chi2: 52.20, df: 28, p: .06",
        "z: 1.20, p: .03",
        "z: 2.20, p: .06",
        "t: 1.02, df: 48, p: '< .05'",
    ],
)
def test_what_statcheck_calls_a_decision_error_is_a_contradiction(tmp_path: Path, test: str) -> None:
    found = of_test(tmp_path, test, "")["recomputed p"]
    assert found.verdict == CONTRADICTION
    assert "on the other side of 0.05" in found.explanation


@pytest.mark.parametrize(
    ("test", "verdict"),
    [
        ("t: 2.20, df: 28, p: .036", AGREEMENT),
        ("t: 2.20, df: 28, p: .04", AGREEMENT),
        ("t: -2.20, df: 28, p: '< .05'", AGREEMENT),
        ("t: 2.20, df: 28, p: .03", CONTRADICTION),
        ("t: 2.20, df: 28, p: .018", REMARK),  # one-sided
        ("t: 2.20, df: 28, p: .018, sides: 2", CONTRADICTION),
        ("t: 2.20, df: 28, p: .018, sides: 1", AGREEMENT),
        ("F: 10.86, df: [1, 11], p: .0071, test: rm_anova", AGREEMENT),
        ("F: 5.10, df: [2, 22], p: .024, test: rm_anova", REMARK),  # corrected, though df are not
        ("F: 5.10, df: [2, 22], p: .024, test: anova", CONTRADICTION),
        ("F: 5.10, df: [2, 22], p: .024, test: rm_anova, epsilon: .80", AGREEMENT),
        ("F: 5.10, df: [2, 22], p: .044, test: rm_anova, epsilon: .80", CONTRADICTION),
        ("F: 5.10, df: [1.60, 17.60], p: .024, test: rm_anova", AGREEMENT),
        ("chi2: 6.50, df: 2, p: .048, test: friedman", REMARK),  # may be exact
        ("chi2: 6.50, df: 2, p: .048, test: friedman, method: normal", CONTRADICTION),
        ("t: 2.20, p: .05, test: t_paired", AGREEMENT),  # df follow from n
        ("t: 2.20, p: .07, test: t_paired", REMARK),  # had fewer taken part
        ("t: 2.20, p: .05", UNCHECKED),
        ("t: 2.20, df: 11", UNCHECKED),
        ("p: .05", UNCHECKED),
    ],
)
def test_recomputed_p(tmp_path: Path, test: str, verdict: str) -> None:
    assert of_test(tmp_path, test)["recomputed p"].verdict == verdict


@pytest.mark.parametrize(
    ("test", "verdict"),
    [
        ("test: t_paired, t: 2.2, df: 11", AGREEMENT),
        ("test: t_paired, t: 2.2, df: 12", CONTRADICTION),
        ("test: t_paired, t: 2.2, df: 10", REMARK),
        ("test: t_paired, n: 12, t: 2.2, df: 10", CONTRADICTION),
        ("test: rm_anova, F: 2.2, df: [3, 33]", AGREEMENT),
        ("test: rm_anova, F: 2.2, df: [3, 36]", REMARK),  # (3.27, 36) of five conditions, rounded
        ("test: rm_anova, F: 2.2, df: [3, 45]", CONTRADICTION),
        ("test: rm_anova, F: 2.2, df: [3, 30]", REMARK),
        ("test: rm_anova, F: 2.2, df: [1.39, 15.29]", AGREEMENT),
        ("test: rm_anova, F: 2.2, df: [1.39, 19.29]", CONTRADICTION),
        ("test: rm_anova, F: 2.2, df: [1, 15]", REMARK),  # rounded after a correction
        ("test: correlation, r: .5, df: 10", AGREEMENT),
        ("test: correlation, r: .5, df: 11", CONTRADICTION),
        ("test: t_independent, t: 2.2, df: 22", UNCHECKED),
    ],
)
def test_degrees_of_freedom(tmp_path: Path, test: str, verdict: str) -> None:
    assert of_test(tmp_path, test)["degrees of freedom"].verdict == verdict


@pytest.mark.parametrize(
    ("test", "verdict"),
    [
        ("test: anova, F: 2.2, df: [1, 22]", AGREEMENT),
        ("test: anova, F: 2.2, df: [1, 23]", CONTRADICTION),
        ("test: anova, F: 2.2, df: [2, 22]", REMARK),  # another group may not be in the file
        ("test: anova, F: 2.2, df: [2, 22], conditions: [a, b]", CONTRADICTION),
        ("test: t_independent, t: 2.2, df: 21", REMARK),
    ],
)
def test_degrees_of_freedom_of_groups(tmp_path: Path, test: str, verdict: str) -> None:
    found = of_measure(tmp_path, f"cells: {{a: {{n: 12}}, b: {{n: 12}}}}, tests: [{{{test}}}]")
    assert found["degrees of freedom"].verdict == verdict


@pytest.mark.parametrize(
    ("cells", "test", "verdict"),
    [  # mean difference 2, SDs 3 and 2: √12·2/5 = 1.39 ≤ t ≤ √12·2/1 = 6.93
        ("a: {mean: 7.00, sd: 3.00}, b: {mean: 5.00, sd: 2.00}", "test: t_paired, t: 1.39, df: 11", AGREEMENT),
        ("a: {mean: 7.00, sd: 3.00}, b: {mean: 5.00, sd: 2.00}", "test: t_paired, t: 1.30, df: 11", CONTRADICTION),
        ("a: {mean: 7.00, sd: 3.00}, b: {mean: 5.00, sd: 2.00}", "test: t_paired, t: -6.90, df: 11", AGREEMENT),
        ("a: {mean: 7.00, sd: 3.00}, b: {mean: 5.00, sd: 2.00}", "test: rm_anova, F: 60, df: [1, 11]", CONTRADICTION),
        ("a: {mean: 7.00, sd: 3.00}, b: {mean: 5.00, sd: 2.00}", "test: rm_anova, F: 30, df: [1, 10]", UNCHECKED),
        ("a: {mean: 7, sd: 3.0, n: 9}, b: {mean: 5, sd: 3.0, n: 9}", "test: t_independent, t: 1.41, df: 16", AGREEMENT),
        ("a: {mean: 7.0, sd: 3.0, n: 9}, b: {mean: 5.0, sd: 3.0, n: 9}", "test: welch, t: 2.0, df: 16", CONTRADICTION),
    ],
)
def test_a_statistic_against_means_and_sds(tmp_path: Path, cells: str, test: str, verdict: str) -> None:
    found = of_measure(tmp_path, f"cells: {{{cells}}}, tests: [{{{test}}}]")["statistic from means"]
    assert found.verdict == verdict


@pytest.mark.parametrize(
    ("test", "verdict"),
    [
        ("p: .0137", AGREEMENT),
        ("p: .0135", REMARK),  # by the normal approximation only
        ("p: .0135, method: exact", CONTRADICTION),
        ("n: 5, p: .0625", AGREEMENT),
        ("n: 5, p: .0313", REMARK),  # one-sided
        ("n: 5, p: .0431, sides: 2", REMARK),  # by the normal approximation
        ("n: 5, p: .0313, sides: 2", CONTRADICTION),
        ("n: 5, p: .0313, sides: 2, method: exact", CONTRADICTION),
        ("n: 5, p: .01, sides: 2", CONTRADICTION),
        ("n: 5, p: '< .05', method: exact, sides: 2", CONTRADICTION),
        ("n: 8, p: '< .001'", CONTRADICTION),
        ("n: 30, p: .0123", AGREEMENT),
        ("n: 300, p: .0123", UNCHECKED),
        ("n: 20, p: .000000001", CONTRADICTION),
        ("W: 6, p: .0137", AGREEMENT),  # one zero: 14 of 2¹¹ signs give 6 or less
        ("W: 60, p: .0137, method: exact, sides: 2", AGREEMENT),
        ("W: 79, p: .0137", CONTRADICTION),
        ("W: 10.3, p: .0137", CONTRADICTION),
        ("n: 5, W: 0, p: .9", REMARK),  # two pairs, one-sided, normal
        ("n: 5, W: 0, p: .9, sides: 2", CONTRADICTION),
        ("W: 78", AGREEMENT),
    ],
)
def test_wilcoxon_p_at_n(tmp_path: Path, test: str, verdict: str) -> None:
    assert of_test(tmp_path, f"test: wilcoxon, {test}")["Wilcoxon"].verdict == verdict


@pytest.mark.parametrize(
    ("measure", "check", "verdict"),
    [
        ("n: 28, scale: {step: 1}, cells: {a: {mean: 5.19}}", "GRIM", CONTRADICTION),
        ("n: 28, scale: {step: 1}, cells: {a: {mean: 5.18}}", "GRIM", AGREEMENT),
        ("n: 28, scale: {step: 1, items: 3}, cells: {a: {mean: 5.19}}", "GRIM", AGREEMENT),
        ("n: 200, scale: {step: 1}, cells: {a: {mean: 5.19}}", "GRIM", UNCHECKED),
        ("n: 18, scale: {step: 1}, cells: {a: {mean: 3.44, sd: 2.47}}", "GRIMMER", CONTRADICTION),
        ("n: 28, scale: {step: 1}, cells: {a: {mean: 5.21, sd: 1.60}}", "GRIMMER", AGREEMENT),
        ("n: 4, scale: {step: 1, min: 1, max: 5}, cells: {a: {mean: 5.00, sd: 0.50}}", "GRIMMER", CONTRADICTION),
        ("n: 4, scale: {step: 1, min: 1, max: 5}, cells: {a: {mean: 5.30}}", "range", CONTRADICTION),
        ("n: 4, scale: {step: 5, min: 0}, cells: {a: {mean: 51.25}}", "GRIM", AGREEMENT),
        ("n: 4, scale: {step: 5, min: 0}, cells: {a: {mean: 51.00}}", "GRIM", CONTRADICTION),
        ("n: 5, scale: {step: 1}, cells: {a: {median: 3.5}}", "median", CONTRADICTION),
        ("n: 6, scale: {step: 1}, cells: {a: {median: 3.5}}", "median", AGREEMENT),
        ("scale: {min: 0, max: 100}, cells: {a: {mean: 90.0, sd: 32}}", "range", CONTRADICTION),
        ("scale: {min: 0, max: 100}, cells: {a: {mean: 90.0, sd: 31}}", "range", AGREEMENT),
        ("scale: {min: 0}, cells: {a: {mean: 1.0, sd: 3.7}}", "range", CONTRADICTION),
        ("cells: {a: {mean: 5, sd: -1}}", "range", CONTRADICTION),
        ("cells: {a: {mean: 3.7263e5, rmse: 610.44}}", "RMSE", AGREEMENT),
        ("cells: {a: {mean: 3.7263e5, rmse: 610.46}}", "RMSE", CONTRADICTION),
        ("cells: {a: {mean: 5}}", "any", UNCHECKED),
    ],
)
def test_a_cell_by_itself(tmp_path: Path, measure: str, check: str, verdict: str) -> None:
    assert of_measure(tmp_path, measure)[check].verdict == verdict


@pytest.mark.parametrize(
    ("cells", "reduction", "verdict"),
    [
        ("a: {mean: 44.21}, b: {mean: 32.41}", "percent: 26.7", AGREEMENT),
        ("a: {mean: 44.21}, b: {mean: 32.41}", "percent: 26.6", CONTRADICTION),
        ("a: {mean: 44.21}, b: {mean: 32.41}", "percent: 36.4", CONTRADICTION),
        ("a: {mean: 32.41}, b: {mean: 44.21}", "percent: -36.4", AGREEMENT),
        ("a: {rmse: 610.44}, b: {rmse: 479.32}", "percent: 21.5 %, of: rmse", AGREEMENT),
        ("a: {mean: 0.0}, b: {mean: 1.0}", "percent: 5", UNCHECKED),
        ("a: {mean: 2.0}, b: {mean: 1.0}", "percent: 45, of: participants", UNCHECKED),
    ],
)
def test_reductions(tmp_path: Path, cells: str, reduction: str, verdict: str) -> None:
    found = of_measure(tmp_path, f"cells: {{{cells}}}, reductions: [{{from: a, to: b, {reduction}}}]")["reduction"]
    assert found.verdict == verdict
    assert ("; relative to the second, " in found.explanation) is (verdict == CONTRADICTION)


@pytest.mark.parametrize(
    ("total", "verdict"),
    [
        ("sum: 221", AGREEMENT),
        ("sum: 220", CONTRADICTION),
        ("sum: 221.5", CONTRADICTION),
        ("mean: 18.42", AGREEMENT),
        ("mean: 18.43", CONTRADICTION),
        ("average: 9.21", AGREEMENT),
        ("average: 9.20", CONTRADICTION),
    ],
)
def test_totals_of_whole_number_scales(tmp_path: Path, total: str, verdict: str) -> None:
    text = f"""
        n: 12
        measures:
          - {{name: m 1, scale: {{step: 1}}, cells: {{a: {{mean: 7.17}}}}}}
          - {{name: m 2, scale: {{step: 1}}, cells: {{a: {{mean: 11.25}}}}}}
        totals: [{{label: t, measures: m *, condition: a, {total}}}]
    """
    found = {finding.check: finding for finding in audited(tmp_path, text)}
    assert found["total"].verdict == verdict


@pytest.mark.parametrize(
    ("entry", "check", "verdict"),
    [
        ("shares: [{label: s, of: 12, percent: 58}]", "percentage", AGREEMENT),
        ("shares: [{label: s, of: 12, percent: 60}]", "percentage", CONTRADICTION),
        ("shares: [{label: s, of: 12, count: 7, percent: 58.3}]", "percentage", AGREEMENT),
        ("shares: [{label: s, of: 12, count: 7, percent: 58.4}]", "percentage", CONTRADICTION),
        ("shares: [{label: s, of: 120, percent: 58}]", "percentage", UNCHECKED),
        ("shares: [{label: s, of: 120, percent: 158}]", "percentage", CONTRADICTION),
        ("counts: [{label: c, parts: [6, 6], total: 12}]", "count", AGREEMENT),
        ("counts: [{label: c, parts: [6, 5], total: 12}]", "count", CONTRADICTION),
    ],
)
def test_percentages_and_counts(tmp_path: Path, entry: str, check: str, verdict: str) -> None:
    found = {finding.check: finding for finding in audited(tmp_path, f"measures: [{{name: m}}]\n{entry}\n")}
    assert found[check].verdict == verdict


@pytest.mark.parametrize(
    ("test", "verdict"),
    [
        ("p: .0508, significant: true", CONTRADICTION),
        ("p: .0508, significant: false", AGREEMENT),
        ("p: .0508, significant: true, alpha: .10", AGREEMENT),
        ("p: .05, significant: true", UNCHECKED),
        ("p: .050, significant: false", UNCHECKED),
        ("p: .05, significant: true, F: 4.80, df: [1, 11], test: anova, sides: 2", CONTRADICTION),  # p = .0509
        ("p: '< .05', significant: false", CONTRADICTION),
        ("p: '> .05', significant: true", CONTRADICTION),
        ("p: '< .10', significant: true", UNCHECKED),
        ("t: 1.20, df: 28, significant: true", CONTRADICTION),
        ("p: .03, p_adjusted: .06, significant: true", CONTRADICTION),
        ("p: .03, p_adjusted: .06, significant: false", AGREEMENT),
        ("significant: true", UNCHECKED),
    ],
)
def test_claims(tmp_path: Path, test: str, verdict: str) -> None:
    assert of_test(tmp_path, test)["claim"].verdict == verdict


FAMILY = """
measures:
  - {{name: m 1, tests: [{{p: .010, {0}}}]}}
  - {{name: m 2, tests: [{{p: .030, {1}}}]}}
families: [{{label: f, measures: m *, adjust: {2}}}]
"""


@pytest.mark.parametrize(
    ("first", "second", "adjust", "verdicts"),
    [
        ("significant: true", "significant: true", "none", [AGREEMENT]),
        ("significant: true", "significant: true, alpha: .02", "none", [REMARK]),
        ("p_adjusted: .020", "p_adjusted: .030", "none", [UNCHECKED]),
        ("p_adjusted: .020", "p_adjusted: .030", "holm", [AGREEMENT, AGREEMENT]),
        ("p_adjusted: .020", "p_adjusted: .060", "bonferroni", [AGREEMENT, AGREEMENT]),
        ("p_adjusted: .020", "p_adjusted: .060", "holm", [AGREEMENT, CONTRADICTION]),
    ],
)
def test_families(tmp_path: Path, first: str, second: str, adjust: str, verdicts: list[str]) -> None:
    findings = audited(tmp_path, FAMILY.format(first, second, adjust))
    assert [found.verdict for found in findings if found.check == "multiplicity"] == verdicts


def test_claims_of_an_adjusted_family_are_judged_by_it(tmp_path: Path) -> None:
    findings = audited(tmp_path, FAMILY.format("significant: true", "significant: true", "bonferroni"))
    claims = [(found.what, found.verdict) for found in findings if found.check == "claim"]
    assert claims == [("m 1", AGREEMENT), ("m 2", CONTRADICTION)]


def test_no_convention_is_taken_for_granted(tmp_path: Path) -> None:
    """A contradiction says so where figures cut off, or another divisor, would resolve it."""
    grim = "n: 28, scale: {step: 1}, cells: {a: {mean: 5.17}}"  # 145/28 = 5.1785…
    found = of_measure(tmp_path, grim)["GRIM"]
    assert found.verdict == CONTRADICTION
    assert "no contradiction if figures are cut off" in found.explanation
    assert of_measure(tmp_path, grim, "rounding: cut_off")["GRIM"].verdict == AGREEMENT
    grimmer = "n: 35, scale: {step: 1}, cells: {a: {mean: 5.23, sd: 2.55}}"
    found = of_measure(tmp_path, grimmer)["GRIMMER"]
    assert found.verdict == CONTRADICTION
    assert "if the SD were divided by n" in found.explanation
    assert of_measure(tmp_path, grimmer, "sd: population")["GRIMMER"].verdict == AGREEMENT


def test_zeros_at_the_end_count(tmp_path: Path) -> None:
    assert of_measure(tmp_path, "scale: {step: 1}, n: 7, cells: {a: {mean: 6.10}}")["GRIM"].verdict == CONTRADICTION
    assert of_measure(tmp_path, "scale: {step: 1}, n: 7, cells: {a: {mean: 6.1}}")["GRIM"].verdict == AGREEMENT
