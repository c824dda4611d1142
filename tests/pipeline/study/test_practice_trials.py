"""Trials that do not count: practice, and those that study.yaml leaves out."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from tests.pipeline.helpers import Steadyhand
from tests.pipeline.study.kept_tables import CASES, Folder, copied, means, proposed, squared_errors

pytestmark = pytest.mark.usefixtures("one_cache")


def practice_trials() -> pd.DataFrame:
    return pd.read_csv(CASES / "practice" / "trials.csv")


@pytest.mark.parametrize("key", ["practice: {column: practice}", "practice: {trials: 2}"])
def test_practice_trials_count_nowhere_and_are_listed(tmp_path: Path, steadyhand: Steadyhand, key: str) -> None:
    study = copied("practice", tmp_path, key=key)
    assert steadyhand("compare", study).code == 0
    kept = practice_trials().query("practice == 0")
    assert means(steadyhand, "selection_mse_mm2") == pytest.approx(squared_errors(kept).to_dict(), rel=1e-12)
    rows = steadyhand.results()["exclusions"]
    assert {(r["participant"], r["condition"], r["reason"]) for r in rows if r["what"] == "practice trials"} == {
        (person, condition, "left out, as study.yaml says under practice: 1, 2")
        for person in practice_trials()["participant"].unique()
        for condition in ("kinect", "fusion")
    }


def test_a_column_that_marks_practice_is_pointed_out(tmp_path: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("compare", copied("practice", tmp_path))
    assert ran.code == 0
    assert proposed(ran.out) == ["practice: {column: practice}"]


def test_a_trial_is_left_out_and_listed_with_its_number(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """The case excludes trial 1 of P01, which is in both conditions and both sessions."""
    assert steadyhand("compare", copied("practice", tmp_path)).code == 0
    trials = practice_trials()
    kept = trials[~((trials["participant"] == "P01") & (trials["trial"] == 1))]
    assert means(steadyhand, "selection_mse_mm2") == pytest.approx(squared_errors(kept).to_dict(), rel=1e-12)
    (row,) = (r for r in steadyhand.results()["exclusions"] if r["what"] == "excluded in study.yaml")
    assert (row["participant"], row["reason"]) == ("P01", "trial 1: practice")


def test_a_trial_of_everybody_can_be_left_out_and_one_that_is_not_there_is_an_error(
    tmp_path: Path, steadyhand: Steadyhand
) -> None:
    study = copied("practice", tmp_path)
    path = study / "study.yaml"
    settings = path.read_text(encoding="utf-8")
    path.write_text(settings.replace("participant: P01, ", ""), encoding="utf-8")
    assert steadyhand("compare", study).code == 0
    kept = practice_trials().query("trial != 1")
    assert means(steadyhand, "selection_mse_mm2") == pytest.approx(squared_errors(kept).to_dict(), rel=1e-12)
    path.write_text(settings.replace("trial: 1", "trial: 99"), encoding="utf-8")
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert 'study.yaml: exclusions: there is no trial "99" in the data' in ran.err


def test_practice_that_nothing_marks_is_an_error(tmp_path: Path, steadyhand: Steadyhand) -> None:
    study = copied("practice", tmp_path, key="practice: {column: warmup}")
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert 'neither the trials nor the measures have a column "warmup"' in ran.err


def test_practice_trials_of_the_measures_are_left_out_too(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "participant,condition,trial,measure,value\n" + "".join(
        f"{person},{condition},{trial},m,{100 if trial == 1 else 1}\n"
        for person in (1, 2)
        for condition in "ab"
        for trial in (1, 2, 3)
    )
    settings = "conditions: [a, b]\nmeasures: measures.csv\npractice: {trials: 1}\n"
    assert steadyhand("compare", folder(settings, **{"measures.csv": rows})).code == 0
    assert means(steadyhand, "m") == {"a": 1.0, "b": 1.0}
