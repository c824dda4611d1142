"""`check`: what moved and by how much, for people and for a CI page."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.commands import junit
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Ran, run

Folder = Callable[..., Path]
SETTINGS = "conditions: [a, b]\nmeasures: measures.csv\ncomparisons: [{measure: m, test: wilcoxon}]\n"
MEASURES = "participant,condition,measure,value\n" + "".join(
    f"P{p},{c},m,{p + (c == 'b') * (p % 3 - 1) * p}\n" for p in range(1, 9) for c in "ab"
)


class Check:
    """`steadyhand check` with a cache of all these tests."""

    def __init__(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, cache: Path
    ) -> None:
        self._capsys, self._monkeypatch = capsys, monkeypatch
        self._options = ("--cache", str(cache), "--jobs", "1")
        self.junit = tmp_path / "ci" / "junit.xml"

    def __call__(self, *words: str | Path) -> Ran:
        return run(self._capsys, self._monkeypatch, "check", *words, *self._options)

    def page(self, *words: str | Path) -> tuple[Ran, ElementTree.Element]:
        """The run, and the JUnit file it wrote."""
        ran = self(*words, "--junit", self.junit)
        return ran, ElementTree.parse(self.junit).getroot()  # noqa: S314 - our own


@pytest.fixture
def check(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, cache_of_module: Path
) -> Check:
    return Check(capsys, monkeypatch, tmp_path, cache_of_module)


def edit(study: Path, figure: str, value: object) -> None:
    """Expect another value of a figure; `None` for the value that stands there takes the figure out."""
    path = study / "expected.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    if value is None:
        del content[figure]
    else:
        content[figure] = value
    path.write_text(json.dumps(content), encoding="utf-8")


def test_without_expected_numbers_it_says_what_to_do(folder: Folder, check: Check) -> None:
    root = folder(SETTINGS, name="my study", **{"measures.csv": MEASURES})
    ran, page = check.page(root)
    assert ran.code == 2
    assert f"there is no such file; write it with: steadyhand check '{root}' --accept" in ran.err
    assert page.attrib == {"name": "steadyhand check", "tests": "1", "failures": "0", "errors": "1"}
    error = page.find("testsuite/testcase/error")
    assert error is not None
    assert "expected.json: there is no such file" in error.attrib["message"]


def test_the_table_says_by_how_much(folder: Folder, check: Check) -> None:
    root = folder(SETTINGS, **{"measures.csv": MEASURES})
    assert check(root, "--accept").code == 0
    edit(root, "descriptives | m | a | mean", 4.0)  # it is 4.5
    edit(root, "descriptives | m | a | sd", 0.0)  # √6
    edit(root, "descriptives | m | b | n", None)
    edit(root, "descriptives | m | c | n", 8)
    edit(root, "comparisons | m | wilcoxon | condition | a - b | status", "undefined: all differences are zero")
    edit(root, "descriptives | m | a | median", 4.5 * (1 + 1e-8))  # what rounding may do
    ran = check(root)
    assert ran.code == 3
    lines = {line.split("  ")[1]: line.split()[-4:] for line in ran.out.splitlines() if line.startswith("  ")}
    assert lines["figure"] == ["expected", "found", "difference", "relative"]
    assert " ".join(ran.out.split()).startswith("study: 5 moved (of")
    assert "4 4.5 +0.5 +12.5 %" in " ".join(ran.out.split())
    assert "0 2.449489743 +2.449 –" in " ".join(ran.out.split())
    assert "descriptives | m | b | n absent 8 – –" in " ".join(ran.out.split())
    assert "descriptives | m | c | n 8 absent – –" in " ".join(ran.out.split())
    assert "status undefined: all differences are zero ok – –" in " ".join(ran.out.split())
    assert f"If these changes are intended, accept them with: steadyhand check {root} --accept" in ran.out


def test_accepting_shows_what_a_person_is_to_review(folder: Folder, check: Check) -> None:
    root = folder(SETTINGS, **{"measures.csv": MEASURES})
    assert "numbers accepted into" in check(root, "--accept").out
    edit(root, "descriptives | m | a | mean", 4.0)
    ran = check(root, "--accept")
    assert ran.code == 0
    assert "4 4.5 +0.5 +12.5 %" in " ".join(ran.out.split())
    assert "review them before you commit" in ran.out
    assert check(root).code == 0


def test_the_same_test_twice_is_two_rows(folder: Folder, check: Check) -> None:
    twice = SETTINGS.replace("[{measure", "[{measure: m, test: wilcoxon, zeros: pratt}, {measure")
    root = folder(twice, **{"measures.csv": MEASURES})
    assert check(root, "--accept").code == 0
    expected = json.loads((root / "expected.json").read_text(encoding="utf-8"))
    effect_sizes = [name for name in expected if name.endswith("| effect_size")]
    assert len(effect_sizes) == 2
    assert expected[effect_sizes[0]] != expected[effect_sizes[1]]


@pytest.mark.parametrize(
    ("text", "told"),
    [("{", "not valid JSON"), ("[1]", "should hold one JSON object"), ("[" * 100_000, "not valid JSON")],
)
def test_expected_numbers_that_cannot_be_read(folder: Folder, check: Check, text: str, told: str) -> None:
    root = folder(SETTINGS, **{"measures.csv": MEASURES, "expected.json": text})
    for words in ((), ("--accept",)):
        ran = check(root, *words)
        assert ran.code == 2
        assert told in ran.err
        assert "remove it and write it with: steadyhand check" in ran.err
    assert (root / "expected.json").read_text() == text


def test_a_study_that_cannot_be_checked_does_not_stop_the_others(folder: Folder, check: Check) -> None:
    new = folder(SETTINGS, name="new", **{"measures.csv": MEASURES})
    broken = folder("conditions: [a]\n", name="broken")
    good = folder(SETTINGS, name="good", **{"measures.csv": MEASURES})
    assert check(good, "--accept").code == 0
    ran, page = check.page(new, broken, good)
    assert ran.code == 2
    assert "good: all" in ran.out
    outcome = {suite.attrib["name"]: (suite.attrib["errors"], suite.attrib["failures"]) for suite in page}
    assert outcome == {"new": ("1", "0"), "broken": ("1", "0"), "good": ("0", "0")}
    edit(good, "descriptives | m | a | mean", 4.0)
    assert check(new, broken, good).code == 3


def test_a_ci_page_names_the_row_and_the_figures(folder: Folder, check: Check) -> None:
    root = folder(SETTINGS, **{"measures.csv": MEASURES})
    assert check(root, "--accept").code == 0
    edit(root, "descriptives | m | a | mean", 4.0)
    edit(root, "descriptives | m | a | median", 5)
    ran, page = check.page(root)
    assert ran.code == 3
    failed = [case for case in page.iter("testcase") if len(case)]
    assert [(case.attrib["classname"], case.attrib["name"]) for case in failed] == [("study.descriptives", "m | a")]
    assert failed[0][0].attrib["message"] == "mean: expected 4, found 4.5 (+0.5, +12.5 %); and 1 more"
    assert failed[0][0].text == (
        "mean: expected 4, found 4.5 (+0.5, +12.5 %)\nmedian: expected 5, found 4.5 (-0.5, -10 %)"
    )
    names = [(case.attrib["classname"], case.attrib["name"]) for case in page.iter("testcase")]
    assert names[1:] == [("study.descriptives", "m | b"), ("study.comparisons", "m | wilcoxon | condition | a - b")]
    assert page.attrib["tests"] == "3"
    assert page.attrib["failures"] == "1"


def test_a_session_read_in_part_is_a_failure_of_its_own(folder: Folder, check: Check) -> None:
    settings = "conditions: [a, b]\nsessions: '{participant}_{condition}.mcap'\n" + STREAMS
    root = folder(settings)
    for name in ("P01_a", "P01_b"):
        write_session(root / f"{name}.mcap", session_messages())
    assert check(root, "--accept").code == 0
    _, page = check.page(root)
    assert page.attrib["failures"] == "0"
    log = root / "P01_b.mcap"
    log.write_bytes(log.read_bytes()[:-3000])
    assert check(root, "--accept").code == 1
    ran, page = check.page(root)
    assert ran.code == 1
    assert "session P01_b read in part" in ran.err
    failed = [case for case in page.iter("testcase") if len(case)]
    assert [case.attrib["name"] for case in failed] == ["every session is read whole"]
    assert "session P01_b read in part" in (failed[0][0].text or "")


HOSTILE = """]]></failure><script>alert("1")</script> & 'é' \u202e | $(rm) %s \x1b[2J"""


def test_hostile_names_are_data(folder: Folder, check: Check) -> None:
    quoted = '"' + HOSTILE.replace('"', '""') + '"'
    root = folder(
        "conditions: [a, b]\nmeasures: measures.csv\n",
        name="<a&b>",
        **{"measures.csv": MEASURES.replace(",m,", f",{quoted},")},
    )
    assert check(root, "--accept").code == 0
    edit(root, f"descriptives | {HOSTILE} | a | mean", -1.0)
    ran, page = check.page(root)
    assert ran.code == 3
    assert "\x1b" not in ran.out
    shown = HOSTILE.replace("\x1b", "□")
    failed = [case for case in page.iter("testcase") if len(case)]
    assert [case.attrib["name"] for case in failed] == [f"{shown} | a"]
    assert page[0].attrib["name"] == "<a&b>"
    assert [element.tag for element in failed[0].iter()] == ["testcase", "failure"]


@given(first=st.text(), second=st.text(), third=st.text())
def test_any_text_makes_a_file_that_can_be_read(
    tmp_path_factory: pytest.TempPathFactory, first: str, second: str, third: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.xml"
    case = junit.Case(first, second, (second, third))
    junit.write(path, [junit.Suite(third, [case, case], remarks=first)])
    root = ElementTree.parse(path).getroot()  # noqa: S314 - our own
    readable = all(character.isprintable() for character in second)
    assert not readable or root[0][0].attrib["name"] == second


def test_a_junit_file_is_written_over_no_other(folder: Folder, check: Check, tmp_path: Path) -> None:
    root = folder(SETTINGS, **{"measures.csv": MEASURES})
    for path in (root / "measures.csv", root):
        ran = check(root, "--junit", path)
        assert ran.code == 2
        assert "already exists and is not a JUnit file; choose another name" in ran.err
    assert (root / "measures.csv").read_text() == MEASURES
    ran = check(root, "--accept", "--junit", tmp_path / "junit.xml")
    assert ran.code == 2
    assert "--accept compares nothing that --junit could report; give only one of them" in ran.err
    assert not (root / "expected.json").exists()
    for _ in range(2):  # an earlier run's is
        check.page(root)
