"""docs/notebook.md: its blocks run, one after the other, and give the outputs it shows."""

from __future__ import annotations

import ast
import contextlib
import io
import re
from pathlib import Path

import pytest

from pipeline.engine import folders
from tests.conftest import CLONE

PAGE = CLONE / "docs" / "notebook.md"


def shown_by(block: str, names: dict[str, object]) -> str:
    """What a notebook shows of a cell: what it prints, and the value of an expression that stands last."""
    cell = ast.parse(block)
    last = cell.body.pop() if isinstance(cell.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(cell, str(PAGE), "exec"), names)  # noqa: S102
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), str(PAGE), "eval"), names)  # noqa: S307
            if value is not None:
                print(repr(value))
    return printed.getvalue()


def test_the_tutorial_shows_what_its_code_gives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "reports").mkdir()
    monkeypatch.setattr(folders, "reports_folder", lambda: tmp_path / "reports")  # and so the cache is beside it
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.chdir(CLONE)
    text = PAGE.read_text(encoding="utf-8")
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```\n(?:\n```text\n(.*?)```)?", text, flags=re.DOTALL)
    assert len(blocks) == text.count("```python")
    for block, output in blocks:
        assert [line.rstrip() for line in shown_by(block, names).splitlines()] == output.splitlines(), block
    assert (tmp_path / folders.CACHE_FOLDER).is_dir()
