"""The command `new`, and what it wrote."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.pipeline.helpers import Ran, run

AXES = {"Rotation": "XYZW", "Position": "XYZ"}
TLX_HEADER = "participant,condition,mental,physical,temporal,performance,effort,frustration"
CASES = Path(__file__).resolve().parents[2] / "data" / "cases_in"
New = Callable[..., Ran]


@pytest.fixture
def new(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> New:
    """`steadyhand new`, where there is no terminal."""
    return lambda *words: run(capsys, monkeypatch, "new", *words)


def written(folder: Path, name: str, text: str, encoding: str = "utf-8") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding=encoding)
    return folder


def settings(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((folder / "study.yaml").read_text(encoding="utf-8"))
    return content


def assert_commented(folder: Path) -> None:
    for line in (folder / "study.yaml").read_text(encoding="utf-8").splitlines():
        assert "# " in line, line
