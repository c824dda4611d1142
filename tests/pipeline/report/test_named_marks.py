"""Whose a mark is: titles in a figure's SVG, marks over its image in the page, and a table of values for paper."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import pytest

from pipeline.report import figures
from pipeline.report.document.compact_svg import compact
from pipeline.report.document.pictures import pictures
from pipeline.report.figures.group_clouds import by_group, groups
from pipeline.report.figures.named_marks import named_marks
from tests.pipeline.analysis.test_options import TIMES, Values, read, study
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.report.figures.drawn import saved

WIDE = pd.DataFrame({"A": [1.5, 2.0, None], "B": [2.5, 1.0, 3.0]}, index=['P<1>"', "ü & co", "P3"])


def test_every_mark_of_a_participant_has_a_title_and_a_place(tmp_path: Path) -> None:
    path = saved(figures.paired(WIDE, "completion_time_s"), tmp_path)
    found = named_marks(path.read_text(encoding="utf-8"))
    assert found is not None
    names = [mark.name for mark in found.every]
    assert names == ['P<1>": 1.50 s', "ü & co: 2.00 s", 'P<1>": 2.50 s', "ü & co: 1.00 s", "P3: 3.00 s", *names[5:]]
    assert names[5:] == ['P<1>": −1.00 s', "ü & co: 1.00 s"]  # the differences beside them
    assert all(0 < mark.x < found.width and 0 < mark.y < found.height for mark in found.every)
    high, low = found.every[1], found.every[0]
    assert high.y < low.y  # 2.0 is above 1.5


def test_a_figure_without_people_has_no_named_marks(tmp_path: Path) -> None:
    wide = {"nasa_tlx/effort": pd.DataFrame({"A": [1.0, 2.0], "B": [2.0, 1.0]})}
    assert named_marks(saved(figures.workload(wide), tmp_path).read_text(encoding="utf-8")) is None


def test_of_very_many_marks_none_has_a_name(tmp_path: Path) -> None:
    wide = pd.DataFrame({"A": [float(at) for at in range(600)]}, index=[f"P{at}" for at in range(600)])
    content = saved(figures.paired(wide, "completion_time_s"), tmp_path).read_text(encoding="utf-8")
    assert named_marks(content) is None
    assert "names-" not in content


def test_a_page_has_the_names_over_the_image_and_not_within(tmp_path: Path) -> None:
    saved(figures.paired(WIDE, "completion_time_s"), tmp_path)
    picture = pictures(tmp_path, ["figure.svg"])["figure.svg"]
    assert picture.marks is not None
    assert len(picture.marks.every) == 7
    assert "P3" not in picture.url


def test_a_compact_figure_keeps_every_mark_to_a_hundredth_of_a_point(tmp_path: Path) -> None:
    whole = saved(figures.paired(WIDE, "completion_time_s"), tmp_path).read_text(encoding="utf-8")
    small = compact(whole)
    assert len(small) < 0.9 * len(whole)
    place = re.compile(r'<use [^>]*x="([-\d.]+)" y="([-\d.]+)"')
    before, after = place.findall(whole), place.findall(small)
    assert len(before) == len(after) > 7
    for one, other in zip(before, after, strict=True):
        assert [float(number) for number in other] == pytest.approx([float(number) for number in one], abs=0.0051)
    assert whole.count("<path") == small.count("<path")


def test_marks_of_one_look_share_it_and_marks_of_two_keep_their_own() -> None:
    alike = '<g clip-path="url(#p)">\n<use xlink:href="#m" x="1" y="2" style="fill: red"/>\n'
    same = f'{alike}<use xlink:href="#m" x="3" y="4" style="fill: red"/>\n</g>'
    other = f'{alike}<use xlink:href="#m" x="3" y="4" style="fill: blue"/>\n</g>'
    assert compact(same).count("fill: red") == 1
    assert compact(other) == other


def test_groups_are_columns_and_a_condition_of_each_where_both_matter() -> None:
    wide = pd.DataFrame({"A": [1.0, 2.0, 5.0], "B": [3.0, 4.0, None]}, index=["P1", "P2", "P3"])
    group_of = {"P1": "long", "P2": "none", "P3": "none"}
    means = by_group(wide, group_of, ["none", "long"], conditions=False)
    assert list(means) == ["none", "long"]
    assert means["none"].dropna().to_dict() == {"P2": 3.0}
    cells = by_group(wide, group_of, ["none", "long"], conditions=True)
    assert list(cells) == ["none, A", "none, B", "long, A", "long, B"]
    assert cells.loc["P1"].dropna().to_dict() == {"long, A": 1.0, "long, B": 3.0}


def test_groups_with_long_names_are_told_apart_below_small_panels() -> None:
    values = pd.Series([1.0, 2.0, 4.0])
    names = ["short course, kinect", "short course, fusion", "short talk, kinect", "short talk, fusion"]
    wide = pd.DataFrame(dict.fromkeys(names, values))
    figure = groups({f"nasa_tlx/{scale}": wide for scale in ("mental", "physical", "effort")}, "training")
    labels = [tick.get_text() for tick in figure.axes[0].get_xticklabels()]
    assert labels == ["short\ncourse\nkinect", "short\ncourse\nfusion", "short talk\nkinect", "short talk\nfusion"]


@pytest.mark.usefixtures("blank_print")
def test_groups_that_are_compared_have_a_figure_of_their_own(steadyhand: Steadyhand, tmp_path: Path) -> None:
    people = "participant,training\n" + "".join(f"P{at:02},{'long' if at % 2 else 'none'}\n" for at in range(1, 11))
    entries = ["measure: time_s, test: mixed_anova", "measure: errors, test: mann_whitney"]
    page = read(steadyhand, study(tmp_path / "s", TIMES, entries, "factors: {training: between}\n", people))
    assert "Time (s) by training. Means with 95 % intervals: long, A" in page
    assert "Errors by training. Means with 95 % intervals: long " in page
    assert "Each small mark is a participant with a value in every condition;" in page
    assert "Point at a mark, or tap it, to see whose it is." in page


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_values_of_everybody_are_a_table(steadyhand: Steadyhand, tmp_path: Path) -> None:
    values: Values = {**TIMES, "nasa_tlx/effort": {"A": [10.0] * 10, "B": [20.0] * 5 + [30.0] * 5}}
    entries = ["measure: [time_s, errors], test: t_paired", "measure: nasa_tlx/*, test: wilcoxon"]
    page = read(steadyhand, study(tmp_path / "s", values, entries))
    assert "Participant Time (s): A Time (s): B Errors: A Errors: B P01 12.10 10.20 3.00 2.00" in page
    assert "Each participant's rating under each condition" in page


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_values_of_people_who_met_one_condition_each_stand_beside_it(steadyhand: Steadyhand, tmp_path: Path) -> None:
    folder = study(
        tmp_path / "s",
        {
            "time_s": {"B": [4.5, 6.5, 5.0], "A": [1.0, 2.0, 2.5]},
            "errors": {"B": [7.0, 9.0, 8.0], "A": [3.0, 3.0, 5.0]},
        },
        ["measure: [time_s, errors], test: t_welch"],
        "factors: {condition: between}\n",
        apart=True,
    )
    page = read(steadyhand, folder)
    assert "Each participant's value of each measure and the condition that they met" in page
    assert "Participant Condition Time (s) Errors B-01 B 4.50 7.00 B-02 B" in page
    assert "B-03 B 5.00 8.00 A-01 A 1.00 3.00" in page  # in the order of the conditions
