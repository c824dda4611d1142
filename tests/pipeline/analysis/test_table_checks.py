"""Values that are not what they are taken for: named with the cause, and silent where a column is merely unusual."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.analysis.table_checks import check_rows, order_rows
from pipeline.study.scoring_settings import ScoringEntry
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]
Row = dict[str, Any]
TIMES = [9.66, 7.88, 10.65, 9.57, 9.96, 9.76, 6.28, 11.04]


def typed(measure: str, *values: float) -> pd.DataFrame:
    people = [f"P{place}" for place in range(len(values))]
    return pd.DataFrame(
        {"participant": people, "measure": measure, "value": np.array(values, float), "source": "measures.csv"}
    )


def alarms(values: pd.DataFrame, selections: pd.DataFrame | None = None) -> list[Row]:
    rows = check_rows(values, selections)
    assert {row["session"] for row in rows} <= {None}
    return [row for row in rows if row["status"] != "green"]


@pytest.mark.parametrize(
    ("measure", "values", "check", "says"),
    [
        (
            "trial_time_s",
            [1008.0, 1460.0, 1439.0, 1250.0],
            "unit of time",
            "probably milliseconds; divide them by 1000",
        ),
        ("completion_time_s", [61000.0, 58000.0, 72000.0], "unit of time", "probably milliseconds"),
        ("m", [1.7e15 + 3, 1.7e15, 1.7e15 + 9e9], "unit of time", "instants, in microseconds since 1970"),
        (
            "time",
            [*TIMES, -99.0, -99.0],
            "code for missing",
            "is -99 in 2 rows (P8 and P9) and 6.28 to 11 in all others",
        ),
        ("time", [*TIMES, 999.0], "code for missing", "leave the cell empty"),
        ("time", [*TIMES, 999.0], "code for missing", "write missing: [999] in study.yaml"),
        ("ueq/q1", [1, -2, 3, -99], "code for missing", "is -99 in 1 rows"),
        ("nasa_tlx/mental", [10, 20, 15, 250], "range of the scale", "such as 250"),
        ("sus/q3", [1, 2, 5, 7], "range of the scale", "outside 1 to 5, such as 7"),
        ("sus/score", [70, 85, 102.5], "range of the scale", "outside 0 to 100, such as 102.5"),
        ("ueq/q1", [1, 7, 0, 3], "range of the scale", "outside 1 to 7, such as 0"),
        ("ueq/q1", [-3, 0, -4, 3], "range of the scale", "outside -3 to 3, such as -4"),
        ("ueq/attractiveness", [1.2, 0.4, 3.5], "range of the scale", "outside -3 to 3, such as 3.5"),
        ("ssq/nausea", [0, 3, 4], "range of the scale", "outside 0 to 3, such as 4"),
        ("ipq/sp1", [0, 6, 7], "range of the scale", "outside 0 to 6, such as 7"),
    ],
)
def test_what_is_not_what_it_is_taken_for_is_amber(measure: str, values: list[float], check: str, says: str) -> None:
    (found,) = (row for row in alarms(typed(measure, *values)) if row["check"].startswith(check))
    assert (found["check"], found["status"]) == (f"{check}: {measure}", "amber")
    assert says in found["message"]


@pytest.mark.parametrize(
    ("measure", "values"),
    [
        ("trial_time_s", [1.2, 1.4, 140.0]),
        ("completion_time_s", [1200.0, 1500.0, 900.0]),  # twenty minutes
        ("score", [90.0, 95.0, 99.0, 100.0]),
        ("bias_mm", [-99.0, -40.0, 30.0, 80.0]),
        ("nasa_tlx/effort", [0.0, 100.0, 55.0]),
        ("sus/q3", [1.0, 5.0, 3.0]),
        ("sus/score", [0.0, 100.0, 72.5]),
        ("ueq/q1", [-3.0, 3.0, 0.0]),
        ("ueq/q1", [1.0, 7.0, 4.0]),
        ("ssq/total", [0.0, 200.0, 30.0]),
        ("ssq/nausea", [0.0, 9.54, 28.62, 19.08]),  # the score of that name, not its item
        ("own/q1", [1.0, 500.0, 30.0]),
        ("steps", [1.2e9, 15.0, 1.0]),
        ("time_s", [float("nan"), float("inf"), 3.0]),
    ],
)
def test_a_slow_task_or_a_wide_scale_is_no_alarm(measure: str, values: list[float]) -> None:
    assert alarms(typed(measure, *values)) == []


def test_a_range_that_study_yaml_states_counts_more_than_the_instruments_own() -> None:
    stated = {"nasa_tlx": ScoringEntry(rule="raw_tlx", range=(0, 20)), "own": ScoringEntry(rule="mean", range=(1, 7))}
    for measure, value, limits in (("nasa_tlx/mental", 21.0, "0 to 20"), ("own/q1", 8.0, "1 to 7")):
        (row,) = (row for row in check_rows(typed(measure, 3.0, value), None, stated) if row["status"] != "green")
        assert f"outside {limits}, such as {value:g}" in row["message"]


@given(st.lists(st.floats(0.2, 60), min_size=1, max_size=30))
def test_times_of_trials_as_people_take_them_are_never_alarms(values: list[float]) -> None:
    assert alarms(typed("trial_time_s", *values)) == []


def chosen(scale: float) -> pd.DataFrame:
    target = np.array([[100.0, 50.0], [300.0, -40.0], [200.0, 10.0], [-50.0, 80.0]])
    return pd.DataFrame(
        {
            "target_x_mm": scale * target[:, 0],
            "target_y_mm": scale * target[:, 1],
            "target_z_mm": np.nan,
            "x_mm": target[:, 0] + 3,
            "y_mm": target[:, 1] - 2,
            "z_mm": np.nan,
        }
    )


def test_targets_of_another_unit_than_the_selections_are_amber() -> None:
    (found,) = alarms(typed("m", 1.0), chosen(1e-3))
    assert found["check"] == "unit of the targets"
    assert "targets are probably in metres where selections are in millimetres" in found["message"]
    (found,) = alarms(typed("m", 1.0), chosen(1e3))
    assert "selections are probably in metres where targets are in millimetres" in found["message"]
    assert alarms(typed("m", 1.0), chosen(1.0)) == []


def test_targets_with_other_axes_than_the_selections_are_amber() -> None:
    swapped = chosen(1.0)
    swapped[["target_x_mm", "target_y_mm"]] = swapped[["target_y_mm", "target_x_mm"]].to_numpy()
    (found,) = alarms(typed("m", 1.0), swapped)
    assert "the targets' x and y are exchanged" in found["message"]
    downwards = chosen(1.0)
    downwards["target_y_mm"] *= -1
    (found,) = alarms(typed("m", 1.0), downwards)
    assert "the targets' y points the other way" in found["message"]
    aside = chosen(1.0)
    aside["target_x_mm"] += 400
    (found,) = alarms(typed("m", 1.0), aside)
    assert "all targets are off by (397, 2) mm" in found["message"]


def orders(*periods: tuple[str, str, int]) -> pd.DataFrame:
    return pd.DataFrame(periods, columns=["participant", "condition", "period"]).assign(source="the measures")


def test_an_order_that_contradicts_the_dates_of_the_logs_names_who() -> None:
    stated = orders(("P1", "a", 1), ("P1", "b", 2), ("P2", "a", 1), ("P2", "b", 2))
    columns = ["participant", "condition", "start_ns"]
    began = [("P1", "a", 0), ("P1", "b", 900 * 10**9), ("P2", "a", 900 * 10**9), ("P2", "b", 0)]
    (row,) = order_rows(stated, pd.DataFrame(began, columns=columns))
    assert (row["status"], row["found"]) == ("amber", "1 of 2")
    assert "for 1 of 2 participants (P2)" in row["message"]
    as_stated = [(person, condition, place * 10**9) for place, (person, condition, _) in enumerate(began)]
    (row,) = order_rows(stated, pd.DataFrame(as_stated, columns=columns))
    assert row["status"] == "green"  # logs of the same minute, as simulated ones are, have no order


def test_codes_listed_under_missing_are_missing_values(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "".join(f"P{n},{c},time,{value}\n" for n in range(5) for c, value in (("a", 3 + n), ("b", 4 + 2 * n)))
    rows += "P5,a,time,-99\nP5,b,time,5\nP6,a,time,k. A.\nP6,b,time,-99.0\n"
    settings = "conditions: [a, b]\nmeasures: measures.csv\ncomparisons: [{measure: time, test: t_paired}]\n"
    header = {"measures.csv": f"participant,condition,measure,value\n{rows}"}
    ran = steadyhand("compare", folder(settings, **header))
    assert ran.code == 2
    assert 'found "k. A." (if that stands for a missing value, list it under `missing:` in study.yaml)' in ran.err
    ran = steadyhand("compare", folder(f"missing: [-99, k. A.]\n{settings}", **header))
    assert ran.code == 0, ran.err
    found = steadyhand.results()
    assert [row["n"] for row in found["comparisons"]] == [5]
    assert [row["check"] for row in found["checks"] if row["status"] != "green"] == []


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_milliseconds_in_a_table_are_said_on_the_console_and_the_first_page(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    header = "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm,start_s,selection_s\n"
    rows = "".join(
        f"P{person},{condition},{trial},100,50,{95 + person},{52 + trial},{2e3 * trial},{2e3 * trial + 1200 + person}\n"
        for person in range(4)
        for condition in "ab"
        for trial in (1, 2)
    )
    settings = "conditions: [a, b]\ntrials: trials.csv\ncomparisons:\n  - {measure: trial_time_s, test: t_paired}\n"
    ran = steadyhand("report", folder(settings, **{"trials.csv": header + rows}))
    assert ran.code == 0
    assert 'amber: tables: unit of time: trial_time_s: "trial_time_s" in trials.csv has a median of' in ran.out
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert page.index("divide them by 1000") < page.index('id="design"')
    (check,) = (row for row in steadyhand.results()["checks"] if row["status"] != "green")
    assert (check["session"], check["status"]) == (None, "amber")


def test_no_values_are_no_fault() -> None:
    assert check_rows(typed("time_s")[:0], None) == []
