"""The pages: complete, self-contained, and the same for the same input."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from pypdf import PdfReader

from pipeline.report.document import html, pdf
from pipeline.report.document.model import (
    Column,
    CrossReference,
    Document,
    Paragraph,
    Section,
    Table,
)
from pipeline.study.statistical_tests import TESTS
from pipeline.words.comparison import method_in_words
from pipeline.words.numbers import p_phrase, percent
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand, as_printed, exit_code
from tests.pipeline.made_once import made_once
from tests.pipeline.reference import study_of
from tests.pipeline.report.pages import checked, script

Folder = Callable[..., Path]


def test_a_long_name_in_a_pdf_table_is_broken_behind_punctuation_and_stays_in_its_column(tmp_path: Path) -> None:
    name = "kalman_fusion[jerk_psd_mm2_s5=30000000.0,bias_walk_mm_s2_per_sqrt_s=0.00001,gate_sd=4.5]"
    figures = tuple(f"{number} [1, 2]" * 3 for number in range(4))
    titles = (Column("Estimator", False), *(Column(f"c{number}") for number in range(4)))
    table = Table("t", "Names", titles, ((name, *figures), *(("raw", *figures),) * 8))
    pdf.render(Document("d", "", "", (Section("s", "S", (table,)),)), tmp_path, tmp_path / "r.pdf")
    (page,) = PdfReader(tmp_path / "r.pdf").pages
    pieces = [line.strip("\u200b ") for line in page.extract_text().splitlines()]
    begin = next(index for index, line in enumerate(pieces) if line.startswith("kalman"))
    end = next(index for index, line in enumerate(pieces) if "4.5]" in line)
    assert end > begin
    assert all(line[-1] in "[,_=/" for line in pieces[begin:end])
    assert name in "".join(pieces).replace("\u200b", "")


def test_words_lead_to_the_row_of_a_table(tmp_path: Path) -> None:
    rows = (("first", "1"), ("second", "2"))
    table = Table("t", "Rows", (Column("a", False), Column("b")), rows, anchors=("row-1", "row-2"))
    section = Section("s", "S", (Paragraph(("see ", CrossReference("<b>there</b>", "row-2"))), table))
    document = Document("d", "", "", (section,))
    html.render(document, tmp_path, tmp_path / "r.html")
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert '<a href="#row-2">&lt;b&gt;there&lt;/b&gt;</a>' in page
    assert re.findall(r'<tr id="([^"]*)">\s*<th scope="row">(\w+)', page) == [("row-1", "first"), ("row-2", "second")]
    pdf.render(document, tmp_path, tmp_path / "r.pdf")
    (sheet,) = PdfReader(tmp_path / "r.pdf").pages
    assert [link.get_object()["/Subtype"] for link in sheet["/Annots"]] == ["/Link"]  # type: ignore[attr-defined]
    assert "see <b>there</b>" in sheet.extract_text()


SETTINGS = (
    "title: Two conditions\ndata_origin: simulated\nconditions: [a, b]\nsessions: '{participant}_{condition}.mcap'\n"
    "display: {px_per_mm: 10}\nquestionnaires: q.csv\n"
    "estimators: {raw: {type: raw}, gp: {type: window_gp, use: [tracker]}, fusion: {type: window_gp}}\n"
    "comparisons: [{measure: selection_mse_px2, test: rm_anova}, {measure: nasa_tlx/*, test: wilcoxon, adjust: holm}]\n"
)


# Of relative paths, since provenance.json repeats the words of the command.
COMMAND = ("report", "study", "--out", "out", "--cache", "cache", "--jobs", "1")


def _write_study(root: Path) -> None:
    """Three people in two conditions, with logs and two scales of a questionnaire."""
    root.mkdir()
    (root / "study.yaml").write_text(SETTINGS + STREAMS, encoding="utf-8")
    ratings = "".join(
        f"P{p},{c},nasa_tlx,{s},{(p * 3 + len(s) + (c == 'b') * p) % 20}\n"
        for p in (1, 2, 3)
        for c in "ab"
        for s in ("mental", "effort")
    )
    (root / "q.csv").write_text(f"participant,condition,questionnaire,scale,rating\n{ratings}", encoding="utf-8")
    for participant in (1, 2, 3):
        for condition in "ab":
            messages = session_messages(4.0, seed=participant, bias_mm=participant * (condition == "b"))
            write_session(root / f"P{participant}_{condition}.mcap", messages)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A study, its report in `out` and its cache in `cache`, to be read only."""

    def make(folder: Path) -> None:
        _write_study(folder / "study")
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            assert exit_code(patch, *COMMAND) == 0

    yield from made_once(tmp_path_factory, "report", make)


@pytest.fixture
def report(finished: Path) -> Path:
    return finished / "out"


def results_of(report: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((report / "results.json").read_text(encoding="utf-8"))
    return content


def test_the_page_is_whole_without_network_and_runs_nothing_but_its_own_script(report: Path) -> None:
    """The script sorts tables and marks the section; whatever else there were to run, the page's policy forbids."""
    page = (report / "report.html").read_text(encoding="utf-8")
    found = checked(page)
    assert found.scripts == [script("report.js")]
    digest = base64.b64encode(hashlib.sha256(found.scripts[0].encode()).digest()).decode()
    assert "default-src 'none'; img-src data:; font-src data:; style-src 'sha256-" in page
    assert f"script-src 'sha256-{digest}'" in page
    assert found.pictures_without_alt == 0
    ours = ("#", "data:image/svg+xml;charset=utf-8,", "traces.html")
    assert all(reference.startswith(ours) for reference in found.references)
    style = page.split("</style>")[0]
    assert style.count("url(") == style.count("url(data:font/woff2;base64,") == 3
    assert found.tags.count("h1") == 1
    assert "Simulated data" in page
    titles = re.findall(r"<h2[^>]*>([^<]*)</h2>", page)
    for title in (
        "Summary",
        "Design and participants",
        "Data quality and exclusions",
        "Fusion accuracy",
        "Target selection",
    ):
        assert title in titles
    for anchor in re.findall(r'href="#([^"]+)"', page):
        assert f'id="{anchor}"' in page


def test_every_figure_is_whole_and_vector(report: Path) -> None:
    figures = list((report / "figures").iterdir())
    assert {"streams.svg", "estimates.svg", "lead.svg", "accuracy.svg"} <= {f.name for f in figures}
    for figure in figures:
        root = ElementTree.parse(figure).getroot()  # noqa: S314 - our own file
        assert root.tag.endswith("svg")
        assert figure.stat().st_size < 500_000


def test_the_pdf_is_tagged_named_and_says_the_origin_on_every_page(report: Path) -> None:
    reader = PdfReader(report / "report.pdf")
    root = reader.trailer["/Root"]
    assert root["/MarkInfo"]["/Marked"]  # type: ignore[index]
    assert root["/Lang"] == "en"  # type: ignore[index]
    assert reader.metadata is not None
    assert reader.metadata.title == "Two conditions"
    metadata = root["/Metadata"].get_data().decode()  # type: ignore[index]
    assert "pdfuaid:part" in metadata
    assert "pdfaid:part" in metadata
    assert len(reader.outline) > 5
    for page in reader.pages:
        assert "Simulated data" in page.extract_text()


def test_the_same_input_gives_the_same_bytes(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In another folder, and without a cache."""
    shutil.copytree(finished / "study", tmp_path / "study")
    monkeypatch.chdir(tmp_path)
    assert exit_code(monkeypatch, *COMMAND) == 0
    report, again = finished / "out", tmp_path / "out"
    names = sorted(path.relative_to(report) for path in report.rglob("*") if path.is_file())
    assert names == sorted(path.relative_to(again) for path in again.rglob("*") if path.is_file())
    for name in names:
        assert (again / name).read_bytes() == (report / name).read_bytes(), name


def test_the_first_page_answers_with_means_intervals_and_a_figure(report: Path) -> None:
    page = (report / "report.html").read_text(encoding="utf-8")
    text = " ".join("".join(checked(page.partition("Back to the contents")[0]).text).split())
    results = results_of(report)
    row = next(row for row in results["comparisons"] if row["measure"] == "selection_mse_px2")
    means = {  # in the unit that people feel: roots, also of the bounds
        one[
            "condition"
        ]: f"{math.sqrt(one['mean']):.2f} px [{math.sqrt(one['ci_low']):.2f}, {math.sqrt(one['ci_high']):.2f}]"
        for one in results["descriptives"]
        if one["measure"] == "selection_mse_px2"
    }
    assert row["reduction"] < 0
    expected = (
        f"Selection error, MSE was {percent(-row['reduction'])} higher (worse) with b than with a"
        f"{'' if row['p'] < 0.05 else ', a difference that is not statistically significant'}: on average, as"
        f" roots, {means['b']} with b against {means['a']} with a ({p_phrase(row['p'])}, n = 3)."
    )
    assert " ".join(expected.split()) in text
    assert 'id="figure-answer"' in page
    for caution in ("The data are simulated:", "Few participants:"):
        assert caution in text


def test_every_number_of_a_comparison_on_the_page_stands_in_results_json(report: Path) -> None:
    page = (report / "report.html").read_text(encoding="utf-8")
    for row in results_of(report)["comparisons"]:
        ranks = row["statistic_name"] == "W+"  # a sum of ranks is whole or a half
        assert (f"=\u00a0{row['statistic']:g}" if ranks else f"{row['statistic']:.2f}") in page


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_files_of_an_earlier_report_that_are_no_more_are_removed(
    finished: Path, steadyhand: Steadyhand, tmp_path: Path
) -> None:
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    report, study = steadyhand.out, tmp_path / "study"
    assert (report / "figures" / "lead.svg").exists()
    (report / "mine.txt").write_text("a file of the user's")
    path = study / "study.yaml"
    path.write_text(path.read_text().replace("estimators: {raw", "# estimators: {raw"))
    assert steadyhand("report", study).code == 0
    assert not (report / "figures" / "lead.svg").exists()
    assert (report / "mine.txt").exists()


def test_names_in_any_script_are_drawn_and_set(folder: Folder, steadyhand: Steadyhand) -> None:
    """Where a font has no glyph the PDF and the figures show a box; the page has the character itself."""
    rows = "participant,condition,measure,value\n" + "".join(
        f"参加者{p},{c},m $x_1$ 🙂,{p * (1 + (c == 'β'))}\n" for p in (1, 2, 3, 5) for c in ("عربي", "β")
    )
    settings = (
        "title: 測定 🙂\nconditions: [عربي, β]\nmeasures: measures.csv\ncomparisons: [{measure: 'm $x_1$ 🙂', test:"
        " wilcoxon}]\n"
    )
    ran = steadyhand("report", folder(settings, **{"measures.csv": rows}))
    assert ran.code == 0, ran.err
    assert "測定 🙂" in (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert "□□ □" in PdfReader(steadyhand.out / "report.pdf").pages[0].extract_text()


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_every_test_reads_in_the_report(folder: Folder, steadyhand: Steadyhand) -> None:
    """A sentence, a line of the table and the method of each, with the figures of results.json."""
    tests = [
        "test: rm_anova, adjust: holm",
        "test: art_anova",
        "test: friedman",
        "test: mixed_model, fixed: [condition, period]",
        "test: crossover",
        "test: t_paired",
        "test: wilcoxon",
        "test: tost, bounds: [-30, 30]",
        "test: bayes_t",
    ]
    study = study_of(folder, "crossover_2x2_n12", "main", ["kinect", "fusion"], tests)
    assert steadyhand("report", study).code == 0
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    text = " ".join("".join(checked(page).text).split())
    for sentence in (
        "M: F(1, 11) = 5.81, p = .0346, Holm-adjusted p = .0346, η²G = .10 [.00, .29], n = 12, lower by 5.70.",
        "M: ART ANOVA: F(1, 11) = 5.77, p = .0351, η²p = .34 [.00, .65], n = 12.",
        "M: mixed model with period: kinect − fusion, t(10) = 3.71, p = .0040, estimate = 5.70 [2.28, 9.13], n = 12.",
        "M: mixed model with period: period, t(10) = −4.01, p = .0025, estimate = −6.16 [−9.58, −2.73], n = 12.",
        "M: crossover: kinect − fusion, t(10) = 3.71, p = .0040, estimate = 5.70 [2.28, 9.13], n = 12.",
        "M: crossover: carry-over: KF − FK, t(10) = 0.27, p = .7892, estimate = 2.57 [−18.30, 23.44], n = 12.",
        "the conditions are equivalent within the bounds at the 5 % level",
        "the data are 2.20 times as likely under a difference as under none",
        "Bayes factor (JZS, prior scale 0.707): kinect − fusion, BF₁₀ = 2.20",
        "Design: 1 remark, about effect of the period.",
        "mixed model with period: linear mixed model, random intercept, REML, Satterthwaite degrees of freedom",
    ):
        assert sentence in text, sentence
    for row in steadyhand.results()["comparisons"]:
        assert TESTS[row["test"]].label in text
        ranks = row["statistic_name"] == "W+"
        assert (f"W₊ = {row['statistic']:g}" if ranks else f"{abs(row['statistic']):.2f}") in text
        assert as_printed(method_in_words(row)) in text
    for row in steadyhand.results()["design_check"]:
        assert as_printed(row["found"]) in text


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_follow_ups_share_a_sentence_and_a_singular_fit_is_a_caution(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "".join(
        f"P{person},{condition},m,{value}\n"
        for person, values in enumerate(((1, 5, 9), (4, 9, 2), (8, 1, 6), (2, 7, 5)))
        for condition, value in zip("abc", values, strict=True)
    )
    settings = (
        "conditions: [a, b, c]\nmeasures: measures.csv\ncomparisons:\n  - {measure: m, test: rm_anova}\n"
        "  - {measure: m, test: mixed_model, follow_up: bonferroni}\n"
    )
    study = folder(settings, **{"measures.csv": f"participant,condition,measure,value\n{rows}"})
    assert steadyhand("report", study).code == 0
    text = " ".join("".join(checked((steadyhand.out / "report.html").read_text(encoding="utf-8")).text).split())
    assert "M: 6 pairs were compared after the rm ANOVA and the mixed model: see the table of all comparisons." in text
    assert "b − c 4 t(9) = " in text  # Satterthwaite's degrees of freedom stand with the statistic
    assert "Bonferroni-adjusted p" in text
    assert "Singular fit of the mixed model for M: it finds no variance between participants" in text
    assert "singular fit: no variance between participants is found" in text
    assert "its pairs by linear mixed model" not in text  # all rows of a model have one method


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_a_questionnaire_of_which_only_the_total_was_kept_is_shown(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "".join(
        f"P{person},{each},nasa_tlx,total,{person}{ord(each) - 96}\n" for person in range(3) for each in "ab"
    )
    study = folder(
        "conditions: [a, b]\nquestionnaires: q.csv\n",
        **{"q.csv": f"participant,condition,questionnaire,scale,rating\n{rows}"},
    )
    assert steadyhand("report", study).code == 0
    text = " ".join("".join(checked((steadyhand.out / "report.html").read_text(encoding="utf-8")).text).split())
    assert "Total (plain sum) by participant" in text
    assert "What was measured? 3 participants under 2 conditions, a and b; nothing was compared." in text
    assert "a participant's sum over the scales" not in text
