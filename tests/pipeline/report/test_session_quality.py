"""Traffic lights for sessions, and what results would be without the exclusions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.report.traffic_lights import LIGHTS, Judged, judged, light_of, limits_text
from pipeline.study.settings import QualityLimits, Study
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.report.pages import checked

Folder = Callable[..., Path]
Row = dict[str, Any]

GOOD: Row = {
    "session": "S1",
    "stream": "tracker",
    "messages_read": 1000,
    "messages_lost": 0,
    "rate_hz": 30.0,
    "gap_max_s": 0.04,
    "out_of_order": 0,
    "jitter_ms": 2.0,
    "latency_s": 0.0,
}


def study(stream: Row | None = None, **settings: Any) -> Study:
    tracker = {"topic": "/t", "kind": "position", "rate_hz": 30, **(stream or {})}
    return Study.model_validate(
        {"conditions": ["a"], "sessions": "{session}.mcap", "streams": {"tracker": tracker}, **settings}
    )


def lights(of: Study, *rows: Row, agreement: tuple[Row, ...] = ()) -> dict[str, str]:
    """The worst light of each fact."""
    found: dict[str, list[Judged]] = {}
    for one in judged(of, rows, agreement):
        found.setdefault(one.fact, []).append(one)
    return {fact: light_of(figures) for fact, figures in found.items()}


def test_a_good_stream_is_green_in_everything_that_is_judged() -> None:
    assert lights(study(), GOOD) == dict.fromkeys(("Rate", "Longest gap", "Delay", "Clock", "Lost"), "green")


@pytest.mark.parametrize(
    ("changed", "fact", "light"),
    [
        ({"rate_hz": 24.0}, "Rate", "green"),  # 80 % is not below 80 %
        ({"rate_hz": 23.9}, "Rate", "amber"),
        ({"rate_hz": 14.0}, "Rate", "red"),
        ({"gap_max_s": 0.2}, "Longest gap", "green"),
        ({"gap_max_s": 0.201}, "Longest gap", "amber"),
        ({"gap_max_s": 1.5}, "Longest gap", "red"),
        ({"latency_s": 0.3}, "Delay", "amber"),
        ({"latency_s": -0.6}, "Delay", "red"),  # it arrives before it was measured: the clocks differ
        ({"jitter_ms": 21.0}, "Clock", "amber"),
        ({"out_of_order": 11}, "Clock", "red"),
        ({"messages_lost": 11}, "Lost", "amber"),
        ({"messages_lost": 100}, "Lost", "red"),
        ({"messages_lost": None}, "Lost", "amber"),
    ],
)
def test_each_figure_is_judged_by_its_limits(changed: Row, fact: str, light: str) -> None:
    found = lights(study(), {**GOOD, **changed})
    assert found.pop(fact) == light
    assert set(found.values()) == {"green"}


def test_limits_can_be_moved_and_a_delay_counts_the_stated_latency() -> None:
    strict = study(quality_limits={"gap_s": [0.01, 0.02], "lost_share": [0, 0]})
    assert lights(strict, GOOD)["Longest gap"] == "red"
    assert lights(strict, {**GOOD, "messages_lost": 1})["Lost"] == "red"
    assert lights(study({"stamp": "arrival", "latency_s": 0.3}), GOOD)["Delay"] == "amber"


def test_a_rate_that_nobody_states_is_held_against_the_other_sessions() -> None:
    rows = [{**GOOD, "session": f"S{at}", "rate_hz": rate} for at, rate in enumerate((30.0, 29.0, 10.0))]
    found = [one for one in judged(study({"rate_hz": None}), rows, []) if one.fact == "Rate"]
    assert [one.light for one in found] == ["green", "green", "red"]
    assert found[2].text == "✗ red: 10.0 Hz for 29.0 (tracker)"
    assert "Rate" not in lights(study({"rate_hz": None}), *rows[:2])


def test_a_stream_that_is_not_there_and_a_replay_that_differs_are_seen() -> None:
    two = study(estimators={"e": {"type": "raw"}})
    streams = {**two.streams, "reference": two.streams["tracker"]}
    assert lights(two.model_copy(update={"streams": streams}), GOOD)["Lost"] == "amber"
    for apart, light in ((1e-9, "green"), (0.5, "amber"), (2.0, "red"), (None, "not judged")):
        row = {"session": "S1", "estimator": "e", "max_mm": apart}
        assert lights(two, GOOD, agreement=(row,))["Replay"] == light


@given(share=st.floats(0, 1), gap=st.floats(0, 100))
def test_worse_figures_never_have_a_better_light(share: float, gap: float) -> None:
    better = {**GOOD, "rate_hz": 30.0 * share, "gap_max_s": gap}
    worse = {**better, "rate_hz": 30.0 * share * 0.9, "gap_max_s": gap * 1.1}
    of = study()
    for fact in ("Rate", "Longest gap"):
        assert LIGHTS.index(lights(of, worse)[fact]) >= LIGHTS.index(lights(of, better)[fact])


def test_limits_are_told_with_all_their_digits() -> None:
    told = limits_text(QualityLimits(agreement_mm=(1e-6, 2.5)))
    assert "rate below 80 % (50 %)" in told
    assert "replay apart by over 0.000001 mm (2.5 mm)" in told


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ("{gap_s: [1, 0.2]}", '"quality_limits": gap_s needs the limit of amber first, then that of red'),
        ("{rate_share: [0.5, 0.8]}", '"quality_limits": rate_share needs the limit of amber first'),
        ("{gap_s: 1}", '"quality_limits.gap_s"'),
        ("{lost_share: [2, 3]}", '"quality_limits.lost_share.0": input should be less than or equal to 1'),
        ("{gap: [1, 2]}", 'unknown key "quality_limits.gap"; did you mean "gap_s"?'),
    ],
)
def test_bad_limits_are_an_error_that_names_them(
    folder: Folder, steadyhand: Steadyhand, limits: str, message: str
) -> None:
    ran = steadyhand("compare", folder(f"conditions: [a]\nmeasures: m.csv\nquality_limits: {limits}\n"))
    assert ran.code == 2
    assert message in ran.err


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_the_report_counts_the_lights_first(folder: Folder, steadyhand: Steadyhand) -> None:
    root = folder(
        "conditions: [a]\nsessions: '{participant}_{condition}.mcap'\nquality_limits: {gap_s: [0.001, 10]}\n" + STREAMS
    )
    for person in ("P1", "P2"):
        write_session(root / f"{person}_a.mcap", session_messages(2.5))
    assert steadyhand("report", root).code == 0
    text = " ".join("".join(checked((steadyhand.out / "report.html").read_text(encoding="utf-8")).text).split())
    assert "Quality: 2 sessions: 0 ✓ green, 2 ▲ amber and 0 ✗ red." in text
    assert "▲ amber: 0.0333 s (tracker) and 2 more" in text
    assert "longest gap over 0.001 s (10 s)" in text


SETTINGS = """
conditions: [a, b]
measures: measures.csv
questionnaires: q.csv
comparisons:
  - {measure: time_s, test: rm_anova}
  - {measure: other_s, test: t_paired}
  - {measure: tlx/*, test: wilcoxon, adjust: holm}
"""
EXCLUSIONS = """
exclusions:
  - {participant: P4, measure: time_s, reason: phone rang}
  - {participant: P2, measure: tlx/x, reason: asleep}
"""


def tables(odd: str = "90") -> dict[str, str]:
    times = ((5, 4), (6, 4.5), (7, 4), (3, odd), (6, 5))
    measures = "participant,condition,measure,value\n"
    ratings = "participant,condition,questionnaire,scale,rating\n"
    for person, pair in enumerate(times, 1):
        for at, (condition, value) in enumerate(zip("ab", pair, strict=True)):
            measures += f"P{person},{condition},time_s,{value}\nP{person},{condition},other_s,{person * (at + 1)}\n"
            for scale in "xy":
                ratings += f"P{person},{condition},tlx,{scale},{person + at * (person % 3)}\n"
    return {"measures.csv": measures, "q.csv": ratings}


def test_comparisons_without_the_exclusions_are_those_of_a_study_that_has_none(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    assert steadyhand("compare", folder(SETTINGS, **tables())).code == 0
    whole = steadyhand.results()
    assert whole["comparisons_all_data"] == []
    assert steadyhand("compare", folder(SETTINGS + EXCLUSIONS, **tables())).code == 0
    found = steadyhand.results()
    assert found["comparisons_all_data"] == whole["comparisons"]
    assert found["comparisons"][0]["n"] == 4
    assert found["comparisons"] != whole["comparisons"]


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_the_report_shows_what_changes_without_the_exclusions(folder: Folder, steadyhand: Steadyhand) -> None:
    assert steadyhand("report", folder(SETTINGS + EXCLUSIONS, **tables())).code == 0
    text = " ".join("".join(checked((steadyhand.out / "report.html").read_text(encoding="utf-8")).text).split())
    results = steadyhand.results()
    assert (
        "Without the 2 exclusions of study.yaml: 2 of 4 comparisons change, 1 of them between significant and not"
        in text
    )
    part = text.split("the comparisons that change", 1)[1].split("p: adjusted over", 1)[0]
    assert "Time (s) rm ANOVA conditions with exclusions 4 F(1, 3) = 11.79" in part
    assert f"without exclusions 5 F(1, 4) = {results['comparisons_all_data'][0]['statistic']:.2f}" in part
    assert "Other (s)" not in part
    assert "phone rang" in text
    assert (steadyhand.out / "tables" / "comparisons_all_data.csv").is_file()


@pytest.mark.usefixtures("no_figures", "blank_print")
def test_exclusions_that_change_no_comparison_are_said_to(folder: Folder, steadyhand: Steadyhand) -> None:
    settings = SETTINGS.replace("  - {measure: time_s, test: rm_anova}\n", "").replace(
        "  - {measure: tlx/*, test: wilcoxon, adjust: holm}\n", ""
    )
    assert steadyhand("report", folder(settings + EXCLUSIONS, **tables())).code == 0
    text = " ".join("".join(checked((steadyhand.out / "report.html").read_text(encoding="utf-8")).text).split())
    assert "Without the 2 exclusions of study.yaml: every comparison has the same result." in text


def test_all_data_that_no_test_takes_are_said_and_stop_nothing(folder: Folder, steadyhand: Steadyhand) -> None:
    rows = "participant,condition,measure,value,task\n" + "".join(
        f"P{person},{condition},time_s,{person * 3 + at + len(task)},{task}\n"
        for person in (1, 2, 3, 4)
        for at, condition in enumerate("ab")
        for task in (("t", "long") if person < 4 else ("",))
    )
    settings = """
    conditions: [a, b]
    measures: measures.csv
    comparisons: [{measure: time_s, test: rm_anova, within: [condition, task]}]
    exclusions: [{participant: P4, reason: no task}]
    """
    ran = steadyhand("compare", folder(settings, **{"measures.csv": rows}))
    assert ran.code == 0, ran.err
    found = steadyhand.results()
    assert found["comparisons_all_data"] == []
    (row,) = [row for row in found["exclusions"] if row["what"] == "no comparison without the exclusions"]
    assert 'no factor "task"' in row["reason"]
