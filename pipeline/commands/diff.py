"""`diff`: what changed between two results, and what may explain it."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from pipeline.commands import console, explanation
from pipeline.commands.check import MOVED
from pipeline.commands.explanation import Explanation, Made
from pipeline.errors import PipelineError
from pipeline.study.folder import SETTINGS_FILE
from pipeline.tables import differences, results
from pipeline.tables.differences import ABSENT, Change, Differences, Identified
from pipeline.words import counted

_RESULTS = "results.json"
_CELL_LENGTH = 80
_DIGEST_LENGTH = 16
_SAME = "Settings, inputs, versions and code are the same."


def diff(before: Path, now: Path, tolerance: float, as_json: bool) -> None:
    """Print what changed from one result to the other; exit with 3 where anything did."""
    old, new = (explanation.made(_results_in(path)) for path in (before, now))
    identity = results.identity_of(old.content)
    if identity is None or identity is not results.identity_of(new.content):
        raise PipelineError(f"{old.path} and {new.path}: one is of a study and one of a replay; give two of a kind")
    found = differences.between(old.content, new.content, identity, tolerance)
    why = explanation.explained(old, new)
    for side in (old, new):
        _warn(side, identity)
    if as_json:
        console.say(json.dumps(_as_object(old, new, tolerance, found, why), indent=1, ensure_ascii=False))
    else:
        _show(found)
        _explain(why, bool(found))
    sys.exit(MOVED if found else 0)


def _results_in(path: Path) -> Path:
    """The file itself, or the one in a folder."""
    if not path.exists():
        raise PipelineError(f"{path}: there is no such file or folder; name a results.json, or a folder that holds one")
    if path.is_dir() and not (path / _RESULTS).is_file():
        study = path if (path / SETTINGS_FILE).is_file() else "STUDY"
        raise PipelineError(f"{path}: holds no {_RESULTS}; write one with: steadyhand compare {study} --out DIR")
    return path / _RESULTS if path.is_dir() else path


def _warn(side: Made, identity: Mapping[str, Sequence[str]]) -> None:
    """What of a side is not looked at."""
    if side.unknown is not None:
        console.warn(side.unknown)
    strange = set(side.content) - {"schema_version", "study", "studies", *identity}
    if strange:
        console.warn(f"{side.path}: {', '.join(sorted(strange))}: not known to this Steadyhand, and not compared")


def _changes(found: Differences, of_number: bool) -> Iterator[tuple[Identified, Change]]:
    return ((one.row, change) for one in found.moved for change in one.changes if change.is_numeric == of_number)


def _show(found: Differences) -> None:
    """How much changed, then a table of numbers, rows, and a table of text."""
    if not found:
        console.say(f"No figure changed, of {found.compared}.")
        return
    numbers, texts = ([*_changes(found, one)] for one in (True, False))
    told = f"{counted(len(numbers), 'number')} moved and {counted(len(texts), 'text')} changed"
    only = f"{counted(len(found.removed), 'row')} only in A, {counted(len(found.added), 'row')} only in B"
    console.say(f"{told}, of {found.compared} figures in both; {only}")
    for table, changes in _by_table(numbers):
        lines = [(name, *change.cells) for name, change in changes]
        _table((table, "A", "B", "difference", "relative"), lines, left=1)
    for side, rows in (("A", found.removed), ("B", found.added)):
        if rows:
            console.say(f"Only in {side}:")
        for row in rows:
            console.say(f"  {row.table} | {row.name}".replace("\n", " "))
    for table, changes in _by_table(texts):
        _table((table, "A", "B"), [(name, *map(_shortened, change.cells[:2])) for name, change in changes])


def _by_table(changes: Sequence[tuple[Identified, Change]]) -> Iterator[tuple[str, list[tuple[str, Change]]]]:
    """Each table's changes, with the names of row and figure."""
    for table, group in groupby(changes, key=lambda one: one[0].table):
        yield table, [(" | ".join(filter(None, (row.name, change.name))), change) for row, change in group]


def _explain(why: Explanation, moved: bool) -> None:
    """What is not the same in the making of the two."""
    parts = (
        ("setting", [(one.name, *map(_shortened, _setting(one))) for one in why.settings]),
        ("input, SHA-256", [(one.name, *_digests(one)) for one in why.inputs]),
        ("version", [(one.name, *one.cells[:2]) for one in why.versions]),
        ("code and libraries of the stage, SHA-256", [(one.name, *_digests(one)) for one in why.code]),
    )
    if not any(rows for _, rows in parts):
        if why.complete:
            console.say(_SAME)
        return
    console.say("What may explain it:" if moved else "What differs without a change in the results:")
    for title, rows in parts:
        if rows:
            _table((title, "A", "B"), rows)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], left: int | None = None) -> None:
    console.table(header, rows, left or len(header))


def _setting(change: Change) -> tuple[str, str]:
    """Both values as they stand in study.yaml; what does not stand there has its default, or is an entry less."""
    absent = "absent" if isinstance(change.before, dict) or isinstance(change.now, dict) else "default"
    before, now = (absent if value is ABSENT else explanation.json_text(value) for value in (change.before, change.now))
    return before, now


def _digests(change: Change) -> tuple[str, ...]:
    return tuple(cell[:_DIGEST_LENGTH] for cell in change.cells[:2])


def _shortened(text: str) -> str:
    return text if len(text) <= _CELL_LENGTH else f"{text[: _CELL_LENGTH - 1]}…"


def _as_object(old: Made, new: Made, tolerance: float, found: Differences, why: Explanation) -> dict[str, Any]:
    """All of it for a program; what is absent on a side has no key for that side."""

    def rows(listed: Sequence[Identified]) -> list[dict[str, Any]]:
        return [{"table": row.table, "row": dict(row.key)} for row in listed]

    def sides(change: Change) -> dict[str, Any]:
        return {side: value for side, value in (("a", change.before), ("b", change.now)) if value is not ABSENT}

    def figures(of_number: bool) -> Iterator[dict[str, Any]]:
        for row, change in _changes(found, of_number):
            by = {"difference": change.difference, "relative": change.relative} if of_number else {}
            yield {"table": row.table, "row": dict(row.key), "figure": change.name, **sides(change), **by}

    parts = {"settings": why.settings, "inputs_sha256": why.inputs, "versions": why.versions, "code_sha256": why.code}
    return {
        "a": str(old.path),
        "b": str(new.path),
        "tolerance": tolerance,
        "compared": found.compared,
        "numbers": list(figures(True)),
        "texts": list(figures(False)),
        "only_in_a": rows(found.removed),
        "only_in_b": rows(found.added),
        "making_known": why.complete,
        **{part: [{"name": one.name, **sides(one)} for one in changes] for part, changes in parts.items()},
    }
