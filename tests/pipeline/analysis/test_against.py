"""Known reasons: the other programs' ways as those programs compute them, and no reason where none is met."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import stats

from pipeline.analysis.against import conventions, derivatives, digits, in_r
from pipeline.analysis.against.agreement import held_against
from pipeline.analysis.against.known_reasons import REASONS
from pipeline.analysis.against.problems import Groups, Model, Paired, Problem, Within
from pipeline.analysis.against.programs import LIBRARIES
from pipeline.analysis.against.theirs import Call, Figure, Theirs, ask, rounded
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.mixed import Factor, mixed_model
from pipeline.statistics.paired import t_paired
from pipeline.study.comparison import Comparison

RATINGS = st.lists(st.integers(-6, 6), min_size=3, max_size=30).map(lambda values: np.array(values, dtype=float))


@given(RATINGS, st.booleans(), st.booleans())
def test_the_normal_approximation_of_signed_ranks_is_that_of_scipy(
    apart: FloatArray, pratt: bool, corrected: bool
) -> None:
    assume(np.any(apart != 0))
    way = conventions.signed_rank_corrected_p if corrected else conventions.signed_rank_normal_p
    ranking: Literal["pratt", "wilcox"] = "pratt" if pratt else "wilcox"
    theirs = stats.wilcoxon(apart, None, ranking, corrected, method="asymptotic")  # type: ignore[call-overload]
    # Where W is in the middle SciPy takes off nothing, and the figure here is above 1 and cut.
    assert way(apart, pratt) == pytest.approx(float(theirs.pvalue), abs=1e-12)


@given(RATINGS, RATINGS, st.booleans())
def test_the_normal_approximation_of_rank_sums_is_that_of_scipy(
    first: FloatArray, second: FloatArray, corrected: bool
) -> None:
    assume(np.ptp(np.concatenate([first, second])) > 0)
    way = conventions.rank_sum_corrected_p if corrected else conventions.rank_sum_normal_p
    theirs = stats.mannwhitneyu(first, second, use_continuity=corrected, method="asymptotic")
    assert way(Groups([first, second]))["p"] == pytest.approx(float(theirs.pvalue), abs=1e-12)


def test_students_t_and_friedmans_chi_squared_are_those_of_scipy() -> None:
    values = np.random.default_rng(3).integers(1, 6, (9, 3)).astype(float)
    found = conventions.student(Groups([values[:, 0], values[:6, 1]]))
    theirs = stats.ttest_ind(values[:, 0], values[:6, 1])
    interval = theirs.confidence_interval()
    assert list(found.values()) == pytest.approx(
        [theirs.statistic, theirs.df, theirs.pvalue, interval.low, interval.high]
    )
    ranked = stats.friedmanchisquare(*values.T)
    friedman = conventions.friedman_of_floats(Within(values, (0,)))
    assert (friedman["statistic"], friedman["p"]) == pytest.approx((ranked.statistic, ranked.pvalue))


def paired_problem() -> Problem:
    first, second = np.array([5.0, 4.0, 6.0, 7.0, 5.5]), np.array([4.0, 4.5, 3.0, 5.0, 4.0])
    result = t_paired(first, second)
    names = ("effect", "contrast", "n", "statistic_name", "statistic", "df1", "df2", "p", "effect_size", "status")
    row: dict[str, Any] = {name: getattr(result, name) for name in names}
    row |= {"measure": "m", "test": "t_paired", "p_adjusted": None, "details": dict(result.details)}
    return Problem(row, "t_paired", Paired(first, second), Comparison(measure="m", test="t_paired"))


def test_a_difference_that_no_way_meets_has_no_reason() -> None:
    problem = paired_problem()
    size = abs(problem.row["details"]["d_av"])
    found = held_against(problem, Theirs("f", {"effect_size": Figure(size), "p": Figure(0.5), "df2": Figure(4.0)}))
    assert found.agree == ["df2"]
    assert [(one.quantity, one.reason is None) for one in found.differ] == [("effect_size", False), ("p", True)]
    almost = held_against(problem, Theirs("f", {"effect_size": Figure(size * 1.0001)}))
    assert [one.quantity for one in almost.unexplained] == ["effect_size"]


def test_printed_digits_leave_a_figure_open() -> None:
    problem = paired_problem()
    low = problem.row["details"]["ci_difference"][0]
    assert held_against(problem, Theirs("f", {"ci_difference_low": rounded(round(low, 2), 2)})).agree
    assert held_against(problem, Theirs("f", {"ci_difference_low": rounded(round(low, 2) + 0.01, 2)})).unexplained


def test_no_number_is_not_a_contradiction() -> None:
    (one,) = held_against(paired_problem(), Theirs("f", {"p": Figure(math.nan)})).differ
    assert one.reason == "it has no number for these data"


def test_a_library_that_fails_is_quoted() -> None:
    def fail(_data: Paired, _entry: Comparison) -> dict[str, float]:
        raise ZeroDivisionError("division by zero\nand more")

    (found,) = ask({"t_paired": (Call("f(x)", fail),)}, paired_problem())
    assert (found.call, found.failure) == ("f(x)", "ZeroDivisionError: division by zero")


def test_every_reason_is_of_a_procedure_that_some_program_has() -> None:
    procedures = set(in_r.PROCEDURES).union(*(library.calls for library in LIBRARIES.values()))
    assert {name for reason in REASONS for name in reason.procedures} <= procedures


def test_what_r_wrote_before_it_was_stopped_counts() -> None:
    written = '0,"t.test(x, y)","statistic",2.5,""\n0,"t.test(x, y)","p",NA,""\n1,"aov","",NA,"no F"\n1,"afex","stat'
    found = in_r.read(written)
    (test,) = found[0]
    assert (test.call, test.figures["statistic"]) == ("t.test(x, y)", Figure(2.5))
    assert math.isnan(test.figures["p"].value)
    assert found[1] == [Theirs("aov", failure="no F")]


def a_model(values: FloatArray, people: list[str], condition: list[int]) -> Problem:
    factor = Factor(("A", "B"), np.array(condition))
    (result,) = mixed_model(values, people, {"condition": factor}, ["condition"])
    data = Model(values, people, {"condition": factor}, ["condition"], {}, "condition", (0, 1))
    details = dict(result.details)
    row = {"statistic": result.statistic, "df2": result.df2, "p": result.p, "effect_size": result.effect_size}
    named = {"statistic_name": "t", "status": "ok", "effect": "condition", "contrast": result.contrast}
    entry = Comparison.model_validate({"measure": "m", "test": "mixed_model"})
    return Problem({**row, **named, "details": details}, "mixed_model", data, entry)


def test_standard_errors_from_the_joint_information_are_those_of_statsmodels_and_in_balanced_data_ours() -> None:
    random = np.random.default_rng(5)
    people, condition = [f"P{at}" for at in range(8) for _ in range(4)], [0, 0, 1, 1] * 8
    values = random.normal(0, 1, 8).repeat(4) + random.normal(0, 1, 32) + np.array(condition)
    whole = a_model(values, people, condition)
    kept = [at for at in range(32) if at not in (1, 2, 5, 8, 13)]
    gaps = a_model(values[kept], [people[at] for at in kept], [condition[at] for at in kept])
    for problem in (whole, gaps):
        (theirs,) = ask({"mixed_model": LIBRARIES["statsmodels"].calls["mixed_model"]}, problem)
        joint = derivatives.of_observed_information(problem, theirs.figures, "se")
        assert joint == pytest.approx(theirs.figures["se"].value, rel=1e-5)
        own = problem.row["details"]["se"]
        assert (joint == pytest.approx(own, rel=1e-6)) == (problem is whole)


def test_no_reason_of_extreme_numbers_is_given_of_plain_ones() -> None:
    values = np.array([1.0, 2.5, 2, 3, 3, 5, 4, 4, 5, 7.5])
    people, condition = [f"P{at}" for at in range(5) for _ in range(2)], [0, 1] * 5
    model = a_model(values, people, condition)
    far = {"df1": 1.0, "df2": 7.0, "statistic": 3.0, "log_likelihood": model.row["details"]["log_likelihood"]}
    figures = {name: Figure(value) for name, value in far.items()}
    assert derivatives.where_it_is_flat(model, figures, "df2") is None
    (anova,) = rm_anova(values.reshape(5, 2), ("condition",))
    row: dict[str, Any] = {"statistic": anova.statistic, "df2": anova.df2, "p": anova.p, "status": "ok", "details": {}}
    problem = Problem(row, "rm_anova", Within(values.reshape(5, 2), (0,)), model.entry)
    assert digits.run_out(problem, {"statistic": Figure((anova.statistic or 0) * 1.00001)}, "statistic") is None
