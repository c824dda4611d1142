"""A preregistration from study.yaml to the page, the frozen file, and what a later report says was done otherwise."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.analysis.preregistration.hypotheses import Done
from pipeline.analysis.preregistration.plan_and_done import plan_and_done
from pipeline.analysis.preregistration.verdicts import DEVIATIONS
from pipeline.errors import PipelineError
from pipeline.study.comparison import Comparison
from pipeline.study.folder import load_study
from pipeline.study.preregistration import (
    FrozenFile,
    Registered,
    frozen_text,
    read_preregistered,
    registered_of,
)
from pipeline.study.statistical_tests import ADJUSTMENTS, TESTS
from tests.pipeline.helpers import Ran, Steadyhand, exit_code, run
from tests.pipeline.made_once import made_once

pytestmark = pytest.mark.usefixtures("blank_figures")

Folder = Callable[..., Path]
Plan = Callable[..., Ran]
MEASURES = "participant,condition,measure,value\n" + "".join(
    f"P{p:02d},{c},{m},{10 * k + p + (c == 'b') * (3 + p % 3)}\n"
    for p in range(1, 11)
    for c in "ab"
    for k, m in enumerate(("time_s", "errors", "tlx/effort", "tlx/mental"))
)
COMPARISONS = """\
  - {measure: time_s, test: t_paired, direction: less, hypothesis: b is slower}
  - {measure: errors, test: wilcoxon}
  - {measure: tlx/*, test: wilcoxon, adjust: holm}
"""
REST = """\
preregistration:
  question: Is b slower?
  participants: 10
  seed: 7
  outlier_rules: None is left out.
"""
HEAD = "title: Two systems\nconditions: [a, b]\nmeasures: measures.csv\ncomparisons:\n"
SETTINGS = HEAD + COMPARISONS + REST


@pytest.fixture
def plan(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Plan:
    return lambda *words: run(capsys, monkeypatch, "plan", *words)


@pytest.fixture(scope="module")
def preregistered(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A study that was preregistered before there were data; its power is simulated once for all tests."""

    def make(root: Path) -> None:
        (root / "study.yaml").write_text(SETTINGS, encoding="utf-8")
        with pytest.MonkeyPatch.context() as patched:
            assert exit_code(patched, "plan", root, "--preregister") == 0

    yield from made_once(tmp_path_factory, "preregistered", make)


@pytest.fixture
def registered(preregistered: Path, tmp_path: Path) -> Path:
    """A copy of that study, which has data now."""
    root = tmp_path / "study"
    shutil.copytree(preregistered, root)
    (root / "measures.csv").write_text(MEASURES)
    return root


def answers(page: str, form: str) -> dict[str, str]:
    """The answer of each question of one of the forms."""
    part = page.split(f"## {form}\n", 1)[1].split("\n## ", 1)[0]
    return {one.split("\n", 1)[0]: one.split("\n", 1)[1].strip() for one in part.split("### ")[1:]}


# The page and the frozen file -------------------------------------------------------------------------------------


def test_the_page_has_the_questions_in_their_order(registered: Path) -> None:
    page = (registered / "preregistration.md").read_text(encoding="utf-8")
    asked = answers(page, "As AsPredicted asks")
    assert [question[:2] for question in asked] == [f"{number}." for number in range(1, 9)]
    osf = answers(page, "As OSF asks")
    assert list(dict.fromkeys(question.partition(":")[0] for question in osf)) == [
        "Study Information",
        "Design Plan",
        "Sampling Plan",
        "Variables",
        "Analysis Plan",
        "Other",
    ]
    assert all(osf.values())
    assert all(asked.values())


def test_the_answers_are_study_yamls_and_nothing_is_invented(registered: Path) -> None:
    page = (registered / "preregistration.md").read_text(encoding="utf-8")
    asked = list(answers(page, "As AsPredicted asks").values())
    assert "not stated" in asked[0]
    assert "there was when this page was written: none." in asked[0]
    assert "Question: Is b slower?" in asked[1]
    assert "(`time_s`): b is slower; a < b" in asked[1]
    assert "`tlx/*`: hypothesis and direction not stated" in asked[1]
    assert "a is the baseline" in asked[3]
    assert "paired t tests (two-sided" in asked[4]
    assert "Family of `tlx/*`: p adjusted by Holm." in asked[4]
    assert "Outliers: None is left out." in asked[5]
    assert "Exclusions: not stated" in asked[5]
    assert "Participants: 10" in asked[6]
    assert "Rationale: not stated" in asked[6]
    assert "with the seed 7" in asked[7]


def test_the_power_of_the_planned_participants(registered: Path) -> None:
    """pwr.t.test(n = 10, power = 0.8, type = "paired"): d = 0.9961."""
    page = (registered / "preregistration.md").read_text(encoding="utf-8")
    assert "10 participants find d_z ≥ 1.00 with a power of 0.8 (paired t test, unadjusted p)." in page


def test_what_is_not_stated_is_said_to_whoever_writes_it(folder: Folder, plan: Plan) -> None:
    ran = plan(folder(SETTINGS, **{"measures.csv": MEASURES}), "--preregister")
    assert ran.code == 0
    assert "preregistration.exclusion_rules" in ran.err
    assert "hypothesis or direction of errors" in ran.err
    assert "preregistration.seed" not in ran.err
    page = (folder(SETTINGS) / "preregistration.md").read_text(encoding="utf-8")
    assert "there was when this page was written: `measures.csv`." in page


def test_the_digest_is_that_of_the_lines_above_it(registered: Path) -> None:
    """As `head -n -1 preregistered.yaml | sha256sum` prints it; the page states it too."""
    text = (registered / "preregistered.yaml").read_text(encoding="utf-8")
    above, last = text[: text.rindex("sha256:")], text[text.rindex("sha256:") :]
    digest = hashlib.sha256(above.encode()).hexdigest()
    assert last == f"sha256: {digest}\n"
    assert digest in (registered / "preregistration.md").read_text(encoding="utf-8")


def test_it_is_never_written_over(registered: Path, plan: Plan) -> None:
    before = {path: path.read_bytes() for path in registered.iterdir()}
    for missing in ("preregistered.yaml", "preregistration.md"):
        (registered / missing).unlink()
        ran = plan(registered, "--preregister")
        assert ran.code == 2
        assert "already exists, and a preregistration is never overwritten" in ran.err
        (registered / missing).write_bytes(before[registered / missing])
    assert {path: path.read_bytes() for path in registered.iterdir()} == before


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("conditions: [a, b]\nmeasures: measures.csv\n", "there are none, so there is nothing to preregister"),
        (HEAD + "  - {measure: m, test: tost, bounds: [-1, 1], direction: less}\n", "direction has no meaning there"),
        (HEAD + "  - {measure: m, test: t_paired, direction: lower}\n", "direction"),
        (
            HEAD.replace("[a, b]", "[a, b, c]") + "  - {measure: m, test: t_paired, direction: less}\n",
            "and there are 3; say it in hypothesis",
        ),
        (SETTINGS + "  participant: 3\n", "unknown key"),
    ],
)
def test_what_cannot_be_preregistered(folder: Folder, plan: Plan, settings: str, message: str) -> None:
    root = folder(settings)
    ran = plan(root, "--preregister")
    assert ran.code == 2
    assert message in ran.err
    assert [path.name for path in root.iterdir()] == ["study.yaml"]


def test_one_study_is_preregistered_at_a_time(plan: Plan) -> None:
    assert "needs one study folder, found 2 names" in plan("a", "b", "--preregister").err
    assert "there is no such folder" in plan("a", "--preregister").err


ENTRIES = st.builds(
    lambda test, measure, adjust, direction: Comparison(
        measure=measure,
        test=test,
        adjust=adjust,
        direction=direction if TESTS[test].question == "difference" else None,
        bounds=(-1, 1) if test == "tost" else None,
    ),
    st.sampled_from(sorted(TESTS)),
    st.sampled_from(["time_s", "a: b # c", "tlx/*", "é", "1e3", "sha256: x"]),
    st.sampled_from(["none", *ADJUSTMENTS]),
    st.sampled_from([None, "less", "greater"]),
)


@given(entries=st.lists(ENTRIES, min_size=1, max_size=4), title=st.text(max_size=20))
def test_what_is_frozen_is_read_back_as_it_was(
    tmp_path_factory: pytest.TempPathFactory, entries: list[Comparison], title: str
) -> None:
    registered = Registered(title=title, conditions=("a", "b"), comparisons=tuple(entries))
    text, digest = frozen_text(registered)
    root = tmp_path_factory.mktemp("frozen")
    for ends in ("\n", "\r\n"):
        (root / "preregistered.yaml").write_bytes(text.replace("\n", ends).encode())
        read = read_preregistered(root)
        assert read is not None
        assert read.registered == registered
        assert read.digest == digest
        assert read.is_intact


# What was done beside it ------------------------------------------------------------------------------------------


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


def test_an_altered_file_is_a_red_caution(registered: Path, steadyhand: Steadyhand) -> None:
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


def test_a_file_that_comes_or_goes_is_noticed(registered: Path, steadyhand: Steadyhand) -> None:
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


# Laws -------------------------------------------------------------------------------------------------------------


@given(
    entries=st.lists(ENTRIES, max_size=4), known=st.lists(st.sampled_from(["time_s", "tlx/a", "tlx/b", "tlx/total"]))
)
def test_a_study_done_as_planned_has_no_deviation(entries: list[Comparison], known: list[str]) -> None:
    registered = Registered(conditions=("a", "b"), comparisons=tuple(entries))
    study = load_plain(registered)
    rows = plan_and_done(FrozenFile(registered, "x", "x"), study, Done(sorted(set(known)), 5, ()))
    assert [row for row in rows if row["verdict"] in DEVIATIONS] == []


@given(planned=st.lists(ENTRIES, max_size=3), done=st.lists(ENTRIES, max_size=3))
def test_two_different_lists_of_tests_never_pass_as_planned(planned: list[Comparison], done: list[Comparison]) -> None:
    before = Registered(conditions=("a", "b"), comparisons=tuple(planned))
    after = Registered(conditions=("a", "b"), comparisons=tuple(done))
    rows = plan_and_done(FrozenFile(before, "x", "x"), load_plain(after), Done((), 5, ()))

    def tests(entries: list[Comparison]) -> list[tuple[str, str]]:
        return sorted((entry.title, entry.test) for entry in entries)

    if tests(planned) != tests(done):
        assert [row for row in rows if row["what"] == "test" and row["verdict"] in DEVIATIONS]


def load_plain(registered: Registered) -> Any:
    """A study that says what is registered and nothing else."""
    from pipeline.study.settings import Study

    fields = {name: getattr(registered, name) for name in Registered.model_fields}
    return Study.model_construct(**fields)


def test_what_is_registered_of_a_study_is_all_that_decides_its_tests(registered: Path) -> None:
    read = read_preregistered(registered)
    assert read is not None
    assert read.registered == registered_of(load_study(registered))


def test_a_link_out_of_the_folder_is_refused(registered: Path, tmp_path: Path, steadyhand: Steadyhand) -> None:
    path = registered / "preregistered.yaml"
    path.rename(tmp_path / "elsewhere.yaml")
    path.symlink_to(tmp_path / "elsewhere.yaml")
    ran = steadyhand("compare", registered)
    assert ran.code == 2
    assert "is outside the study folder" in ran.err


def test_an_unknown_key_is_an_error_of_the_file(registered: Path) -> None:
    path = registered / "preregistered.yaml"
    path.write_text(path.read_text(encoding="utf-8") + "power: 0.8\n", encoding="utf-8")
    with pytest.raises(PipelineError, match="unknown key"):
        read_preregistered(registered)
