"""What is not there, and is said to be missing or to have been left out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.conftest import write_session
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]
Row = dict[str, Any]

TRIALS = """
conditions: [A, B]
trials: trials.csv
comparisons: [{measure: trial_time_s, test: t_paired}]
"""
HEADER = "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm,start_s,selection_s\n"


def exclusions(steadyhand: Steadyhand, study: Path) -> list[Row]:
    ran = steadyhand("compare", study)
    assert ran.code == 0, ran.err
    rows: list[Row] = steadyhand.results()["exclusions"]
    return rows


def trials(*lacking: tuple[str, str, int]) -> str:
    """Two trials in each condition; those of `lacking` have no selected point."""
    lines = [
        f"{person},{condition},{trial},0,0,{'3,4' if (person, condition, trial) not in lacking else ','},{trial},"
        f"{trial + 0.5 + 0.1 * number + 0.05 * number * (condition == 'B')}"
        for number, person in enumerate(("P1", "P2", "P3"))
        for condition in "AB"
        for trial in (1, 2)
    ]
    return HEADER + "\n".join(lines) + "\n"


def test_trials_without_a_selection_are_counted_by_cell(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder(TRIALS, **{"trials.csv": trials(("P2", "B", 1))})
    (row,) = exclusions(steadyhand, study)
    assert row["what"] == "trials without a measurable selection"
    assert (row["participant"], row["condition"], row["measure"]) == ("P2", "B", "selection_mse_mm2")


def test_a_study_that_measures_no_selections_lacks_none(folder: Folder, steadyhand: Steadyhand) -> None:
    everything = [(person, condition, trial) for person in ("P1", "P2", "P3") for condition in "AB" for trial in (1, 2)]
    assert exclusions(steadyhand, folder(TRIALS, **{"trials.csv": trials(*everything)})) == []


def test_somebody_who_is_not_in_participants_csv_is_kept_and_named(folder: Folder, steadyhand: Steadyhand) -> None:
    """And who is listed there and has no data is named as such."""
    settings = TRIALS + "participants: participants.csv\n"
    files = {"trials.csv": trials(), "participants.csv": "participant\nP1\nP2\nP4\n"}
    found = {(row["participant"], row["what"]) for row in exclusions(steadyhand, folder(settings, **files))}
    assert ("P3", "not in participants") in found
    assert "P1" not in {participant for participant, _ in found}
    assert {what for participant, what in found if participant == "P4"}.isdisjoint({"not in participants"})
    assert "P4" in {participant for participant, _ in found}


def test_the_exclusion_of_a_session_explains_no_other_cell_that_is_empty(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    """P3 has no session of b, and nothing that study.yaml leaves out is the reason."""
    study = folder(
        "conditions: [a, b]\nsessions: '{participant}_{condition}.mcap'\nevents: {topic: /events}\n"
        "exclusions: [{session: P2_a, reason: dropped the phone}]\n"
        "comparisons: [{measure: selection_mse_mm2, test: t_paired}]\n"
    )
    for name in ("P1_a", "P1_b", "P2_a", "P2_b", "P3_a", "P4_a", "P4_b"):
        write_session(study / f"{name}.mcap")
    rows = exclusions(steadyhand, study)
    assert any(row["participant"] == "P3" and row["condition"] == "b" for row in rows), rows
