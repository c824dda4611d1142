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
from pipeline.commands.explanation import Explanation, ResultsFile
from pipeline.errors import PipelineError
from pipeline.study.folder import SETTINGS_FILE
from pipeline.tables import differences, results
from pipeline.tables.differences import ABSENT, Change, Differences, Identified
from pipeline.words.phrases import counted

_RESULTS = "results.json"
_CELL_LENGTH = 80
_DIGEST_LENGTH = 16
_SAME = "Settings, inputs, versions and code are the same."


def diff(before: Path, now: Path, tolerance: float, as_json: bool) -> None:
    """Print what changed from one result to the other; exit with 3 where anything did."""
    old, new = (explanation.read_with_provenance(_results_in(path)) for path in (before, now))
    identity = results.identity_of(old.content)
    if identity is None or identity is not results.identity_of(new.content):
        raise PipelineError(
            f"{old.path} and {new.path}: results of a study cannot be compared with results of a replay"
        )
    changed = differences.between(old.content, new.content, identity, tolerance)
    why = explanation.explain(old, new)
    for side in (old, new):
        _warn(side, identity)
    if as_json:
        console.say(json.dumps(_as_object(old, new, tolerance, changed, why), indent=1, ensure_ascii=False))
    else:
        _show(changed)
        _explain(why, bool(changed))
    sys.exit(MOVED if changed else 0)


def _results_in(path: Path) -> Path:
    """The file itself, or the one in a folder."""
    if not path.exists():
        raise PipelineError(f"{path}: there is no such file or folder; name a results.json or a folder with one")
    if path.is_dir() and not (path / _RESULTS).is_file():
        study = path if (path / SETTINGS_FILE).is_file() else "STUDY"
        raise PipelineError(f"{path}: contains no {_RESULTS}; write one with: steadyhand compare {study} --out DIR")
    return path / _RESULTS if path.is_dir() else path


def _warn(side: ResultsFile, identity: Mapping[str, Sequence[str]]) -> None:
    """Warn of what is not compared in one of the two results."""
    if side.unused_because is not None:
        console.warn(side.unused_because)
    strange = set(side.content) - {"schema_version", "study", "studies", *identity}
    if strange:
        console.warn(
            f"{side.path}: {', '.join(sorted(strange))}: unknown to this version of Steadyhand, and not compared"
        )


def _changes(changed: Differences, of_number: bool) -> Iterator[tuple[Identified, Change]]:
    return (
        (moved.row, change) for moved in changed.moved for change in moved.changes if change.is_numeric == of_number
    )


def _show(changed: Differences) -> None:
    """Print how much changed, then a table of numbers, the rows only one side has, and a table of text."""
    if not changed:
        console.say(f"None of {changed.compared} figures changed.")
        return
    numbers, texts = ([*_changes(changed, of_number)] for of_number in (True, False))
    moved = f"{counted(len(numbers), 'number')} moved and {counted(len(texts), 'text')} changed"
    only = f"{counted(len(changed.removed), 'row')} only in A, {counted(len(changed.added), 'row')} only in B"
    console.say(f"{moved}, of {changed.compared} figures in both; {only}")
    for table, changes in _by_table(numbers):
        lines = [(name, *change.cells) for name, change in changes]
        _table((table, "A", "B", "difference", "relative"), lines, left=1)
    for side, rows in (("A", changed.removed), ("B", changed.added)):
        if rows:
            console.say(f"Only in {side}:")
        for row in rows:
            console.say(f"  {row.table} | {row.name}".replace("\n", " "))
    for table, changes in _by_table(texts):
        _table((table, "A", "B"), [(name, *map(_shortened, change.cells[:2])) for name, change in changes])


def _by_table(changes: Sequence[tuple[Identified, Change]]) -> Iterator[tuple[str, list[tuple[str, Change]]]]:
    """Each table's changes, with the names of row and figure."""
    for table, group in groupby(changes, key=lambda row_and_change: row_and_change[0].table):
        yield table, [(" | ".join(filter(None, (row.name, change.name))), change) for row, change in group]


def _explain(why: Explanation, moved: bool) -> None:
    """Print which settings, inputs, versions and code differ."""
    parts = (
        ("setting", [(change.name, *map(_shortened, _setting(change))) for change in why.settings]),
        ("input, SHA-256", [(change.name, *_digests(change)) for change in why.inputs]),
        ("version", [(change.name, *change.cells[:2]) for change in why.versions]),
        ("code and libraries of the stage, SHA-256", [(change.name, *_digests(change)) for change in why.code]),
    )
    if not any(rows for _, rows in parts):
        if why.complete:
            console.say(_SAME)
        return
    console.say("Possible explanations:" if moved else "Different, but without effect on the results:")
    for title, rows in parts:
        if rows:
            _table((title, "A", "B"), rows)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], left: int | None = None) -> None:
    console.table(header, rows, left or len(header))


def _setting(change: Change) -> tuple[str, str]:
    """Both values as study.yaml states them; a key that it does not state is "default", a missing entry "absent"."""
    absent = "absent" if isinstance(change.before, dict) or isinstance(change.now, dict) else "default"
    before, now = (absent if value is ABSENT else explanation.json_text(value) for value in (change.before, change.now))
    return before, now


def _digests(change: Change) -> tuple[str, ...]:
    return tuple(cell[:_DIGEST_LENGTH] for cell in change.cells[:2])


def _shortened(text: str) -> str:
    return text if len(text) <= _CELL_LENGTH else f"{text[: _CELL_LENGTH - 1]}…"


def _as_object(
    old: ResultsFile, new: ResultsFile, tolerance: float, changed: Differences, why: Explanation
) -> dict[str, Any]:
    """The whole comparison for `--json`; a value that is absent on one side has no key for that side."""

    def rows(listed: Sequence[Identified]) -> list[dict[str, Any]]:
        return [{"table": row.table, "row": dict(row.key)} for row in listed]

    def sides(change: Change) -> dict[str, Any]:
        return {side: value for side, value in (("a", change.before), ("b", change.now)) if value is not ABSENT}

    def figures(of_number: bool) -> Iterator[dict[str, Any]]:
        for row, change in _changes(changed, of_number):
            by = {"difference": change.difference, "relative": change.relative} if of_number else {}
            yield {"table": row.table, "row": dict(row.key), "figure": change.name, **sides(change), **by}

    parts = {"settings": why.settings, "inputs_sha256": why.inputs, "versions": why.versions, "code_sha256": why.code}
    return {
        "a": str(old.path),
        "b": str(new.path),
        "tolerance": tolerance,
        "compared": changed.compared,
        "numbers": list(figures(True)),
        "texts": list(figures(False)),
        "only_in_a": rows(changed.removed),
        "only_in_b": rows(changed.added),
        "making_known": why.complete,
        **{part: [{"name": change.name, **sides(change)} for change in changes] for part, changes in parts.items()},
    }
