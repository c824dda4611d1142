"""Q-Q plots of a report: of which values, whose lie outside, and what is left out of many."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from pipeline.report.sections.normality import PANELS_MAX, which_are_drawn
from tests.pipeline.analysis.test_options import TIMES, Values, read, study
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("blank_figures", "blank_print")

Rows = list[dict[str, str]]
SKEWED = [1.0, 1.1, 1.2, 1.2, 1.3, 1.4, 1.5, 1.6, 1.8, 9.0]
THREE: Values = {
    "time_s": {
        "A": [9.1, 11.2, 10.4, 9.8, 12.0, 10.9, 10.0, 11.5],
        "B": [8.0, 10.1, 9.9, 8.1, 10.2, 9.0, 8.8, 9.9],
        "C": [9.4, 14.8, 10.1, 7.9, 17.1, 10.0, 6.2, 15.3],
    }
}


def shown(steadyhand: Steadyhand, folder: Path) -> tuple[str, Rows]:
    """The words of the report, and the rows behind its Q-Q plots."""
    ran = steadyhand("report", folder, "--format", "html,csv")
    assert ran.code == 0, ran.err
    with (steadyhand.out / "tables" / "normal_quantiles.csv").open(encoding="utf-8") as file:
        return read(steadyhand, folder), list(csv.DictReader(file))


def kinds(rows: Rows) -> dict[tuple[str, str, str], int]:
    """How many values each sample has."""
    counts: dict[tuple[str, str, str], int] = {}
    for row in rows:
        name = (row["measure"], row["kind"], row["of"])
        counts[name] = counts.get(name, 0) + 1
    return counts


def test_whose_difference_lies_outside_is_named_and_is_a_row(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values: Values = {"time_s": {"A": SKEWED, "B": [0.0] * 10}}
    page, rows = shown(steadyhand, study(tmp_path / "s", values, ["measure: time_s, test: t_paired"]))
    assert kinds(rows) == {("time_s", "differences", "A - B"): 10}
    assert [row["participant"] for row in rows if row["outside"] == "1"][-1] == "P10"
    assert [float(row["value"]) for row in rows] == SKEWED
    count = sum(row["outside"] == "1" for row in rows)
    assert f"Values lie outside the band: Time (s), A − B ({count} of 10" in page
    assert "Q-Q plots: some lie outside the 95 % band in 1 of 1 sample" in page
    assert "tables/normal_quantiles.csv" in page


def test_three_conditions_have_residuals_and_their_pairs(steadyhand: Steadyhand, tmp_path: Path) -> None:
    page, rows = shown(steadyhand, study(tmp_path / "s", THREE, ["measure: time_s, test: rm_anova"]))
    pairs = {("time_s", "differences", f"{one} - {other}"): 8 for one, other in ("AB", "AC", "BC")}
    assert kinds(rows) == {("time_s", "residuals", "condition"): 24} | pairs
    assert {row["cell"] for row in rows if row["kind"] == "residuals"} == {"A", "B", "C"}
    assert "Rows: tables/normal_quantiles.csv." in page
    assert "no panels of their own" not in page


def test_rank_tests_need_no_plot_and_a_sample_is_drawn_once(steadyhand: Steadyhand, tmp_path: Path) -> None:
    entries = ["measure: errors, test: wilcoxon", "measure: time_s, test: t_paired", "measure: time_s, test: bayes_t"]
    _, rows = shown(steadyhand, study(tmp_path / "s", TIMES, entries))
    assert kinds(rows) == {("time_s", "differences", "A - B"): 10}


def test_logarithms_are_a_sample_of_their_own(steadyhand: Steadyhand, tmp_path: Path) -> None:
    entries = ["measure: time_s, test: t_paired", "measure: time_s, test: t_paired, transform: log"]
    page, rows = shown(steadyhand, study(tmp_path / "s", TIMES, entries))
    logs = [float(row["value"]) for row in rows if row["logarithms"] == "1"]
    first, second = (np.array(TIMES["time_s"][name]) for name in "AB")
    assert logs == pytest.approx(np.log(first) - np.log(second))
    assert len(rows) == 20
    assert re.search(r"outside the 95 % band in \d of 2 samples", page)


def test_groups_and_mixed_designs_and_models_have_their_own(steadyhand: Steadyhand, tmp_path: Path) -> None:
    people = "participant,training\n" + "".join(f"P{at:02},{'long' if at % 2 else 'none'}\n" for at in range(1, 11))
    entries = [
        "measure: time_s, test: t_welch, between: training",
        "measure: time_s, test: mixed_anova, between: training",
        "measure: time_s, test: mixed_model",
    ]
    page, rows = shown(steadyhand, study(tmp_path / "s", TIMES, entries, "factors: {training: between}\n", people))
    assert kinds(rows) == {
        ("time_s", "group", "training: long"): 5,
        ("time_s", "group", "training: none"): 5,
        ("time_s", "residuals", "training"): 10,
        ("time_s", "residuals", "condition"): 10 + 20,  # one of each person, and of the model one of each value
    }
    assert re.search(r"outside the 95 % band in \d of 5 samples", page)
    assert "The pairs that follow up a mixed ANOVA have no panels of their own." in page


def test_a_measure_without_a_plot_is_named(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values: Values = {**TIMES, "strain": {"A": [5.0] * 10, "B": [4.0] * 10}}
    entries = ["measure: [time_s, strain], test: t_paired"]
    page, _ = shown(steadyhand, study(tmp_path / "s", values, entries))
    assert "Without a panel, for fewer than three values or none that vary: Strain." in page


@pytest.mark.usefixtures("no_figures")  # one of each of 15 measures beside them
def test_of_many_samples_those_with_most_outside_are_drawn(steadyhand: Steadyhand, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    values: dict[str, Mapping[str, list[float]]] = {
        f"m{at:02}": {"A": rng.normal(size=10).round(3).tolist(), "B": rng.normal(size=10).round(3).tolist()}
        for at in range(14)
    }
    values["skewed"] = {"A": SKEWED, "B": [0.0] * 10}
    entries = [f"measure: [{', '.join(values)}], test: t_paired"]
    page, rows = shown(steadyhand, study(tmp_path / "s", values, entries))
    assert len(kinds(rows)) == 15
    assert f"Of 15 samples {PANELS_MAX} are drawn, all that have values outside and the first of" in page
    assert "Skewed, A − B (" in page


@pytest.mark.parametrize(("leaving", "which"), [(0, "the first ones"), (PANELS_MAX, "those with the largest share")])
def test_which_of_many_samples_are_drawn_is_said_as_it_is(leaving: int, which: str) -> None:
    assert which_are_drawn(leaving).startswith(which)
