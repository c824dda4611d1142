"""`check`: do a study's numbers still come out the same?"""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline import results
from pipeline.commands import console, junit
from pipeline.commands.junit import Case, Suite
from pipeline.commands.run import for_each, what_befell
from pipeline.errors import PipelineError
from pipeline.runner.result import Result
from pipeline.stages import COMPARE
from pipeline.wording import NOTHING

EXPECTED = "expected.json"
MOVED = 3  # the exit code
_RELATIVE = 1e-6  # what another processor's rounding may do
_ABSENT = object()
_KEYS = {
    "descriptives": ("measure", "condition"),
    "comparisons": ("measure", "test", "effect", "contrast"),
    "accuracy": ("session", "estimator", "variant"),
    "replay_agreement": ("session", "estimator"),
}

Figures = Mapping[str, Any]


@dataclass(frozen=True)
class Change:
    """A figure that is another, new or gone: its name, and the cells of its line in the table."""

    name: str
    expected: str
    found: str
    difference: str = NOTHING
    relative: str = NOTHING


def check(
    studies: Sequence[Path],
    accept: bool,
    junit_file: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
) -> None:
    """Compare each study with its expected.json, or write it; exit with 3 where a number moved."""
    if junit_file is not None:
        if accept:
            raise PipelineError("check: --junit says how a check went, and --accept makes none; give one of them")
        junit.refuse_other(junit_file)
    suites: list[Suite] = []

    def compare(folder: Path, result: Result) -> int:
        found = dict(_figures(results.read(result.entry("compare") / "results.json")))
        befell = list(what_befell(result))
        for line in befell:
            console.warn(line)
        if accept:
            _accept(folder, result.name, found)
            return result.exit_code
        expected = _expected(folder / EXPECTED)
        changes = _changes(expected, found)
        _show(result.name, len(expected), changes)
        if changes:
            console.say(f"If a person has looked at these and they are meant: {_accepting(folder)}")
        cases = _cases(result.name, expected, found)
        if result.study.sessions is not None:
            cases.append(_sessions_case(result, befell))
        suites.append(Suite(result.name, cases, result.seconds, "\n".join(befell)))
        return MOVED if changes else result.exit_code

    def failed(folder: Path, error: PipelineError) -> None:
        name = folder.resolve().name
        suites.append(Suite(name, [Case(name, "can be checked", _headed(str(error)), broken=True)]))

    code = for_each(studies, COMPARE, jobs, cache, compare, failed=failed, where=executor)
    if junit_file is not None:
        junit.write(junit_file, suites)
    sys.exit(code)


def _accept(folder: Path, name: str, found: Figures) -> None:
    """Write the figures as the expected ones, and show what that changes."""
    path = folder / EXPECTED
    if path.is_file():
        before = _expected(path)
        _show(name, len(before), _changes(before, found))
    path.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    console.say(f"{name}: {len(found)} numbers accepted into {path}; review them before you commit")


def _accepting(folder: Path) -> str:
    """The command that takes today's results as the expected ones."""
    return f"steadyhand check {shlex.quote(str(folder))} --accept"


def _expected(path: Path) -> dict[str, Any]:
    anew = _accepting(path.parent)
    if not path.is_file():
        raise PipelineError(f"{path}: there is no such file; write it with: {anew}")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise PipelineError(
            f"{path}: not valid JSON: {error}; mend it, or remove it and write it with: {anew}"
        ) from None
    if not isinstance(content, dict):
        raise PipelineError(f"{path}: should hold one object, a number a name; remove it and write it with: {anew}")
    return content


def _figures(content: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Every figure of the results by a name that says where it stands."""
    seen: Counter[str] = Counter()
    for table, keys in _KEYS.items():
        for row in content[table]:
            where = " | ".join([table, *(str(row[key]) for key in keys if row[key] is not None)])
            seen[where] += 1
            if seen[where] > 1:  # the same test twice, with other options
                where = f"{where} ({seen[where]})"
            for column, value in row.items():
                if column == "details" and value:
                    for name, detail in value.items():
                        parts = detail if isinstance(detail, list) else [detail]
                        for index, part in enumerate(parts):
                            yield f"{where} | {name}{f' {index}' if len(parts) > 1 else ''}", part
                elif column == "status" or _is_number(value):
                    yield f"{where} | {column}", value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _changes(expected: Figures, found: Figures) -> list[Change]:
    """What is another, new or gone, in the order of the results."""
    changes = []
    for name in dict.fromkeys([*expected, *found]):
        before, now = expected.get(name, _ABSENT), found.get(name, _ABSENT)
        if _is_number(before) and _is_number(now):
            if not math.isclose(before, now, rel_tol=_RELATIVE, abs_tol=1e-12):
                changes.append(_moved(name, before, now))
        elif before != now or type(before) is not type(now):
            changes.append(Change(name, _cell(before), _cell(now)))
    return changes


def _moved(name: str, before: float, now: float) -> Change:
    by = now - before
    relative = f"{100 * by / abs(before):+.3g} %" if before else NOTHING
    return Change(name, _cell(before), _cell(now), f"{by:+.4g}", relative)


def _cell(value: object) -> str:
    if value is _ABSENT:
        return "absent"
    if value is None:
        return "undefined"
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _show(study: str, expected: int, changes: Sequence[Change]) -> None:
    """How many moved, and the table of them."""
    if not changes:
        console.say(f"{study}: all {expected} numbers as expected")
        return
    console.say(f"{study}: {len(changes)} moved (of {expected} expected)")
    header = ("figure", "expected", "found", "difference", "relative")
    console.table(header, [(c.name, c.expected, c.found, c.difference, c.relative) for c in changes])


def _cases(study: str, expected: Figures, found: Figures) -> list[Case]:
    """A test case a row of the results, so that a CI page names what moved and not every digit of it."""
    moved: dict[str, list[Change]] = {}
    for change in _changes(expected, found):
        moved.setdefault(_row_of(change.name), []).append(change)
    return [
        Case(f"{study}.{row.partition(' | ')[0]}", row.partition(" | ")[2] or row, _fault(moved.get(row)))
        for row in dict.fromkeys(_row_of(name) for name in [*expected, *found])
    ]


def _sessions_case(result: Result, befell: Sequence[str]) -> Case:
    """What exit code 1 says, as a test case."""
    fault = ("a session was set aside or read in part", "\n".join(befell)) if result.exit_code else None
    return Case(result.name, "every session is read whole", fault)


def _row_of(figure: str) -> str:
    return figure.rpartition(" | ")[0] or figure


def _fault(changes: Sequence[Change] | None) -> tuple[str, str] | None:
    if not changes:
        return None
    lines = [
        f"{c.name.rpartition(' | ')[2]}: expected {c.expected}, found {c.found} ({c.difference}, {c.relative})"
        for c in changes
    ]
    return lines[0] + (f"; and {len(lines) - 1} more" if len(lines) > 1 else ""), "\n".join(lines)


def _headed(message: str) -> tuple[str, str]:
    return message.partition("\n")[0], message
