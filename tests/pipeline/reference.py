"""The reference cases, as study folders, and what R makes of them."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]
Row = dict[str, Any]
CASES = Path(__file__).resolve().parents[1] / "data" / "statistics"
"""Data and what R 4.2.2 computes of them (afex, car, coin, effectsize, lmerTest, BayesFactor; versions inside)."""

RELATIVE = 1e-6  # closed forms, as the references state
MODEL = 1e-5  # estimates of mixed models, at which R's optimiser stops
SATTERTHWAITE = 1e-3  # their p
BAYES = 1e-4
SHAPIRO = 1e-4
BOUND = 1e-5  # R finds the bounds of d_z by a search that stops there


def expected(case: str) -> Row:
    """What R computes of a case."""
    content: Row = json.loads((CASES / case / "expected.json").read_text())
    return content


def with_key(key: str) -> list[str]:
    """The cases of which R has something of its own."""
    return [path.parent.name for path in sorted(CASES.glob("*/expected.json")) if key in json.loads(path.read_text())]


TASKS = [(case, task) for case in with_key("tasks") for task in expected(case)["tasks"]]


def study_of(folder: Folder, case: str, task: str, conditions: Sequence[str], comparisons: Sequence[str]) -> Path:
    """A study folder with one task's values, or all of them where the tasks are averaged or factors."""
    rows = list(csv.DictReader((CASES / case / "data.csv").read_text().splitlines()))
    further = [name for name in ("period", "sequence") if name in rows[0]]
    lines = [",".join(["participant,condition,measure,task,value", *further])]
    for row in rows:
        if task in ("mean_over_tasks", row["task"]) and row["condition"] in conditions:
            cells = [row["participant"], row["condition"], "m", row["task"], row["value"]]
            lines.append(",".join(cells + [row[name] for name in further]))
    entries = "\n".join(f"  - {{measure: m, {entry}}}" for entry in comparisons)
    text = f"conditions: {json.dumps(list(conditions))}\nmeasures: measures.csv\ncomparisons:\n{entries}\n"
    return folder(text, **{"measures.csv": "\n".join(lines) + "\n"})


def compared(steadyhand: Steadyhand, study: Path) -> list[Row]:
    """The comparisons of a study, through the command."""
    ran = steadyhand("compare", study)
    assert ran.code == 0, ran.err
    rows: list[Row] = steadyhand.results()["comparisons"]
    return rows


def same(found: Any, wanted: Any, tolerance: float = RELATIVE) -> None:
    """Equal within the tolerance, wherever R has a number."""
    if isinstance(wanted, int | float):
        assert found == pytest.approx(wanted, rel=tolerance, abs=1e-9)


def the(rows: Sequence[Row], **wanted: Any) -> Row:
    """The one row that has these."""
    (row,) = [row for row in rows if all(row[key] == value for key, value in wanted.items())]
    return row
