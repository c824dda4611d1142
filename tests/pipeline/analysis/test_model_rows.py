"""Which values a mixed model is of, through a study folder."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from tests.pipeline.helpers import Steadyhand

PEOPLE = (0.0, 1.5, -0.5, 2.0, 0.7, -1.2)
"""How much more everybody's values are than others'."""


def results(folder: Path, steadyhand: Steadyhand, header: str, lines: Iterable[str], entry: str) -> dict[str, Any]:
    """results.json of a study of conditions A and B whose measures.csv has these lines."""
    folder.mkdir()
    (folder / "measures.csv").write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    (folder / "study.yaml").write_text(
        f"conditions: [A, B]\nmeasures: measures.csv\ncomparisons:\n  - {{measure: m, {entry}}}\n", encoding="utf-8"
    )
    ran = steadyhand("compare", folder)
    assert ran.code == 0, ran.err
    return steadyhand.results()


def test_a_task_that_was_done_more_often_counts_no_more_than_another(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """In A the easy task, of 10, is done three times and the hard one, of 20, once: 15 by task, 12.5 by trial."""
    trials = {("A", "easy"): (9, 10, 11), ("A", "hard"): (20,), ("B", "easy"): (8,), ("B", "hard"): (14,)}
    lines = [
        f"P{person},{condition},m,{task},{trial},{value + more + 0.1 * person * (condition == 'B')}"
        for person, more in enumerate(PEOPLE, 1)
        for (condition, task), values in trials.items()
        for trial, value in enumerate(values, 1)
    ]
    header = "participant,condition,measure,task,trial,value"
    found = results(tmp_path / "study", steadyhand, header, lines, "test: mixed_model, fixed: [condition]")
    (row,) = found["comparisons"]
    of_b = 11 + 0.1 * sum(range(1, 7)) / 6
    assert row["effect_size"] == pytest.approx(15 - of_b)


def test_levels_that_are_numbers_are_in_the_order_of_numbers(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """A contrast is the first level less the second, and "10" would come before "2" as text."""
    lines = [
        f"P{person},{condition},m,{size},{5 + int(size) + more + 0.2 * ((person * int(size)) % 3)}"
        for person, more in enumerate(PEOPLE, 1)
        for condition in "AB"
        for size in ("10", "2")
    ]
    header = "participant,condition,measure,size,value"
    found = results(tmp_path / "study", steadyhand, header, lines, "test: mixed_model, fixed: [condition, size]")
    (row,) = (one for one in found["comparisons"] if one["effect"] == "size")
    assert row["contrast"] == "2 - 10"
    assert row["effect_size"] == pytest.approx(-8, abs=0.5)


def test_a_first_period_is_not_in_a_model_of_carry_over_and_nobody_is_left_out_for_it(
    tmp_path: Path, steadyhand: Steadyhand
) -> None:
    lines = [
        f"P{person},{condition},m,{period},{10 + more + (condition == 'B') + 0.3 * ((person * period) % 4)}"
        for person, more in enumerate((*PEOPLE, 0.3, -0.8), 1)
        for period, condition in enumerate("ABBA" if person % 2 else "BAAB", 1)
    ]
    header = "participant,condition,measure,period,value"
    entry = "test: mixed_model, fixed: [condition, carry_over]"
    found = results(tmp_path / "study", steadyhand, header, lines, entry)
    assert found["exclusions"] == []
    assert {row["effect"] for row in found["comparisons"]} == {"condition", "carry_over"}
