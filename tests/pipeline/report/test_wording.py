"""Sentences that must be true of whatever they speak of: of one and of many, of what was computed and what was not."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.words.phrases import all_of, counted
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

Page = Callable[[str, str, str], str]


@pytest.fixture
def page(tmp_path: Path, steadyhand: Steadyhand) -> Page:
    """The text of the report of a study with one table: its settings, the table's kind, and the table."""

    def of(settings: str, kind: str, table: str) -> str:
        study = tmp_path / "study"
        study.mkdir()
        (study / "study.yaml").write_text(f"{kind}: table.csv\n{settings}", encoding="utf-8")
        (study / "table.csv").write_text(table, encoding="utf-8")
        ran = steadyhand("report", study, "--format", "html,json")
        assert ran.code == 0, ran.err
        text = re.sub(r"<[^>]+>", " ", (steadyhand.out / "report.html").read_text(encoding="utf-8"))
        return re.sub(r"\s+([.,:;])", r"\1", re.sub(r"\s+", " ", html.unescape(text)))

    return of


def rated(scales: list[str], people: int = 6) -> str:
    """Ratings of a questionnaire named `joy`."""
    rows = [
        f"P{at},{condition},joy,{scale},{1 + (at * (3 if condition == 'a' else 5) + len(scale)) % 7}"
        for at in range(people)
        for condition in "ab"
        for scale in scales
    ]
    return "\n".join(["participant,condition,questionnaire,scale,rating", *rows, ""])


def measured(values: dict[str, list[tuple[float, float]]]) -> str:
    """Measures of two conditions a and b; of each measure the participants' pairs."""
    rows = [
        f"P{at},{condition},{name},{value}"
        for name, pairs in values.items()
        for at, pair in enumerate(pairs)
        for condition, value in zip("ab", pair, strict=True)
    ]
    return "\n".join(["participant,condition,measure,value", *rows, ""])


def test_an_adjusted_p_is_recommended_only_where_there_is_one(page: Page) -> None:
    settings = "conditions: [a, b]\ncomparisons: [{measure: joy/*, test: wilcoxon}]\n"
    text = page(settings, "questionnaires", rated(["x", "xy"]))
    assert "Use the adjusted p" not in text
    assert "some are significant by chance; these p values are not adjusted for it" in text


def test_one_scale_differs(page: Page) -> None:
    entries = "[{measure: joy/x, test: t_paired}, {measure: joy/x, test: wilcoxon}]"
    text = page(f"conditions: [a, b]\ncomparisons: {entries}\n", "questionnaires", rated(["x"]))
    for test in ("paired t", "Wilcoxon"):  # at the top of the page alone
        assert len(re.findall(rf"Joy, {test}: [01] of 1 scale differs at the 5.% level\.", text)) == 1


def test_a_single_score_is_answered_by_its_means_and_one_comparison_is_no_all(page: Page) -> None:
    text = page("conditions: [a, b]\ncomparisons: [{measure: joy/x, test: t_paired}]\n", "questionnaires", rated(["x"]))
    assert re.search(r"Joy x was [\d.]+ (lower|higher) with b than with a", text)
    assert "of 1 scale" not in text
    assert "scales by participant" not in text
    assert "The 1 comparison of the study." in text
    assert "All 1" not in text
    assert [all_of(n, "comparison") for n in (2, 3)] == ["Both comparisons", "All 3 comparisons"]
    assert counted(2932, "selection") == "2\u2009932 selections"


def test_a_pattern_is_named_by_its_measures_in_the_methods(page: Page) -> None:
    pairs = [(1.0, 2.0), (2.5, 2.0), (1.0, 3.0), (4.0, 4.5), (2.0, 4.0)]
    text = page(
        "conditions: [a, b]\ncomparisons: [{measure: '*', test: t_paired}]\n",
        "measures",
        measured({"time_s": pairs, "bias_mm": [(-a, -b) for a, b in pairs]}),
    )
    assert "*: paired" not in text
    assert "Bias and time were analysed by paired t tests" in text
    assert "Bias was" in text
    assert "Bias were" not in text


def test_a_method_that_computed_nothing_is_not_among_the_methods(page: Page) -> None:
    """The measure that never varies has no test; the other is exact."""
    values = {"same": [(1.0, 1.0)] * 4, "t": [(1.0, 2.0), (2.0, 3.0), (3.0, 5.0), (4.0, 3.0)]}
    text = page("conditions: [a, b]\ncomparisons: [{measure: '*', test: friedman}]\n", "measures", measured(values))
    assert "exact: the sign test" in text
    assert "chi-squared approximation" not in text


def test_one_participant_was_there(page: Page) -> None:
    text = page("conditions: [a, b]\n", "measures", measured({"t": [(1.0, 2.0)]}))
    assert "There was 1 participant and" in text


def test_a_percentage_of_a_mean_near_zero_is_not_said(page: Page) -> None:
    pairs = [(0.0001, 12.0), (0.0002, 12.1), (0.0003, 11.9), (0.0001, 12.3), (0.0004, 12.2)]
    settings = "conditions: [a, b]\ncomparisons: [{measure: error_mm, test: t_paired}]\n"
    text = page(settings, "measures", measured({"error_mm": pairs}))
    assert "Error was 12.10 mm higher with b than with a" in text
    assert " % higher" not in text


@pytest.mark.parametrize(
    ("exposure", "count", "why"), [(0, 2, "an exposure that is not above 0"), (30, 1.5, "no counts")]
)
def test_what_a_rate_cannot_be_of_is_told_apart(page: Page, exposure: float, count: float, why: str) -> None:
    errors = [(1.0, 3.0), (2.0, 2.0), (4.0, 1.0), (3.0, 5.0), (count, 1.0)]
    seconds = [(30.0, 30.0)] * 4 + [(float(exposure), 30.0)]
    settings = "conditions: [a, b]\ncomparisons: [{measure: errors, test: gee_poisson, exposure: secs}]\n"
    text = page(settings, "measures", measured({"errors": errors, "secs": seconds}))
    assert why in text
    assert ("no counts" in text) != ("an exposure that is not above 0" in text)
