"""Tables as people keep them: other separators, decimals, encodings, headers, shapes and units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.pipeline.helpers import Steadyhand
from tests.pipeline.study.kept_tables import CASES, Folder, add, copied, means, proposed, squared_errors

pytestmark = pytest.mark.usefixtures("one_cache")


@pytest.mark.parametrize(
    ("case", "lines"),
    [
        ("cp1252", ["format: {encoding: cp1252}"]),
        (
            "german_spreadsheet",
            [
                'format: {separator: ";", decimal: ","}',
                "columns: {trials: {Teilnehmer: participant, Bedingung: condition, Durchgang: trial, Ziel X:"
                " target_x_mm, Ziel Y: target_y_mm, Auswahl X: selected_x_mm, Auswahl Y: selected_y_mm, Start: start_s,"
                " Ende: selection_s}}",
            ],
        ),
        ("wide", ["wide: {measures: {measure: [time, errors]}}"]),
        (
            "tlx_wide_weights",
            [
                "wide: {questionnaires: {questionnaire: nasa_tlx, scale: [mental, physical, temporal, performance,"
                " effort, frustration, w_mental, w_physical, w_temporal, w_performance, w_effort, w_frustration]}}",
                "scoring: {nasa_tlx: {rule: weighted_tlx, range: [0, 100]}}",
            ],
        ),
    ],
)
def test_what_the_message_says_to_write_makes_the_table_readable(
    tmp_path: Path, steadyhand: Steadyhand, case: str, lines: list[str]
) -> None:
    study = copied(case, tmp_path)
    refused = steadyhand("compare", study)
    assert refused.code == 2
    assert proposed(refused.err) == lines
    add(study, *lines)
    assert steadyhand("compare", study).code == 0
    assert steadyhand.results()["comparisons"][0]["status"] == "ok"


def test_a_spreadsheet_in_german_and_one_in_a_windows_encoding_give_the_same(
    tmp_path: Path, steadyhand: Steadyhand
) -> None:
    """Both hold the same trials; the expected means are computed from the second with pandas."""
    trials = pd.read_csv(CASES / "cp1252" / "trials.csv", encoding="cp1252")
    expected = squared_errors(trials)
    for case in ("cp1252", "german_spreadsheet"):
        study = copied(case, tmp_path)
        add(study, *proposed(steadyhand("compare", study).err))
        assert steadyhand("compare", study).code == 0
        assert means(steadyhand, "selection_mse_mm2") == pytest.approx(expected.to_dict(), rel=1e-12)
        assert means(steadyhand, "trial_time_s")["Kinect"] == pytest.approx(
            (trials["selection_s"] - trials["start_s"])[trials["condition"] == "Kinect"].mean(), rel=1e-12
        )


def test_a_weighted_tlx_is_computed_from_weights_in_columns(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """Hart and Staveland: the sum of rating times weight over 15."""
    study = copied("tlx_wide_weights", tmp_path)
    add(study, *proposed(steadyhand("compare", study).err))
    assert steadyhand("compare", study).code == 0
    table = pd.read_csv(CASES / "tlx_wide_weights" / "questionnaires.csv")
    scales = ["mental", "physical", "temporal", "performance", "effort", "frustration"]
    table["score"] = sum(table[scale] * table[f"w_{scale}"] for scale in scales) / 15
    expected = table.groupby("condition")["score"].mean().to_dict()
    assert means(steadyhand, "nasa_tlx/weighted_tlx") == pytest.approx(expected, rel=1e-12)
    assert not any("w_mental" in row["measure"] for row in steadyhand.results()["descriptives"])


def test_weights_that_no_rule_uses_are_an_error(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """They would be compared as if they were ratings, and counted into the total."""
    study = copied("tlx_wide_weights", tmp_path)
    add(study, proposed(steadyhand("compare", study).err)[0])
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert "write scoring: {nasa_tlx: {rule: weighted_tlx, range: [0, 100]}}" in ran.err


def wide_of(text: str, pattern: str, conditions: str = "[a, b]") -> dict[str, Any]:
    return {
        "settings": f"conditions: {conditions}\nmeasures: measures.csv\nwide: {{measures: {pattern}}}\n",
        "measures.csv": text,
    }


@pytest.mark.parametrize(
    ("text", "entry", "expected"),
    [
        ("participant,a,b\n1,2,3\n2,4,5\n", "{condition: [a, b], measure: m}", {("m", "a"): 3, ("m", "b"): 4}),
        (
            "participant,a_m,b_m,a_time_s,b_time_s\n1,2,3,10,20\n2,4,5,20,30\n",
            '{columns: "{condition}_{measure}"}',
            {("m", "a"): 3, ("m", "b"): 4, ("time_s", "a"): 15, ("time_s", "b"): 25},
        ),
        (
            "participant,condition,rt_1,rt_2\n1,a,1,3\n1,b,5,7\n",
            '{columns: "rt_{trial}", measure: rt}',
            {("rt", "a"): 2, ("rt", "b"): 6},
        ),
        (
            "participant,condition,Trial 1,Trial 2\n1,a,1,3\n1,b,5,7\n",
            "{trial: [Trial 1, Trial 2], measure: rt}",
            {("rt", "a"): 2, ("rt", "b"): 6},
        ),
    ],
)
def test_wide_tables_of_every_shape(
    folder: Folder, steadyhand: Steadyhand, text: str, entry: str, expected: dict[tuple[str, str], float]
) -> None:
    given = wide_of(text, entry)
    assert steadyhand("compare", folder(given.pop("settings"), **given)).code == 0
    found = {(r["measure"], r["condition"]): r["mean"] for r in steadyhand.results()["descriptives"]}
    assert found == expected


@pytest.mark.parametrize(
    ("text", "entry", "message"),
    [
        (
            "participant,a,b\n1,2,3\n",
            "{condition: [a, b]}",
            "nothing says which measure the values are of; add it to the entry, such as measure: time_s",
        ),
        ("participant,a,b\n1,2,3\n", "{condition: [a, c], measure: m}", 'there is no column "c" in measures.csv'),
        ("participant,a,b\n1,2,3\n", '{columns: "{condition}_{measure}"}', "no column of measures.csv fits"),
        ("participant,a,b\n1,2,x\n", "{condition: [a, b], measure: m}", 'row 2: "b" should be a number, found "x"'),
        ("participant,a,b\n1,2,3\n", "{condition: a, measure: m}", "needs one list of the columns that hold values"),
        (
            "participant,condition,a,b\n1,a,2,3\n",
            "{condition: [a, b], measure: m}",
            'says the condition of "a", and measures.csv has a column "condition" too',
        ),
    ],
)
def test_what_a_wide_table_lacks_is_named(
    folder: Folder, steadyhand: Steadyhand, text: str, entry: str, message: str
) -> None:
    given = wide_of(text, entry)
    ran = steadyhand("compare", folder(given.pop("settings"), **given))
    assert ran.code == 2
    assert message in ran.err


def test_a_code_for_missing_is_named_with_its_key_and_then_left_out(tmp_path: Path, steadyhand: Steadyhand) -> None:
    study = copied("minus99", tmp_path)
    (line,) = proposed(steadyhand("compare", study).out)
    assert line == "missing: [-99]"
    add(study, line)
    steadyhand("compare", study)
    assert steadyhand.results()["comparisons"][0]["n"] == 9


def test_milliseconds_are_named_with_their_key_and_then_read_as_such(tmp_path: Path, steadyhand: Steadyhand) -> None:
    study = copied("milliseconds", tmp_path)
    (line,) = proposed(steadyhand("compare", study).out)
    assert line == "columns: {trials: {start_s: start_ms, selection_s: selection_ms}}"
    in_seconds = {condition: mean / 1000 for condition, mean in means(steadyhand, "trial_time_s").items()}
    add(study, line)
    assert "milliseconds;" not in steadyhand("compare", study).out
    assert means(steadyhand, "trial_time_s") == pytest.approx(in_seconds, rel=1e-12)


def test_people_who_met_one_condition_each_are_compared_as_groups(tmp_path: Path, steadyhand: Steadyhand) -> None:
    """The message names the key and the tests; Welch's t agrees with SciPy's."""
    from scipy import stats

    study = copied("between", tmp_path)
    ran = steadyhand("compare", study)
    assert "write factors: {condition: between} and test: t_welch" in ran.out
    assert not [r for r in steadyhand.results()["exclusions"] if r["what"] in ("missing cell", "no data")]
    settings = (study / "study.yaml").read_text(encoding="utf-8").replace("t_paired", "t_welch")
    (study / "study.yaml").write_text(settings + "factors: {condition: between}\n", encoding="utf-8")
    assert steadyhand("compare", study).code == 0
    values = pd.read_csv(CASES / "between" / "measures.csv").groupby("condition")["value"].apply(np.array)
    expected = stats.ttest_ind(values["kinect"], values["fusion"], equal_var=False)
    (row,) = steadyhand.results()["comparisons"]
    assert (row["statistic"], row["p"]) == pytest.approx((expected.statistic, expected.pvalue), rel=1e-9)


def test_a_mixed_design_has_its_factors_and_no_false_missing_cells(tmp_path: Path, steadyhand: Steadyhand) -> None:
    study = copied("mixed_design", tmp_path, levels="factors: {size: [small, medium, large], group: between}")
    assert steadyhand("compare", study).code == 0
    listed = [r for r in steadyhand.results()["exclusions"] if r["what"] in ("missing cell", "no data")]
    values = pd.read_csv(CASES / "mixed_design" / "measures.csv")
    incomplete = values.groupby("participant").size()
    assert {r["participant"] for r in listed} == set(incomplete[incomplete < 9].index)


SIZES = "participant,condition,trial,size,Bemerkung,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm\n" + "".join(
    f"P{person},{condition},{trial},{size},müde,0,0,{person + trial},{0 if condition == 'a' else 3}\n"
    for person in (1, 2, 3)
    for condition in "ab"
    for trial, size in ((1, "small"), (2, "medium"), (3, "large"))
)


def test_a_column_of_trials_is_a_factor_with_its_levels_in_the_stated_order(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    entry = "comparisons: [{measure: selection_mse_mm2, test: rm_anova, within: [condition, size]}]\n"
    settings = f"conditions: [a, b]\ntrials: trials.csv\n{entry}"
    refused = steadyhand("compare", folder(settings, **{"trials.csv": SIZES}))
    assert refused.code == 2
    assert "is one if factors lists it: factors: {size: within}" in refused.err
    study = folder(f"{settings}factors: {{size: [small, medium, large]}}\n", **{"trials.csv": SIZES})
    assert steadyhand("compare", study).code == 0
    pairs = [r["contrast"] for r in steadyhand.results()["comparisons"] if r["effect"] == "size" and r["contrast"]]
    assert pairs == ["small - medium", "small - large", "medium - large"]
    notes = [r for r in steadyhand.results()["checks"] if r["check"] == "further columns"]
    assert [(r["status"], r["found"]) for r in notes] == [("green", "Bemerkung")]


def test_a_level_that_is_not_stated_is_an_error(folder: Folder, steadyhand: Steadyhand) -> None:
    entry = "comparisons: [{measure: selection_mse_mm2, test: rm_anova, within: [condition, size]}]\n"
    settings = f"conditions: [a, b]\ntrials: trials.csv\n{entry}factors: {{size: [small, medum, large]}}\n"
    ran = steadyhand("compare", folder(settings, **{"trials.csv": SIZES}))
    assert ran.code == 2
    assert 'factors: size has no level "medium", and the data do; did you mean "medum"?' in ran.err


@pytest.mark.parametrize(
    ("header", "key", "factor"),
    [
        ("target_x_cm,target_y_cm,selected_x_cm,selected_y_cm", "", 100.0),
        ("target_x_m,target_y_m,selected_x_m,selected_y_m", "", 1e6),
        ("target_x_px,target_y_px,selected_x_px,selected_y_px", "display: {px_per_mm: 10}\n", 0.01),
        (
            "Ziel X [cm],Ziel Y [cm],x,y",
            "columns: {trials: {'Ziel X [cm]': target_x_cm, 'Ziel Y [cm]': target_y_cm, x: selected_x_cm,"
            " y: selected_y_cm}}\n",
            100.0,
        ),
    ],
)
def test_lengths_in_other_units_become_millimetres(
    folder: Folder, steadyhand: Steadyhand, header: str, key: str, factor: float
) -> None:
    trials = f"participant,condition,trial,{header}\nP1,a,1,0,0,3,4\nP1,b,1,0,0,6,8\n"
    settings = f"conditions: [a, b]\ntrials: trials.csv\n{key}"
    assert steadyhand("compare", folder(settings, **{"trials.csv": trials})).code == 0
    assert means(steadyhand, "selection_mse_mm2") == pytest.approx({"a": 25 * factor, "b": 100 * factor}, rel=1e-12)


def test_pixels_without_the_displays_resolution_are_an_error(folder: Folder, steadyhand: Steadyhand) -> None:
    trials = "participant,condition,trial,target_x_px,target_y_px,selected_x_px,selected_y_px\nP1,a,1,0,0,3,4\n"
    ran = steadyhand("compare", folder("conditions: [a]\ntrials: trials.csv\n", **{"trials.csv": trials}))
    assert ran.code == 2
    assert '"target_x_px" is in pixels' in ran.err
    assert "write display: {px_per_mm: 10, unit: px}" in ran.err


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("columns: {trails: {a: b}}", 'unknown key "columns.trails"; did you mean "trials"?'),
        ("columns: {measures: {Wert: value}}", 'columns.measures: there is no column "Wert" in measures.csv'),
        ("format: {separator: ';;'}", "separator should be one character"),
        ("format: {separator: ',', decimal: ','}", 'separator and decimal are both ","'),
        ("format: {encoding: utf-9}", 'encoding "utf-9" is not known'),
        ("practice: {}", "needs either trials, how many come first, or column"),
        ("factors: {condition: [b, a]}", "factors: condition can be between alone"),
        ("factors: {group: betwen}", 'factors: "betwen" is not known; did you mean "between"?'),
    ],
)
def test_a_fault_in_these_keys_is_named(folder: Folder, steadyhand: Steadyhand, keys: str, message: str) -> None:
    measures = "participant,condition,measure,value\nP1,a,m,1\nP1,b,m,2\n"
    ran = steadyhand(
        "compare", folder(f"conditions: [a, b]\nmeasures: measures.csv\n{keys}\n", **{"measures.csv": measures})
    )
    assert ran.code == 2
    assert message in ran.err


def test_a_point_between_thousands_is_no_decimal(folder: Folder, steadyhand: Steadyhand) -> None:
    measures = "participant;condition;measure;value\nP1;a;m;1.234,5\nP1;b;m;2\n"
    settings = 'conditions: [a, b]\nmeasures: measures.csv\nformat: {separator: ";", decimal: ","}\n'
    ran = steadyhand("compare", folder(settings, **{"measures.csv": measures}))
    assert ran.code == 2
    assert 'found "1.234,5"' in ran.err
    assert "take points between thousands out" in ran.err


def test_a_likely_slip_in_a_header_is_an_error_and_another_column_is_kept(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    trials = "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm,{}\nP1,a,1,0,0,3,4,1\n"
    settings = "conditions: [a]\ntrials: trials.csv\n"
    ran = steadyhand("compare", folder(settings, **{"trials.csv": trials.format("Startzeit")}))
    assert ran.code == 2
    assert proposed(ran.err) == ["columns: {trials: {Startzeit: start_s}}"]
    assert steadyhand("compare", folder(settings, **{"trials.csv": trials.format("Wetter")})).code == 0
