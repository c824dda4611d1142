"""`steadyhand audit`: what of printed figures is called a contradiction, a remark or an agreement, and faulty files."""

from __future__ import annotations

import inspect
import json
import re
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import AGREEMENT, CONTRADICTION, REMARK, UNCHECKED, VERDICTS, Finding
from pipeline.errors import PipelineError
from pipeline.study import printed as publication
from pipeline.study.fields import Frozen
from pipeline.study.printed import load_publication
from tests.conftest import CLONE
from tests.pipeline.helpers import Steadyhand, run

FENG = CLONE / "studies" / "feng2016" / "printed.yaml"
REFERENCE = (CLONE / "docs" / "audit.md").read_text(encoding="utf-8")
EXAMPLE = re.findall(r"```yaml\n(.*?)```", REFERENCE, flags=re.DOTALL)[0]


def file(folder: Path, text: str) -> Path:
    path = folder / "printed.yaml"
    path.write_text(textwrap.dedent(text), encoding="utf-8")
    return path


def audited(folder: Path, text: str) -> list[Finding]:
    return audit(load_publication(file(folder, "source: a paper\n" + textwrap.dedent(text))))


def of_test(folder: Path, test: str, rest: str = "n: 12") -> dict[str, Finding]:
    """The findings of one printed test by their check."""
    return {found.check: found for found in audited(folder, f"{rest}\nmeasures: [{{name: m, tests: [{{{test}}}]}}]\n")}


def of_measure(folder: Path, measure: str, rest: str = "n: 12") -> dict[str, Finding]:
    return {found.check: found for found in audited(folder, f"{rest}\nmeasures: [{{name: m, {measure}}}]\n")}


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


MINIMAL = "source: a paper\nmeasures: [{name: m, cells: {a: {mean: 5}}}]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("measures: [{name: m}]\n", '"source" is missing'),
        ("source: s\n", '"measures" is missing'),
        (MINIMAL + "totls: []\n", 'unknown key "totls"; did you mean "totals"?'),
        (
            "source: s\nmeasures: [{name: m, cells: {a: {maen: 5}}}]\n",
            '"measures.0.cells.a.maen"; did you mean "mean"?',
        ),
        ("source: s\nmeasures: [{name: m, tests: [{f: 5}]}]\n", 'unknown key "measures.0.tests.0.f"'),
        (
            "source: s\nmeasures: [{name: m, cells: {a: {mean: '5,19'}}}]\n",
            "should be a number with its digits as printed",
        ),
        ("source: s\nmeasures: [{name: m, cells: {a: {mean: about 5}}}]\n", "(found 'about 5')"),
        ("source: s\nmeasures: [{name: m, cells: {a: {mean: < 5}}}]\n", "only p may have < or >"),
        ("source: s\nmeasures: [{name: m, cells: {a: {mean: }}}]\n", "should be a number with its digits as printed"),
        (
            "source: s\nmeasures: [{name: m, cells: {a: {mean: [5]}}}]\n",
            "should be a number with its digits as printed",
        ),
        ("source: s\nmeasures: []\n", "measures: needs one or more"),
        ("source: s\nn: twelve\nmeasures: [{name: m}]\n", '"n": input should be a valid integer'),
        ("source: s\nmeasures: [{name: m}, {name: m}]\n", 'measures: name: "m" is listed twice'),
        (
            "source: s\nmeasures: [{name: m, cells: {kinect: {}}, reductions: [{from: kinct, to: a, percent: 5}]}]\n",
            'from: "kinct" is not known; did you mean "kinect"?',
        ),
        ("source: s\nmeasures: [{name: m, tests: [{t: 2, F: 4}]}]\n", "has t and F; give each statistic a test"),
        (
            "source: s\nmeasures: [{name: m, tests: [{F: 4, df: 11}]}]\n",
            "the statistic F has 2 degrees of freedom, and df lists 1",
        ),
        ("source: s\nmeasures: [{name: m, tests: [{W: 4}]}]\n", "only test: wilcoxon has a W"),
        ("source: s\nmeasures: [{name: m, tests: [{test: wilcoxn}]}]\n", "measures.0.tests.0.test"),
        ("source: s\nmeasures: [{name: m, scale: {min: 5, max: 1}}]\n", "min should be less than max"),
        ("source: s\nmeasures: [{name: m, scale: {step: 2, min: 0, max: 5}}]\n", "should be a whole number of steps"),
        ("source: s\nmeasures: [{name: m, scale: {step: 0}}]\n", "step should be more than 0"),
        (
            MINIMAL + "totals: [{label: t, measures: q*, condition: a, sum: 5}]\n",
            'totals: there is no measure "q*"',
        ),
        (MINIMAL + "totals: [{label: t, measures: m, condition: b, sum: 5}]\n", 'totals: condition of "m": "b" is not'),
        (MINIMAL + "totals: [{label: t, measures: m, condition: a}]\n", "needs one of sum, mean and average"),
        ("source: s\nmeasures: [{name: m, tests: [{p: > .05}]}]\n", "line 2: not valid YAML"),
        ("a list\n", "holds no settings"),
    ],
)
def test_a_fault_in_the_file_is_named_with_its_remedy(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(PipelineError) as error:
        load_publication(file(tmp_path, text))
    assert message in str(error.value)
    assert "printed.yaml" in str(error.value)


def models() -> Iterator[type[BaseModel]]:
    for kind in vars(publication).values():
        if isinstance(kind, type) and issubclass(kind, Frozen) and kind is not Frozen:
            yield kind


def test_every_key_and_check_is_in_the_reference(tmp_path: Path) -> None:
    for model in models():
        for name, field in model.model_fields.items():
            assert f"`{field.alias or name}`" in REFERENCE, (model, name)
    for verdict in VERDICTS:
        assert f"| {verdict} |" in REFERENCE
    sources = Path(inspect.getfile(audit)).parent.glob("*.py")
    checks = {check for path in sources for check in re.findall(r'Statement\(\s*"([^"]+)"', path.read_text("utf-8"))}
    assert len(checks) > 12
    for check in checks - {"any"}:
        assert f"| {check} |" in REFERENCE, check


def test_the_example_of_the_reference_gives_what_it_says(tmp_path: Path) -> None:
    findings = audit(load_publication(file(tmp_path, EXAMPLE)))
    assert [(found.check, found.what) for found in findings if found.verdict == CONTRADICTION] == [
        ("recomputed p", "Time on task (s): paired t"),
        ("claim", "Temporal demand: Wilcoxon"),
    ]
    assert [found.follows for found in findings if found.verdict == REMARK] == ["1 of 2 after Holm"]


SETTINGS = """
    conditions: [a, b]
    measures: measures.csv
    printed: printed.yaml
    comparisons: [{measure: m, test: wilcoxon}, {measure: m, test: t_paired}]
"""
MEASURES = "participant,condition,measure,value\n" + "".join(
    f"P{p},{condition},m,{p + (condition == 'b') * (p % 3)}\n" for p in range(1, 7) for condition in "ab"
)


def compared(folder: Callable[..., Path], steadyhand: Steadyhand, measure: str) -> tuple[int, str]:
    text = f"source: s\nn: 6\nmeasures: [{{name: m, measure: m, {measure}}}]\n"
    ran = steadyhand("compare", folder(SETTINGS, **{"measures.csv": MEASURES, "printed.yaml": text}))
    return ran.code, ran.err


def test_a_study_sets_printed_figures_beside_its_own(folder: Callable[..., Path], steadyhand: Steadyhand) -> None:
    cells = "cells: {a: {mean: 3.50, sd: 1.87, median: 3.5}, b: {mean: 4.51, rmse: 2.12}}"
    rest = "reductions: [{from: a, to: b, percent: -28.6}], tests: [{test: t_paired, t: -2.74, df: 5, p: .041}]"
    code, err = compared(folder, steadyhand, f"{cells}, {rest}")
    assert code == 0, err
    rows = steadyhand.results()["printed"]
    beside = {row["what"]: (row["printed"], row["computed"], row["verdict"]) for row in rows if row["check"] is None}
    assert beside == {
        "m, a: mean": ("3.50", "3.50", "agrees"),
        "m, a: sd": ("1.87", "1.87", "agrees"),
        "m, a: median": ("3.5", "3.5", "agrees"),
        "m, b: mean": ("4.51", "4.50", "differs"),
        "m, b: rmse": ("2.12", "2.12", "agrees"),
        "m: reduction of the mean, a to b, %": ("-28.6", "-28.6", "agrees"),
        "m: paired t, t": ("-2.74", "-2.74", "agrees"),
        "m: paired t, p": (".041", "0.041", "agrees"),
    }
    assert {row["check"] for row in rows} > {None, "recomputed p", "degrees of freedom", "reduction"}


@pytest.mark.parametrize(
    ("measure", "message"),
    [
        ("cells: {c: {mean: 5}}", 'printed.yaml: the study\'s results have no condition "c"'),
        (
            "tests: [{test: friedman, p: .05}]",
            'the study\'s results have no test "friedman"; known: wilcoxon, t_paired',
        ),
        ("tests: [{p: .05}]", 'a printed test of "m" matches 2 of the study\'s comparisons; it must match exactly one'),
        ("tests: [{test: t_paired, F: 5, df: [1, 5]}]", 'no statistic_name "F"'),
    ],
)
def test_a_printed_figure_that_the_study_lacks_is_named(
    folder: Callable[..., Path], steadyhand: Steadyhand, measure: str, message: str
) -> None:
    code, err = compared(folder, steadyhand, measure)
    assert code == 2
    assert message in err
