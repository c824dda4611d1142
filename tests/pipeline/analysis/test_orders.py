"""Periods from what the logs say of their order, and what is left open where a condition was met twice."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from pipeline.analysis.orders import LOGS, MEASURES, gathered, with_periods
from pipeline.study.session import Session
from pipeline.tables import table as tables

NO_SEQUENCES = tables.frame("sequences", [])


def test_the_first_condition_of_an_order_in_a_log_has_period_1() -> None:
    """Whether a log holds the whole order by name or its own place in it."""
    sessions = [Session(f"P1_{condition}", "P1", condition, Path(f"P1_{condition}.mcap")) for condition in "abc"]
    for facts in (["c > a > b"] * 3, ["2", "3", "1"]):
        rows = [{"session": session.id, "order": fact} for session, fact in zip(sessions, facts, strict=True)]
        orders, _ = gathered(["a", "b", "c"], sessions, pd.DataFrame(rows), None, None)
        found = dict(zip(orders["condition"], orders["period"], strict=True))
        assert found == {"a": 2, "b": 3, "c": 1}
        assert set(orders["source"]) == {LOGS}


def test_a_value_of_a_condition_that_was_met_twice_has_no_period_of_its_own() -> None:
    """P1 met a in the first and in the third period: a value of a alone may be of either."""
    met = [("a", 1), ("b", 2), ("a", 3)]
    rows = [{"participant": "P1", "condition": name, "period": at, "source": MEASURES} for name, at in met]
    values = pd.DataFrame({"participant": ["P1"] * 2, "condition": ["a", "b"], "session": None, "period": None})
    found = with_periods(values, tables.frame("orders", rows), NO_SEQUENCES)
    assert found["period"].isna().tolist() == [True, False]
    assert found["period"].iloc[1] == 2
    assert found["sequence"].tolist() == ["a, b, a"] * 2
