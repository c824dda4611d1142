"""Words that depend on what an entry asks for and what the data allow, through a study folder to the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.pipeline.analysis.test_options import TIMES, Values, read, study
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")


def test_two_models_of_one_measure_are_told_apart(tmp_path: Path, steadyhand: Steadyhand) -> None:
    folder = tmp_path / "study"
    study(
        folder,
        TIMES,
        ["measure: time_s, test: mixed_model", "measure: time_s, test: mixed_model, fixed: [condition, period]"],
    )
    lines = (folder / "measures.csv").read_text(encoding="utf-8").splitlines()
    with_period = [f"{lines[0]},period"]
    for line in lines[1:]:
        person, condition = line.split(",")[:2]
        with_period.append(f"{line},{1 + (int(person[1:]) + (condition == 'B')) % 2}")
    (folder / "measures.csv").write_text("\n".join(with_period) + "\n", encoding="utf-8")
    page = read(steadyhand, folder)
    assert "Time (s), mixed model with period" in page
    rows = steadyhand.results()["comparisons"]
    assert {row["effect"] for row in rows if row["details"].get("further_terms") == ["period"]} == {
        "condition",
        "period",
    }


def test_a_group_of_one_is_a_caution(tmp_path: Path, steadyhand: Steadyhand) -> None:
    people = "participant,group\n" + "".join(f"P{at:02},{'expert' if at == 1 else 'novice'}\n" for at in range(1, 11))
    entry = ["measure: time_s, test: mixed_anova"]
    page = read(steadyhand, study(tmp_path / "study", TIMES, entry, "factors: {group: between}\n", people))
    assert "A single participant in group “expert”, for Time (s): its mean" in page


def test_a_bootstrap_that_could_not_be_is_not_among_the_methods(tmp_path: Path, steadyhand: Steadyhand) -> None:
    few: Values = {"time_s": {"A": [12.1, 15.4, 9.8, 22.6], "B": [10.2, 12.9, 9.1, 15.3]}}
    page = read(steadyhand, study(tmp_path / "study", few, ["measure: time_s, test: t_paired, bootstrap: true"]))
    assert "no bootstrap: it needs 5 participants" in page
    assert "BCa" not in page
    assert "Efron" not in page
