"""`check`: do a study's numbers still come out the same?"""

from __future__ import annotations

import json
import shlex
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.commands import console, junit
from pipeline.commands.junit import Case, Suite
from pipeline.commands.studies import for_each_study
from pipeline.engine.messages import session_messages
from pipeline.engine.result import Result
from pipeline.errors import PipelineError
from pipeline.stages import COMPARE
from pipeline.tables import differences, results
from pipeline.tables.catalogue import CHECKED
from pipeline.tables.differences import Change, Figures

EXPECTED = "expected.json"
MOVED = 3  # the exit code
_RELATIVE = 1e-6  # what another processor's rounding may do


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
            raise PipelineError("check: --accept compares nothing that --junit could report; give only one of them")
        junit.refuse_other(junit_file)
    suites: list[Suite] = []

    def compare(folder: Path, result: Result) -> int:
        figures = dict(_figures(results.read(result.entry("compare") / "results.json")))
        messages = list(session_messages(result))
        for line in messages:
            console.warn(line)
        if accept:
            _accept(folder, result.name, figures)
            return result.exit_code
        expected = _expected(folder / EXPECTED)
        suites.append(_suite(result, expected, figures, messages))
        return MOVED if _compare(folder, result.name, expected, figures) else result.exit_code

    def failed(folder: Path, error: PipelineError) -> None:
        name = folder.resolve().name
        suites.append(Suite(name, [Case(name, "can be checked", _headed(str(error)), broken=True)]))

    code = for_each_study(studies, COMPARE, jobs, cache, compare, failed=failed, executor_name=executor)
    if junit_file is not None:
        junit.write(junit_file, suites)
    sys.exit(code)


def _compare(folder: Path, name: str, expected: Figures, figures: Figures) -> bool:
    """Print what moved; whether anything did."""
    changes = differences.changes(expected, figures, _RELATIVE)
    _show(name, len(expected), changes)
    if changes:
        console.say(f"If these changes are intended, accept them with: {_accept_command(folder)}")
    return bool(changes)


def _accept(folder: Path, name: str, figures: Figures) -> None:
    """Write the figures as the expected ones, and show what that changes."""
    path = folder / EXPECTED
    if path.is_file():
        before = _expected(path)
        _show(name, len(before), differences.changes(before, figures, _RELATIVE))
    path.write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    console.say(f"{name}: {len(figures)} numbers accepted into {path}; review them before you commit")


def _accept_command(folder: Path) -> str:
    """The command that takes today's results as the expected ones."""
    return f"steadyhand check {shlex.quote(str(folder))} --accept"


def _expected(path: Path) -> dict[str, Any]:
    command = _accept_command(path.parent)
    if not path.is_file():
        raise PipelineError(f"{path}: there is no such file; write it with: {command}")
    try:
        return results.read_object(path)
    except PipelineError as error:
        raise PipelineError(f"{error}; correct it, or remove it and write it with: {command}") from None


def _figures(content: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Every figure of the results, by a name that says which table, row and column it is from."""
    seen: Counter[str] = Counter()
    for table in CHECKED:
        keys = differences.OF_A_STUDY[table]
        for row in content[table]:
            where = f"{table} | {differences.Identified(table, {key: row[key] for key in keys}).name}"
            seen[where] += 1
            if seen[where] > 1:  # the same test twice, with other options
                where = f"{where} ({seen[where]})"
            for column, value in row.items():
                if column == "details":
                    yield from ((f"{where} | {name}", part) for name, part in differences.detailed(value))
                elif column == "status" or differences.is_number(value):
                    yield f"{where} | {column}", value


def _show(study: str, expected: int, changes: Sequence[Change]) -> None:
    """Print how many figures moved, and a table of them."""
    if not changes:
        console.say(f"{study}: all {expected} numbers as expected")
        return
    console.say(f"{study}: {len(changes)} moved (of {expected} expected)")
    header = ("figure", "expected", "found", "difference", "relative")
    console.table(header, [(c.name, *c.cells) for c in changes])


def _suite(result: Result, expected: Figures, figures: Figures, messages: Sequence[str]) -> Suite:
    """The check of one study for a CI page."""
    cases = _cases(result.name, expected, figures)
    if result.study.sessions is not None:
        cases.append(_sessions_case(result, messages))
    return Suite(result.name, cases, result.seconds, "\n".join(messages))


def _cases(study: str, expected: Figures, figures: Figures) -> list[Case]:
    """One test case per row of the results, so that a CI page names what moved and not every digit of it."""
    moved: dict[str, list[Change]] = {}
    for change in differences.changes(expected, figures, _RELATIVE):
        moved.setdefault(_row_of(change.name), []).append(change)
    return [
        Case(f"{study}.{row.partition(' | ')[0]}", row.partition(" | ")[2] or row, _failure(moved.get(row)))
        for row in dict.fromkeys(_row_of(name) for name in [*expected, *figures])
    ]


def _sessions_case(result: Result, messages: Sequence[str]) -> Case:
    """What exit code 1 says, as a test case."""
    failure = ("a session was set aside or read in part", "\n".join(messages)) if result.exit_code else None
    return Case(result.name, "every session is read whole", failure)


def _row_of(figure: str) -> str:
    return figure.rpartition(" | ")[0] or figure


def _failure(changes: Sequence[Change] | None) -> tuple[str, str] | None:
    if not changes:
        return None
    lines = []
    for change in changes:
        before, now, by, relative = change.cells
        lines.append(f"{change.name.rpartition(' | ')[2]}: expected {before}, found {now} ({by}, {relative})")
    return lines[0] + (f"; and {len(lines) - 1} more" if len(lines) > 1 else ""), "\n".join(lines)


def _headed(message: str) -> tuple[str, str]:
    return message.partition("\n")[0], message
