"""Running the command as a user does, in this process."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from pipeline.__main__ import main
from pipeline.report.document.typography import typeset


@dataclass(frozen=True)
class Ran:
    """What a user sees of a run."""

    code: int
    out: str
    err: str


def as_printed(text: str) -> str:
    """Words as a page's text has them: a subscript has no underscore before it."""
    return " ".join("".join(run.text for run in typeset(text)).split())


def exit_code(monkeypatch: pytest.MonkeyPatch, *words: str | Path) -> int:
    """That of `steadyhand WORDS`."""
    monkeypatch.setattr("sys.argv", ["steadyhand", *map(str, words)])
    code: Any = 0
    try:
        main()
    except SystemExit as stop:
        code = stop.code
    return int(code or 0)


def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *words: str | Path) -> Ran:
    """`steadyhand WORDS`, its exit code and output."""
    code = exit_code(monkeypatch, *words)
    captured = capsys.readouterr()
    return Ran(code, captured.out, captured.err)


class Steadyhand:
    """The command with a cache and an output folder of its own."""

    def __init__(self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, root: Path) -> None:
        self._capsys, self._monkeypatch = capsys, monkeypatch
        self.out, self.cache = root / "out", root / "cache"

    def __call__(self, command: str, study: Path, *words: str) -> Ran:
        return run(
            self._capsys,
            self._monkeypatch,
            command,
            study,
            "--out",
            self.out,
            "--cache",
            self.cache,
            "--jobs",
            "1",
            *words,
        )

    def results(self) -> dict[str, Any]:
        """results.json of the last run."""
        content: dict[str, Any] = json.loads((self.out / "results.json").read_text(encoding="utf-8"))
        return content
