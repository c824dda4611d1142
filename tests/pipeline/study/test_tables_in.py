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
        ("participant,condition,measure,value,value\n", 'the column "value" is listed twice'),
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
        "n": 3,
        "listed": 4,
        "sex": {"female": 2, "male": 1},
        "age": {"mean": 28.0, "min": 20.0, "max": 34.0},
    }
    absent = [e for e in steadyhand.results()["exclusions"] if e["what"] == "no data"]
    assert [(e["participant"], e["condition"]) for e in absent] == [("P4", "a"), ("P4", "b")]


def test_ids_in_either_unicode_form_are_one(folder: Folder, steadyhand: Steadyhand) -> None:
    text = GOOD.replace("P1,a", "Jose\u0301,a").replace("P1,b", "Jos\u00e9,b")
    assert steadyhand("compare", folder(SETTINGS, **{"measures.csv": text})).code == 0
    assert steadyhand.results()["comparisons"][0]["n"] == 3


TRIALS = (
    "participant,condition,trial,target_x_mm,target_y_mm,target_z_mm,selected_x_mm,selected_y_mm,selected_z_mm,"
    "start_s,selection_s\nP1,a,1,0,0,100,3,4,,0,1\nP1,a,2,0,0,100,3,4,112,2,\nP1,a,3,0,0,,3,4,7,5,4\nP1,b,1,0,0,,6,8,,0,2\n"
)


def test_what_a_trial_lacks_is_listed_and_not_taken_for_zero(folder: Folder, steadyhand: Steadyhand) -> None:
    """Trial 1 lacks a coordinate its target has, 2 has no time, 3 a negative one; the target of 3 is on a plane."""
    assert steadyhand("compare", folder("conditions: [a, b]\ntrials: trials.csv\n", **{"trials.csv": TRIALS})).code == 0
    found = {(r["measure"], r["condition"]): r["mean"] for r in steadyhand.results()["descriptives"]}
    assert found["selection_mse_mm2", "a"] == pytest.approx((25 + 144 + 25) / 2)
    assert found["selection_mse_mm2", "b"] == pytest.approx(100)
    assert found["trial_time_s", "a"] == pytest.approx(1)
    missing = {(r["what"], r["reason"]) for r in steadyhand.results()["exclusions"] if r["condition"] == "a"}
    assert ("trials without a measurable selection", "1 of the cell's trials: 1") in missing
    assert ("trials without a duration", "2 of the cell's trials: 2, 3") in missing


def test_a_missing_cell_of_a_further_factor_is_listed(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "participant,condition,measure,task,value\n" + "".join(
        f"P{p},{c},m,{t},{p}\n" for p in (1, 2) for c in "ab" for t in ("easy", "hard") if (p, c, t) != (1, "a", "hard")
    )
    assert steadyhand("compare", folder(SETTINGS, **{"measures.csv": rows})).code == 0
    entry = next(e for e in steadyhand.results()["exclusions"] if e["what"] == "missing cell")
    assert (entry["participant"], entry["condition"]) == ("P1", "a")
    assert entry["reason"] == "others have this measure at hard"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("P1,a,m,1\n", "P1,a,m,1_0\n"), '"value" should be a number, found "1_0"'),
        (
            GOOD.replace("P1,a,m,1\n", "P1,a,m,1e200\n"),
            '"value" should be a number between 1e-100 and 1e+100, found "1e200"',
        ),
        (HEAD, "measures.csv: holds no rows below its header"),
    ],
)
def test_more_that_is_refused(folder: Folder, steadyhand: Steadyhand, text: str, message: str) -> None:
    ran = steadyhand("compare", folder(SETTINGS, **{"measures.csv": text}))
    assert ran.code == 2
    assert message in ran.err


def test_an_exclusion_of_one_cell_hides_no_other_gap(folder: Folder, steadyhand: Steadyhand) -> None:
    extra = "exclusions: [{participant: P1, condition: a, reason: tired}]\n"
    text = GOOD.replace("P1,b,m,2\n", "") + "P1,b,other,1\nP2,b,other,1\n"
    assert steadyhand("compare", folder(SETTINGS + extra, **{"measures.csv": text})).code == 0
    gaps = [
        (e["participant"], e["condition"]) for e in steadyhand.results()["exclusions"] if e["what"] == "missing cell"
    ]
    assert ("P1", "b") in gaps
    assert ("P1", "a") not in gaps


def test_measure_names_in_either_unicode_form_are_one(folder: Folder, steadyhand: Steadyhand) -> None:
    settings = SETTINGS.replace("measure: m", "measure: me\u0301")
    assert steadyhand("compare", folder(settings, **{"measures.csv": GOOD.replace(",m,", ",m\u00e9,")})).code == 0


def test_a_misspelt_estimator_is_an_error_also_without_logs(folder: Folder, steadyhand: Steadyhand) -> None:
    streams = "streams: {t: {topic: /t, kind: position}}\nestimators: {e: {type: windowgp}}\n"
    ran = steadyhand("compare", folder(SETTINGS + streams, **{"measures.csv": GOOD}))
    assert ran.code == 2
    assert 'study.yaml: estimators.e: type "windowgp" is not known' in ran.err
