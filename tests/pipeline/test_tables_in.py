"""The study's own CSV tables: the message for each fault, and what is listed rather than lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]
SETTINGS = """
title: T
conditions: [a, b]
measures: measures.csv
comparisons: [{measure: m, test: t_paired}]
"""
HEAD = "participant,condition,measure,value\n"
GOOD = HEAD + "P1,a,m,1\nP1,b,m,2\nP2,a,m,4\nP2,b,m,1\nP3,a,m,5\nP3,b,m,2.5\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            GOOD + "P1,a,m,3\n",
            "measures.csv: rows 2, 8 are duplicates (participant P1, condition a, measure m); keep one",
        ),
        (GOOD + "P4,a,m,fast\n", 'measures.csv, row 8: "value" should be a number, found "fast"'),
        (GOOD + 'P4,a,m,"1,5"\n', "(a decimal comma? use a point)"),
        (GOOD + "P4,c,m,1\n", 'measures.csv, row 8: condition "c" is not in study.yaml'),
        (GOOD + "P4,a,m\n", "measures.csv, row 8: has 3 cells, the first line 4"),
        (GOOD + ",a,m,1\n", 'measures.csv, row 8: "participant" is empty'),
        (
            "participant,condition,measure\nP1,a,m\n",
            'the column "value" is missing; found: participant, condition, measure',
        ),
        ("participant,condition,measure,value,value\n", 'the column "value" stands there twice'),
        ("participant;condition;measure;value\n", 'the column "participant" is missing; found: participant;condition'),
        ("", "measures.csv: is empty"),
        ("\ufffe\x00", "measures.csv"),
    ],
)
def test_a_fault_in_a_table_is_named_with_its_row(
    folder: Folder, steadyhand: Steadyhand, text: str, message: str
) -> None:
    ran = steadyhand("compare", folder(SETTINGS, **{"measures.csv": text}))
    assert ran.code == 2
    assert message in ran.err


def test_a_misspelt_column_of_trials_is_an_error(folder: Folder, steadyhand: Steadyhand) -> None:
    trials = "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_ymm\n"
    ran = steadyhand("compare", folder("conditions: [a]\ntrials: trials.csv\n", **{"trials.csv": trials}))
    assert ran.code == 2
    assert 'the column "selected_y_mm" is missing' in ran.err


@pytest.mark.parametrize("cell", ["", "NaN", "inf", "-inf", "NA"])
def test_a_cell_without_a_finite_number_is_listed_and_its_participant_left_out(
    folder: Folder, steadyhand: Steadyhand, cell: str
) -> None:
    ran = steadyhand("compare", folder(SETTINGS, **{"measures.csv": GOOD.replace("P1,b,m,2\n", f"P1,b,m,{cell}\n")}))
    assert ran.code == 0
    (row,) = steadyhand.results()["comparisons"]
    assert row["n"] == 2
    listed = [(entry["participant"], entry["what"]) for entry in steadyhand.results()["exclusions"]]
    assert ("P1", "infinite value" if "inf" in cell else "missing value") in listed
    assert ("P1", "left out of comparisons") in listed


def test_a_participant_with_a_missing_cell_is_listed(folder: Folder, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", folder(SETTINGS, **{"measures.csv": GOOD.replace("P2,b,m,1\n", "")}))
    assert ran.code == 0
    assert steadyhand.results()["comparisons"][0]["n"] == 2
    entry = next(e for e in steadyhand.results()["exclusions"] if e["what"] == "left out of comparisons")
    assert entry["participant"] == "P2"
    assert entry["reason"] == "t_paired: no value in b"


def test_an_exclusion_is_applied_and_listed_and_a_misspelt_one_is_an_error(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    extra = "exclusions: [{participant: P1, reason: left early}]\n"
    assert steadyhand("compare", folder(SETTINGS + extra, **{"measures.csv": GOOD})).code == 0
    assert steadyhand.results()["comparisons"][0]["n"] == 2
    assert steadyhand.results()["exclusions"][0]["reason"] == "left early"
    ran = steadyhand("compare", folder(SETTINGS + extra.replace("P1", "P9"), **{"measures.csv": GOOD}))
    assert ran.code == 2
    assert 'there is no participant "P9" in the data' in ran.err


def test_a_comparison_of_an_unknown_measure_is_an_error(folder: Folder, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", folder(SETTINGS.replace("measure: m", "measure: mm"), **{"measures.csv": GOOD}))
    assert ran.code == 2
    assert 'there is no measure "mm" in the data; did you mean "m"?' in ran.err


def test_participants_give_number_sex_and_age(folder: Folder, steadyhand: Steadyhand) -> None:
    people = "participant,sex,age\nP1,female,20\nP2,male,30\nP3,female,34\nP4,female,40\n"
    root = folder(SETTINGS + "participants: participants.csv\n", **{"measures.csv": GOOD, "participants.csv": people})
    assert steadyhand("compare", root).code == 0
    assert steadyhand.results()["study"]["participants"] == {
        "n": 4,
        "sex": {"female": 3, "male": 1},
        "age": {"mean": 31.0, "min": 20.0, "max": 40.0},
    }
    absent = [e for e in steadyhand.results()["exclusions"] if e["what"] == "no data"]
    assert [(e["participant"], e["condition"]) for e in absent] == [("P4", "a"), ("P4", "b")]


def test_ids_in_either_unicode_form_are_one(folder: Folder, steadyhand: Steadyhand) -> None:
    text = GOOD.replace("P1,a", "Jose\u0301,a").replace("P1,b", "Jos\u00e9,b")
    assert steadyhand("compare", folder(SETTINGS, **{"measures.csv": text})).code == 0
    assert steadyhand.results()["comparisons"][0]["n"] == 3
