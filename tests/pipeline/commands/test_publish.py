"""Files in the user's folder: whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.commands.publish import copy
from tests.pipeline.helpers import Steadyhand


@pytest.mark.parametrize("before", [None, "the report that was there"])
def test_a_copy_that_is_interrupted_leaves_what_was_there(
    before: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, target = tmp_path / "new.html", tmp_path / "out" / "report.html"
    source.write_text("a whole page")
    target.parent.mkdir()
    if before is not None:
        target.write_text(before)

    def interrupted(_source: Path, place: Path) -> None:
        place.write_text("a whole")
        raise KeyboardInterrupt

    monkeypatch.setattr(shutil, "copyfile", interrupted)
    with pytest.raises(KeyboardInterrupt):
        copy(source, target)
    assert {path.name: path.read_text() for path in target.parent.iterdir()} == (
        {} if before is None else {"report.html": before}
    )
    monkeypatch.undo()
    copy(source, target)
    assert {path.name: path.read_text() for path in target.parent.iterdir()} == {"report.html": "a whole page"}


def test_a_file_that_is_the_same_already_is_left_alone(tmp_path: Path) -> None:
    source, target = tmp_path / "a", tmp_path / "b"
    source.write_text("same")
    target.write_text("same")
    before = target.stat()
    copy(source, target)
    assert target.stat().st_ino == before.st_ino


@pytest.fixture
def study(folder: Callable[..., Path]) -> Path:
    rows = "participant,condition,measure,value\n" + "".join(f"P{p},{c},m,{p}\n" for p in range(3) for c in "ab")
    return folder("conditions: [a, b]\nmeasures: m.csv\n", **{"m.csv": rows})


@pytest.mark.usefixtures("no_figures", "blank_print")
@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ("html", {"report.html"}),
        ("pdf,json", {"report.pdf", "results.json"}),
        ("json", {"results.json"}),
        (" csv , zip", {"tables", "report.zip"}),
    ],
)
def test_only_the_formats_that_were_asked_for_are_there(
    asked: str, names: set[str], study: Path, steadyhand: Steadyhand
) -> None:
    assert steadyhand("report", study).code == 0
    mine = steadyhand.out / "tables" / "mine.txt"
    mine.write_text("a file of the user's")
    assert steadyhand("report", study, "--format", asked).code == 0
    mine.unlink()
    left = {path.relative_to(steadyhand.out).parts[0] for path in steadyhand.out.rglob("*") if path.is_file()}
    assert left == names | {"provenance.json"}


def test_json_alone_draws_nothing(study: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("report", study, "--format", "json")
    assert "compare 1" in ran.out
    assert "report 1" not in ran.out


def test_a_format_that_is_not_known_is_said_before_anything_is_computed(study: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("report", study, "--format", "html,pfd")
    assert ran.code == 2
    assert '--format: there is no "pfd"; did you mean "pdf"?' in ran.err
    assert not steadyhand.cache.exists()


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_the_archive_is_written_anew_only_where_something_changed(study: Path, steadyhand: Steadyhand) -> None:
    steadyhand("report", study)
    archive = steadyhand.out / "report.zip"
    before, content = archive.stat().st_ino, archive.read_bytes()
    steadyhand("report", study)
    assert archive.stat().st_ino == before
    archive.unlink()
    steadyhand("report", study)
    assert archive.read_bytes() == content
