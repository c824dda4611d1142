"""The studies whose pages are looked at: the bundled ones, one with hostile text, one with many participants."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.conftest import CLONE, STREAMS, session_messages, write_session
from tests.pipeline.hostile import hostile_study

PEOPLE = 41  # more than a report shows on one page


def written(folder: Path, kind: str) -> list[Path]:
    """The reports in one format, in `folder`/out/<study>: the main page first, and one participant's.

    Raises RuntimeError where they cannot be made.
    """
    studies = [CLONE / "studies" / "feng2016", CLONE / "studies" / "reach", hostile_study(folder / "hostile")]
    studies.append(_many(folder / "many"))
    words = ["report", *map(str, studies), "--out", str(folder / "out"), "--cache", str(folder / "cache")]
    command = [sys.executable, "-m", "pipeline", *words, "--format", kind]
    ran = subprocess.run(command, cwd=CLONE, capture_output=True, text=True, check=False)
    if ran.returncode not in (0, 1):
        raise RuntimeError(f"the reports could not be made: {ran.stderr}")
    pages: list[Path] = []
    for study in studies:
        out = folder / "out" / study.name
        pages += sorted(out.glob(f"*.{kind}"))
        pages += sorted((out / "participants").glob("*.html"))[:1]
    return pages


def _many(root: Path) -> Path:
    """Forty-one people, two of them with a log."""
    rows = "".join(f"P{p:02},{c},m_s,{p + (c == 'b') * (p % 3)}\n" for p in range(PEOPLE) for c in "ab")
    root.mkdir()
    (root / "study.yaml").write_text(
        "title: Many\ndata_origin: simulated\nconditions: [a, b]\nmeasures: m.csv\nsessions: '{participant}_{condition}"
        ".mcap'\nestimators: {raw: {type: raw}}\ncomparisons: [{measure: m_s, test: t_paired}]\n" + STREAMS,
        encoding="utf-8",
    )
    (root / "m.csv").write_text(f"participant,condition,measure,value\n{rows}", encoding="utf-8")
    for person in ("P00", "P01"):
        write_session(root / f"{person}_a.mcap", session_messages(2.5))
    return root
