"""The intervals of conditions' means: of answers 0 or 1, of shares of answers, and those that the figures show."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics import NONE_OF_ALIKE, T_BEYOND, T_OF_SHARES, WILSON, T
from pipeline.statistics.descriptive import mean_interval
from tests.pipeline.analysis.test_options import Row, compared, read, study
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

PAIRED = ["measure: m, test: t_paired"]


def of(steadyhand: Steadyhand, condition: str) -> Row:
    (row,) = (row for row in steadyhand.results()["descriptives"] if row["condition"] == condition)
    return dict(row)


@pytest.mark.parametrize(
    ("yes", "n", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_answers_have_wilsons_interval(yes: int, n: int, low: float, high: float) -> None:
    """Newcombe (1998), Two-sided confidence intervals for the single proportion, Table I, method 3."""
    found = mean_interval(np.repeat([1.0, 0.0], [yes, n - yes]), WILSON)
    assert found == pytest.approx((low, high), abs=5e-5)


@given(n=st.integers(1, 5000))
def test_wilsons_interval_of_answers_all_alike_ends_at_them(n: int) -> None:
    """By its formula, centre ± width is exactly 0 or 1 there; a rounding beyond would leave the mean outside."""
    assert mean_interval(np.zeros(n), WILSON)[0] == 0  # type: ignore[index]
    assert mean_interval(np.ones(n), WILSON)[1] == 1  # type: ignore[index]


def test_a_study_in_which_all_succeed_is_reported(steadyhand: Steadyhand, tmp_path: Path) -> None:
    """statsmodels' bound for 7 of 7 is below 1 by a rounding, on which its picture must not fail."""
    values = {"m": {"A": [1] * 7, "B": [0] * 7}}
    page = read(steadyhand, study(tmp_path / "s", values, ["measure: m, test: mcnemar"]))
    assert "(Wilson's, of answers 0 or 1)" in page


def test_a_report_of_answers_names_wilson_and_stays_within_0_and_1(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values = {"m": {"A": [0] * 20, "B": [1] + [0] * 19}}
    page = read(steadyhand, study(tmp_path / "s", values, ["measure: m, test: mcnemar"]))
    assert [of(steadyhand, name)["interval"] for name in "AB"] == [WILSON] * 2
    assert (of(steadyhand, "A")["ci_low"], of(steadyhand, "A")["ci_high"]) == pytest.approx((0, 0.1611), abs=5e-5)
    assert "(Wilson's, of answers 0 or 1)" in page
    assert "Intervals of the shares of answers 0 or 1 (M) are Wilson's." in page
    assert "wilson1927" in page
    assert steadyhand.results()["intervals_within"] == []


def test_shares_of_trials_keep_t_within_0_and_1(steadyhand: Steadyhand, tmp_path: Path) -> None:
    answers = {"A": [[0, 0], [0, 0], [0, 1], [0, 0], [0, 0]], "B": [[1, 1]] * 5}
    rows = "".join(
        f"P{at},{condition},m,{trial},{value}\n"
        for condition, people in answers.items()
        for at, trials in enumerate(people)
        for trial, value in enumerate(trials)
    )
    folder = study(tmp_path / "s", {"m": {"A": [0], "B": [0]}}, PAIRED)
    (folder / "measures.csv").write_text(f"participant,condition,measure,trial,value\n{rows}", encoding="utf-8")
    page = read(steadyhand, folder)
    low, high = stats.t.interval(0.95, 4, 0.1, stats.sem([0, 0, 0.5, 0, 0]))
    assert low < 0
    assert of(steadyhand, "A")["interval"] == T_OF_SHARES
    assert (of(steadyhand, "A")["ci_low"], of(steadyhand, "A")["ci_high"]) == pytest.approx((0, high))
    assert (of(steadyhand, "B")["ci_low"], of(steadyhand, "B")["interval"]) == (None, NONE_OF_ALIKE)
    assert "cut at 0 and 1, where their mean cannot be" in page
    assert all(0 <= row["ci_low"] <= row["ci_high"] <= 1 for row in steadyhand.results()["intervals_within"])


def test_what_may_be_a_share_is_not_cut_and_that_is_said(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values = {"m": {"A": [0, 0, 0.3, 0, 0.1], "B": [0.4, 0.5, 0.6, 0.5, 0.45]}}
    page = read(steadyhand, study(tmp_path / "s", values, PAIRED))
    assert [of(steadyhand, name)["interval"] for name in "AB"] == [T_BEYOND, T]
    assert of(steadyhand, "A")["ci_low"] < 0
    assert "A t interval reaches beyond 0 to 1 for M" in page
    assert "The t interval of M reaches beyond 0 to 1" in page


def test_what_has_a_unit_is_no_share(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values = {"m_s": {"A": [0, 0, 1, 0, 0], "B": [1, 0, 1, 1, 0]}}
    compared(steadyhand, study(tmp_path / "s", values, ["measure: m_s, test: t_paired"]))
    assert [of(steadyhand, name)["interval"] for name in "AB"] == [T] * 2


def test_every_interval_of_a_paired_figure_stands_in_a_table(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values = {"m": {"A": [3.0, 5, 4, 8, 6], "B": [2.0, 4, 4, 5, 4], "C": [9.0, 5, 7, 8]}}
    assert steadyhand("report", study(tmp_path / "s", values, PAIRED), "--format", "html,csv").code == 0

    def table(name: str) -> list[dict[str, str]]:
        with (steadyhand.out / "tables" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    within = table("intervals_within")
    assert [(row["condition"], row["n"]) for row in within] == [("A", "4"), ("B", "4"), ("C", "4")]
    complete = np.column_stack([values["m"][name][:4] for name in "ABC"])
    normalized = complete - complete.mean(axis=1, keepdims=True)
    margins = stats.t.ppf(0.975, 3) * normalized.std(axis=0, ddof=1) * np.sqrt(3 / 2 / 4)
    assert [float(row["ci_high"]) - float(row["mean"]) for row in within] == pytest.approx(margins)
    differences = table("differences")
    assert [(row["contrast"], row["lower"]) for row in differences] == [("A - B", "3"), ("A - C", "0")]
    low, high = stats.ttest_1samp(complete[:, 0] - complete[:, 1], 0).confidence_interval()
    assert (float(differences[0]["ci_low"]), float(differences[0]["ci_high"])) == pytest.approx((low, high))
