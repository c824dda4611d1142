"""Scores of instruments against what their makers publish, and against the laws of their rules."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from itertools import combinations, groupby
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.statistics.paired import t_paired
from pipeline.statistics.questionnaire_scores import (
    IMPOSSIBLE_WEIGHTS,
    Fault,
    ParticipantScores,
    cronbach_alpha,
    participant_scores,
)
from pipeline.study.scoring_rules import RULES, ScoringRule, own_rule
from tests.pipeline import r_reference

DATA = Path(__file__).resolve().parents[2] / "data" / "scoring"
TLX = RULES["raw_tlx"].items


def score(
    rule: ScoringRule,
    answers: Mapping[str, float | None],
    limits: tuple[float, float] | None = None,
    weights: Mapping[str, float | None] | None = None,
) -> ParticipantScores:
    stated = limits or rule.limits
    assert stated is not None
    return participant_scores(answers, rule.scales, stated, rule.reversed, weights)


def in_order(rule: ScoringRule, *answers: float | None) -> dict[str, float | None]:
    return dict(zip(rule.items, answers, strict=True))


def test_sus_of_brookes_own_example() -> None:
    """Brooke (1996): the ticks add up to 22, and the score is 22 × 2.5 = 55."""
    found = score(RULES["sus"], in_order(RULES["sus"], 5, 4, 2, 1, 2, 3, 2, 4, 5, 2))
    assert found.scores == {"score": pytest.approx(55)}
    assert found.faults == ()


def test_sus_of_a_study_whose_plain_sums_say_the_opposite() -> None:
    rows = list(csv.DictReader((DATA / "sus.csv").read_text().splitlines()))
    scores: dict[str, list[float]] = {"A": [], "B": []}
    sums: dict[str, list[float]] = {"A": [], "B": []}
    for (_, condition), items in groupby(rows, key=lambda row: (row["participant"], row["condition"])):
        answers = {row["scale"]: float(row["rating"]) for row in items}
        value = score(RULES["sus"], answers).scores["score"]
        assert value is not None
        scores[condition].append(value)
        sums[condition].append(sum(answers.values()))
    first, second = np.array(scores["A"]), np.array(scores["B"])
    assert (first.mean(), second.mean()) == (pytest.approx(82.8125), pytest.approx(52.1875))
    test, of_sums = t_paired(first, second), t_paired(np.array(sums["A"]), np.array(sums["B"]))
    assert test.statistic == pytest.approx(15.4, abs=0.05)
    assert test.df2 == 7
    assert test.p == pytest.approx(1e-6, rel=0.3)
    assert of_sums.statistic == pytest.approx(-3.24, abs=0.005)


def test_ueq_perspicuity_of_the_handbooks_example() -> None:
    """The handbook's ticks 6, 7, 5, 6 are 6, 1, 5, 2 from negative to positive, and so +2, −3, +1, −2."""
    answers: dict[str, float | None] = dict.fromkeys(RULES["ueq"].items, 4.0)
    answers |= {"q2": 6, "q4": 7, "q13": 5, "q21": 6}
    found = score(RULES["ueq"], answers).scores
    assert found["perspicuity"] == pytest.approx(-0.5)
    assert {name: value for name, value in found.items() if name != "perspicuity"} == dict.fromkeys(
        ("attractiveness", "efficiency", "dependability", "stimulation", "novelty"), pytest.approx(0)
    )


def test_half_of_each_ueq_scale_begins_with_the_positive_word() -> None:
    """As its handbook says of its construction; each of the 26 items belongs to one scale."""
    rule = RULES["ueq"]
    for scale in rule.scales:
        assert 2 * len(rule.reversed & set(scale.items)) == len(scale.items)
    assert sorted(item for scale in rule.scales for item in scale.items) == sorted(rule.items)


def test_the_short_ueq_is_made_of_items_of_the_long_one() -> None:
    found = score(RULES["ueq_s"], in_order(RULES["ueq_s"], 7, 6, 5, 4, 1, 2, 3, 4))
    assert found.scores == {
        "pragmatic": pytest.approx(1.5),
        "hedonic": pytest.approx(-1.5),
        "overall": pytest.approx(0.0),
    }


def test_ssq_reaches_the_published_maxima() -> None:
    """All sixteen symptoms severe: seven a scale at 3 (Kennedy et al. 1993, weights of table 5)."""
    found = score(RULES["ssq"], dict.fromkeys(RULES["ssq"].items, 3.0)).scores
    assert found == {
        "nausea": pytest.approx(200.34),
        "oculomotor": pytest.approx(159.18),
        "disorientation": pytest.approx(292.32),
        "total": pytest.approx(235.62),
    }
    one = dict.fromkeys(RULES["ssq"].items, 0.0) | {"nausea": 2.0}
    assert score(RULES["ssq"], one).scores == {
        "nausea": pytest.approx(19.08),
        "oculomotor": 0,
        "disorientation": pytest.approx(27.84),
        "total": pytest.approx(4 * 3.74),
    }


def test_ipq_turns_its_three_items() -> None:
    """igroup.org: sp2u = −1 · sp2 + 6, and so for INV3 and REAL1."""
    rule = RULES["ipq"]
    answers = dict.fromkeys(rule.items, 6.0) | dict.fromkeys(rule.reversed, 0.0)
    assert score(rule, answers).scores == dict.fromkeys(
        ("general_presence", "spatial_presence", "involvement", "realism"), 6.0
    )
    assert score(rule, answers | {"inv3": 6.0}).scores["involvement"] == pytest.approx(4.5)


@pytest.mark.parametrize(
    ("limits", "ratings"), [((0, 20), (12, 3, 9)), ((0, 100), (60, 15, 45)), ((1, 21), (13, 4, 10))]
)
def test_raw_tlx_does_not_depend_on_how_the_sheet_counts(
    limits: tuple[float, float], ratings: tuple[float, ...]
) -> None:
    found = score(RULES["raw_tlx"], in_order(RULES["raw_tlx"], *ratings, *ratings), limits)
    assert found.scores == {"raw_tlx": pytest.approx(40)}


def test_weighted_tlx_by_its_formula() -> None:
    """Hart and Staveland (1988): Σ weight · rating / 15."""
    ratings = in_order(RULES["weighted_tlx"], 60, 55, 90, 90, 55, 20)
    weights = in_order(RULES["weighted_tlx"], 3, 1, 0, 4, 2, 5)
    found = score(RULES["weighted_tlx"], ratings, (0, 100), weights)
    assert found.scores["weighted_tlx"] == pytest.approx((180 + 55 + 0 + 360 + 110 + 100) / 15)
    assert found.scores["raw_tlx"] == pytest.approx(370 / 6)


@pytest.mark.parametrize(
    ("weights", "fault"),
    [
        ((3, 1, 0, 4, 2, 4), Fault("", IMPOSSIBLE_WEIGHTS, 14.0, ("weighted_tlx",))),
        ((5, 5, 5, 0, 0, 0), Fault("", IMPOSSIBLE_WEIGHTS, 15.0, ("weighted_tlx",))),
        ((2.5, 2.5, 2.5, 2.5, 2.5, 2.5), Fault("", IMPOSSIBLE_WEIGHTS, 15.0, ("weighted_tlx",))),
        ((6, 1, 0, 4, 2, 2), Fault("mental", "weight out of range", 6.0, ("weighted_tlx",))),
        ((None, 1, 0, 4, 2, 5), Fault("mental", "weight missing", None, ("weighted_tlx",))),
    ],
)
def test_weights_that_fifteen_comparisons_cannot_give(weights: tuple[float | None, ...], fault: Fault) -> None:
    found = score(RULES["weighted_tlx"], dict.fromkeys(TLX, 50.0), (0, 100), in_order(RULES["weighted_tlx"], *weights))
    assert found.faults == (fault,)
    assert found.scores == {"weighted_tlx": None, "raw_tlx": pytest.approx(50)}


@given(st.data())
def test_every_outcome_of_comparing_six_things_is_a_possible_set_of_weights(data: st.DataObject) -> None:
    wins = dict.fromkeys(TLX, 0.0)
    for pair in combinations(TLX, 2):
        wins[data.draw(st.sampled_from(pair))] += 1
    found = score(RULES["weighted_tlx"], dict.fromkeys(TLX, 50.0), (0, 100), wins)
    assert found.faults == ()
    assert found.scores["weighted_tlx"] == pytest.approx(50)


def test_a_missing_item_and_one_out_of_range_leave_out_their_own_scores_only() -> None:
    answers: dict[str, float | None] = dict.fromkeys(RULES["ueq"].items, 5.0)
    answers |= {"q1": None, "q9": 8.0, "q3": float("nan")}
    del answers["q2"]
    found = score(RULES["ueq"], answers)
    assert set(found.faults) == {
        Fault("q1", "missing", None, ("attractiveness",)),
        Fault("q9", "out of range", 8.0, ("efficiency",)),
        Fault("q3", "missing", None, ("novelty",)),
        Fault("q2", "missing", None, ("perspicuity",)),
    }
    defined = {name for name, value in found.scores.items() if value is not None}
    assert defined == {"dependability", "stimulation"}


def test_a_rule_that_the_study_states_itself() -> None:
    rule = own_rule(["q1", "q2", "q3"], "mean", (1, 7), ["q2"])
    assert score(rule, {"q1": 7, "q2": 1, "q3": 7}).scores == {"score": pytest.approx(7)}
    total = own_rule(["a", "b"], "sum", (0, 4))
    assert score(total, {"a": 4, "b": 3}).scores == {"score": pytest.approx(7)}


@pytest.mark.parametrize(
    ("rule", "given", "item"),
    [
        ("sus", "q7", "q7"),
        ("sus", "SUS_07", "q7"),
        ("sus", "Item 10", "q10"),
        ("sus", "11", None),
        ("sus", "total", None),
        ("raw_tlx", "Mental Demand", "mental"),
        ("raw_tlx", "frustration", "frustration"),
        ("ssq", "Dizziness with eyes open", "dizzy_eyes_open"),
        ("ssq", "16", "burping"),
        ("ipq", "SP2", "sp2"),
        ("ipq", "q1", "g1"),
        ("ipq", "sp6", None),
    ],
)
def test_items_by_name_alias_or_number(rule: str, given: str, item: str | None) -> None:
    assert RULES[rule].item(given) == item


@given(st.data())
def test_scores_stay_within_their_bounds_and_turn_with_the_answers(data: st.DataObject) -> None:
    """Answering at the other end of every item turns a centred score's sign, and a percentage to its complement."""
    rule = data.draw(st.sampled_from([RULES[name] for name in ("sus", "ueq", "ueq_s", "ipq")]))
    assert rule.limits is not None
    low, high = rule.limits
    answers = {item: float(data.draw(st.integers(int(low), int(high)))) for item in rule.items}
    one = score(rule, answers).scores
    other = score(rule, {item: low + high - value for item, value in answers.items()}).scores
    for scale in rule.scales:
        first, second = one[scale.name], other[scale.name]
        assert first is not None
        assert second is not None
        ends = {"percent": (0.0, 100.0), "centred": (-3.0, 3.0), "mean": (low, high)}[scale.reading]
        assert ends[0] - 1e-9 <= first <= ends[1] + 1e-9
        assert first + second == pytest.approx(sum(ends), abs=1e-9)


@pytest.mark.parametrize("case", ["agreeing", "loose", "two_items", "opposed"])
def test_cronbachs_alpha_against_psych(case: str) -> None:
    wanted = r_reference.expected("cronbach_alpha")[case]
    rows = [row for row in r_reference.rows("cronbach_alpha") if row["case"] == case]
    found = cronbach_alpha(r_reference.matrix(rows, "item", "rating", "row"))
    assert found.effect_size == pytest.approx(wanted["alpha"], rel=1e-9)
    assert [found.ci_low, found.ci_high] == pytest.approx(wanted["feldt"], rel=1e-9)


@pytest.mark.parametrize(
    ("items", "status"),
    [
        (np.full((5, 3), 4.0), "undefined: no value varies"),
        (np.array([[1.0, 3.0], [3.0, 1.0], [2.0, 2.0]]), "undefined: the sum of the items is the same for everybody"),
        (np.array([[1.0], [2.0]]), "undefined: a scale of one item has no internal consistency"),
        (np.array([[1.0, 2.0, 3.0]]), "undefined: only one participant is complete"),
        (np.empty((0, 3)), "undefined: no participant is complete"),
    ],
)
def test_alpha_of_data_that_have_none_says_why(items: np.ndarray, status: str) -> None:
    found = cronbach_alpha(items)
    assert found.status == status
    assert found.effect_size is None


def test_pingouin_rounds_the_bounds_of_alpha() -> None:
    """Why the interval is our own."""
    import pandas as pd
    import pingouin

    rows = [row for row in r_reference.rows("cronbach_alpha") if row["case"] == "loose"]
    items = r_reference.matrix(rows, "item", "rating", "row")
    low, high = pingouin.cronbach_alpha(data=pd.DataFrame(items))[1]
    assert (low, high) == (round(low, 3), round(high, 3))
    assert cronbach_alpha(items).ci_low == pytest.approx(low, abs=5e-4)
