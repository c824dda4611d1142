"""`diff`: what changed from one result to another, and what may explain it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.commands import explanation
from pipeline.tables import differences
from pipeline.tables.differences import ABSENT, between, changes
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Ran, run

Folder = Callable[..., Path]
SETTINGS = """
conditions: [a, b]
measures: measures.csv
comparisons: [{measure: m, test: wilcoxon}, {measure: m, test: tost, bounds: [-9, 9]}]
"""
MEASURES = "participant,condition,measure,value\n" + "".join(
    f"P{p},{c},m,{p + (c == 'b') * (p % 3 - 1) * p}\n" for p in range(1, 9) for c in "ab"
)


class Diff:
    """`steadyhand compare` and `steadyhand diff` with a cache of all these tests."""

    def __init__(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, root: Path, cache: Path
    ) -> None:
        self._capsys, self._monkeypatch, self._root, self._cache = capsys, monkeypatch, root, cache

    def compared(self, study: Path, name: str, command: str = "compare", *words: str) -> Path:
        """A folder with the study's results as it is now."""
        out = self._root / "out" / name
        options: list[str | Path] = ["--out", out, "--cache", self._cache, "--jobs", "1", *words]
        assert run(self._capsys, self._monkeypatch, command, study, *options).code == 0
        return out

    def __call__(self, *words: str | Path) -> Ran:
        return run(self._capsys, self._monkeypatch, "diff", *words)

    def told(self, *words: str | Path) -> tuple[int, dict[str, Any]]:
        """The exit code, and what it says to programs."""
        ran = self(*words, "--json")
        return ran.code, json.loads(ran.out)


@pytest.fixture
def diff(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, cache_of_module: Path
) -> Diff:
    return Diff(capsys, monkeypatch, tmp_path, cache_of_module)


@pytest.fixture
def study(folder: Folder) -> Path:
    return folder(SETTINGS, **{"measures.csv": MEASURES})


def edit(path: Path, change: Callable[[Any], None], name: str = "results.json") -> Path:
    """Change a JSON file in a folder."""
    content = json.loads((path / name).read_text(encoding="utf-8"))
    change(content)
    (path / name).write_text(json.dumps(content), encoding="utf-8")
    return path


def lines(text: str) -> list[str]:
    """Lines with their words one space apart."""
    return [" ".join(line.split()) for line in text.splitlines()]


def test_the_same_results_are_the_same(study: Path, diff: Diff) -> None:
    one, other = diff.compared(study, "one"), diff.compared(study, "other")
    ran = diff(one, other / "results.json")
    assert ran.code == 0
    assert re.fullmatch(r"None of \d+ figures changed\.", lines(ran.out)[0])
    assert lines(ran.out)[1] == "Settings, inputs, versions and code are the same."
    code, told = diff.told(one, other)
    assert code == 0
    assert told["making_known"] is True
    assert told["compared"] > 50
    empty = {key for key, value in told.items() if value == []}
    assert empty == {
        *("numbers", "texts", "only_in_a", "only_in_b", "settings", "inputs_sha256", "versions", "code_sha256")
    }


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_a_changed_input_is_named_with_the_numbers_it_moved(study: Path, diff: Diff) -> None:
    one = diff.compared(study, "one")
    (study / "measures.csv").write_text(MEASURES.replace("P3,a,m,3", "P3,a,m,30"))
    other = diff.compared(study, "other", "report")
    ran = diff(one, other)
    assert ran.code == 3
    shown = lines(ran.out)
    assert "descriptives A B difference relative" in shown
    assert "m | a | mean 4.5 7.875 +3.375 +75 %" in shown
    assert shown[-2] == "input, SHA-256 A B"
    assert shown[-1].startswith("measures.csv ")
    _, told = diff.told(one, other)
    (mean,) = [
        one
        for one in told["numbers"]
        if (one["table"], one["figure"]) == ("descriptives", "mean")
        and one["row"] == {"measure": "m", "condition": "a"}
    ]
    assert mean == {
        "table": "descriptives",
        "row": {"measure": "m", "condition": "a"},
        "figure": "mean",
        "a": 4.5,
        "b": 7.875,
        "difference": 3.375,
        "relative": 0.75,
    }
    assert [(one["name"], len(one["a"]), len(one["b"])) for one in told["inputs_sha256"]] == [("measures.csv", 64, 64)]


def test_settings_are_named_by_what_differs_in_them(study: Path, diff: Diff) -> None:
    one = diff.compared(study, "one")
    changed = SETTINGS.replace("wilcoxon}", "wilcoxon, zeros: pratt}, {measure: m, test: t_paired}")
    changed += "alpha: 0.01\nexclusions: [{participant: P7, reason: tracker lost}]\n"
    (study / "study.yaml").write_text(changed)
    other = diff.compared(study, "other")
    ran = diff(one, other)
    assert ran.code == 3
    shown = lines(ran.out)
    assert 'comparisons.m, wilcoxon.zeros default "pratt"' in shown
    assert 'comparisons absent {"measure": "m", "test": "t_paired"}' in shown
    assert "alpha 0.05 0.01" in shown
    assert 'exclusions absent {"participant": "P7", "reason": "tracker lost"}' in shown
    assert "participants n 8 7 -1 -12.5 %" in shown
    assert "Only in B:" in shown
    assert "comparisons | m | t_paired | condition | a - b" in shown
    assert "exclusions | P7 | excluded in study.yaml" in shown
    assert not any(line.startswith("comparisons.m, tost") for line in shown)
    _, back = diff.told(other, one)
    assert {row["table"] for row in back["only_in_a"]} >= {"comparisons", "exclusions"}
    assert {"name": "alpha", "a": 0.01, "b": 0.05} in back["settings"]


def test_what_differs_without_a_change_in_the_results(study: Path, diff: Diff) -> None:
    one = diff.compared(study, "one")
    (study / "study.yaml").write_text(f"title: Another\nnotes: {'long ' * 40}\n{SETTINGS}")
    ran = diff(one, diff.compared(study, "other"))
    assert ran.code == 0
    shown = lines(ran.out)
    assert "Different, but without effect on the results:" in shown
    assert any(line.startswith('notes default "long long') and line.endswith("…") for line in shown)
    assert any(line.startswith("study.yaml ") for line in shown)


def test_versions_and_code_are_compared(study: Path, diff: Diff) -> None:
    one, other = diff.compared(study, "one"), diff.compared(study, "other")

    def older(provenance: dict[str, Any]) -> None:
        provenance["versions"]["numpy"] = "1.0"
        provenance["python"] = "3.2"
        provenance["code_sha256"]["compare"] = "0" * 64

    edit(one, older, "provenance.json")
    _, told = diff.told(one, other)
    assert [(change["name"], change["a"]) for change in told["versions"]] == [("Python", "3.2"), ("numpy", "1.0")]
    assert [change["name"] for change in told["code_sha256"]] == ["compare"]
    assert any(line.startswith("compare 0000000000000000 ") for line in lines(diff(one, other).out))


def test_numbers_within_the_tolerance_are_the_same(study: Path, diff: Diff) -> None:
    one, other = diff.compared(study, "one"), diff.compared(study, "other")

    def shift(content: Any) -> None:
        content["descriptives"][0]["mean"] *= 1 + 1e-7

    edit(other, shift)
    assert diff(one, other).code == 3
    assert diff(one, other, "--tolerance", "1e-6").code == 0
    assert diff(one, other, "--tolerance", "-1").code == 2


def test_text_and_figures_that_come_to_be_undefined(study: Path, diff: Diff) -> None:
    one, other = diff.compared(study, "one"), diff.compared(study, "other")

    def undefined(content: Any) -> None:
        row = content["comparisons"][0]
        row["status"], row["p"] = "undefined: all differences are zero", None
        row["details"]["new"] = 1.5

    ran = diff(one, edit(other, undefined))
    assert ran.code == 3
    shown = lines(ran.out)
    assert shown[0].startswith("2 numbers moved and 1 text changed, of ")
    row = "m | wilcoxon | condition | a - b"
    assert any(line.startswith(f"{row} | p ") and line.endswith(" undefined – –") for line in shown)
    assert f"{row} | new absent 1.5 – –" in shown
    assert f"{row} | status ok undefined: all differences are zero" in shown
    _, told = diff.told(one, other)
    assert [set(change) & {"a", "b"} for change in told["numbers"]] == [{"a", "b"}, {"b"}]


def test_provenance_of_other_results_explains_nothing(study: Path, diff: Diff) -> None:
    one, other = diff.compared(study, "one"), diff.compared(study, "other")
    edit(other, lambda content: content["study"].update(alpha=0.1))
    ran = diff(one, other)
    assert ran.code == 0
    assert "describes another results.json than the one there (checksums differ); it is ignored" in ran.err
    assert "alpha 0.05 0.1" in lines(ran.out)
    for text, said in (("{", "not valid JSON"), ("[]", "should hold one JSON object")):
        (other / "provenance.json").write_text(text)
        assert said in diff(one, other).err
    (other / "provenance.json").write_text('{"settings": [1], "versions": 3, "studies": {"x": null}}')
    assert diff(one, other).code == 0
    (other / "provenance.json").unlink()
    code, told = diff.told(one, other)
    assert (code, told["making_known"]) == (0, False)
    assert "there is no provenance.json beside it" in diff(one, other).err


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_compare_into_a_reports_folder_leaves_no_old_provenance(study: Path, diff: Diff) -> None:
    out = diff.compared(study, "one", "report")
    drawn = sorted((out / "figures").iterdir())
    (study / "study.yaml").write_text(f"{SETTINGS}alpha: 0.01\n")
    assert diff.compared(study, "one") == out
    made = json.loads((out / "provenance.json").read_text())
    assert made["settings"]["alpha"] == 0.01
    assert explanation.read_with_provenance(out / "results.json").unused_because is None
    (study / "study.yaml").write_text("conditions: [a, b]\nmeasures: measures.csv\n")
    (study / "measures.csv").write_text(MEASURES.replace(",m,", ",other,"))
    diff.compared(study, "one", "report")
    assert drawn
    assert not any(path.exists() for path in drawn)


def test_results_of_replays_are_compared_by_study_and_variant(folder: Folder, diff: Diff) -> None:
    root = folder(
        "conditions: [a]\nsessions: '{participant}_{condition}.mcap'\nestimators: {raw: {type: raw}}\n" + STREAMS
    )
    write_session(root / "P1_a.mcap", session_messages(2.5))
    one = diff.compared(root, "one", "replay")
    more = root.parent / "more.yaml"
    more.write_text("estimators: {held: {type: raw}}\n")
    other = diff.compared(root, "other", "replay", "--estimators", str(more))
    code, told = diff.told(one, other)
    assert code == 3
    assert told["making_known"] is True
    assert {row["row"]["estimator"] for row in told["only_in_b"]} == {"held"}
    assert {row["table"] for row in told["only_in_b"]} == {"accuracy", "replay_means"}
    (variant,) = told["settings"]
    assert variant["name"] == "study.variants"
    assert variant["b"]["estimator"] == "held"
    ran = diff(one, diff.compared(root, "third"))
    assert ran.code == 2
    assert "results of a study cannot be compared" in ran.err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "results.json: not valid JSON"),
        ("[" * 100_000, "not valid JSON"),
        ("\ud800".encode("utf-8", "surrogatepass"), "not valid JSON"),
        ('{"schema_version": 1, "study": {"alpha": NaN}}', "NaN is not a finite number"),
        ('{"schema_version": 1, "study": {"alpha": 1e999}}', "1e999 is not a finite number"),
        (f'{{"schema_version": 1, "study": {{"alpha": {"9" * 400}}}}}', "not valid JSON"),
        ("[]", "should hold one JSON object"),
        ("{}", "is not a results.json of Steadyhand: it has no schema_version"),
        ('{"schema_version": 1}', "it has no study"),
        ('{"schema_version": 1, "study": 3}', "it has no study"),
        ('{"schema_version": 2, "study": {}}', "has schema_version 2, but this Steadyhand reads 1; write the results"),
        ('{"schema_version": 1, "study": {"participants": 3}}', "participants should be an object"),
        ('{"schema_version": 1, "study": {}, "comparisons": 3}', "comparisons should be a list"),
        (
            '{"schema_version": 1, "study": {}, "descriptives": [3]}',
            "descriptives: row 1 is not a row that Steadyhand wrote",
        ),
        (
            '{"schema_version": 1, "study": {}, "descriptives": [{"measure": "m", "condition": 7}]}',
            'descriptives: row 1 needs "condition", text or null',
        ),
    ],
)
def test_files_that_are_not_results(diff: Diff, tmp_path: Path, text: str | bytes, said: str) -> None:
    good, bad = tmp_path / "good.json", tmp_path / "bad" / "results.json"
    good.write_text('{"schema_version": 1, "study": {}}')
    bad.parent.mkdir()
    bad.write_bytes(text if isinstance(text, bytes) else text.encode())
    for words in ((good, bad), (bad.parent, good)):
        ran = diff(*words)
        assert (ran.code, ran.out) == (2, "")
        assert said in ran.err


def test_places_without_results(study: Path, diff: Diff, tmp_path: Path) -> None:
    one = diff.compared(study, "one")
    assert "there is no such file or folder; name a results.json" in diff(one, tmp_path / "none").err
    ran = diff(one, study)
    assert ran.code == 2
    assert f"{study}: contains no results.json; write one with: steadyhand compare {study} --out DIR" in ran.err


def test_what_another_version_added_is_said(study: Path, diff: Diff) -> None:
    one, other = diff.compared(study, "one"), diff.compared(study, "other")
    edit(other, lambda content: content.update(further=[]))
    ran = diff(one, other)
    assert ran.code == 0
    assert "further: unknown to this version of Steadyhand, and not compared" in ran.err


def test_hostile_names_are_data(folder: Folder, diff: Diff) -> None:
    hostile = "[red]\x1b[2J | $(rm) 'é' ]]>"
    root = folder(
        "conditions: [a, b]\nmeasures: measures.csv\n", **{"measures.csv": MEASURES.replace(",m,", f",{hostile},")}
    )
    one = diff.compared(root, "one")
    (root / "measures.csv").write_text(
        MEASURES.replace(",m,", f",{hostile},").replace(f"P3,a,{hostile},3", f"P3,a,{hostile},30")
    )
    ran = diff(one, diff.compared(root, "other"))
    assert ran.code == 3
    assert "\x1b" not in ran.out
    assert hostile.replace("\x1b", "□") in ran.out


VALUES = st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-1e6, 1e6) | st.text(max_size=3)
FIGURES = st.dictionaries(st.sampled_from("abcdef"), VALUES)


@given(before=FIGURES, now=FIGURES, relative=st.sampled_from([0.0, 1e-9, 0.1]))
def test_changes_are_none_of_the_same_and_mirror_each_other(
    before: dict[str, Any], now: dict[str, Any], relative: float
) -> None:
    assert changes(before, dict(before), relative) == []
    there = {change.name: (change.before, change.now) for change in changes(before, now, relative)}
    back = {change.name: (change.now, change.before) for change in changes(now, before, relative)}
    assert there == back
    rebuilt = {**before, **{name: value for name, (_, value) in there.items()}}
    kept = {name for name, value in rebuilt.items() if value is not ABSENT}
    assert kept == set(now)


@given(by=st.floats(-1e3, 1e3), size=st.floats(1e-3, 1e6), relative=st.floats(1e-9, 0.5))
def test_the_tolerance_is_of_the_larger_of_two_numbers(by: float, size: float, relative: float) -> None:
    moved = changes({"x": size}, {"x": size + by}, relative)
    assert bool(moved) == (abs((size + by) - size) > max(relative * max(size, abs(size + by)), 1e-12))


ROW = st.fixed_dictionaries({"measure": st.sampled_from("mn"), "condition": st.just("a"), "mean": st.integers(0, 3)})
ROWS = st.lists(ROW, max_size=6)


@given(before=ROWS, now=ROWS)
def test_rows_are_matched_whatever_their_order(before: list[dict[str, Any]], now: list[dict[str, Any]]) -> None:
    identity = {"descriptives": ("measure", "condition")}

    def found(old: list[dict[str, Any]], new: list[dict[str, Any]]) -> differences.Differences:
        return between({"descriptives": old}, {"descriptives": new}, identity, 0.0)

    assert not found(before, sorted(before, key=repr, reverse=True))
    both = found(before, now)
    assert len(before) - len(both.removed) == len(now) - len(both.added)
    of = {row["measure"] for row in before}, {row["measure"] for row in now}
    assert {row.key["measure"] for row in both.removed} >= of[0] - of[1]
    assert {row.key["measure"] for row in both.added} >= of[1] - of[0]
