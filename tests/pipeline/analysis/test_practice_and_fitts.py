"""Practice and Fitts' law, from trials.csv to tables and report."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.statistics.fitts import effective_width
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.reference import the
from tests.pipeline.report.pages import checked

pytestmark = pytest.mark.usefixtures("blank_figures", "blank_print", "one_cache")

Folder = Callable[..., Path]

SETTINGS = """
conditions: [a, b]
trials: trials.csv
comparisons: [{measure: trial_time_s, test: t_paired}]
"""
HEADER = (
    "participant,condition,trial,target_x_mm,target_y_mm,selected_x_mm,selected_y_mm"
    ",start_s,selection_s,target_width_mm"
)
SLOPES = {"a": -0.3, "b": -0.05}
"""Of log time over log trial number."""


def practised(trials: int = 12, people: int = 6) -> str:
    """Targets to and fro at one distance; times by a power law with a little noise, each person with a slope."""
    random = np.random.default_rng(5)
    lines = [HEADER]
    for person in range(people):
        for condition, slope in SLOPES.items():
            start = 0.0
            for trial in range(1, trials + 1):
                seconds = (2 + 0.2 * person) * trial ** (slope + 0.01 * person) * np.exp(random.normal(0, 0.01))
                x = 100.0 * (trial % 2)
                lines.append(
                    f"P{person},{condition},{trial},{x},0,{x + random.normal():.3f},0,{start},{start + seconds},20"
                )
                start += seconds + 0.5
    return "\n".join(lines) + "\n"


PACE_S = {"P1": -0.02, "P2": 0.0, "P3": 0.02}
"""What each takes longer than the line."""
BLOCKS = [(100.0, 40.0), (200.0, 20.0), (400.0, 10.0)]


def aimed(intercept_s: float = 0.3, slope_s_bit: float = 0.2, blocks: int = 3) -> Iterator[str]:
    """Eleven movements to and fro in each block, whose times are a line over nominal difficulty; b takes 0.1 s more."""
    random = np.random.default_rng(9)
    yield HEADER
    for person, own_s in PACE_S.items():
        for more_s, condition in ((0.0, "a"), (0.1, "b")):
            start, trial = 0.0, 0
            for amplitude, width in BLOCKS[:blocks]:
                seconds = intercept_s + own_s + more_s + slope_s_bit * np.log2(amplitude / width + 1)
                for place in range(12):
                    trial += 1
                    x = amplitude * (place % 2)
                    off = random.normal(0, width / 5)
                    yield f"{person},{condition},{trial},{x},0,{x + off:.4f},0,{start},{start + seconds},{width}"
                    start += seconds + 0.1
                start += 5  # the movement to the next block begins nobody knows where


def results(folder: Folder, steadyhand: Steadyhand, trials: str) -> dict[str, Any]:
    assert steadyhand("compare", folder(SETTINGS, **{"trials.csv": trials})).code == 0
    return steadyhand.results()


def test_slopes_of_practice_are_found_again(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = results(folder, steadyhand, practised())["learning"]
    for condition, slope in SLOPES.items():
        row = the(rows, trials="all trials", contrast=condition)
        assert (row["n"], row["left_out"], row["status"], row["remark"]) == (6, 0, "ok", None)
        assert row["slope"] == pytest.approx(slope + 0.025, abs=0.01)  # the mean over people of 0.01 · person
        assert row["ratio_when_trials_double"] == pytest.approx(2 ** row["slope"])
        assert row["ci_low"] < row["slope"] < row["ci_high"]
    pair = the(rows, trials="all trials", contrast="a - b")
    assert pair["slope"] == pytest.approx(-0.25, abs=0.01)
    assert pair["p_adjusted"] == pair["p"] < 0.001  # one pair
    assert pair["first_trial_s"] is None
    assert the(rows, trials="last half", contrast="a")["p_adjusted"] < 0.001


def test_trials_count_in_the_order_of_their_starts(folder: Folder, steadyhand: Steadyhand) -> None:
    """A number of a trial may name its target; when it began says which came first."""
    head, *lines = practised().splitlines()
    cells = [line.split(",") for line in lines]
    turned = [",".join([*cell[:2], str(100 - int(cell[2])), *cell[3:]]) for cell in cells]
    plain = results(folder, steadyhand, "\n".join([head, *lines]))["learning"]
    assert results(folder, steadyhand, "\n".join([head, *turned]))["learning"] == plain


def test_trials_whose_clocks_all_begin_at_zero_count_by_their_numbers(folder: Folder, steadyhand: Steadyhand) -> None:
    head, *lines = practised().splitlines()
    cells = [line.split(",") for line in lines]
    own = [",".join([*cell[:7], "0", str(float(cell[8]) - float(cell[7])), cell[9]]) for cell in cells]
    row = the(results(folder, steadyhand, "\n".join([head, *own]))["learning"], trials="all trials", contrast="a")
    assert row["slope"] == pytest.approx(-0.275, abs=0.01)


def test_too_few_trials_say_so_and_stay_out_of_the_report(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder(SETTINGS, **{"trials.csv": practised(trials=2)})
    assert steadyhand("report", study).code == 0
    found = steadyhand.results()
    assert {row["status"] for row in found["learning"]} == {
        "undefined: nobody has three trials with a time in one session of the condition"
    }
    assert {(row["n"], row["left_out"]) for row in found["learning"]} == {(0, 6)}
    assert found["fitts"] == found["fitts_points"] == []
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert 'id="practice"' not in page
    assert 'id="fitts"' not in page


def test_the_report_says_what_practice_means(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder(SETTINGS, **{"trials.csv": practised()})
    assert steadyhand("report", study).code == 0
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert "People became faster from trial to trial in a" in page
    assert "were still becoming faster in the last half of the trials" in page
    text = " ".join("".join(checked(page).text).split())
    assert "Practice differed between conditions (a − b, Holm-adjusted p < .0001)" in text
    assert "the order of the conditions is not known or not balanced" in page
    assert "newell1981" in (steadyhand.out / "references.bib").read_text(encoding="utf-8")
    assert (steadyhand.out / "figures" / "practice.svg").exists()


def test_targets_of_a_fixed_order_are_no_practice(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder(SETTINGS, **{"trials.csv": "\n".join(aimed())})
    assert steadyhand("report", study).code == 0
    remark = "everybody had the same targets in the same order, so practice cannot be told from the targets"
    assert {row["remark"] for row in steadyhand.results()["learning"]} == {remark}
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert f"Whether people became faster with practice cannot be said: {remark}" in page
    assert not (steadyhand.out / "figures" / "practice.svg").exists()


def test_the_line_of_fitts_is_found_again(folder: Folder, steadyhand: Steadyhand) -> None:
    found = results(folder, steadyhand, "\n".join(aimed()))
    for more_s, condition in ((0.0, "a"), (0.1, "b")):
        row = the(found["fitts"], condition=condition, difficulty="nominal")
        assert (row["n"], row["blocks"], row["status"]) == (3, 3, "ok")
        assert row["intercept_s"] == pytest.approx(0.3 + more_s)
        assert row["slope_s_bit"] == pytest.approx(0.2)
        assert row["r_squared"] == pytest.approx(1)
        bits = [np.log2(amplitude / width + 1) for amplitude, width in BLOCKS]
        each = [b / (0.3 + more_s + own_s + 0.2 * b) for b in bits for own_s in PACE_S.values()]
        assert row["throughput_bits_s"] == pytest.approx(np.mean(each))
        assert row["remark"] == "a line through three points has one degree of freedom"
    points = [row for row in found["fitts_points"] if row["condition"] == "a" and row["difficulty"] == "nominal"]
    assert sorted((row["amplitude_mm"], row["width_mm"]) for row in points) == BLOCKS
    assert {(row["n"], row["movements"]) for row in points} == {(3, 33)}


def test_effective_difficulty_and_throughput_are_those_of_the_measure(folder: Folder, steadyhand: Steadyhand) -> None:
    """Sequences are told apart by width too: both ways to throughput agree."""
    trials = "\n".join(aimed())
    found = results(folder, steadyhand, trials)
    rows = [row for row in csv.DictReader(trials.splitlines()) if (row["participant"], row["condition"]) == ("P1", "a")]
    # Of the block's twelve trials the first has no movement; the axis turns around with every movement.
    off = [float(row["selected_x_mm"]) - float(row["target_x_mm"]) for row in rows[1:12]]
    along = np.array(off) * np.array([1, -1] * 5 + [1])
    (first,) = [
        row["width_mm"]
        for row in results_of_one(folder, steadyhand, trials)
        if row["block"] == "A 100 mm, W 40 mm" and row["condition"] == "a"
    ]
    assert first == pytest.approx(effective_width(along))
    for condition in "ab":
        line = the(found["fitts"], condition=condition, difficulty="effective")
        measure = the(found["descriptives"], measure="throughput_bits_s", condition=condition)
        assert line["throughput_bits_s"] == pytest.approx(measure["mean"])


def results_of_one(folder: Folder, steadyhand: Steadyhand, trials: str) -> list[dict[str, Any]]:
    """The effective points of a study in which P1 alone took part."""
    alone = "\n".join(line for line in trials.splitlines() if line.startswith(("participant", "P1")))
    rows = results(folder, steadyhand, alone)["fitts_points"]
    return [row for row in rows if row["difficulty"] == "effective"]


@pytest.mark.parametrize(
    ("changes", "remark"),
    [
        ({"blocks": 2}, "fewer than 3 indices of difficulty, which is too few for a line"),
        ({"slope_s_bit": -0.04, "intercept_s": 0.8}, "movement time does not rise with difficulty"),
        (
            {"slope_s_bit": 0.6, "intercept_s": -0.6},
            "an intercept below −200 ms, where no movement time can be, points to something other than difficulty",
        ),
    ],
)
def test_a_line_that_is_no_law_is_said_with_care(
    changes: dict[str, Any], remark: str, folder: Folder, steadyhand: Steadyhand
) -> None:
    study = folder(SETTINGS, **{"trials.csv": "\n".join(aimed(**changes))})
    assert steadyhand("report", study).code == 0
    assert remark in the(steadyhand.results()["fitts"], condition="a", difficulty="nominal")["remark"]
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert remark in " ".join("".join(checked(page).text).split())
    assert (steadyhand.out / "figures" / "fitts.svg").exists() == ("blocks" not in changes)


def test_a_width_that_no_target_has(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder(SETTINGS, **{"trials.csv": "\n".join(aimed()).replace(",40.0", ",-40", 1)})
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert 'trials.csv, row 2: "target_width_mm" should be above 0, found -40' in ran.err
