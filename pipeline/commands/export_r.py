"""A study for R: its tables as CSV, and a script that reads them and computes the comparisons anew, with afex."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Sequence
from pathlib import Path

from pipeline.analysis.against import in_r
from pipeline.analysis.against.problems import Problem, all_problems
from pipeline.analysis.comparisons import answered, people_of
from pipeline.analysis.complete_cases import read_values
from pipeline.commands.export_tables import as_csv
from pipeline.engine.result import Result

_SCRIPT = Path(__file__).with_name("analysis.R")
_OURS = ("measure", "test", "effect", "contrast", "statistic", "df1", "df2", "p", "effect_size", "p_adjusted")


def for_r(result: Result, folder: Path) -> int:
    """Write the folder; how many files it has."""
    tables, recomputed = folder / "tables", folder / "recomputed"
    tables.mkdir(exist_ok=True)
    recomputed.mkdir(exist_ok=True)
    count = as_csv(result, tables)
    problems = [problem for problem in _problems(result) if in_r.knows(problem)]
    for name, text in (in_r.tables(problems) if problems else {}).items():
        (recomputed / name).write_text(text, encoding="utf-8")
        count += 1
    _write_ours(problems, recomputed / "steadyhand.csv")
    shutil.copyfile(in_r.SCRIPT, recomputed / in_r.SCRIPT.name)
    shutil.copyfile(_SCRIPT, folder / _SCRIPT.name)
    return count + 3


def _problems(result: Result) -> list[Problem]:
    values = read_values(result.entry("measure"), people_of(result.study, result.folder, result.pseudonyms))
    return all_problems(answered(result.study, values))


def _write_ours(problems: Sequence[Problem], path: Path) -> None:
    """The rows of `comparisons` that R computes anew, by the number of the problem."""
    with path.open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(["problem", *_OURS])
        for number, problem in enumerate(problems):
            row = problem.row
            lines.writerow([number, *("NA" if row.get(name) is None else row[name] for name in _OURS)])
