"""A study with hostile text in every field a user or a log can fill, for every output to show as text."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import yaml

from tests.conftest import STREAMS, session_messages, write_session

HOSTILE = [
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    '"><b>bold</b>',
    "</title></style></script><script>alert(2)</script>",
    "<!--",
    "#panic()",
    '#image("/etc/passwd")',
    "$x^2$ *strong* _emph_ `code` @label \\ // comment",
    "{{ 7 * 7 }}",
    "{% include 'x' %}",
    '=HYPERLINK("x")',
    "&amp;&lt;&#60;",
    "مرحبا \u202eabc",
    "\u0007bell",
    "x" * 500,
]

TITLE = " ".join(HOSTILE[:-1])
CONDITIONS = ("<i>a</i>", "=b</script>")
PEOPLE = ("@P1", "-P2", "<b>P3", "\u202eP4", "P5 " + "y" * 120)
MEASURES = ("../m<x>_s", "q<y>/one</script>", "q<y>/two")
ESTIMATOR = "<u>e</u> {{ 7 * 7 }}"
SESSION = "s<img src=x onerror=alert(1)>&amp;#panic()"


def hostile_study(root: Path) -> Path:
    """The study's folder: two logs, measures, printed facts, exclusions."""
    root.mkdir(parents=True, exist_ok=True)
    evil = "\n".join(HOSTILE[:-2] + HOSTILE[-1:])  # YAML has no place for a bell
    settings = {
        "title": TITLE.replace("\u0007", ""),
        "notes": evil,
        "citation": evil,
        "data_origin": "simulated",
        "conditions": list(CONDITIONS),
        "measures": "measures.csv",
        "sessions": "{session}.mcap",
        "estimators": {ESTIMATOR: {"type": "raw"}, "fusion": {"type": "fusion_kalman"}},
        "shown": {CONDITIONS[0]: ESTIMATOR},
        "comparisons": [
            {"measure": MEASURES[0], "test": "t_paired"},
            {"measure": "q<y>/*", "test": "wilcoxon", "adjust": "holm"},
        ],
        "exclusions": [{"participant": PEOPLE[1], "condition": CONDITIONS[1], "reason": evil}],
        **yaml.safe_load(STREAMS),
    }
    (root / "study.yaml").write_text(yaml.safe_dump(settings, allow_unicode=True), encoding="utf-8")
    (root / "measures.csv").write_text(_measures(), encoding="utf-8")
    for index, condition in enumerate(CONDITIONS):
        facts = {"participant": PEOPLE[0], "condition": condition, "order": "1", "<script>": json.dumps(HOSTILE)}
        write_session(root / f"{SESSION}{index}.mcap", session_messages(2.5, seed=index), **facts)
    return root


def _measures() -> str:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(("participant", "condition", "measure", "value"))
    for number, person in enumerate(PEOPLE):
        for shift, condition in enumerate(CONDITIONS):
            rows.writerows((person, condition, measure, number * 2 + shift * (number + 1)) for measure in MEASURES)
    return text.getvalue()
