"""How many people a report says that it is about."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.pipeline.analysis.test_options import TIMES, read, study
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("no_figures", "blank_print")

TESTS = ["measure: time_s, test: t_paired"]


def people(count: int) -> str:
    """participants.csv of so many; the women are the first ten, and of 30, the others 60."""
    rows = (f"P{at:02},{'f' if at <= 10 else 'm'},{30 if at <= 10 else 60}\n" for at in range(1, count + 1))
    return "participant,sex,age\n" + "".join(rows)


def test_people_without_values_are_listed_and_not_analysed(steadyhand: Steadyhand, tmp_path: Path) -> None:
    page = read(steadyhand, study(tmp_path / "s", TIMES, TESTS, people=people(12)))
    assert "10 participants analysed of 12 listed under 2 conditions" in page
    assert "Participants: 10 participants (10 f), aged 30 to 30 years (mean 30.0), analysed of 12 listed." in page
    assert "There were 10 participants (10 f, aged 30 to 30 years, M = 30.0) analysed of 12 listed and 2" in page
    assert steadyhand.results()["study"]["participants"]["n"] == 10


def test_who_is_not_listed_counts_where_there_are_values(steadyhand: Steadyhand, tmp_path: Path) -> None:
    page = read(steadyhand, study(tmp_path / "s", TIMES, TESTS, people=people(9)))
    assert "10 participants analysed, 9 listed under 2 conditions" in page


def test_where_all_listed_have_values_there_is_one_number(steadyhand: Steadyhand, tmp_path: Path) -> None:
    page = read(steadyhand, study(tmp_path / "s", TIMES, TESTS, people=people(10)))
    assert "10 participants under 2 conditions" in page
    assert "listed" not in page.partition("Provenance")[0]
