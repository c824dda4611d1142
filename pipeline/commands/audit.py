"""`audit`: do a publication's printed figures agree with each other?"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from pipeline.analysis.audit.audit import audit as findings_in
from pipeline.analysis.audit.finding import AGREEMENT, CONTRADICTION, REMARK, UNCHECKED, VERDICTS, Finding
from pipeline.commands import console
from pipeline.study.printed import load_publication
from pipeline.words.phrases import counted, listing

CONTRADICTED = 3  # the exit code, as of numbers that moved
_FILE_WIDTH = 140  # in characters, where the output is not a terminal
_COLOURS = {CONTRADICTION: "bold red", REMARK: "yellow", AGREEMENT: "green"}


def audit(path: Path, as_json: bool) -> None:
    """Print every check of the file, the gravest first; exit with 3 where figures contradict each other."""
    publication = load_publication(path)
    findings = findings_in(publication)
    counts = Counter(finding.verdict for finding in findings)
    if as_json:
        content = {
            "source": publication.source,
            "counts": {verdict: counts[verdict] for verdict in VERDICTS},
            "findings": [asdict(finding) for finding in findings],
        }
        console.say(json.dumps(content, indent=1, ensure_ascii=False))
    else:
        _print(sorted(findings, key=lambda finding: VERDICTS.index(finding.verdict)))
        parts = [counted(counts[verdict], verdict) for verdict in (CONTRADICTION, REMARK, AGREEMENT)]
        parts.append(f"{counts[UNCHECKED]} that cannot be checked")
        console.say(f"{publication.source}: {listing(parts)}")
    sys.exit(CONTRADICTED if counts[CONTRADICTION] else 0)


def _print(findings: Sequence[Finding]) -> None:
    """Print a table as wide as the terminal. Text from the file is data: no markup, no control characters."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    out = Console(width=None if sys.stdout.isatty() else _FILE_WIDTH, highlight=False)
    table = Table("Verdict", "Check", "Printed", "Follows from the rest", box=SIMPLE, pad_edge=False)
    for column in table.columns:
        column.overflow = "fold"
    for before, finding in zip([None, *findings], findings, strict=False):
        if before is not None and before.verdict != finding.verdict:
            table.add_section()
        explanation = "" if finding.verdict == AGREEMENT else f"\n{finding.explanation}"
        words = (f"{finding.check}: {finding.what}", finding.printed, f"{finding.follows}{explanation}".strip())
        style = _COLOURS.get(finding.verdict, "")
        table.add_row(Text(finding.verdict, style=style), *(Text(console.printable(word)) for word in words))
    out.print(table)
