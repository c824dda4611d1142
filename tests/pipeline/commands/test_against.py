"""`check --against`: what other programs say of a study's comparisons, and why."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from pipeline.analysis.against import in_r
from pipeline.analysis.against.problems import Groups, Problem
from pipeline.analysis.against.programs import LIBRARIES, Library
from pipeline.analysis.against.theirs import Call
from pipeline.commands import r_process
from pipeline.study.comparison import Comparison
from tests.conftest import CLONE
from tests.pipeline.helpers import Ran, run

CASES = CLONE / "tests" / "data" / "cases"
Against = Callable[..., Ran]
HAS_R = pytest.mark.skipif(r_process.executable() is None, reason="there is no R here")


@pytest.fixture
def against(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, cache_of_module: Path) -> Against:
    """`steadyhand check` of a case beside other programs; ours is computed once, theirs each time."""

    def check(case: str, programs: str, *words: str | Path) -> Ran:
        options = ("--against", programs, "--cache", cache_of_module, "--jobs", "1", *words)
        return run(capsys, monkeypatch, "check", CASES / case, *options)

    return check


def block(ran: Ran, title: str) -> str:
    """What was printed under the row with this title, white space apart."""
    return " ".join(ran.out.split(title, 1)[1].split("\n\n", 1)[0].split())


@pytest.mark.slow
def test_every_difference_of_the_libraries_has_a_verified_reason(against: Against) -> None:
    ran = against("every_test", "scipy,pingouin,statsmodels")
    assert ran.code == 0, ran.out
    assert " 0 without one; " in ran.out
    rank = block(ran, "likert, wilcoxon, condition, A - B, n = 15\n")
    assert "pingouin.wilcoxon(x, y) agrees: W+, effect size, but p: ours 0.462891, theirs 0.427202" in rank
    assert "normal approximation with continuity correction" in rank
    assert "groups of unequal size weigh by their size" in block(ran, "m, mixed_anova, condition, n = 15")
    assert "normal z for t" in block(ran, "m, mixed_model, condition, A - B, n = 15")
    assert "Student's t with one variance" in block(ran, "m, t_welch, device, a - b, n = 10")
    logs = block(ran, "likert, t_paired, condition, A - B, of the logarithms, n = 15")
    assert "scipy.stats.ttest_rel(x, y) agrees: t, df2, p, interval from, interval to" in logs
    assert "pingouin.multicomp(p, method) could not: it has no Hommel" in logs
    assert "rows that no other program computes here: art_anova (1)" in ran.out


@HAS_R
@pytest.mark.slow
def test_every_difference_of_r_has_a_verified_reason(against: Against) -> None:
    ran = against("every_test", "r")
    assert ran.code == 0, ran.out
    assert " 0 without one" in ran.out
    assert "t.test(x, y, paired = TRUE) agrees: t, df2, p, interval from, interval to" in ran.out
    assert "oneway.test(value ~ g) agrees: F, df1, df2, p" in ran.out


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        ("confound", "standard error from the joint information of coefficients and variances"),
        ("n2big", "its integration over g from 0 to ∞ misses digits in the long tail"),
    ],
)
def test_extreme_and_unbalanced_data_have_a_reason_in_the_libraries(against: Against, case: str, reason: str) -> None:
    ran = against(case, "pingouin,statsmodels")
    assert ran.code == 0, ran.out
    assert reason in ran.out


@HAS_R
@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "reason"),
    [
        ("epoch_us", "its digits run out, for the values are far larger than what they differ by"),
        ("giant_outlier", "have an eigenvalue that it takes for zero"),
        ("n2big", "have an eigenvalue that it takes for zero"),
    ],
)
def test_extreme_data_have_a_reason_in_r(against: Against, case: str, reason: str) -> None:
    ran = against(case, "r")
    assert ran.code == 0, ran.out
    assert reason in ran.out


def test_adjusted_p_values_are_of_the_p_that_is_judged_by(against: Against) -> None:
    ran = against("gg_holm", "statsmodels")
    assert ran.code == 0
    assert "multipletests(p, method) p_adjusted: ours 0.0964054, theirs 0.0350695" in " ".join(ran.out.split())
    assert "adjusts the uncorrected p" in ran.out


def test_a_refusal_is_quoted(against: Against) -> None:
    ran = against("friedman2", "scipy")
    assert ran.code == 0
    assert "scipy.stats.friedmanchisquare(x, y, …) could not: ValueError: At least 3 samples must be given" in ran.out


def test_a_difference_without_a_reason_is_said_and_fails(
    against: Against, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    call = Call("f(x, y)", lambda data, _entry: {"p": 0.5, "df2": len(data.first) - 1})
    monkeypatch.setitem(LIBRARIES, "scipy", Library(lambda: "SciPy 0", {"t_paired": (call,)}))
    ran = against("family2", "scipy", "--junit", tmp_path / "junit.xml")
    assert ran.code == 1
    assert ran.out.count("theirs 0.5 (+0.4") == ran.out.count(": NO KNOWN REASON") == 2
    assert "family2: 2 figures agree, 0 differ for a known reason, 2 without one" in ran.out
    page = ElementTree.parse(tmp_path / "junit.xml").getroot()  # noqa: S314 - our own
    assert (page.attrib["tests"], page.attrib["failures"], page.attrib["errors"]) == ("2", "2", "0")


@pytest.mark.parametrize(
    ("programs", "words", "message"),
    [
        ("pinguin", (), '--against: there is no program "pinguin"; did you mean "pingouin"?'),
        (" , ", (), "--against: names no program"),
        ("r", ("--accept",), "give only one of them"),
    ],
)
def test_what_cannot_be_meant(against: Against, programs: str, words: tuple[str, ...], message: str) -> None:
    ran = against("friedman2", programs, *words)
    assert ran.code == 2
    assert message in ran.err


def test_without_r_the_others_are_compared(against: Against, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(r_process, "executable", lambda: None)
    ran = against("friedman2", "scipy,r")
    assert ran.code == 0
    assert "R is left out: there is no Rscript on the PATH" in ran.err
    assert "scipy.stats.wilcoxon(x, y) agrees" in ran.out


def test_r_that_takes_too_long_or_stops_is_said(tmp_path: Path) -> None:
    slow, broken = tmp_path / "slow", tmp_path / "broken"
    slow.write_text("#!/bin/sh\necho '0,f,p,0.5,' > answers.csv\nexec sleep 60\n")
    broken.write_text("#!/bin/sh\necho 'no package' >&2\nexit 3\n")
    for script in (slow, broken):
        script.chmod(0o755)
    ran = r_process.run(str(slow), in_r.SCRIPT, {"a.csv": "x\n"}, "answers.csv", 0.5)
    assert (ran.written, ran.failure) == ("0,f,p,0.5,\n", "R took longer than 0.5 s")
    ran = r_process.run(str(broken), in_r.SCRIPT, {}, "answers.csv", 60)
    assert (ran.written, ran.failure) == ("", "R stopped with exit code 3: no package")


def test_no_name_of_a_study_reaches_r(against: Against, monkeypatch: pytest.MonkeyPatch) -> None:
    handed: dict[str, str] = {}

    def refuse(_rscript: str, _script: Path, files: dict[str, str], *_rest: object) -> r_process.RunInR:
        handed.update(files)
        return r_process.RunInR("", "R took longer than 1 s")

    monkeypatch.setattr(r_process, "executable", lambda: sys.executable)
    monkeypatch.setattr(r_process, "run", refuse)
    ran = against("every_test", "r")
    assert "in R: R took longer than 1 s" in ran.err
    for name in ("P01", "novice", "likert", "target", "near"):
        assert name not in "".join(handed.values())
    assert handed["problems.csv"].count("\n") > 30


def test_r_is_asked_for_what_its_script_knows() -> None:
    entry = Comparison(measure="m", test="kruskal")
    assert in_r.knows(Problem({}, "kruskal", Groups([]), entry))
    assert not in_r.knows(Problem({}, "games_howell", Groups([]), entry))
    script = in_r.SCRIPT.read_text(encoding="utf-8")
    for procedure in in_r.PROCEDURES:
        assert f"    {procedure} = " in script


def test_an_unchanged_report_imports_none_of_the_libraries(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study = tmp_path / "family2"
    shutil.copytree(CASES / "family2", study)
    code = (
        "import sys\nfrom pipeline.__main__ import main\ntry: main()\nexcept SystemExit: pass\n"
        "heavy = {'pingouin', 'statsmodels', 'scipy.stats', 'pipeline.analysis.against'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    places = ("--out", tmp_path / "out", "--cache", tmp_path / "cache")
    words: list[str | Path] = ["report", study, *places, "--format", "json"]
    assert run(capsys, monkeypatch, *words, "--jobs", "1").code == 0
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True, check=True, cwd=CLONE
    )
    assert "Nothing had changed" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"
