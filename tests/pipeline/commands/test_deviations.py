"""What a later report says was done otherwise than it was preregistered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pipeline.analysis.preregistration.hypotheses import Done
from pipeline.analysis.preregistration.plan_and_done import plan_and_done
from pipeline.analysis.preregistration.verdicts import DEVIATIONS
from pipeline.study.folder import load_study
from pipeline.study.preregistration import (
    FrozenFile,
    read_preregistered,
)
from tests.pipeline.commands.preregistered import MEASURES, SETTINGS, Folder, Plan, plan, preregistered, registered
from tests.pipeline.helpers import Steadyhand

__all__ = ["plan", "preregistered", "registered"]  # fixtures

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print", "one_cache")


def changed(registered: Path, **replaced: str) -> Path:
    """The study with parts of study.yaml replaced, keyed by what names the part in `REPLACED`."""
    path = registered / "study.yaml"
    text = path.read_text(encoding="utf-8")
    for key, new in replaced.items():
        old = REPLACED[key]
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return registered


REPLACED = {
    "time": "  - {measure: time_s, test: t_paired, direction: less, hypothesis: b is slower}\n",
    "errors": "  - {measure: errors, test: wilcoxon}\n",
    "tlx": "  - {measure: tlx/*, test: wilcoxon, adjust: holm}\n",
    "rest": "preregistration:\n",
    "outliers": "  outlier_rules: None is left out.\n",
}


def deviations(steadyhand: Steadyhand, study: Path) -> dict[tuple[str, str | None], tuple[str, str, str]]:
    """Every row that a reader has to know of, after comparing the study."""
    assert steadyhand("compare", study).code == 0
    rows = steadyhand.results()["preregistration"]
    return {
        (row["what"], row["measure"]): (row["planned"], row["done"], row["verdict"])
        for row in rows
        if row["verdict"] in DEVIATIONS
    }


def test_nothing_is_said_of_a_study_that_was_not_preregistered(folder: Folder, steadyhand: Steadyhand) -> None:
    assert steadyhand("report", folder(SETTINGS, **{"measures.csv": MEASURES}), "--format", "html,json").code == 0
    assert steadyhand.results()["preregistration"] == []
    assert "reregist" not in (steadyhand.out / "report.html").read_text(encoding="utf-8")


def test_all_as_planned(registered: Path, steadyhand: Steadyhand) -> None:
    assert steadyhand("report", registered, "--format", "html,json,csv").code == 0
    rows: list[dict[str, Any]] = steadyhand.results()["preregistration"]
    assert not [row for row in rows if row["verdict"] in DEVIATIONS]
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert "All that can be compared was done as preregistered" in page
    assert 'id="preregistration"' in page
    (found,) = [row for row in rows if row["what"] == "hypothesis"]
    assert (found["planned"], found["verdict"]) == ("b is slower; a < b", "supported")
    assert {row["measure"] for row in rows if row["what"] == "test"} == {"time_s", "errors, tlx/*"}


@pytest.mark.parametrize(
    ("replaced", "what", "said"),
    [
        ({"errors": ""}, ("test", "errors"), ("Wilcoxon", "not tested", "deviation")),
        (
            {"errors": "  - {measure: errors, test: t_paired}\n"},
            ("test", "errors"),
            ("Wilcoxon", "paired t", "deviation"),
        ),
        (
            {"errors": "  - {measure: errors, test: wilcoxon, zeros: pratt}\n"},
            ("test", "errors"),
            ("Wilcoxon", "Wilcoxon (zeros: pratt)", "deviation"),
        ),
        (
            {"errors": REPLACED["errors"] + "  - {measure: errors, test: t_paired}\n"},
            ("test", "errors"),
            ("not planned", "paired t", "exploratory"),
        ),
        (
            {"errors": "  - {measure: errors, test: wilcoxon, adjust: bonferroni}\n"},
            ("adjustment of p", "errors"),
            ("not adjusted", "Bonferroni over errors by Wilcoxon", "deviation"),
        ),
        (
            {"tlx": "  - {measure: tlx/effort, test: wilcoxon, adjust: holm}\n"},
            ("adjustment of p", "tlx/effort"),
            (
                "Holm over tlx/effort by Wilcoxon and tlx/mental by Wilcoxon",
                "Holm over tlx/effort by Wilcoxon",
                "deviation",
            ),
        ),
        ({"rest": "alpha: 0.01\npreregistration:\n"}, ("level of significance", None), ("0.05", "0.01", "deviation")),
        (
            {"rest": "exclusions: [{participant: P03, reason: late}]\npreregistration:\n"},
            ("exclusion", None),
            ("not planned", "participant P03 (late)", "deviation"),
        ),
        (
            {"rest": "exclusions: [{participant: P03, reason: late}]\npreregistration:\n"},
            ("participants", None),
            ("10", "9", "deviation"),
        ),
        (
            {"outliers": "  outlier_rules: Beyond 3 SD.\n"},
            ("outlier rules", None),
            ("None is left out.", "Beyond 3 SD.", "deviation"),
        ),
        (
            {"outliers": "  outlier_rules: None is left out.\n  exclusion_rules: The slow ones.\n"},
            ("exclusion rules", None),
            ("not stated", "The slow ones.", "deviation"),
        ),
        (
            {"time": "  - {measure: time_s, test: t_paired, direction: greater}\n"},
            ("hypothesis", "time_s"),
            ("b is slower; a < b", "a > b", "deviation"),
        ),
        (
            {"errors": "  - {measure: errors, test: wilcoxon, hypothesis: As we always knew}\n"},
            ("hypothesis", "errors"),
            ("not planned", "As we always knew", "deviation"),
        ),
    ],
)
def test_every_deviation_is_named(
    registered: Path,
    steadyhand: Steadyhand,
    replaced: dict[str, str],
    what: tuple[str, str | None],
    said: tuple[str, str, str],
) -> None:
    assert deviations(steadyhand, changed(registered, **replaced))[what] == said


def test_the_pairs_that_are_asked_about_are_frozen(folder: Folder, plan: Plan, steadyhand: Steadyhand) -> None:
    three = SETTINGS.replace("[a, b]", "[a, b, c]").replace("direction: less, ", "")
    root = folder(f"{three}question: [[c, a], [b, c]]\n")
    assert plan(root, "--preregister").code == 0
    assert "Pairs that are asked about: c versus a and b versus c." in (root / "preregistration.md").read_text()
    of_c = [row.replace(",b,", ",c,") for row in MEASURES.splitlines() if ",b," in row]
    (root / "measures.csv").write_text(MEASURES + "\n".join(of_c) + "\n")
    (root / "study.yaml").write_text(f"{three}question: [[b, c], [a, c]]\n")  # the same, written otherwise
    assert deviations(steadyhand, root) == {}
    (root / "study.yaml").write_text(f"{three}question: [[b, c]]\n")
    (planned, done, verdict) = deviations(steadyhand, root)["pairs that are asked about", None]
    assert (planned, done, verdict) == ("a - c, b - c", "b - c", "deviation")


def test_a_file_from_before_pairs_were_frozen_says_nothing_of_them(registered: Path) -> None:
    frozen = read_preregistered(registered)
    assert frozen is not None
    before = frozen.registered.model_copy(update={"question": None})
    rows = plan_and_done(
        FrozenFile(before, frozen.digest, frozen.digest), load_study(registered), Done(["time_s"], 10, [])
    )
    assert "pairs that are asked about" not in {row["what"] for row in rows}


def test_who_is_on_the_list_and_did_not_come_is_missing(folder: Folder, plan: Plan, steadyhand: Steadyhand) -> None:
    """participants.csv may hold the plan: 12 people, of whom 10 have values."""
    people = "participant\n" + "".join(f"P{number:02d}\n" for number in range(1, 13))
    planned = SETTINGS.replace("participants: 10", "participants: 12").replace(
        "measures:", "participants: participants.csv\nmeasures:"
    )
    study = folder(planned, **{"measures.csv": MEASURES, "participants.csv": people})
    assert plan(study, "--preregister").code == 0
    assert deviations(steadyhand, study) == {("participants", None): ("12", "10", "deviation")}


def test_the_first_page_lists_the_deviations(registered: Path, steadyhand: Steadyhand) -> None:
    new = "  - {measure: errors, test: t_paired}\n"
    study = changed(registered, errors=new, rest="exclusions: [{participant: P03, reason: late}]\npreregistration:\n")
    assert steadyhand("report", study, "--format", "html,json,csv").code == 0
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    summary = page.split('id="summary"', 1)[1].split("</section>", 1)[0]
    assert "Preregistered, with 3 deviations" in summary
    assert "planned Wilcoxon; done paired t." in summary
    assert "participant P03 (late) was not planned." in summary
    table = (steadyhand.out / "tables" / "preregistration.csv").read_text(encoding="utf-8")
    assert "test,errors,Wilcoxon,paired t,deviation" in table
    assert "The preregistration was altered" not in page


def test_an_altered_file_is_a_red_caution(registered: Path, steadyhand: Steadyhand, tmp_path: Path) -> None:
    steadyhand.cache = tmp_path / "cache"
    assert steadyhand("report", registered, "--format", "html,json").code == 0
    path = registered / "preregistered.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace("alpha: 0.05", "alpha: 0.1"), encoding="utf-8")
    ran = steadyhand("report", registered, "--format", "html,json")
    assert "compare 1" in ran.out  # the file's digest is part of the key
    assert "report 1" in ran.out
    summary = (steadyhand.out / "report.html").read_text(encoding="utf-8").split("</section>", 1)[0]
    assert "✗ red: the preregistration was altered after it was written" in summary
    rows = steadyhand.results()["preregistration"]
    assert rows[0]["verdict"] == "altered"
    assert "preregistered.yaml" in (steadyhand.out / "provenance.json").read_text(encoding="utf-8")


def test_a_file_that_comes_or_goes_is_noticed(registered: Path, steadyhand: Steadyhand, tmp_path: Path) -> None:
    steadyhand.cache = tmp_path / "cache"
    assert steadyhand("compare", registered).code == 0
    assert "nothing was computed again" in steadyhand("compare", registered).out
    (registered / "preregistered.yaml").unlink()
    assert "compare 1" in steadyhand("compare", registered).out
    assert steadyhand.results()["preregistration"] == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("alpha: 0.05\n", "put the file back as it was registered"),
        ("conditions: [a, b\n", "not valid YAML"),
        ("conditions: [a, b]\ncomparisons: [{measure: m, test: t_pared}]\n", 'did you mean "t_paired"?'),
    ],
)
def test_a_file_that_cannot_be_read_is_an_error(
    registered: Path, steadyhand: Steadyhand, text: str, message: str
) -> None:
    (registered / "preregistered.yaml").write_text(text)
    ran = steadyhand("compare", registered)
    assert ran.code == 2
    assert "preregistered.yaml" in ran.err
    assert message in ran.err


def test_a_file_without_a_digest_counts_as_altered(registered: Path) -> None:
    path = registered / "preregistered.yaml"
    path.write_text("conditions: [a, b]\n")
    read = read_preregistered(registered)
    assert read is not None
    assert not read.is_intact
    assert read.stated_digest is None
