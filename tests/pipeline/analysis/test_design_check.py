"""The order in which conditions were met, from wherever it is told, and what the check of a design says of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import permutations
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.analysis.orders import conditions_in_order
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.reference import study_of, the

Folder = Callable[..., Path]
Row = dict[str, Any]

SQUARE = ["ABDC", "BCAD", "CDBA", "DACB"]
"""A balanced Latin square of four (Williams 1949)."""


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("fusion > kinect", ["fusion", "kinect"]),
        ("fusion,kinect", ["fusion", "kinect"]),
        ("KF", ["kinect", "fusion"]),
        ("f-k", ["fusion", "kinect"]),
        ("kinectfusion", ["kinect", "fusion"]),
        ("group 1", None),
        ("kinect", None),
        ("KFK", None),
        ("", None),
    ],
)
def test_a_sequence_lists_conditions_or_their_letters_or_is_a_label(text: str, found: list[str] | None) -> None:
    assert conditions_in_order(text, ["kinect", "fusion"]) == found


def test_a_condition_within_anothers_name_is_not_taken_for_it() -> None:
    assert conditions_in_order("gp fusion, gp", ["gp", "gp fusion"]) == ["gp fusion", "gp"]
    assert conditions_in_order("GF", ["gp", "gp fusion"]) is None


@given(order=st.permutations(["kinect", "fusion", "raw", "1€"]), between=st.sampled_from([" > ", ", ", "-", ";", "→"]))
def test_every_order_of_conditions_is_read_back(order: list[str], between: str) -> None:
    assert conditions_in_order(between.join(order), ["kinect", "fusion", "raw", "1€"]) == order
    assert conditions_in_order("".join(name[0] for name in order), ["kinect", "fusion", "raw", "1€"]) == order


def checked(
    folder: Folder,
    steadyhand: Steadyhand,
    orders: Sequence[str],
    participants: str | None = None,
    *,
    period: bool = True,
    conditions: str = "ABCD",
) -> list[Row]:
    """The rows of design_check for people who met conditions, a letter each, in these orders."""
    lines = ["participant,condition,measure,value" + (",period" if period else "")]
    for person, order in enumerate(orders, 1):
        for place, condition in enumerate(order, 1):
            value = 10 + ord(condition) + (person * 7 + place * person) % 5
            lines.append(f"P{person:02d},{condition},m,{value}" + (f",{place}" if period else ""))
    settings = f"conditions: [{', '.join(conditions)}]\nmeasures: measures.csv\n"
    settings += "comparisons: [{measure: m, test: friedman}]\n"
    files = {"measures.csv": "\n".join(lines) + "\n"}
    if participants is not None:
        settings += "participants: participants.csv\n"
        files["participants.csv"] = participants
    ran = steadyhand("compare", folder(settings, **files))
    assert ran.code == 0, ran.err
    rows: list[Row] = steadyhand.results()["design_check"]
    return rows


def test_a_balanced_square_calls_for_no_remark_on_its_order(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = checked(folder, steadyhand, SQUARE * 3)
    assert the(rows, what="order of the conditions")["found"] == "known for 12 of 12 participants"
    for condition in "ABCD":
        row = the(rows, what="times in each period", condition=condition)
        assert (row["found"], row["expected"], row["remark"]) == ("3, 3, 3, 3", "3 in each", None)
    row = the(rows, what="times each condition comes just before each other")
    assert (row["found"], row["expected"], row["remark"]) == ("3", "3", None)
    for what in ("effect of the period", "carry-over"):
        row = the(rows, what=what)
        assert row["statistic_name"] == "F"
        assert 0 <= row["p"] <= 1


def test_rotation_alone_balances_the_periods_and_not_what_came_before(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = checked(folder, steadyhand, ["ABCD", "BCDA", "CDAB", "DABC"] * 2)
    assert the(rows, what="times in each period", condition="A")["remark"] is None
    row = the(rows, what="times each condition comes just before each other")
    assert (row["found"], row["remark"]) == ("0 to 6", "not balanced for the preceding condition")


def test_one_order_for_everybody_is_not_balanced_and_leaves_nothing_to_test(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    rows = checked(folder, steadyhand, ["AB"] * 6, conditions="AB")
    assert the(rows, what="times in each period", condition="A")["found"] == "6, 0"
    assert the(rows, what="times in each period", condition="A")["remark"] == "not balanced over the periods"
    for what in ("effect of the period", "carry-over"):
        row = the(rows, what=what)
        assert (row["found"], row["p"]) == ("undefined: everybody met the conditions in the same order", None)


def test_an_odd_participant_out_is_as_balanced_as_can_be(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = checked(folder, steadyhand, ["AB", "BA", "AB", "BA", "AB"], conditions="AB")
    row = the(rows, what="times in each period", condition="B")
    assert (row["found"], row["expected"], row["remark"]) == ("2, 3", "2 or 3 in each", None)


def test_an_order_that_is_not_known_is_said(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = checked(folder, steadyhand, SQUARE, period=False)
    row = the(rows, what="order of the conditions")
    assert (row["found"], row["remark"]) == (
        "not known",
        "whether orders were balanced, and whether they mattered, cannot be checked",
    )
    assert not [row for row in rows if row["what"] == "times in each period"]


@pytest.mark.parametrize(
    "table",
    [
        "participant,sequence\nP01,A > B\nP02,BA\nP03,AB\nP04,B A\n",
        "participant,period_1,period_2\nP01,A,B\nP02,B,A\nP03,A,B\nP04,B,A\n",
        "participant,sequence,period_1,period_2\nP01,one,A,B\nP02,two,B,A\nP03,one,A,B\nP04,two,B,A\n",
    ],
)
def test_the_participants_table_says_the_order(folder: Folder, steadyhand: Steadyhand, table: str) -> None:
    rows = checked(folder, steadyhand, ["AB", "BA", "AB", "BA"], table, period=False, conditions="AB")
    assert the(rows, what="order of the conditions")["found"] == "known for 4 of 4 participants"
    assert the(rows, what="times in each period", condition="A")["found"] == "2, 2"


def test_what_was_run_counts_where_the_plan_was_another(folder: Folder, steadyhand: Steadyhand) -> None:
    plan = "participant,sequence\nP01,AB\nP02,AB\nP03,BA\nP04,AB\n"
    rows = checked(folder, steadyhand, ["AB", "BA", "AB", "BA"], plan, conditions="AB")
    row = next(row for row in rows if row["expected"] == "one order")
    assert row["found"] == "the measures and the participants table differ for P02, P03 and P04"
    assert row["remark"] == "the measures are used"
    assert the(rows, what="times in each period", condition="A")["found"] == "2, 2"


def test_a_period_that_names_no_condition_is_an_error(folder: Folder, steadyhand: Steadyhand) -> None:
    files = {
        "measures.csv": "participant,condition,measure,value\nP1,A,m,1\nP1,B,m,2\n",
        "participants.csv": "participant,period_1\nP1,fusoin\n",
    }
    settings = "conditions: [A, B]\nmeasures: measures.csv\nparticipants: participants.csv\n"
    ran = steadyhand("compare", folder(settings, **files))
    assert ran.code == 2
    assert 'row 2: "period_1": condition "fusoin" is not in study.yaml; known: A, B' in ran.err


def test_a_participant_with_two_sequences_is_an_error(folder: Folder, steadyhand: Steadyhand) -> None:
    text = "participant,condition,measure,value,sequence\nP1,A,m,1,AB\nP1,B,m,2,BA\n"
    ran = steadyhand("compare", folder("conditions: [A, B]\nmeasures: m.csv\n", **{"m.csv": text}))
    assert ran.code == 2
    assert 'the measures: participant "P1" has the sequences "AB" and "BA"; give each participant one' in ran.err


def test_a_period_that_is_no_number_is_an_error(folder: Folder, steadyhand: Steadyhand) -> None:
    text = "participant,condition,measure,value,period\nP1,A,m,1,1\nP1,B,m,2,0\n"
    ran = steadyhand("compare", folder("conditions: [A, B]\nmeasures: m.csv\n", **{"m.csv": text}))
    assert ran.code == 2
    assert 'row 3: "period" should be 1 for what came first, 2 for what came next, and so on, found "0"' in ran.err


def test_the_logs_say_the_order_and_how_many_sessions_and_trials_there_are(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    root = folder(
        "conditions: [a, b]\nsessions: '{session}.mcap'\n"
        "comparisons: [{measure: selection_mse_mm2, test: mixed_model, fixed: [condition, period]}]\n" + STREAMS
    )
    for person in (1, 2, 3, 4):
        for place, condition in enumerate("ab" if person % 2 else "ba", 1):
            facts = {"participant": f"P{person}", "condition": condition, "order": str(place)}
            messages = session_messages(3.5, bias_mm=person * place)
            write_session(root / f"{person}{condition}.mcap", messages, **facts)
    write_session(root / "1c.mcap", session_messages(3.5), participant="P1", condition="a", order="3")
    ran = steadyhand("compare", root)
    assert ran.code == 0, ran.err
    rows = steadyhand.results()["design_check"]
    row = the(rows, what="sessions in each cell")
    assert (row["found"], row["remark"]) == ("1 to 2", "values of several sessions are pooled: P1 in a")
    row = the(rows, what="trials in each cell")
    assert (row["found"], row["expected"]) == ("2 to 4", "the same in each")
    assert "unequal" in row["remark"]
    row = the(rows, what="order of the conditions")
    assert row["found"] == "known for 3 of 4 participants"
    assert row["remark"] == "not known in full, with each condition once, for P1"
    (condition, period) = steadyhand.results()["comparisons"]
    assert condition["details"]["n_observations"] == 9  # P1 has two sessions of one condition, in two periods
    assert period["effect"] == "period"


def test_who_lacks_a_condition_is_counted(folder: Folder, steadyhand: Steadyhand) -> None:
    study = study_of(folder, "missing_cell_3cond_n10", "main", ["A", "B", "C"], ["test: friedman"])
    assert steadyhand("compare", study).code == 0
    row = the(steadyhand.results()["design_check"], what="participants with every condition")
    assert (row["measure"], row["found"], row["expected"]) == ("m", "8", "10")
    assert row["remark"]


def test_values_in_each_cell_are_counted_where_a_measure_has_several(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "".join(f"P{p},{c},m,{p * t},{t}\n" for p in (1, 2, 3) for c in "ab" for t in range(1, 3 + (p == 2)))
    settings = "conditions: [a, b]\nmeasures: m.csv\ncomparisons: [{measure: m, test: wilcoxon}]\n"
    study = folder(settings, **{"m.csv": f"participant,condition,measure,value,trial\n{rows}"})
    assert steadyhand("compare", study).code == 0
    row = the(steadyhand.results()["design_check"], what="values in each cell")
    assert (row["measure"], row["found"]) == ("m", "2 to 3")
    assert "unequal" in row["remark"]


def test_one_condition_has_no_design_to_check(folder: Folder, steadyhand: Steadyhand) -> None:
    text = "participant,condition,measure,value\nP1,a,m,1\nP2,a,m,2\n"
    assert steadyhand("compare", folder("conditions: [a]\nmeasures: m.csv\n", **{"m.csv": text})).code == 0
    assert steadyhand.results()["design_check"] == []


def test_the_period_and_carry_over_of_the_references(folder: Folder, steadyhand: Steadyhand) -> None:
    """lmerTest's F of period and carry-over (Williams), and R's t tests of the 2 × 2 crossover."""
    for case, conditions, period, carry_over in (
        ("williams_4cond_n12", "ABDC", 0.017063829005042, 0.158562438841034),
        ("crossover_2x2_n12", ["kinect", "fusion"], 0.00249388667391974, 0.789249379263514),
    ):
        assert steadyhand("compare", study_of(folder, case, "main", list(conditions), ["test: rm_anova"])).code == 0
        rows = steadyhand.results()["design_check"]
        assert the(rows, what="effect of the period")["p"] == pytest.approx(period, rel=1e-3)
        assert the(rows, what="effect of the period")["remark"] == "values change with the period"
        assert the(rows, what="carry-over")["p"] == pytest.approx(carry_over, rel=1e-3)
        assert the(rows, what="carry-over")["remark"] is None


@pytest.mark.parametrize("count", [2, 3])
def test_all_permutations_are_balanced(folder: Folder, steadyhand: Steadyhand, count: int) -> None:
    orders = ["".join(order) for order in permutations("ABC"[:count])]
    rows = checked(folder, steadyhand, orders * 2, conditions="ABC"[:count])
    assert not [row for row in rows if row["remark"] and "balanced" in row["remark"]]
