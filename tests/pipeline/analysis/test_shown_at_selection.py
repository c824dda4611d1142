"""What each estimator would have shown when people selected: a root of a mean over people, each with one value."""

from __future__ import annotations

import pytest

from pipeline.analysis.compare import shown_at_selection
from pipeline.study.settings import Study
from pipeline.tables import table as tables

STUDY = Study.model_validate({"conditions": ["a"], "measures": "m.csv"})


def trial(participant: str, estimator: str, squared_error_mm2: float | None) -> dict[str, object]:
    return {
        "participant": participant,
        "condition": "a",
        "estimator": estimator,
        "squared_error_mm2": squared_error_mm2,
    }


def test_people_count_alike_however_many_trials_they_have() -> None:
    """Mean squared errors of 4 and 16 mm²: √10, not √8.8 over all trials, nor 3 as the mean of roots."""
    rows = [trial("P1", "fusion", error) for error in (0.0, 8.0, 4.0)] + [trial("P2", "fusion", 16.0)]
    rows += [trial("P2", "fusion", None), trial("P1", "recorded", 1.0)]
    found = shown_at_selection(STUDY, tables.frame("trials", rows))
    (row,) = (row for row in found if row["estimator"] == "fusion")
    assert row["n"] == 2
    assert row["rmse_mm"] == pytest.approx(10**0.5)


def test_nothing_is_said_where_only_what_was_recorded_is_known() -> None:
    assert shown_at_selection(STUDY, tables.frame("trials", [trial("P1", "recorded", 1.0)])) == []
