"""A study that is preregistered, and may then be changed."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.pipeline.helpers import Ran, exit_code, run
from tests.pipeline.made_once import made_once

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

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
