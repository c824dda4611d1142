"""McNemar, Cochran's Q and generalized estimating equations: against R, against each other, and where they end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.statistics import STATUSES
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.clustered import Family, Trials, gee
from pipeline.statistics.errors import cochran_q, mcnemar
from pipeline.statistics.friedman import friedman
from pipeline.statistics.result import Result
from tests.pipeline import r_reference

BINARY, CLUSTERED = r_reference.expected("binary"), r_reference.expected("clustered")
FIT = 1e-6  # where R's and statsmodels' iterations stop


def answers(case: str) -> FloatArray:
    return r_reference.matrix([row for row in r_reference.rows("binary") if row["case"] == case], "condition", "answer")


def trials(case: str) -> tuple[Trials, list[str], Family]:
    rows = [row for row in r_reference.rows("clustered") if row["case"] == case]
    levels = sorted({row["condition"] for row in rows})
    outcome, exposure = (np.array([float(row[name]) for row in rows]) for name in ("outcome", "exposure"))
    codes = np.array([levels.index(row["condition"]) for row in rows], dtype=np.int64)
    family: Family = "logit" if case.startswith("errors") else "poisson"
    return Trials(outcome, [row["participant"] for row in rows], codes, exposure), levels, family


@pytest.mark.parametrize("case", ["two_n14", "two_n30", "two_one_way"])
def test_mcnemar_against_r(case: str) -> None:
    wanted, found = BINARY[case], mcnemar(*answers(case).T)
    assert (found.statistic, found.details["c"]) == (wanted["b"], wanted["c"])
    assert found.p == pytest.approx(wanted["p"], rel=1e-9)
    for name in ("mid_p", "chi2", "chi2_p"):
        assert found.details[name] == pytest.approx(wanted[name], rel=1e-9)
    low, high = wanted["odds_ratio_ci"]
    assert found.ci_low == pytest.approx(low, rel=1e-9)
    assert found.ci_high == (None if high == "Inf" else pytest.approx(high, rel=1e-9))
    assert found.effect_size == (wanted["b"] / wanted["c"] if wanted["c"] else None)
    assert ("no_effect_size" in found.details) == (wanted["c"] == 0)
    assert found.details["ci_difference"] == pytest.approx([max(-1, min(1, x)) for x in wanted["bonett_price"]])


@pytest.mark.parametrize("case", ["three_n10", "four_n8"])
def test_cochrans_q_against_r(case: str) -> None:
    wanted, values = BINARY[case], answers(case)
    found, ranked = cochran_q(values), friedman(values)
    assert found.statistic == pytest.approx(wanted["Q"], rel=1e-9)
    assert found.p == pytest.approx(wanted["exact_p"], rel=1e-9)
    assert found.details["chi2_p"] == pytest.approx(wanted["chi2_p"], rel=1e-9)
    assert found.statistic == pytest.approx(ranked.statistic)
    assert found.effect_size == pytest.approx(ranked.effect_size)


@given(
    st.lists(st.tuples(st.integers(0, 1), st.integers(0, 1)), min_size=2, max_size=30).filter(
        lambda pairs: any(a != b for a, b in pairs)
    )
)
def test_q_of_two_conditions_is_mcnemar(pairs: list[tuple[int, int]]) -> None:
    values = np.array(pairs, dtype=float)
    q, m, turned = cochran_q(values), mcnemar(*values.T), mcnemar(*values.T[::-1])
    assert q.p == pytest.approx(m.p)
    assert q.statistic == pytest.approx(m.details["chi2"])
    assert turned.p == pytest.approx(m.p)
    # The interval holds 1 exactly where p is not below .05.
    assert ((m.ci_low or 0.0) > 1 or (m.ci_high or math.inf) < 1) == ((m.p or 0.0) < 0.05)
    if m.effect_size and turned.effect_size:
        assert m.effect_size * turned.effect_size == pytest.approx(1)


def test_many_participants_have_the_p_of_chi_squared() -> None:
    values = np.random.default_rng(0).integers(0, 2, size=(400, 5)).astype(float)
    found = cochran_q(values)
    assert found.method == "Cochran's Q, chi-squared approximation"
    assert found.p == found.details["chi2_p"]


@pytest.mark.parametrize("case", [name for name in CLUSTERED if name != "versions"])
def test_gee_against_geepack_and_clubsandwich(case: str) -> None:
    wanted = CLUSTERED[case]
    arranged, levels, family = trials(case)
    rows = gee(arranged, levels, family)
    pairs = rows[-len(wanted["pairs"]) :]
    for found, pair in zip(pairs, wanted["pairs"], strict=True):
        assert found.statistic == pytest.approx(pair["t"], rel=FIT)
        assert found.p == pytest.approx(pair["p"], rel=1e-5)
        assert found.df2 == pair["df"]
        assert found.effect_size == pytest.approx(pair["ratio"], rel=FIT)
        assert [found.ci_low, found.ci_high] == pytest.approx(pair["ci"], rel=FIT)
        assert found.details["se"] == pytest.approx(pair["se"], rel=FIT)
        assert found.details["se_uncorrected"] == pytest.approx(pair["se_uncorrected"], rel=FIT)
        assert found.details["dispersion"] == pytest.approx(wanted["dispersion"], rel=FIT)
    if len(levels) > 2:
        whole = rows[0]
        assert (whole.statistic_name, whole.df1, whole.df2) == ("F", wanted["df1"], wanted["df2"])
        assert whole.statistic == pytest.approx(wanted["F"], rel=FIT)
        assert whole.p == pytest.approx(wanted["F_p"], rel=1e-5)
        assert whole.details["no_effect_size"].startswith("no effect size of more than two conditions")
    else:
        assert rows[0].statistic == pytest.approx(math.copysign(math.sqrt(wanted["F"]), pairs[0].statistic or 0))


def test_balanced_trials_give_the_plain_odds_ratio_of_their_sums() -> None:
    arranged, levels, family = trials("errors_two")
    (found,) = gee(arranged, levels, family)
    share = [float(arranged.outcome[arranged.conditions == code].mean()) for code in (0, 1)]
    odds = [one / (1 - one) for one in share]
    assert found.details["means"] == pytest.approx(share)
    assert found.effect_size == pytest.approx(odds[0] / odds[1])


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_neither_the_order_of_rows_nor_the_unit_of_exposure_matters(seed: int) -> None:
    arranged, levels, family = trials("counts_three_unequal")
    order = np.random.default_rng(seed).permutation(len(arranged.outcome))
    assert arranged.exposure is not None
    other = Trials(
        arranged.outcome[order],
        [arranged.participants[place] for place in order],
        arranged.conditions[order],
        arranged.exposure[order] * 60,
    )
    for one, two in zip(gee(arranged, levels, family), gee(other, levels, family), strict=True):
        assert two.p == pytest.approx(one.p, rel=1e-6)
        assert two.effect_size == (None if one.effect_size is None else pytest.approx(one.effect_size, rel=1e-6))


def _gee(rows: list[tuple[str, int, float]], family: Family, levels: int = 2) -> list[Result]:
    people, codes, outcome = zip(*rows, strict=True) if rows else ((), (), ())
    arranged = Trials(np.array(outcome, dtype=float), people, np.array(codes, dtype=np.int64))
    return gee(arranged, [f"c{level}" for level in range(levels)], family)


def _crossed(outcomes: list[Any]) -> list[tuple[str, int, float]]:
    """A list of outcomes by condition of each participant."""
    return [
        (f"P{person}", code, value)
        for person, both in enumerate(outcomes)
        for code, values in enumerate(both)
        for value in values
    ]


DIFFER = [[[0, 1], [1, 1]], [[0, 0], [1, 0]], [[1, 0], [0, 1]], [[0, 0], [1, 1]]]


@pytest.mark.parametrize(
    ("outcomes", "family", "status"),
    [
        ([], "logit", "undefined: no participant is complete"),
        (DIFFER[:1], "logit", "undefined: only one participant is complete"),
        (DIFFER[:2], "logit", "undefined: too few values for the terms of the model"),
        ([[[0], [1]], [[0], [1]], [[0], [0]]], "logit", "undefined: in one condition all answers are the same"),
        ([[[0], [0]], [[0], [0]], [[0], [0]]], "logit", "undefined: no value varies"),
        ([[[0, 2], [1]]] * 3, "logit", "undefined: there are values other than 0 and 1"),
        ([[[0, 1.5], [1]]] * 3, "poisson", "undefined: there are values that are no counts, which"),
        ([[[0], [3]], [[0], [1]], [[0], [2]]], "poisson", "undefined: in one condition all answers are the same"),
        ([[[0, 1], []]] * 3, "logit", "undefined: a condition has no value"),
        ([[[0, 1, 1], [0, 0, 1]]] * 4, "logit", "undefined: all differences are equal"),
        ([[[2], [4]]] * 4, "poisson", "undefined: all differences are equal"),
    ],
)
def test_data_without_an_estimate_say_why(outcomes: list[Any], family: Family, status: str) -> None:
    (found,) = _gee(_crossed(outcomes), family)
    assert found.status.startswith(status)
    assert found.status in STATUSES
    assert (found.p, found.statistic, found.effect_size) == (None, None, None)


def test_of_few_participants_the_pairs_are_tested_and_not_the_whole() -> None:
    random = np.random.default_rng(1)
    outcomes = [[random.integers(0, 2, 6).tolist() for _ in range(3)] for _ in range(4)]
    whole, *pairs = _gee(_crossed(outcomes), "logit", 3)
    assert whole.status == "undefined: too few values for the terms of the model"
    assert [pair.status for pair in pairs] == ["ok"] * 3


@settings(deadline=None, max_examples=80)
@given(
    st.lists(
        st.lists(st.lists(st.integers(0, 1), min_size=0, max_size=3), min_size=3, max_size=3), min_size=1, max_size=7
    ),
    st.sampled_from(["logit", "poisson"]),
)
def test_any_answers_have_figures_or_a_status(outcomes: list[Any], family: Family) -> None:
    rows = _crossed(outcomes)
    for found in _gee(rows, family, 3):
        assert found.status in STATUSES
        assert (found.p is None) == (found.status != "ok")
        assert found.p is None or 0 <= found.p <= 1


@pytest.mark.parametrize(
    ("values", "status"),
    [
        (np.array([[1, 1], [0, 0], [1, 1.0]]), "undefined: all differences are zero"),
        (np.array([[1, 0], [0, 2.0]]), "undefined: there are values other than 0 and 1"),
        (np.array([[1, np.nan], [0, 1.0]]), "undefined: there are values other than 0 and 1"),
        (np.empty((0, 2)), "undefined: no participant is complete"),
    ],
)
def test_answers_that_cannot_be_tested_say_why(values: FloatArray, status: str) -> None:
    assert mcnemar(values[:, 0], values[:, 1]).status == status
    assert cochran_q(values).status == status


def test_a_rate_ratio_does_not_need_poissons_variance() -> None:
    """Counts that vary three times as much as Poisson's law has it have standard errors to match."""
    random = np.random.default_rng(4)
    people, per = 60, 20
    mean = np.exp(random.normal(0, 0.3, people))
    outcome = random.negative_binomial(1, 1 / (1 + 2 * np.repeat(mean, 2 * per))).astype(float)
    codes = np.tile(np.repeat([0, 1], per), people)
    (found,) = gee(Trials(outcome, [str(p) for p in np.repeat(range(people), 2 * per)], codes), ["a", "b"], "poisson")
    poisson = np.sqrt(sum(1 / outcome[codes == code].sum() for code in (0, 1)))
    assert found.details["dispersion"] > 2
    assert found.details["se"] > 1.3 * poisson
    assert found.p == pytest.approx(2 * stats.t.sf(abs(found.statistic or 0), people - 2))
