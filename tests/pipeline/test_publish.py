"""Files in the user's folder: whole or not at all."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from pipeline.commands.publish import copy


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
