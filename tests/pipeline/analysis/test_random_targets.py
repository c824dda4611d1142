"""Crossed targets in a mixed model, through a study folder: against lmerTest, and where they have no variance."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.pipeline.analysis.test_options import read
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.statistics.r_cases import expected, rows

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

CROSSED = "value ~ condition + (1 | participant) + (1 | participant:condition) + (1 | target)"


def study(folder: Path, case: str, entry: str, conditions: str = "[A, B]") -> Path:
    """A study folder of an R case, with its targets as a column of the measures."""
    folder.mkdir()
    lines = ["participant,condition,measure,target,trial,value"]
    for row in rows(case):
        lines.append(f"{row['participant']},{row['condition']},m,{row['target']},{row['trial']},{row['value']}")
    (folder / "measures.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = f"conditions: {conditions}\nmeasures: measures.csv\ncomparisons:\n  - {{measure: m, test: {entry}}}\n"
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    return folder


def test_crossed_targets_against_lmertest(tmp_path: Path, steadyhand: Steadyhand) -> None:
    page = read(steadyhand, study(tmp_path / "study", "models_balanced", "mixed_model, random: target"))
    (row,) = steadyhand.results()["comparisons"]
    model: dict[str, Any] = next(one for one in expected("models_balanced")["models"] if one["formula"] == CROSSED)
    wanted = model["fixed"]["conditionB"]
    assert row["effect_size"] == pytest.approx(-wanted["estimate"], rel=1e-5)
    assert row["statistic"] == pytest.approx(-wanted["t"], rel=1e-5)
    assert [row["df2"], row["p"]] == pytest.approx([wanted["df"], wanted["p"]], rel=1e-3)
    for name in ("participant", "participant:condition", "target"):
        assert row["details"]["variances"][name] == pytest.approx(model["variances"][name], rel=1e-4)
    assert "a crossed random intercept for each target" in page
    assert "(1 | participant) + (1 | participant:condition) + (1 | target)" in page
    assert "is left out" not in page


def test_the_targets_of_trials_are_those_of_a_column(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """The same values as times of trials, whose targets are places: each has the same intercept."""
    steadyhand("compare", study(tmp_path / "column", "models_balanced", "mixed_model, random: target"))
    (wanted,) = steadyhand.results()["comparisons"]
    folder = tmp_path / "trials"
    folder.mkdir()
    least = min(float(row["value"]) for row in rows("models_balanced"))
    lines = ["participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm,start_s,selection_s"]
    for number, row in enumerate(rows("models_balanced"), 1):
        place = f"{10 * (ord(str(row['target'])[-1]) % 50)},5"
        lines.append(
            f"{row['participant']},{row['condition']},{number},{place},{place},100,{101 + float(row['value']) - least}"
        )
    (folder / "trials.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "study.yaml").write_text(
        "conditions: [A, B]\ntrials: trials.csv\n"
        "comparisons:\n  - {measure: trial_time_s, test: mixed_model, random: target}\n",
        encoding="utf-8",
    )
    page = read(steadyhand, folder)
    found = next(one for one in steadyhand.results()["comparisons"] if one["effect"] == wanted["effect"])
    for figure in ("effect_size", "statistic", "df2", "p"):
        assert found[figure] == pytest.approx(wanted[figure], rel=1e-6)
    assert found["details"]["variances"] == pytest.approx(wanted["details"]["variances"], rel=1e-6)
    assert "a crossed random intercept for each target" in page


def test_targets_without_variance_are_left_out_and_said(tmp_path: Path, steadyhand: Steadyhand) -> None:
    entry = "mixed_model, random: target, missing: available"
    page = read(steadyhand, study(tmp_path / "study", "models_singular", entry))
    (row,) = steadyhand.results()["comparisons"]
    assert row["status"] == "ok"
    assert row["details"]["variances"]["target"] == 0
    assert "A random intercept is left out (that of each target) in the mixed model for M" in page
    assert "singular fit, estimated as zero and left out: " in page


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("mixed_model, random: targets", '"m" has no factor "targets"; did you mean "target"?'),
        ("mixed_model, random: target, fixed: [condition, target]", '"target" is a fixed term already'),
        ("rm_anova, random: target", "rm_anova does not take random; it is for mixed_model"),
    ],
)
def test_a_random_factor_that_cannot_be_is_an_error(
    tmp_path: Path, steadyhand: Steadyhand, entry: str, said: str
) -> None:
    ran = steadyhand("compare", study(tmp_path / "study", "models_balanced", entry))
    assert ran.code == 2
    assert said in ran.err
