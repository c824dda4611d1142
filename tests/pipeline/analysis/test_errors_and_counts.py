"""Errors and counts through a study folder: McNemar, Cochran's Q, and generalized estimating equations.

The data and what R computes of them are those of the tests of the functions themselves (geepack, clubSandwich, coin).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.pipeline import r_reference
from tests.pipeline.analysis.test_options import read
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("blank_figures", "blank_print")

BINARY, CLUSTERED = r_reference.expected("binary"), r_reference.expected("clustered")
FIT = 1e-6  # where R's and statsmodels' iterations stop


def study(folder: Path, case: str, entries: Sequence[str], file: str, values: Mapping[str, str]) -> Path:
    """A study folder of an R case: `values` are measures by the column of the case's data that has them."""
    folder.mkdir()
    rows = [row for row in r_reference.rows(file) if row["case"] == case]
    conditions = sorted({row["condition"] for row in rows})
    lines = ["participant,condition,measure,trial,value"]
    for measure, column in values.items():
        seen: dict[tuple[str, str], int] = {}
        for row in rows:
            cell = row["participant"], row["condition"]
            seen[cell] = seen.get(cell, 0) + 1
            lines.append(f"{','.join(cell)},{measure},{seen[cell]},{row[column]}")
    (folder / "measures.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    comparisons = "".join(f"  - {{{entry}}}\n" for entry in entries)
    text = f"conditions: [{', '.join(conditions)}]\nmeasures: measures.csv\ncomparisons:\n{comparisons}"
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    return folder


def binary(folder: Path, case: str, *tests: str) -> Path:
    return study(folder, case, [f"measure: missed, test: {test}" for test in tests], "binary", {"missed": "answer"})


def clustered(folder: Path, case: str, *entries: str) -> Path:
    values = {"missed": "outcome", "observed_s": "exposure"}
    return study(folder, case, [f"measure: missed, test: {entry}" for entry in entries], "clustered", values)


def results(steadyhand: Steadyhand) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = steadyhand.results()["comparisons"]
    return rows


@pytest.mark.parametrize("case", ["two_n14", "two_one_way"])
def test_mcnemar_through_a_study(tmp_path: Path, steadyhand: Steadyhand, case: str) -> None:
    page = read(steadyhand, binary(tmp_path / "study", case, "mcnemar"))
    (row,), wanted = results(steadyhand), BINARY[case]
    assert (row["statistic"], row["details"]["c"]) == (wanted["b"], wanted["c"])
    assert row["p"] == pytest.approx(wanted["p"], rel=1e-9)
    first, second = row["details"]["proportion_first"], row["details"]["proportion_second"]
    assert row["mean_difference"] == pytest.approx(first - second)
    points = f"{abs(100 * (first - second)):.1f} percentage points"
    assert points in page
    assert f"{100 * first:.1f} %" in page
    assert f"McNemar's test, b = {wanted['b']}, c = {wanted['c']}, p = " in page
    assert "treat yes and no as measurements" not in page
    if wanted["c"]:
        assert f"OR = {wanted['b'] / wanted['c']:.2f}, 95 % CI [" in page
    else:
        assert "no finite odds ratio: nobody's answer changed in the other direction" in page
    assert "mcnemar1947" in (steadyhand.out / "references.bib").read_text(encoding="utf-8")


def test_cochrans_q_is_followed_up_by_mcnemars_tests(tmp_path: Path, steadyhand: Steadyhand) -> None:
    page = read(steadyhand, binary(tmp_path / "study", "three_n10", "cochran_q"))
    whole, *pairs = results(steadyhand)
    wanted = BINARY["three_n10"]
    assert (whole["statistic"], whole["p"]) == pytest.approx((wanted["Q"], wanted["exact_p"]), rel=1e-9)
    assert [row["contrast"] for row in pairs] == ["1 - 2", "1 - 3", "2 - 3"]
    assert {row["adjust"] for row in pairs} == {"holm"}
    assert max(row["details"]["family_size"] for row in pairs) == 3
    assert f"Cochran's Q test, Q(2) = {wanted['Q']:.2f}, p < .001, η²Q = " in page
    assert "followed up pair by pair with Holm-adjusted McNemar's tests" in page
    assert "follow-up, McNemar's test, b = " in page


@pytest.mark.parametrize("case", [name for name in CLUSTERED if name != "versions"])
def test_every_trial_counts_in_the_estimating_equations(tmp_path: Path, steadyhand: Steadyhand, case: str) -> None:
    """The folder's table of cells has means over trials; they tell as much as the trials themselves."""
    wanted, logit = CLUSTERED[case], case.startswith("errors")
    entry = "gee_logit" if logit else "gee_poisson, exposure: observed_s"
    page = read(steadyhand, clustered(tmp_path / "study", case, entry))
    rows = results(steadyhand)
    pairs = rows[-len(wanted["pairs"]) :]
    for found, pair in zip(pairs, wanted["pairs"], strict=True):
        assert found["statistic"] == pytest.approx(pair["t"], rel=1e-5)
        assert found["p"] == pytest.approx(pair["p"], rel=1e-4)
        assert found["effect_size"] == pytest.approx(pair["ratio"], rel=1e-5)
        assert [found["ci_low"], found["ci_high"]] == pytest.approx(pair["ci"], rel=1e-5)
        if logit:
            assert found["details"]["dispersion"] == pytest.approx(wanted["dispersion"], rel=1e-5)
    trials = [row for row in r_reference.rows("clustered") if row["case"] == case]
    assert pairs[0]["details"]["n_observations"] == len(trials)
    assert ("OR = " if logit else "rate ratio = ") in page
    # Pairs none of which differs share a sentence, which has their statistics and no sizes.
    together = len(pairs) > 1 and all(row["p_adjusted"] >= 0.05 for row in pairs)
    assert ("did not differ significantly between" if together else "percentage points" if logit else " per s") in page
    assert "participants being the clusters" in page
    if len(wanted["pairs"]) > 1:
        assert rows[0]["p"] == pytest.approx(wanted["F_p"], rel=1e-4)
        assert {row["adjust"] for row in pairs} == {"holm"}


def test_an_exposure_that_is_not_there_is_answered_with_what_is(tmp_path: Path, steadyhand: Steadyhand) -> None:
    case = next(name for name in CLUSTERED if name.startswith("counts"))
    ran = steadyhand("compare", clustered(tmp_path / "study", case, "gee_poisson, exposure: observed"))
    assert ran.code == 2
    assert 'exposure: there is no measure "observed" in the data' in ran.err
    assert '"observed_s"' in ran.err


def test_several_answers_in_a_cell_need_the_model(tmp_path: Path, steadyhand: Steadyhand) -> None:
    page = read(steadyhand, clustered(tmp_path / "study", "errors_two", "mcnemar", "t_paired"))
    mcnemar, _ = results(steadyhand)
    assert mcnemar["status"] == "undefined: there are values other than 0 and 1"
    assert "there are several; test: gee_logit takes all" in page
    assert "paired t treat yes and no as measurements" in page
    assert "(test: gee_logit)" in page
