"""Variants side by side: their means, the intervals of these, and their order."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest

from pipeline.analysis.ranking import ranked
from pipeline.words.accuracy_reference import SMOOTHED

T_1, T_2 = 12.706204736, 4.302652730
"""The 97.5 % points of Student's t with one and two degrees of freedom, as tables print them."""


def accuracy(**figures: dict[str, list[float]]) -> pd.DataFrame:
    """Of each estimator, its figures session by session."""
    rows = [
        {"study": "s", "session": f"S{at}", "estimator": name, "variant": None, "reference": "reference"}
        | {figure: values[at] for figure, values in of_one.items()}
        for name, of_one in figures.items()
        for at in range(len(next(iter(of_one.values()))))
    ]
    found = pd.DataFrame(rows)
    for figure in ("rmse_mm", "sd_mm", "coverage_95", "lag_s", "jitter_mm"):
        if figure not in found:
            found[figure] = float("nan")
    return found


def trials(*squared_errors: tuple[str, float]) -> pd.DataFrame:
    """The trials' sessions, and how far off fusion would have been."""
    return pd.DataFrame(
        [
            {"study": "s", "session": name, "estimator": "fusion", "variant": None, "squared_error_mm2": value}
            for name, value in squared_errors
        ],
        columns=["study", "session", "estimator", "variant", "squared_error_mm2"],
    )


def test_the_least_error_comes_first_and_what_has_none_last() -> None:
    table = accuracy(far={"rmse_mm": [9.0, 11.0]}, blind={"rmse_mm": [float("nan")] * 2}, near={"rmse_mm": [4.0, 6.0]})
    rows = ranked(table, trials())
    assert [(row["estimator"], row["rank"]) for row in rows] == [("near", 1), ("far", 2), ("blind", None)]


def test_an_interval_is_students_as_far_as_a_figure_can_go() -> None:
    """Of 4 and 6 it is 5 ± 12.7 · √2 / √2, which no error is below 0 for; of 5, 6 and 7 it is 6 ± 4.30 / √3."""
    (row,) = ranked(
        accuracy(fusion={"rmse_mm": [4.0, 6.0], "coverage_95": [0.9, 1.0], "lag_s": [-0.01, 0.01]}), trials()
    )
    assert (row["rmse_mm"], row["rmse_low_mm"], row["coverage_high_95"]) == (5.0, 0.0, 1.0)
    assert row["rmse_high_mm"] == pytest.approx(5 + T_1)
    assert row["coverage_low_95"] == pytest.approx(max(0.95 - T_1 * 0.05, 0.0))
    assert row["lag_low_s"] == pytest.approx(-T_1 * 0.01)
    (row,) = ranked(accuracy(fusion={"rmse_mm": [5.0, 6.0, 7.0]}), trials())
    assert row["rmse_low_mm"] == pytest.approx(6 - T_2 / 3**0.5)


def test_a_session_counts_once_however_many_trials_it_has() -> None:
    """Mean squared errors 4 and 16 of two sessions: √10; over trials it would be √7."""
    table = accuracy(fusion={"rmse_mm": [1.0, 2.0]})
    (row,) = ranked(table, trials(("S0", 1.0), ("S0", 2.0), ("S0", 9.0), ("S1", 16.0), ("S2", float("nan"))))
    assert row["selection_n"] == 2
    assert row["selection_rmse_mm"] == pytest.approx(10**0.5)
    assert row["selection_rmse_low_mm"] == 0.0
    assert row["selection_rmse_high_mm"] == pytest.approx((10 + T_1 * 6) ** 0.5)


def test_smoothed_readings_rank_nothing() -> None:
    table = accuracy(far={"rmse_mm": [9.0]}, near={"rmse_mm": [4.0]})
    table["reference"] = SMOOTHED
    rows: list[dict[str, Any]] = ranked(table, trials())
    assert [(row["estimator"], row["rank"]) for row in rows] == [("far", None), ("near", None)]
