"""Of how many sessions a mean of accuracy is, where some have no such figure."""

from __future__ import annotations

from typing import Any

from pipeline.report.sections.accuracy import of_how_many


def rows(*jitters: float | None, estimator: str = "a") -> list[dict[str, Any]]:
    return [{"estimator": estimator, "jitter_mm": jitter} for jitter in jitters]


def test_a_figure_of_every_session_needs_no_word() -> None:
    assert of_how_many(rows(1.0, 2.0), "jitter_mm", 2) == ""


def test_a_figure_of_some_says_of_how_many() -> None:
    assert of_how_many(rows(1.0, None, 2.0), "jitter_mm", 3) == ", in 2 of 3 sessions"
    two = [*rows(1.0, None, 2.0), *rows(1.0, 2.0, 3.0, estimator="b")]
    assert of_how_many(two, "jitter_mm", 3) == ", in 2 to 3 of 3 sessions"


def test_a_figure_that_none_has_is_a_dash_in_the_table() -> None:
    assert of_how_many(rows(None, None), "jitter_mm", 2) == ""
