"""What the reports of between-subjects and mixed studies say of their participants, pairs and directions."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pipeline.report.prose.answer import answer, notes
from pipeline.words.names import was
from tests.pipeline.analysis.test_options import Values, read, study
from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("blank_figures", "blank_print", "one_cache")

BETWEEN: Values = {
    "completion_time_s": {
        "mouse": [11.0, 10.2, 12.5, 9.8, 13.1, 11.7, 10.9],
        "touch": [8.1, 9.4, 7.9, 8.8, 10.2, 9.1],
        "gaze": [14.2, 12.9, 15.8, 13.3, 16.0],
    },
    "errors": {"mouse": [2, 1, 3, 2, 4, 2, 3], "touch": [3, 2, 4, 3, 2, 5], "gaze": [5, 4, 6, 3, 7]},
    "success": {"mouse": [1, 1, 1, 1, 1, 0, 1], "touch": [1, 1, 0, 1, 0, 1], "gaze": [0, 1, 0, 1, 0]},
}
ENTRIES = [
    "measure: completion_time_s, test: anova_welch",
    "measure: errors, test: gee_poisson",
    "measure: success, test: gee_logit",
]


def between(folder: Path) -> Path:
    rows = "".join(f"{name}-{at + 1:02}\n" for name, values in BETWEEN["errors"].items() for at in range(len(values)))
    declared = "factors: {condition: between}\n"
    return study(folder, BETWEEN, ENTRIES, declared, people=f"participant\n{rows}spare\n", apart=True)


def test_a_between_subjects_report_says_who_met_what(steadyhand: Steadyhand, tmp_path: Path) -> None:
    page = read(steadyhand, between(tmp_path / "s"))
    assert "18 participants analysed of 19 listed" in page
    assert "3 conditions, each participant met one: mouse, touch and gaze" in page
    assert "met by every participant" not in page
    assert "n: every participant with a value, in a test of two groups those of the two." in page
    assert "Nothing was left out" not in page
    missing = [row for row in steadyhand.results()["exclusions"] if row["participant"] == "spare"]
    assert [row["reason"] for row in missing] == ["the participant is listed in participants.csv and has no data"]
    assert "follow-up, Games and Howell's test" in page
    assert "the conditions differ; means run from 8.92 s" in page
    assert {row["interval"] for row in steadyhand.results()["descriptives"] if row["measure"] == "success"} == {
        "Wilson"
    }


def test_ratios_and_means_stand_the_way_round_that_the_differences_do(steadyhand: Steadyhand, tmp_path: Path) -> None:
    assert steadyhand("compare", between(tmp_path / "s")).code == 0
    results = steadyhand.results()
    lines = {(line.measure.split(",")[0], line.pair): line for line in answer(results)}
    assert "ratios: the first named over the other" in notes(results)
    assert lines["Completion time (s)", "mouse − touch"].means == "11.31 → 8.92 s"
    for measure in ("Errors", "Success"):
        line = lines[measure, "mouse − gaze"]
        ratio = float(re.findall(r"= ([\d.]+)", line.effect_size)[0])
        assert ("lower" in line.difference) == (ratio > 1), line  # the first over the second
    (row,) = (one for one in results["comparisons"] if one["contrast"] == "mouse - gaze" and one["measure"] == "errors")
    shown = f"= {row['effect_size']:.2f} [{row['ci_low']:.2f}, {row['ci_high']:.2f}]"
    assert shown in lines["Errors", "mouse − gaze"].effect_size


def test_a_difference_that_depends_on_the_group_is_a_caution(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values: Values = {
        "time_s": {
            "A": [20.0, 21, 19, 22, 20.5, 14, 15, 13.5, 14.2, 15.1],
            "B": [15.0, 16.5, 14.2, 16.4, 15.9, 14.1, 14.8, 13.6, 14.5, 15.0],
        }
    }
    people = "participant,group\n" + "".join(f"P{at:02},{'new' if at <= 5 else 'old'}\n" for at in range(1, 11))
    entry = ["measure: time_s, test: mixed_anova"]
    page = read(steadyhand, study(tmp_path / "s", values, entry, "factors: {group: between}\n", people=people))
    assert "The difference depends: in Time (s) it is not the same at each level of group" in page
    assert "Participants were compared between the levels of group." in page
    assert "Participants of each group: 5 new and 5 old." in page
    assert "Means by group and condition. Group: 5 new and 5 old." in page
    means = {(row["group"], row["condition"]): row for row in steadyhand.results()["descriptives_by_group"]}
    assert {key: round(row["mean"], 2) for key, row in means.items()} == {
        ("new", "A"): 20.5,
        ("new", "B"): 15.6,
        ("old", "A"): 14.36,
        ("old", "B"): 14.4,
    }
    assert {(row["n"], row["group_n"], row["interval"]) for row in means.values()} == {(5, 5, "t")}
    assert "follow-up, paired t test, t(4)" in page
    assert "follow-up, Welch's t test, t(" in page


@pytest.mark.parametrize("of_new", [5, 4])
def test_a_mixed_anova_of_two_conditions_answers_by_their_difference(
    steadyhand: Steadyhand, tmp_path: Path, of_new: int
) -> None:
    """It is averaged over the groups, so that of unequal ones the means of everybody are another difference."""
    a = np.array([20.0, 21, 19, 22, 20.5, 14, 15, 13.5, 14.2, 15.1])
    b = np.array([15.0, 16.5, 14.2, 16.4, 15.9, 14.1, 14.8, 13.6, 14.5, 15.0])
    people = "participant,group\n" + "".join(f"P{at:02},{'new' if at <= of_new else 'old'}\n" for at in range(1, 11))
    folder = study(
        tmp_path / "s",
        {"completion_time_s": {"A": a.tolist(), "B": b.tolist()}},
        ["measure: completion_time_s, test: mixed_anova"],
        "factors: {group: between}\n",
        people=people,
    )
    page = read(steadyhand, folder)
    (line,) = answer(steadyhand.results())
    amount = ((b - a)[:of_new].mean() + (b - a)[of_new:].mean()) / 2
    assert line.difference.startswith(f"{-amount:.2f} s [")
    assert "n = 10." in notes(steadyhand.results())  # of the pair, not of its follow-ups within a group
    share = f"{100 * (1 - b.mean() / a.mean()):.1f} %"
    if of_new == 5:
        assert line.means == f"{a.mean():.2f} → {b.mean():.2f} s"
        assert f"Completion time was {share} lower (better) with B than with A: on average" in page
    else:
        assert line.means == "–"
        assert f"Completion time was {-amount:.2f} s lower (better) with B than with A (p" in page


def test_groups_that_are_named_like_conditions_are_a_remark(steadyhand: Steadyhand, tmp_path: Path) -> None:
    times: dict[str, list[float]] = {
        "A": [20.0, 21, 19, 22, 14, 15, 13.5, 14.2],
        "B": [15.0, 16.5, 14.2, 16, 14, 15, 13, 15],
    }
    people = "participant,group\n" + "".join(f"P{at:02},{'A' if at <= 4 else 'old'}\n" for at in range(1, 9))
    entry = ["measure: time_s, test: mixed_anova"]
    values: Values = {"time_s": times}
    folder = study(tmp_path / "s", values, entry, "factors: {group: between}\n", people=people)
    page = read(steadyhand, folder)
    assert "A names a condition and a group, so that pairs at a level can be read in two ways" in page


@pytest.mark.parametrize(
    ("label", "verb"),
    [
        ("Time", "was"),
        ("Errors", "were"),
        ("Corrections per trial", "were"),
        ("Success", "was"),
        ("Axis", "was"),
        ("Bias", "was"),
    ],
)
def test_the_verb_fits_the_measure(label: str, verb: str) -> None:
    assert was(label) == verb


def test_means_of_other_people_than_those_tested_are_no_answer(steadyhand: Steadyhand, tmp_path: Path) -> None:
    """P01 and P02 lack the hard task with B, and so are not tested; the means of everybody would differ by 0.6."""
    rows = "".join(
        f"P{at:02},{condition},m_s,{task},{10 + at + {'A': 0, 'B': 1}[condition] + {'easy': 0, 'hard': 4}[task]}\n"
        for at in range(1, 9)
        for condition in "AB"
        for task in ("easy", "hard")
        if not (at <= 2 and (condition, task) == ("B", "hard"))
    )
    noisy = rows.replace("P05,B,m_s,easy,16", "P05,B,m_s,easy,17")
    folder = study(tmp_path / "s", {"m_s": {"A": [0], "B": [0]}}, ["measure: m_s, test: t_paired"])
    (folder / "measures.csv").write_text(f"participant,condition,measure,task,value\n{noisy}", encoding="utf-8")
    page = read(steadyhand, folder)
    (row,) = steadyhand.results()["comparisons"]
    assert row["n"] == 6
    assert "with B than with A: a mean difference of 1.08 s (p" in page
    assert "on average" not in page


def test_groups_whose_names_look_alike_are_named(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values: Values = {"time_s": {name: [float(at + len(name)) for at in range(8)] for name in "AB"}}
    people = "participant,group\n" + "".join(
        f"P{at:02},{'Novice' if at == 3 else 'novice' if at <= 4 else 'expert'}\n" for at in range(1, 9)
    )
    entry = ["measure: time_s, test: mixed_anova"]
    ran = steadyhand("compare", study(tmp_path / "s", values, entry, "factors: {group: between}\n", people=people))
    assert ran.code == 2
    assert 'the groups "novice" and "Novice" of group differ only in case' in ran.err
    assert 'write "novice" for P03' in ran.err
