"""Sentences, methods, references and glossary: what they say is what the rows say."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pypdf import PdfReader

from pipeline.analysis.comparisons import answered
from pipeline.analysis.comparisons import compared as rows_of
from pipeline.analysis.complete_cases import Values
from pipeline.analysis.descriptives import descriptives, means_of_measures
from pipeline.report.prose.glossary import explained
from pipeline.report.prose.references import bibliography, entries, escaped, used
from pipeline.report.sections.comparisons import anchor
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.words.condition_means import StudyFacts, study_facts
from pipeline.words.sentences import full_sentence, verdict
from tests.pipeline.helpers import Steadyhand, as_printed
from tests.pipeline.hostile import HOSTILE
from tests.pipeline.reference import TASKS, compared, expected, study_of, the
from tests.pipeline.report.pages import checked

Folder = Callable[..., Path]
Row = dict[str, Any]

TESTS = (
    {"test": "rm_anova", "adjust": "holm"},
    {"test": "friedman"},
    {"test": "t_paired", "adjust": "bonferroni"},
    {"test": "wilcoxon", "adjust": "holm"},
    {"test": "art_anova"},
    {"test": "mixed_model"},
    {"test": "tost", "bounds": [-5, 5]},
    {"test": "bayes_t"},
)


def apa(value: float, digits: int) -> str:
    """R's figure, rounded, without a leading zero."""
    return f"{value:.{digits}f}".replace("0.", ".", 1).replace("-", "−")


def p_of(p: float) -> str:
    if p > 0.9995:
        return "p > .999"
    return "p < .001" if p < 0.001 else f"p = {apa(p, 3)}"


def sentences(steadyhand: Steadyhand, rows: Sequence[Row]) -> list[str]:
    results = steadyhand.results()
    told = study_facts(results["study"]["conditions"], results["study"]["alpha"], results["descriptives"])
    return [full_sentence(row, told) for row in rows]


@pytest.mark.parametrize(("case", "task"), [pair for pair in TASKS if "paired" in expected(pair[0])["tasks"][pair[1]]])
def test_the_sentences_of_two_conditions_print_what_r_computes(
    folder: Folder, steadyhand: Steadyhand, case: str, task: str
) -> None:
    reference = expected(case)["tasks"][task]
    first, second = reference["conditions"]
    study = study_of(
        folder, case, task, reference["conditions"], ["test: rm_anova", "test: t_paired", "test: wilcoxon"]
    )
    rows = compared(steadyhand, study)
    anova, t, ranks = sentences(steadyhand, rows)
    if any(row["status"] != "ok" for row in rows):
        assert "undefined" in anova
        assert " = " not in anova.replace("n = ", "")
        return
    f, paired, dz = reference["rm_anova"]["condition"], reference["paired"]["t_test"], reference["paired"]["cohen_dz"]
    df, n, difference = f["df2"], reference["n_complete"], reference["paired"]["mean_diff"]
    assert f"F(1, {df}) = {f['F']:.2f}, {p_of(f['p'])}, η²G = {apa(f['generalized_eta2'], 2)}, 95 % CI [" in anova
    low, high = (f"{bound:.2f}".replace("-", "−") for bound in dz["ci95_noncentral_t"])
    found = f"t({df}) = {paired['t']:.2f}, {p_of(paired['p'])}, d_z = {dz['estimate']:.2f}".replace("-", "−")
    assert f"paired t test, {found}, 95 % CI [{low}, {high}], n = {n}." in t
    exact = reference["wilcoxon"].get("exact_enumeration_zeros_dropped")
    if exact:
        assert f"exact Wilcoxon signed-rank test, W₊ = {exact['W_plus']:g}, {p_of(exact['p_two_sided'])}" in ranks
    for said, p in ((anova, f["p"]), (t, paired["p"])):
        assert ("significantly" in said) and ("did not differ significantly" in said) == (p >= 0.05)
        way = f"{'lower' if difference > 0 else 'higher'} with {second}"
        assert (way if abs(difference) > 1e-9 else "the same in both") in said
        assert (f"than with {first}" in said) == (p < 0.05)


def test_the_sentence_of_three_conditions_prints_the_correction_of_r(folder: Folder, steadyhand: Steadyhand) -> None:
    reference = expected("rm3_nonspherical_n15")["tasks"]["main"]
    f, chi = reference["rm_anova"]["condition"], reference["friedman"]
    study = study_of(
        folder, "rm3_nonspherical_n15", "main", reference["conditions"], ["test: rm_anova", "test: friedman"]
    )
    rows = compared(steadyhand, study)
    (anova,) = sentences(steadyhand, [the(rows, test="rm_anova", contrast=None)])
    (ranked,) = sentences(steadyhand, [the(rows, test="friedman")])
    ball = f["sphericity"]
    exact = the(rows, test="friedman")["p"]  # R's p is the approximation; the exact one has tests of its own
    assert abs(exact - chi["friedman"]["p"]) < 0.01
    assert f"F(2, 28) = {f['F']:.2f}, {p_of(f['p'])}" in anova
    assert f"Greenhouse-Geisser ε = {apa(ball['gg_eps'], 3)}, {p_of(ball['p_gg'])}" in anova
    assert anova.startswith(f"M did not differ significantly between {', '.join(reference['conditions'][:2])} and ")
    assert f"χ²(2) = {chi['friedman']['chi2']:.2f}, {p_of(exact)}, W = {apa(chi['kendall_W'], 2)}" in ranked
    for condition, of in reference["descriptives_complete_cases"].items():
        assert f"{condition}: M = {of['mean']:.2f}, SD = {of['sd']:.2f}" in anova


def test_models_and_crossover_say_their_direction(folder: Folder, steadyhand: Steadyhand) -> None:
    reference = expected("crossover_2x2_n12")["tasks"]["main"]["crossover"]
    tests = ["test: crossover", "test: mixed_model, fixed: [condition, period]"]
    rows = compared(steadyhand, study_of(folder, "crossover_2x2_n12", "main", ["kinect", "fusion"], tests))
    treatment, period, carried, model, slope = sentences(steadyhand, rows)
    assert reference
    assert treatment.startswith("M was significantly lower with fusion than with kinect (by 5.70; ")
    assert "crossover analysis, t(10) = 3.71, p = .004, estimate = 5.70, 95 % CI [2.28, 9.13], n = 12." in treatment
    assert "in period 2 than in period 1" in period
    assert carried.startswith("M: the effect of carry-over: KF − FK was not statistically significant")
    assert "mixed model, t(10) = 3.71" in model
    assert slope.startswith("M: the effect of period was statistically significant, mixed model, t(10) = −4.01")


VALUES = st.lists(
    st.tuples(*[st.one_of(st.integers(0, 9).map(float), st.floats(0.5, 2000, width=32))] * 3), min_size=2, max_size=7
)


def a_study(
    conditions: Sequence[str], values: Sequence[Sequence[float]], tests: Sequence[Row]
) -> tuple[list[Row], StudyFacts]:
    """The rows of comparisons of a measure m_s, and what sentences may say."""
    entries = [{"measure": "m_s", **one} for one in tests]
    study = Study.model_validate({"conditions": conditions, "measures": "m.csv", "comparisons": entries})
    cells = [
        {"participant": f"P{person}", "condition": condition, "measure": "m_s", "value": value}
        for person, row in enumerate(values)
        for condition, value in zip(conditions, row, strict=False)
    ]
    measures = tables.frame("measures", cells)
    observations = tables.frame("observations", [{**cell, "n": 1} for cell in cells])
    tabled = Values(measures, observations, tables.frame("target_observations", []), {})
    rows, _ = rows_of(answered(study, tabled))
    for row in rows:
        row["details"] = json.loads(row["details"]) if row["details"] else None
    complete = list(
        tables.records("comparisons", tables.frame("comparisons", [{**row, "details": None} for row in rows]))
    )
    found = [{**whole, "details": row["details"]} for whole, row in zip(complete, rows, strict=True)]
    summaries = descriptives(means_of_measures(study, measures), observations)
    described = list(tables.records("descriptives", tables.frame("descriptives", summaries)))
    return found, study_facts(conditions, study.alpha, described)


def figures_of(value: Any) -> list[float]:
    """Every number in a row, and in its details."""
    if isinstance(value, dict):
        return [figure for part in value.values() for figure in figures_of(part)]
    if isinstance(value, list):
        return [figure for part in value for figure in figures_of(part)]
    return [float(value)] if isinstance(value, int | float) and not isinstance(value, bool) else []


@settings(max_examples=12, deadline=None)
@given(values=VALUES, three=st.booleans())
def test_every_number_in_a_sentence_is_a_figure_of_its_row_rounded(
    values: list[tuple[float, ...]], three: bool
) -> None:
    conditions = ["alpha", "beta", "gamma"][: 3 if three else 2]
    rows, told = a_study(conditions, values, TESTS)
    for row in rows:
        said = full_sentence(row, told)
        known = figures_of(row) + [figure for one in told.descriptives.values() for figure in figures_of(dict(one))]
        known += [100 * row["reduction"]] if row["reduction"] is not None else []
        known += [1 / row["statistic"]] if row["statistic"] and row["test"] == "bayes_t" else []
        plain = re.sub(r"\b(95|90) % CI|p [<>] \.\d+|\u2009", "", said.replace("−", "-"))
        for printed in re.findall(r"(?<![\w.])-?\d*\.?\d+(?:e-?\+?\d+)?", plain):
            decimals = len(printed.split("e")[0].partition(".")[2]) - int(printed.partition("e")[2] or 0)
            half = 0.5000001 * 10.0**-decimals
            assert any(abs(abs(figure) - abs(float(printed))) <= half for figure in known), (printed, said)


@settings(max_examples=20, deadline=None)
@given(values=VALUES)
@example(
    values=[(1, 9, 0), (6, 693.1923217773438, 0), (880, 307, 0), (1332, 1, 0), (1346, 1, 0), (1685, 4, 0)]
)  # p = .04996
def test_the_direction_is_that_of_the_test_and_significance_that_of_its_p(values: list[tuple[float, ...]]) -> None:
    rows, told = a_study(["alpha", "beta"], values, TESTS[:6])
    for row in (row for row in rows if row["status"] == "ok"):
        said = full_sentence(row, told)
        p = row["p"] if row["p_adjusted"] is None else row["p_adjusted"]
        assert ("not differ significantly" in said) == (p >= 0.05)
        way = row["effect_size"] if row["test"] in ("wilcoxon", "mixed_model") else row["mean_difference"]
        if way and abs(way) > 1e-9:
            assert f"{'lower' if way > 0 else 'higher'} with beta" in said
        shown = re.search(r"p ([=<>]) (\.\d+)", said)
        assert shown is not None
        if shown[1] == "=":  # rounding never carries a p over the level
            assert (float(shown[2]) < 0.05) == (row["p"] < 0.05)


def test_ranks_and_means_that_disagree_are_said_to() -> None:
    rows, told = a_study(["a", "b"], [(1, 2), (2, 3), (3, 4.5), (4, 5.5), (90, 5)], [{"test": "wilcoxon"}])
    said = full_sentence(rows[0], told)
    assert "higher with b by ranks, while its mean was lower by 16.00 s" in said


def test_a_bayes_factor_beyond_all_numbers_is_said_by_its_logarithm() -> None:
    values = [(1000.0 + person % 2 / 1000, 1.0) for person in range(120)]
    rows, told = a_study(["a", "b"], values, [{"test": "bayes_t"}])
    assert rows[0]["statistic"] is None
    said = full_sentence(rows[0], told)
    assert (
        "more than 10³⁰⁸ times as likely under a difference between a and b as under none, ln BF₁₀ = 1\u2009709" in said
    )
    assert verdict(rows[0], 0.05) == "the data are more than 10³⁰⁸ times as likely under a difference as under none"


def test_what_is_undefined_is_said_in_words() -> None:
    rows, told = a_study(["a", "b"], [(1, 1), (2, 2)], TESTS)
    said = {row["test"]: full_sentence(row, told) for row in rows}
    assert said["rm_anova"] == "M: the repeated-measures ANOVA is undefined: all differences are zero (n = 2)."
    assert (
        said["wilcoxon"] == "M: the Wilcoxon signed-rank test of a − b is undefined: all differences are zero (n = 2)."
    )
    assert all("undefined: all differences are zero" in text for text in said.values())


def test_names_that_can_be_read_in_two_ways_are_not_taken_apart() -> None:
    conditions = ["a", "a - b", "b - c", "c"]
    rows, told = a_study(conditions, [(1, 2, 3, 4), (2, 4, 3, 1), (5, 4, 2, 2)], [{"test": "t_paired"}])
    said = [(row["contrast"], full_sentence(row, told)) for row in rows]
    assert "between a and c (" in dict(said)["a - c"]
    for contrast, text in said:
        assert text.startswith("M: the effect of a − b − c was not") == (contrast == "a - b - c")


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_stay_as_they_are_in_sentences_and_do_no_harm_in_bibtex(name: str) -> None:
    rows, told = a_study([name, "b"], [(1, 2), (2, 5), (3, 4)], [{"test": "rm_anova"}])
    assert f"with b by 1.67 s, 95 % CI [−1.20, 4.54], 83.3 %; {name}: M = 2.00" in full_sentence(rows[0], told)
    study = Study(title=name, citation=f"{name} {{ }} % @article{{x,", conditions=("a",), measures="m.csv")
    (source, *_), text = used(study, [], [], {}), escaped(name)
    assert source.fields["title"] == text
    assert not re.search(r"(?<!\\)[#$%&_]", text)
    depth = 0
    for mark in source.bibtex:
        depth += {"{": 1, "}": -1}.get(mark, 0)
        assert depth >= 0
    assert depth == 0
    assert source.bibtex.count("\n@") == 0


def test_only_what_was_used_is_cited(tmp_path: Path) -> None:
    rows, _ = a_study(["a", "b"], [(1, 2), (2, 5), (3, 4), (4, 4)], [{"test": "wilcoxon", "adjust": "holm"}])
    told = {"title": "T", "citation": "Doe (2020). doi 10.1234/abc.5, data", "estimators": {"e": {"type": "one_euro"}}}
    study = Study.model_validate({**told, "conditions": ["a", "b"], "measures": "m.csv"})
    found = used(study, rows, ["nasa_tlx/mental"], {"numpy": "2.0", "tomato": "1.2"})
    keys = [one.key for one in found]
    assert keys[:2] == ["study", "feng2017"]
    assert set(keys[2:]) == {
        "wilcoxon1945",
        "kerby2014",
        "holm1979",
        "shapiro1965",
        "iglewicz1993",
        "hart1988",
        "casiez2012",
        "harris2020",
        "package_tomato",
    }
    text = bibliography(found)
    assert "doi = {10.1234/abc.5}" in text
    assert "note = {numpy, version 2.0}" in text
    assert len(re.findall(r"^@", text, flags=re.MULTILINE)) == len(found) == len(set(keys))
    assert "Wilcoxon, F. (1945). Individual comparisons by ranking methods. Biometrics Bulletin 1(6), 80–83." in [
        one.text.partition(" doi")[0] for one in found
    ]
    assert (
        used(study.model_copy(update={"citation": "F. doi 10.1007/s13042-015-0488-5"}), [], [], {})[0].key == "feng2017"
    )


def test_the_glossary_explains_what_is_used_and_nothing_else() -> None:
    words = dict(explained(["F(1, 11) = 2.00, p = .100, η²G = .10", "SD"]))
    assert list(words) == ["SD", "p", "F", "η²G"]
    assert explained(["A title", "Participants"]) == []


@pytest.mark.usefixtures("blank_figures")
def test_a_report_has_words_to_paste_that_lead_to_their_rows(folder: Folder, steadyhand: Steadyhand) -> None:
    tests = ["test: rm_anova", "test: wilcoxon, adjust: holm", "test: mixed_model", "test: bayes_t"]
    study = study_of(folder, "rm2_n12_time", "main", ["kinect", "fusion"], tests)
    assert steadyhand("report", study).code == 0
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    text = " ".join("".join(checked(page).text).split())
    rows = steadyhand.results()["comparisons"]
    for at, said in enumerate(sentences(steadyhand, rows)):
        assert as_printed(said) in text
        assert f'<a href="#{anchor(at)}">[row]</a>' in page
        assert f'<tr id="{anchor(at)}">' in page
    assert "There were 12 participants and 2 conditions, compared within participants: kinect and fusion" in text
    assert "M was analysed by repeated-measures ANOVA (generalized η²)." in text
    bibtex = (steadyhand.out / "references.bib").read_text(encoding="utf-8")
    for key in re.findall(r"^@\w+\{([^,]+),", bibtex, flags=re.MULTILINE):
        assert key.removeprefix("package_") in text
    assert "@article{rouder2009," in bibtex
    assert "friedman1937" not in bibtex
    assert "Glossary" in text
    assert "Bayes factor, BF₁₀" in text
    # What is pasted holds no links to the report: a page leaves them out of the copy, print leaves them out.
    assert "[row]" not in "".join(sheet.extract_text() for sheet in PdfReader(steadyhand.out / "report.pdf").pages)


def test_a_quoted_word_of_a_title_is_in_quotation_marks() -> None:
    assert "(1947). The generalization of ‘Student's’ problem when" in entries()["welch1947"].text
    assert "SUS: A “quick and dirty” usability scale" in entries()["brooke1996"].text
