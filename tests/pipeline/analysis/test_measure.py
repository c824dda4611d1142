"""From a study's tables to the values that are compared: totals of questionnaires, and how often a value counts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy import stats

from tests.pipeline.helpers import Steadyhand
from tests.pipeline.reference import Row, compared, the

Folder = Callable[..., Path]

SCALES = ("mental", "effort", "frustration")


def ratings(*lacking: tuple[str, str, str]) -> str:
    """Ratings of three people in two conditions, 10 times the person plus 1, 2, 3; twice that in condition b."""
    lines = ["participant,condition,questionnaire,scale,rating"]
    for person, condition in ((person, condition) for person in (1, 2, 3) for condition in "ab"):
        for place, scale in enumerate(SCALES, 1):
            if (f"P{person}", condition, scale) not in lacking:
                rating = (10 * person + place) * (2 if condition == "b" else 1)
                lines.append(f"P{person},{condition},nasa_tlx,{scale},{rating}")
    return "\n".join(lines) + "\n"


def test_a_total_is_the_sum_over_the_scales(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder("conditions: [a, b]\nquestionnaires: q.csv\n", **{"q.csv": ratings()})
    assert steadyhand("compare", study).code == 0
    for condition, mean in (("a", 66), ("b", 132)):
        row = the(steadyhand.results()["descriptives"], measure="nasa_tlx/total", condition=condition)
        assert (row["n"], row["mean"]) == (3, mean)


def test_there_is_no_total_of_a_person_who_left_a_scale_out(folder: Folder, steadyhand: Steadyhand) -> None:
    """A sum over fewer scales would look like less work. Whoever has no total is left out of its comparison."""
    entry = "comparisons: [{measure: nasa_tlx/total, test: t_paired}, {measure: nasa_tlx/mental, test: t_paired}]\n"
    study = folder(f"conditions: [a, b]\nquestionnaires: q.csv\n{entry}", **{"q.csv": ratings(("P2", "b", "effort"))})
    total, mental = compared(steadyhand, study)
    assert (total["n"], mental["n"]) == (2, 3)
    assert total["mean_difference"] == pytest.approx((36 + 96) / 2 - (72 + 192) / 2)
    in_b = the(steadyhand.results()["descriptives"], measure="nasa_tlx/total", condition="b")
    assert (in_b["n"], in_b["mean"]) == (2, (72 + 192) / 2)
    reasons = {(row["participant"], row["reason"]) for row in steadyhand.results()["exclusions"]}
    assert ("P2", "t_paired: no value in b") in reasons


def test_a_total_can_be_excluded_and_its_scales_stay(folder: Folder, steadyhand: Steadyhand) -> None:
    """There is no total yet when the rows of the tables are left out, so it is left out afterwards."""
    exclusion = "exclusions: [{participant: P2, condition: b, measure: nasa_tlx/total, reason: told to hurry}]\n"
    study = folder(f"conditions: [a, b]\nquestionnaires: q.csv\n{exclusion}", **{"q.csv": ratings()})
    assert steadyhand("compare", study).code == 0
    described = steadyhand.results()["descriptives"]
    in_b = the(described, measure="nasa_tlx/total", condition="b")
    assert (in_b["n"], in_b["mean"]) == (2, (72 + 192) / 2)
    assert the(described, measure="nasa_tlx/total", condition="a")["n"] == 3
    mental = the(described, measure="nasa_tlx/mental", condition="b")
    assert (mental["n"], mental["mean"]) == (3, (22 + 42 + 62) / 3)


TIMES = {
    ("P1", "a"): [10, 11, 15, 12],
    ("P1", "b"): [7, 8, 6, 13],
    ("P2", "a"): [20, 14, 18, 30],
    ("P2", "b"): [16, 15, 9, 11],
    ("P3", "a"): [12, 12, 13, 9],
    ("P3", "b"): [13, 8, 9, 10],
    ("P4", "a"): [25, 19, 22, 27],
    ("P4", "b"): [15, 17, 20, 21],
}
"""Seconds of the four trials of each person and condition."""


def trials(first_sessions: dict[tuple[str, str], int]) -> str:
    """The times as trials, the first so many of each cell in its first session and the others in its second."""
    places = "target_x_mm,target_y_mm,selected_x_mm,selected_y_mm"
    lines = [f"participant,condition,session,trial,{places},start_s,selection_s"]
    for (person, condition), seconds in TIMES.items():
        for trial, duration_s in enumerate(seconds, 1):
            session = f"{person}{condition}{1 if trial <= first_sessions[person, condition] else 2}"
            lines.append(f"{person},{condition},{session},{trial},0,0,0,0,0,{duration_s}")
    return "\n".join(lines) + "\n"


def modelled(folder: Folder, steadyhand: Steadyhand, first_sessions: dict[tuple[str, str], int]) -> Row:
    entry = "comparisons: [{measure: trial_time_s, test: mixed_model}]\n"
    study = folder(f"conditions: [a, b]\ntrials: trials.csv\n{entry}", **{"trials.csv": trials(first_sessions)})
    return the(compared(steadyhand, study), effect="condition")


@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(first_sessions=st.fixed_dictionaries({cell: st.integers(0, 4) for cell in TIMES}))
def test_every_trial_of_a_mixed_model_counts_once_in_whichever_session(
    folder: Folder, steadyhand: Steadyhand, first_sessions: dict[tuple[str, str], int]
) -> None:
    """A model of one mean for each person and condition is the paired t test of these means."""
    row = modelled(folder, steadyhand, first_sessions)
    means = {cell: sum(seconds) / 4 for cell, seconds in TIMES.items()}
    first, second = ([means[person, condition] for person in ("P1", "P2", "P3", "P4")] for condition in "ab")
    expected = stats.ttest_rel(first, second)
    assert row["statistic"] == pytest.approx(expected.statistic)
    assert row["p"] == pytest.approx(expected.pvalue)
    assert row["effect_size"] == pytest.approx((sum(first) - sum(second)) / 4)
