"""The first page and the console answer for each pair that is asked about, with the same lines."""

from __future__ import annotations

import html
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from pipeline.report.prose.answer import HEADER, Line, answer, lines_for_first_page
from pipeline.words.comparison import test_label as label_of_test
from pipeline.words.effect_sizes import effect_size
from tests.pipeline.analysis.test_options import Values, study
from tests.pipeline.helpers import Steadyhand, as_printed

THREE: Values = {
    "time_s": {
        "a": [9.1, 11.2, 10.4, 9.8, 12.0, 10.9],
        "b": [8.0, 10.1, 9.9, 8.1, 10.2, 9.0],
        "c": [9.4, 10.8, 10.1, 9.9, 11.1, 10.0],
    }
}


def lines_of(steadyhand: Steadyhand, folder: Path) -> list[Line]:
    ran = steadyhand("compare", folder)
    assert ran.code == 0, ran.err
    lines = answer(steadyhand.results())
    for line in lines:  # the console prints what the page does
        assert re.search(r"\s+".join(map(re.escape, line.cells)), ran.out), line
    return lines


def test_of_three_conditions_the_baseline_is_compared_with_each_other(steadyhand: Steadyhand, tmp_path: Path) -> None:
    first, second = lines_of(steadyhand, study(tmp_path / "s", THREE, ["measure: time_s, test: t_paired"]))
    a, b = np.array(THREE["time_s"]["a"]), np.array(THREE["time_s"]["b"])
    test = stats.ttest_rel(a, b)
    bounds = test.confidence_interval()
    assert (first.measure, first.pair, second.pair) == ("Time (s)", "a − b", "a − c")
    assert first.means == f"{a.mean():.2f} → {b.mean():.2f} s"
    low, high = (f"{bound:.2f}" for bound in (bounds.low, bounds.high))
    share = f"{100 * (1 - b.mean() / a.mean()):.1f} %"
    assert first.difference == f"{np.mean(a - b):.2f} s [{low}, {high}]; b {share} lower"
    assert first.effect_size.startswith(f"d_z = {np.mean(a - b) / np.std(a - b, ddof=1):.2f} [")
    assert first.p == f"{test.pvalue:.4f}".removeprefix("0")


def test_a_line_has_the_signs_of_the_results(steadyhand: Steadyhand, tmp_path: Path) -> None:
    """The same pair has one difference and one effect size on the first page, in the table, in words and in JSON."""
    folder = study(tmp_path / "s", THREE, ["measure: time_s, test: wilcoxon", "measure: time_s, test: t_paired"])
    lines = {(line.measure, line.pair): line for line in lines_of(steadyhand, folder)}
    rows = [
        row for row in steadyhand.results()["comparisons"] if row["contrast"] and row["contrast"].startswith("a - ")
    ]
    assert len(rows) == len(lines) == 4
    for row in rows:
        line = lines[f"Time (s), {label_of_test(row)}", row["contrast"].replace("-", "−")]
        value = row["details"].get("hodges_lehmann", row["mean_difference"])  # a rank test has its own estimate
        assert line.difference.startswith(f"{value:.2f} s".replace("-", "−"))
        assert line.effect_size == effect_size(row)


def test_study_yaml_may_name_the_pairs(steadyhand: Steadyhand, tmp_path: Path) -> None:
    """In either order: a difference is the earlier condition minus the later, as in every table."""
    folder = study(tmp_path / "s", THREE, ["measure: time_s, test: t_paired"], "question: [[c, b]]\n")
    assert [line.pair for line in lines_of(steadyhand, folder)] == ["b − c"]


@pytest.mark.parametrize(
    ("question", "message"),
    [("[[a, d]]", '"d"'), ("[[a, a]]", "listed twice")],
)
def test_a_pair_that_cannot_be_is_an_error(steadyhand: Steadyhand, tmp_path: Path, question: str, message: str) -> None:
    folder = study(tmp_path / "s", THREE, ["measure: time_s, test: t_paired"], f"question: {question}\n")
    ran = steadyhand("compare", folder)
    assert ran.code == 2
    assert "question" in ran.err
    assert message in ran.err


def test_pairs_after_an_analysis_of_all_conditions_answer(steadyhand: Steadyhand, tmp_path: Path) -> None:
    folder = study(tmp_path / "s", THREE, ["measure: time_s, test: rm_anova"])
    ran = steadyhand("compare", folder)
    assert [line.pair for line in answer(steadyhand.results())] == ["a − b", "a − c"]
    assert "see the report" not in ran.out
    assert "F(2, 10)" in ran.out


def test_two_conditions_of_an_analysis_have_the_interval_of_the_paired_t(
    steadyhand: Steadyhand, tmp_path: Path
) -> None:
    two = {"time_s": {name: THREE["time_s"][name] for name in "ab"}}
    folder = study(tmp_path / "s", two, ["measure: time_s, test: rm_anova", "measure: time_s, test: t_paired"])
    by_anova, by_t = lines_of(steadyhand, folder)
    assert (by_anova.measure, by_t.measure) == ("Time (s), rm ANOVA", "Time (s), paired t")
    assert by_anova.difference == by_t.difference
    assert by_anova.p == by_t.p
    assert "[" in by_t.difference


def test_whether_it_is_better_is_said_of_a_significant_difference_alone(steadyhand: Steadyhand, tmp_path: Path) -> None:
    folder = study(
        tmp_path / "s",
        {"completion_time_s": THREE["time_s"]},
        ["measure: completion_time_s, test: t_paired, adjust: holm"],
    )
    better, unsure = lines_of(steadyhand, folder)
    assert (better.significant, unsure.significant) == (True, False)
    assert better.difference.endswith("lower (better)")
    assert unsure.difference.endswith("lower")


def test_squared_errors_are_shown_by_their_roots(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values = {"selection_mse_mm2": {"a": [90.0, 110, 100, 100], "b": [60.0, 70, 62, 64]}}
    (line,) = lines_of(steadyhand, study(tmp_path / "s", values, ["measure: selection_mse_mm2, test: t_paired"]))
    assert line.means == "10.00 → 8.00 mm (root)"


def test_means_of_other_people_than_those_tested_are_not_shown(steadyhand: Steadyhand, tmp_path: Path) -> None:
    """They could contradict the difference: here they rise by 1.25, while everybody who met both is faster by 1."""
    values = {"time_s": {"a": [10.0, 11, 12, 4], "b": [9.0, 10.1, 10.9]}}
    (line,) = lines_of(steadyhand, study(tmp_path / "s", values, ["measure: time_s, test: t_paired"]))
    assert line.difference.startswith("1.00 s")
    assert line.means == "–"


def test_equivalence_and_evidence_are_no_difference(steadyhand: Steadyhand, tmp_path: Path) -> None:
    two = {"time_s": {name: THREE["time_s"][name] for name in "ab"}}
    folder = study(
        tmp_path / "s", two, ["measure: time_s, test: tost, bounds: [-1, 1]", "measure: time_s, test: bayes_t"]
    )
    ran = steadyhand("compare", folder)
    assert answer(steadyhand.results()) == []
    assert "equivalence (TOST)" in ran.out
    assert "Bayes factor" in ran.out


def test_groups_of_participants_are_pairs_too(steadyhand: Steadyhand, tmp_path: Path) -> None:
    people = "participant,group\n" + "".join(f"P{at:02},{'old' if at > 3 else 'young'}\n" for at in range(1, 7))
    settings = "factors: {group: between}\n"
    entries = ["measure: time_s, test: t_welch, between: group"]
    (line,) = lines_of(steadyhand, study(tmp_path / "s", THREE, entries, settings, people))
    assert {line.pair} <= {"old − young", "young − old"}
    assert "[" in line.difference


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_the_first_page_has_the_lines_as_a_table(steadyhand: Steadyhand, tmp_path: Path) -> None:
    folder = study(tmp_path / "s", THREE, ["measure: time_s, test: t_paired"])
    assert steadyhand("report", folder, "--format", "html,json").code == 0
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8").partition("Back to the contents")[0]
    words = " ".join(html.unescape(re.sub(r"<[^>]*>", " ", re.sub(r"</?(?:var|sub)>", "", page))).split())
    for cell in (*HEADER, *(cell for line in answer(steadyhand.results()) for cell in line.cells)):
        assert as_printed(cell) in words


def test_too_many_lines_are_cut_between_measures() -> None:
    lines = [Line(name, pair, "", "", "", "", None) for name in ("m", "n", "o") for pair in ("a − b", "a − c")]
    assert [line.measure for line in lines_for_first_page(lines, most=5)] == ["m", "m", "n", "n"]
    assert [line.measure for line in lines_for_first_page(lines, most=1)] == ["m", "m"]
    assert lines_for_first_page(lines) == lines
