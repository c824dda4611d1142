"""`inspect`: what a log holds, and how much of it can be read."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from pipeline.commands import console
from pipeline.errors import PipelineError, SessionError
from pipeline.sessions.checks.agreement import LAG
from pipeline.sessions.inspection import Inspection, Topic, inspected
from pipeline.sessions.logs import read_log
from pipeline.sessions.stream_quality import quality_row
from pipeline.tables import table as tables
from pipeline.words.numbers import number
from pipeline.words.phrases import counted, listing, one_line

_GUESSED = "gravity_mm_s2 is a guess: the log has no orientation; give gravity as it points in the tracker's frame"


def inspect(files: Sequence[Path], as_json: bool) -> None:
    """Print each topic, what it is usable as, a block for study.yaml and the checks.

    Exit with 1 where a log was read in part or holds nothing that a study can use, 2 where none of one can be read.
    """
    rows: list[dict[str, object]] = []
    code = 0
    for path in files:
        if not path.exists():
            raise PipelineError(f"{path}: there is no such file or folder")
        try:
            log = read_log(path, [])
        except SessionError as error:
            console.warn(one_line(f"steadyhand: {path}: {error}"))
            code = 2
            continue
        of_log = [quality_row(path.stem, topic, readings, []) for topic, readings in sorted(log.topics.items())]
        rows += tables.records("quality", tables.frame("quality", of_log))
        for fault in log.faults:
            console.warn(one_line(f"steadyhand: {path}: {fault}"))
        if log.faults or any(row["messages_lost"] for row in of_log):
            code = max(code, 1)
        if as_json:
            continue
        inspection = inspected(path, log)
        _print(path, of_log, log.facts, {topic.name: topic for topic in inspection.topics})
        for line in (*_block(inspection), *_checks(inspection)):
            console.say(one_line(line))
        if not inspection.usable:
            console.warn(f"steadyhand: {path}: no topic is usable as position, acceleration or events")
            code = max(code, 1)
    if as_json:
        console.say(json.dumps(rows, indent=1, ensure_ascii=False))
    sys.exit(code)


def _print(path: Path, rows: Sequence[dict[str, object]], facts: object, topics: Mapping[object, Topic]) -> None:
    console.say(f"{path}  {dict(facts) if isinstance(facts, dict) and facts else 'no session facts'}")
    for row in rows:
        lost, topic = row.get("messages_lost"), topics.get(row["stream"])
        rate = row.get("rate_hz") if topic is None or topic.rate_hz is None else topic.rate_hz
        line = (
            f"  {row['stream']}: {row['messages_read']} messages, "
            f"{'an unknown number' if lost is None else lost} lost"
            + (f", {number(rate, 1)} Hz" if isinstance(rate, float) else "")
            + (f"; {row['note']}" if row.get("note") else "")
        )
        console.say(one_line(line))
        if topic is not None:
            console.say(one_line(f"    {_described(topic)}"))


def _described(topic: Topic) -> str:
    """`geometry_msgs/msg/PointStamped (cdr), frame_id "tracker"; usable as position`."""
    frames = f", frame_id {listing([json.dumps(name) for name in topic.frames])}" if topic.frames else ""
    use = f"usable as {topic.content}" if topic.content is not None else f"not usable, because {topic.why_not}"
    return f"{topic.type.name or 'no type'} ({topic.type.encoding or 'no encoding'}){frames}; {use}"


def _block(inspection: Inspection) -> Iterator[str]:
    """A block for study.yaml that fits this log, to be pasted and reviewed."""
    if not inspection.usable:
        return
    yield "For study.yaml, as this log has it:"
    if inspection.streams:
        yield "streams:"
    for name, stream in inspection.streams.items():
        remark = f"  # {_GUESSED}" if name in inspection.guessed else ""
        yield f"  {name}: {{{', '.join(f'{key}: {_yaml(value)}' for key, value in stream.items())}}}{remark}"
    if inspection.events is not None:
        yield f"events: {{topic: {_yaml(inspection.events)}}}"


def _yaml(value: object) -> str:
    """A value as YAML reads it: words and topics plain, anything else as JSON, which is YAML too."""
    plain = isinstance(value, str) and re.fullmatch(r"[A-Za-z/][\w/.-]*", value)
    return str(value) if plain else json.dumps(value, ensure_ascii=False)


def _checks(inspection: Inspection) -> Iterator[str]:
    """The checks that are not green, and the lag in any case."""
    contradicted = [finding for finding in inspection.findings if finding.status != "green"]
    if inspection.findings:
        yield f"Checks: {counted(len(contradicted), 'contradiction')} in {len(inspection.findings)}"
    for finding in inspection.findings:
        if finding.check == LAG:
            yield f"  lag of the tracker's stamps behind the phone's, by their movement: {finding.found}"
    for finding in contradicted:
        figures = f"found {finding.found}, expected {finding.expected}"
        yield f"  {finding.status}, {finding.check}: {figures}; {finding.message}"
