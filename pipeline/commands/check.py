"""`check`: do a study's numbers still come out the same?"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline import results
from pipeline.commands import console
from pipeline.commands.run import for_each
from pipeline.errors import PipelineError
from pipeline.runner import Result
from pipeline.stages import COMPARE

EXPECTED = "expected.json"
MOVED = 3  # the exit code
_RELATIVE = 1e-6  # what another processor's rounding may do
_KEYS = {
    "descriptives": ("measure", "condition"),
    "comparisons": ("measure", "test", "effect", "contrast"),
    "accuracy": ("session", "estimator", "variant"),
    "replay_agreement": ("session", "estimator"),
}


def check(studies: Sequence[Path], accept: bool, jobs: int | None, cache: Path | None) -> None:
    """Compare each study with its expected.json, or write it; exit with 3 where a number moved."""

    def compare(folder: Path, result: Result) -> int:
        found = dict(_numbers(results.read(result.entry("compare") / "results.json")))
        path = folder / EXPECTED
        if accept:
            path.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
            console.say(f"{result.name}: {len(found)} numbers accepted into {path}; review them before you commit")
            return 0
        moved = list(_moved(_expected(path), found))
        for line in moved:
            console.say(f"{result.name}: {line}")
        console.say(f"{result.name}: {len(found) - len(moved)} numbers as expected, {len(moved)} not")
        return MOVED if moved else result.exit_code

    sys.exit(for_each(studies, COMPARE, jobs, cache, compare))


def _expected(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise PipelineError(f"{path}: there is no such file; write it with: steadyhand check {path.parent} --accept")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise PipelineError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(content, dict):
        raise PipelineError(f"{path}: should hold one object, a number a name")
    return content


def _numbers(content: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Every figure of the results by a name that says where it stands."""
    for table, keys in _KEYS.items():
        for row in content[table]:
            where = " | ".join([table, *(str(row[key]) for key in keys if row[key] is not None)])
            for column, value in row.items():
                if column == "details" and value:
                    for name, detail in value.items():
                        parts = detail if isinstance(detail, list) else [detail]
                        for index, part in enumerate(parts):
                            yield f"{where} | {name}{f' {index}' if len(parts) > 1 else ''}", part
                elif column == "status" or (isinstance(value, int | float) and not isinstance(value, bool)):
                    yield f"{where} | {column}", value


def _moved(expected: Mapping[str, Any], found: Mapping[str, Any]) -> Iterator[str]:
    """A line a figure that is another, new or gone."""
    for name in dict.fromkeys([*expected, *found]):
        before, now = expected.get(name), found.get(name)
        if isinstance(before, int | float) and isinstance(now, int | float):
            if not math.isclose(before, now, rel_tol=_RELATIVE, abs_tol=1e-12):
                yield f"{name}: expected {before:.10g}, found {now:.10g} ({now - before:+.3g})"
        elif name not in found:
            yield f"{name}: expected {before}, and is not there any more"
        elif name not in expected:
            yield f"{name}: is new: {now}"
        elif before != now:
            yield f"{name}: expected {before}, found {now}"
