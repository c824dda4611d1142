"""Orders of conditions: the squares, who gets which, and the table `plan` writes."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.statistics.counterbalancing import allocated, assigned, balance, nested, williams_design
from pipeline.study.given_tables import read_participants
from pipeline.study.table_file import TableFile
from tests.pipeline.helpers import Ran, run

CONDITIONS = st.integers(2, 12)
Plan = Callable[..., Ran]


@pytest.fixture
def plan(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Plan:
    return lambda *words: run(capsys, monkeypatch, "plan", *words)


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.parametrize(
    ("conditions", "wanted"),
    [
        (4, ["ABDC", "BCAD", "CDBA", "DACB"]),
        (6, ["ABFCED", "BCADFE", "CDBEAF", "DECFBA", "EFDACB", "FAEBDC"]),
        (3, ["ABC", "BCA", "CAB", "CBA", "ACB", "BAC"]),
    ],
)
def test_the_squares_of_bradley(conditions: int, wanted: list[str]) -> None:
    """Bradley (1958), J. Am. Stat. Assoc. 53, 525: 1, 2, N, 3, N − 1, …, then each cell one more than the one above."""
    assert ["".join("ABCDEF"[at] for at in order) for order in williams_design(conditions)] == wanted


@given(conditions=CONDITIONS)
def test_each_condition_in_each_period_and_after_each_other_equally_often(conditions: int) -> None:
    design = williams_design(conditions)
    squares = 1 if conditions % 2 == 0 else 2
    assert len(design) == squares * conditions
    for order in design:
        assert sorted(order) == list(range(conditions))
    for place in range(conditions):
        assert sorted(order[place] for order in design) == sorted(list(range(conditions)) * squares)
    pairs = [pair for order in design for pair in pairwise(order)]
    assert len(set(pairs)) == conditions * (conditions - 1)
    assert {pairs.count(pair) for pair in set(pairs)} == {squares}
    assert balance(design).complete


@given(conditions=CONDITIONS, participants=st.integers(1, 60), seed=st.none() | st.integers(0, 99))
def test_any_number_of_participants_is_spread_as_evenly_as_it_can_be(
    conditions: int, participants: int, seed: int | None
) -> None:
    orders = assigned(conditions, participants, seed)
    assert len(orders) == participants
    found = balance(orders)
    assert found.period[1] - found.period[0] <= 1
    assert found.neighbours[1] - found.neighbours[0] <= (1 if conditions % 2 == 0 else 2)
    if participants % conditions == 0:
        assert found.period[0] == found.period[1] == participants // conditions
    if participants % len(williams_design(conditions)) == 0:
        assert found.complete
        assert sorted(set(orders)) == sorted(williams_design(conditions))
    assert orders == assigned(conditions, participants, seed)


@given(groups=st.integers(2, 6), participants=st.integers(1, 60), seed=st.none() | st.integers(0, 99))
def test_groups_differ_by_one_at_most_whenever_recruiting_stops(
    groups: int, participants: int, seed: int | None
) -> None:
    found = allocated(groups, participants, seed)
    for stop in range(1, participants + 1):
        sizes = [found[:stop].count(group) for group in range(groups)]
        assert max(sizes) - min(sizes) <= 1
    assert found == allocated(groups, participants, seed)


@given(conditions=st.integers(2, 4), levels=st.integers(2, 4), seed=st.none() | st.integers(0, 99))
def test_orders_of_levels_are_tied_to_neither_condition_nor_sequence(
    conditions: int, levels: int, seed: int | None
) -> None:
    """Over all sequences of conditions times all orders of levels, every pair of both comes equally often."""
    people = len(williams_design(conditions)) * len(williams_design(levels))
    orders, of_levels = assigned(conditions, people, seed), nested(conditions, levels, people, seed)
    for condition in range(conditions):
        pairs = [(order, each[condition]) for order, each in zip(orders, of_levels, strict=True)]
        assert len(set(pairs)) == people
        assert {pairs.count(pair) for pair in set(pairs)} == {1}


def test_one_condition_has_no_order() -> None:
    with pytest.raises(ValueError, match="two conditions or more, found 1"):
        williams_design(1)


def test_the_table_is_a_participants_table(plan: Plan, tmp_path: Path) -> None:
    path = tmp_path / "new" / "participants.csv"
    ran = plan("laser", "cube, red", "Größe", "object", "-n", "8", "--out", path)
    assert ran.code == 0
    assert "Counterbalancing is complete." in ran.err
    assert "Each condition is in each period 2 times, and directly follows each other one 2 times" in ran.err
    table = read_participants(TableFile(path))
    assert list(table) == ["participant", "sequence", "period_1", "period_2", "period_3", "period_4"]
    assert list(table["participant"]) == [f"P0{number}" for number in range(1, 9)]
    assert table.iloc[0]["sequence"] == "laser > cube, red > object > Größe"
    assert list(table.iloc[0])[2:] == ["laser", "cube, red", "object", "Größe"]
    assert path.read_text(encoding="utf-8") == plan("laser", "cube, red", "Größe", "object", "-n", "8").out


def test_what_counterbalancing_lacks_is_said(plan: Plan) -> None:
    ran = plan("a", "b", "c", "-n", "9")
    assert ran.code == 0
    assert "Each condition is in each period 3 times, and directly follows each other one 2 to 4 times" in ran.err
    assert "3 conditions take 6 sequences, which 9 participants cannot share evenly; 6 or 12 participants" in ran.err
    assert "which 1 participant cannot share evenly; 2 participants could" in plan("a", "b", "-n", "1").err


def test_chance_decides_within_a_square(plan: Plan) -> None:
    in_turn, drawn = (rows(plan("a", "b", "c", "d", "-n", "8", *words).out) for words in ((), ("--seed", "3")))
    sequences, shuffled = ([row["sequence"] for row in table] for table in (in_turn, drawn))
    assert shuffled != sequences
    assert sorted(shuffled[:4]) == sorted(shuffled[4:]) == sorted(sequences[:4])
    assert shuffled == [row["sequence"] for row in rows(plan("a", "b", "c", "d", "-n", "8", "--seed", "3").out)]


def test_ids_sort_as_they_count(plan: Plan) -> None:
    ids = [row["participant"] for row in rows(plan("a", "b", "-n", "100", "--prefix", "S").out)]
    assert ids == sorted(ids)
    assert ids[0] == "S001"


def test_the_conditions_of_a_study(plan: Plan, folder: Callable[..., Path]) -> None:
    root = folder("conditions: [kinect, fusion]\nmeasures: m.csv\n", **{"m.csv": "x\n"})
    assert rows(plan("--study", root, "-n", "2").out)[1]["sequence"] == "fusion > kinect"
    ran = plan("kinect", "--study", root, "-n", "2")
    assert ran.code == 2
    assert "given both on the command line and by --study; give only one of them" in ran.err


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["a"], "needs at least two conditions, found 1"),
        ([], "needs at least two conditions, found 0"),
        (["é", "e\u0301"], 'condition "é" is listed twice'),
        (["a", " "], "a condition has no name"),
        (["a", "b\x1b[2J"], "condition 'b\\x1b[2J' contains a character that cannot be printed; leave it out"),
    ],
)
def test_names_that_cannot_be_conditions(plan: Plan, names: list[str], told: str) -> None:
    ran = plan(*names, "-n", "4")
    assert ran.code == 2
    assert told in ran.err
    assert ran.out == ""


def test_a_table_that_is_there_is_not_written_over(plan: Plan, tmp_path: Path) -> None:
    path = tmp_path / "participants.csv"
    path.write_text("participant,age\nP01,31\n")
    ran = plan("a", "b", "-n", "4", "--out", path)
    assert ran.code == 2
    assert "already exists; choose another file, or remove this one" in ran.err
    assert path.read_text() == "participant,age\nP01,31\n"
