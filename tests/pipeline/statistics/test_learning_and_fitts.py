"""The power law of practice and Fitts' law: against R, and against the laws themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.statistics import STATUSES
from pipeline.statistics.fitts import Fitted, effective, effective_width, fitted, nominal
from pipeline.statistics.learning import learning
from pipeline.statistics.result import Result
from tests.pipeline import r_reference

LEARNING, FITTS = r_reference.expected("learning"), r_reference.expected("fitts")


def learned() -> dict[str | None, Result]:
    rows = r_reference.rows("learning")
    values, orders = (np.array([float(row[name]) for row in rows]) for name in ("time", "order"))
    codes = np.array(["abc".index(row["condition"]) for row in rows], dtype=np.int64)
    people = [row["participant"] for row in rows]
    return {row.contrast: row for row in learning(values, orders, people, codes, ["a", "b", "c"])}


def test_slopes_against_r() -> None:
    found = learned()
    wanted = {name: figures for name, figures in LEARNING.items() if name != "versions"}
    assert list(found) == list(wanted)
    for name, figures in wanted.items():
        row = found[name]
        assert (row.effect, row.n, row.df2) == ("trial order", figures["n"], figures["df"])
        assert row.statistic == pytest.approx(figures["t"], rel=1e-9)
        assert row.p == pytest.approx(figures["p"], rel=1e-9)
        assert row.effect_size == pytest.approx(figures["dz"], rel=1e-9)
        assert row.details["slope"] == pytest.approx(figures["mean"], rel=1e-9)
        assert row.details["ci_slope"] == pytest.approx(figures["ci"], rel=1e-9)
        assert row.details["ratio_when_trials_double"] == pytest.approx(2 ** figures["mean"])
        assert row.details["n_without_slope"] == 10 - figures["n"]


@given(
    slopes=st.lists(st.floats(-1, 1), min_size=2, max_size=6),
    unit=st.sampled_from([1.0, 1000.0, 1e95]),
    trials=st.integers(2, 9),
)
def test_a_power_law_has_its_own_exponent_in_any_unit(slopes: list[float], unit: float, trials: int) -> None:
    orders = np.tile(np.arange(1.0, trials + 1), len(slopes))
    people = np.repeat(np.arange(len(slopes)), trials)
    values = unit * (2 + people) * orders ** np.repeat(slopes, trials)
    codes = np.zeros(len(orders), dtype=np.int64)
    (found,) = learning(values, orders, [str(person) for person in people], codes, ["a"])
    assert found.details["slope"] == pytest.approx(np.mean(slopes), abs=1e-9)
    first = np.exp(np.mean(np.log(unit * (2 + np.arange(len(slopes))))))
    assert found.details["value_at_first_trial"] == pytest.approx(first, rel=1e-9)


@pytest.mark.parametrize(
    ("values", "orders", "status"),
    [
        ([2.0, 0.0, 3.0, 4.0], [1, 2, 1, 2], "undefined: a logarithm needs values above zero"),
        ([2.0, 1.0, 3.0, 4.0], [0, 1, 0, 1], "undefined: a logarithm needs values above zero"),
        ([2.0, 1.0, 3.0, 4.0], [1, 1, 1, 1], "undefined: no participant is complete"),
        ([2.0, 1.0, 3.0, 4.0], [1, 2, 3, 3], "undefined: only one participant is complete"),
        ([2.0, 2.0, 3.0, 3.0], [1, 2, 1, 2], "undefined: all differences are zero"),
        ([], [], "undefined: no participant is complete"),
    ],
)
def test_trials_without_a_slope_say_why(values: list[float], orders: list[int], status: str) -> None:
    people, codes = ["P1", "P1", "P2", "P2"][: len(values)], np.zeros(len(values), dtype=np.int64)
    (found,) = learning(np.array(values), np.array(orders, dtype=float), people, codes, ["a"])
    assert found.status == status
    assert found.status in STATUSES
    assert (found.p, found.statistic) == (None, None)


# Fitts ------------------------------------------------------------------------------------------------------------


def movements() -> dict[str, Any]:
    rows = r_reference.rows("fitts")
    columns: dict[str, Any] = {
        name: np.array([float(row[name]) for row in rows])
        for name in ("amplitude", "width", "moved", "deviation", "time")
    }
    return {**columns, "block": [row["block"] for row in rows]}


def same_line(found: Fitted, wanted: dict[str, Any]) -> None:
    assert found.status == "ok"
    assert found.blocks == wanted["blocks"]
    assert found.intercept_s == pytest.approx(wanted["intercept"], rel=1e-9)
    assert found.slope_s_bit == pytest.approx(wanted["slope"], rel=1e-9)
    assert found.ci_intercept == pytest.approx(wanted["ci_intercept"], rel=1e-9)
    assert found.ci_slope == pytest.approx(wanted["ci_slope"], rel=1e-9)
    assert found.r_squared == pytest.approx(wanted["r_squared"], rel=1e-9)
    assert found.throughput_bits_s == pytest.approx(wanted["throughput"], rel=1e-9)


def test_fitts_law_against_r() -> None:
    data = movements()
    same_line(fitted(nominal(data["amplitude"], data["width"], data["time"])), FITTS["nominal"])
    blocks = effective(data["moved"], data["deviation"], data["time"], data["block"])
    same_line(fitted(blocks), FITTS["effective"])
    assert blocks.count.sum() == len(data["time"])


def test_an_effective_width_holds_96_percent_of_normal_hits() -> None:
    """ISO 9241-411: 4 % of hits lie outside."""
    hits = np.random.default_rng(0).normal(0, 3, 200_000)
    assert np.mean(np.abs(hits) < effective_width(hits) / 2) == pytest.approx(0.961, abs=0.002)


@given(intercept=st.floats(0, 1), slope=st.floats(0.01, 1))
def test_times_on_a_line_give_back_the_line(intercept: float, slope: float) -> None:
    amplitude, width = np.array([100.0, 200, 400, 100]), np.array([10.0, 10, 20, 40])
    found = fitted(nominal(amplitude, width, intercept + slope * np.log2(amplitude / width + 1)))
    assert found.intercept_s == pytest.approx(intercept, abs=1e-9)
    assert found.slope_s_bit == pytest.approx(slope)
    assert found.r_squared == pytest.approx(1)


@pytest.mark.parametrize(
    ("amplitude", "width", "time", "status"),
    [
        ([], [], [], "undefined: too few values for the terms of the model"),
        ([100, 200], [10, 10], [0.5, 0.6], "undefined: too few values for the terms of the model"),
        ([100, 200, 400], [10, 20, 40], [0.5, 0.6, 0.4], "undefined: no value varies"),
    ],
)
def test_blocks_without_a_line_say_why(
    amplitude: list[float], width: list[float], time: list[float], status: str
) -> None:
    found = fitted(nominal(*(np.array(column, dtype=float) for column in (amplitude, width, time))))
    assert found.status == status
    assert (found.slope_s_bit, found.r_squared) == (None, None)
    assert (found.throughput_bits_s is None) == (not amplitude)


def test_a_block_without_spread_is_left_out_and_equal_times_explain_nothing() -> None:
    blocks = effective(np.array([100.0, 101, 50, 50]), np.array([1.0, -1, 2, 2]), np.ones(4), ["a", "a", "b", "b"])
    assert blocks.count.tolist() == [2]
    flat = fitted(nominal(np.array([100.0, 200, 400]), np.full(3, 10.0), np.full(3, 0.5)))
    assert (flat.slope_s_bit, flat.r_squared) == (0, None)
