"""JUnit XML, as the pages of CI servers read it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from pipeline.errors import PipelineError
from pipeline.report.glyphs import STAND_IN

_NOT_IN_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True)
class Case:
    """One check. `failure` is a headline and its details; `broken` says that the check itself could not be made."""

    group: str
    name: str
    failure: tuple[str, str] | None = None
    broken: bool = False


@dataclass(frozen=True)
class Suite:
    """The checks of one study, how long they took, and what else there is to say."""

    name: str
    cases: Sequence[Case]
    seconds: float = 0.0
    remarks: str = ""


def refuse_other(path: Path) -> None:
    """Refuse to overwrite a file that is not XML; called before anything is computed."""
    if path.is_dir() or (path.exists() and not path.read_bytes()[:100].lstrip().startswith(b"<?xml")):
        raise PipelineError(f"--junit {path}: already exists and is not a JUnit file; choose another name")


def write(path: Path, suites: Sequence[Suite]) -> None:
    """Write the suites as one file."""
    root = ElementTree.Element(
        "testsuites", {"name": "steadyhand check", **_counts([c for s in suites for c in s.cases])}
    )
    for suite in suites:
        element = ElementTree.SubElement(
            root, "testsuite", {"name": _text(suite.name), **_counts(suite.cases), "time": f"{suite.seconds:.3f}"}
        )
        for case in suite.cases:
            _add(element, case)
        if suite.remarks:
            ElementTree.SubElement(element, "system-out").text = _text(suite.remarks)
    ElementTree.indent(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _add(suite: ElementTree.Element, case: Case) -> None:
    element = ElementTree.SubElement(suite, "testcase", {"classname": _text(case.group), "name": _text(case.name)})
    if case.failure is not None:
        headline, details = map(_text, case.failure)
        kind = "error" if case.broken else "failure"
        ElementTree.SubElement(element, kind, {"message": headline, "type": kind}).text = details


def _counts(cases: Sequence[Case]) -> dict[str, str]:
    return {
        "tests": str(len(cases)),
        "failures": str(sum(case.failure is not None and not case.broken for case in cases)),
        "errors": str(sum(case.failure is not None and case.broken for case in cases)),
    }


def _text(text: str) -> str:
    """The text without characters that XML 1.0 cannot hold at all; others are escaped when it is written."""
    return _NOT_IN_XML.sub(STAND_IN, text)
