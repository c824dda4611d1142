"""Printed figures in a file, and what the audit finds of them."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import Finding
from pipeline.study.printed import load_publication
from tests.conftest import CLONE

FENG = CLONE / "studies" / "feng2016" / "printed.yaml"
REFERENCE = (CLONE / "docs" / "audit.md").read_text(encoding="utf-8")
EXAMPLE = re.findall(r"```yaml\n(.*?)```", REFERENCE, flags=re.DOTALL)[0]


def file(folder: Path, text: str) -> Path:
    path = folder / "printed.yaml"
    path.write_text(textwrap.dedent(text), encoding="utf-8")
    return path


def audited(folder: Path, text: str) -> list[Finding]:
    return audit(load_publication(file(folder, "source: a paper\n" + textwrap.dedent(text))))


def of_test(folder: Path, test: str, rest: str = "n: 12") -> dict[str, Finding]:
    """The findings of one printed test by their check."""
    return {found.check: found for found in audited(folder, f"{rest}\nmeasures: [{{name: m, tests: [{{{test}}}]}}]\n")}


def of_measure(folder: Path, measure: str, rest: str = "n: 12") -> dict[str, Finding]:
    return {found.check: found for found in audited(folder, f"{rest}\nmeasures: [{{name: m, {measure}}}]\n")}
