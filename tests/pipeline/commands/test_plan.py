"""`plan` with a second factor, groups of participants, blocks and targets."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.study.given_tables import read_participants
from pipeline.study.table_file import TableFile
from tests.pipeline.helpers import Ran, run

Plan = Callable[..., Ran]


@pytest.fixture
def plan(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Plan:
    return lambda *words: run(capsys, monkeypatch, "plan", *words)


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_a_second_factor_in_every_condition(plan: Plan) -> None:
    ran = plan("a", "b", "-n", "8", "--cross", "task=easy,hard", "--seed", "3")
    assert ran.code == 0
    table = rows(ran.out)
    assert list(table[0]) == ["participant", "sequence", "period_1", "period_2", "task_1", "task_2"]
    met = Counter((row[f"period_{at}"], at, row[f"task_{at}"]) for row in table for at in (1, 2))
    assert len(met) == 8  # each condition, period and order
    assert set(met.values()) == {2}
    assert "In each condition and period each level of task comes first 2 times." in ran.err
    assert plan("a", "b", "-n", "8", "--cross", "task=easy,hard", "--seed", "3").out == ran.out
    # The further factor leaves the orders of the conditions as they were.
    before = rows(plan("a", "b", "-n", "8", "--seed", "3").out)
    assert [row["sequence"] for row in table] == [row["sequence"] for row in before]


@pytest.mark.parametrize("seed", [(), ("--seed", "5")])
def test_orders_are_balanced_within_each_group(plan: Plan, tmp_path: Path, seed: tuple[str, ...]) -> None:
    path = tmp_path / "participants.csv"
    ran = plan("a", "b", "c", "-n", "12", "--between", "training=none,short", *seed, "--out", path)
    assert ran.code == 0
    assert "training: 6 none and 6 short." in ran.err
    assert ran.err.count("Counterbalancing is complete.") == 2
    table = read_participants(TableFile(path))
    for group in ("none", "short"):
        assert table[table["training"] == group]["sequence"].nunique() == 6


def test_chance_decides_the_groups_in_balanced_blocks(plan: Plan) -> None:
    words = ("a", "b", "-n", "40", "--between", "g=x,y")
    groups = [row["g"] for row in rows(plan(*words, "--seed", "1").out)]
    assert [set(groups[at : at + 2]) for at in range(0, 40, 2)] == [{"x", "y"}] * 20
    assert groups != [row["g"] for row in rows(plan(*words).out)]
    assert groups != [row["g"] for row in rows(plan(*words, "--seed", "2").out)]


def test_participants_who_meet_one_condition_each(plan: Plan) -> None:
    ran = plan("--between", "condition=A,B", "-n", "5", "--seed", "2")
    assert ran.code == 0
    assert sorted(Counter(row["condition"] for row in rows(ran.out)).values()) == [2, 3]
    assert list(rows(ran.out)[0]) == ["participant", "condition"]


def test_blocks_and_targets_have_a_table_of_their_own(plan: Plan, tmp_path: Path) -> None:
    path = tmp_path / "blocks.csv"
    words = ("a", "b", "-n", "4", "--cross", "task=easy,hard", "--blocks", "3", "--targets", "4", "--seed", "1")
    ran = plan(*words, "--schedule", path)
    assert ran.code == 0
    table = rows(path.read_text(encoding="utf-8"))
    assert list(table[0]) == ["participant", "period", "condition", "task", "block", "targets"]
    assert len(table) == 4 * 2 * 2 * 3
    first = [row for row in table if row["participant"] == "P01"]
    assert [row["period"] for row in first] == ["1"] * 6 + ["2"] * 6
    assert [row["block"] for row in first[:6]] == ["1", "2", "3"] * 2
    # The schedule says what the participants table says.
    of_table = rows(ran.out)[0]
    assert first[0]["condition"] == of_table["period_1"]
    assert f"{first[0]['task']} > {first[3]['task']}" == of_table["task_1"]
    places = Counter((place, target) for row in table for place, target in enumerate(row["targets"].split(" > ")))
    assert len(places) == 16
    assert set(places.values()) == {12}  # 48 blocks, four targets
    again = tmp_path / "again.csv"
    plan(*words, "--schedule", again)
    assert again.read_bytes() == path.read_bytes()


def test_targets_may_have_names(plan: Plan, tmp_path: Path) -> None:
    plan("a", "b", "-n", "1", "--targets", "north, south", "--schedule", tmp_path / "s.csv")
    assert {row["targets"] for row in rows((tmp_path / "s.csv").read_text())} == {"north > south", "south > north"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("a", "b"), "how many participants? Give --participants, as in -n 12"),
        (("a", "b", "-n", "4", "--cross", "easy,hard"), "needs a name and at least two levels, as in --cross task="),
        (("a", "b", "-n", "4", "--cross", "task=easy"), "needs a name and at least two levels"),
        (("a", "b", "-n", "4", "--cross", "task=x,x"), 'level "x" is listed twice'),
        (("a", "b", "-n", "4", "--cross", "period_1=x,y"), 'a factor cannot be called "period_1"'),
        (("a", "b", "-n", "4", "--cross", "g=x,y", "--between", "g=u,v"), 'are both called "g"'),
        (("a", "b", "-n", "4", "--between", "condition=x,y"), "is for participants who meet one condition each"),
        (("a", "b", "-n", "4", "--blocks", "2"), "go into a table of their own; name it, as in --schedule blocks.csv"),
        (("a", "b", "-n", "4", "--targets", "1", "--schedule", "s.csv"), "needs 2 to 100 targets, each once"),
        (("a", "b", "-n", "4", "--targets", "n,n", "--schedule", "s.csv"), "needs 2 to 100 targets, each once"),
        (("--between", "condition=x,y", "-n", "4", "--targets", "2", "--schedule", "s"), "need conditions that"),
    ],
)
def test_what_cannot_be_planned(plan: Plan, words: tuple[str, ...], message: str) -> None:
    ran = plan(*words)
    assert ran.code == 2
    assert message in ran.err
    assert ran.out == ""


def test_nothing_is_written_where_one_of_the_files_is_there(plan: Plan, tmp_path: Path) -> None:
    there, new = tmp_path / "blocks.csv", tmp_path / "participants.csv"
    there.write_text("mine\n")
    ran = plan("a", "b", "-n", "4", "--blocks", "2", "--out", new, "--schedule", there)
    assert ran.code == 2
    assert "--schedule" in ran.err
    assert "already exists; choose another file, or remove this one" in ran.err
    assert not new.exists()
    assert there.read_text() == "mine\n"
