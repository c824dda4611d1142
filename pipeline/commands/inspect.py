"""`inspect`: what a log holds and what of it can be read."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.commands import console
from pipeline.errors import PipelineError, SessionError
from pipeline.sessions.logs import read_log
from pipeline.sessions.stream_quality import quality_row
from pipeline.tables import table as tables
from pipeline.words import number


def inspect(files: Sequence[Path], as_json: bool) -> None:
    """Print a row a topic; exit with 1 where a log was read in part, 2 where none of one can be read."""
    rows: list[dict[str, object]] = []
    code = 0
    for path in files:
        if not path.is_file():
            raise PipelineError(f"{path}: there is no such file")
        try:
            log = read_log(path, [])
        except SessionError as error:
            console.warn(f"steadyhand: {path}: {error}")
            code = 2
            continue
        found = [quality_row(path.stem, topic, readings, []) for topic, readings in sorted(log.topics.items())]
        rows += tables.records("quality", tables.frame("quality", found))
        for fault in log.faults:
            console.warn(f"steadyhand: {path}: {fault}")
        if log.faults or any(row["messages_lost"] for row in found):
            code = max(code, 1)
        if not as_json:
            _print(path, found, log.facts)
    if as_json:
        console.say(json.dumps(rows, indent=1, ensure_ascii=False))
    sys.exit(code)


def _print(path: Path, rows: Sequence[dict[str, object]], facts: object) -> None:
    console.say(f"{path}  {dict(facts) if isinstance(facts, dict) and facts else 'no session facts'}")
    for row in rows:
        lost = row.get("messages_lost")
        rate = row.get("rate_hz")
        console.say(
            f"  {row['stream']}: {row['messages_read']} messages, "
            f"{'an unknown number' if lost is None else lost} lost"
            + (f", {number(rate, 1)} Hz" if isinstance(rate, float) else "")
            + (f"; {row['note']}" if row.get("note") else "")
        )
