"""Printed totals between the ones that whole scores of people can give."""

from __future__ import annotations

import pytest

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import AGREEMENT, CONTRADICTION
from pipeline.study.printed import Publication


def verdict(total: dict[str, str], second_step: str = "1") -> str:
    """Of 12 people's means of 7.2 and 11.3: whole scores that add up to 86 or 87, and to 135 or 136."""
    measures = [
        {"name": "m 1", "scale": {"step": "1"}, "cells": {"a": {"mean": "7.2"}}},
        {"name": "m 2", "scale": {"step": second_step}, "cells": {"a": {"mean": "11.3"}}},
    ]
    totals = [{"label": "t", "measures": "m *", "condition": "a", **total}]
    content = {"source": "a paper", "n": 12, "measures": measures, "totals": totals}
    (found,) = (finding for finding in audit(Publication.model_validate(content)) if finding.check == "total")
    return found.verdict


@pytest.mark.parametrize(
    ("total", "expected"),
    [
        ({"sum": "222"}, AGREEMENT),
        ({"sum": "222.0"}, AGREEMENT),
        ({"sum": "222.5"}, CONTRADICTION),
        ({"mean": "18.50"}, AGREEMENT),  # 222 / 12
        ({"mean": "18.58"}, AGREEMENT),  # 223 / 12
        ({"mean": "18.45"}, CONTRADICTION),
        ({"average": "9.25"}, AGREEMENT),  # 222 / 24
        ({"average": "9.23"}, CONTRADICTION),
    ],
)
def test_a_total_between_two_possible_ones_is_a_contradiction(total: dict[str, str], expected: str) -> None:
    """In all they add up to 221, 222 or 223."""
    assert verdict(total) == expected


def test_half_steps_of_one_scale_leave_half_sums_open() -> None:
    assert verdict({"sum": "222.5"}, second_step="0.5") == AGREEMENT
