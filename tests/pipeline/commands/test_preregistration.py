"""A preregistration from study.yaml to the page and the frozen file."""

from __future__ import annotations

import hashlib
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
from tests.pipeline.commands.preregistered import (
    HEAD,
    MEASURES,
    SETTINGS,
    Folder,
    Plan,
    plan,
    preregistered,
    registered,
)
from tests.pipeline.helpers import Steadyhand

__all__ = ["plan", "preregistered", "registered"]  # fixtures

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")


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
