"""Numbers and names as people read them."""

from __future__ import annotations

import pytest

from pipeline.study.measures import measure_order
from pipeline.words.effect_sizes import effect_size
from pipeline.words.evidence import statistic
from pipeline.words.names import measure_as_subject, measure_label, short_label
from pipeline.words.numbers import (
    estimate,
    fraction,
    fraction_interval,
    interval,
    milliseconds,
    number,
    p_phrase,
    percent,
)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (44.208, "44.21"),
        (-0.5, "−0.50"),
        (372633.4, "372\u2009633"),
        (0.01234, "0.0123"),
        (0.0, "0.00"),
        (3.25e20, "3.25e+20"),
        (None, "–"),
    ],
)
def test_numbers(value: float | None, shown: str) -> None:
    assert number(value) == shown


def test_p_values_lags_and_shares() -> None:
    assert p_phrase(0.0071) == "p = .0071"
    assert p_phrase(3e-9) == "p < .0001"
    assert (milliseconds(0.1166), milliseconds(-0.0004), milliseconds(-0.0123), milliseconds(None)) == (
        "+117",
        "0",
        "−12",
        "–",
    )
    assert percent(0.3834) == "38.3 %"


def test_what_cannot_exceed_one_has_no_leading_zero_and_p_is_never_nought_or_one() -> None:
    assert [fraction(value, 2) for value in (0.157, -0.034, -0.001, 1.0, None)] == [
        ".16",
        "−.03",
        ".00",
        "1.00",
        "–",
    ]
    assert fraction_interval(-0.034, 0.851) == "[−.03, .85]"
    assert [p_phrase(p, digits=3) for p in (0.00049, 0.0071, 0.9994, 0.9996, 1.0)] == [
        "p < .001",
        "p = .007",
        "p = .999",
        "p > .999",
        "p > .999",
    ]
    assert p_phrase(1.0) == "p > .9999"


@pytest.mark.parametrize(
    ("name", "value", "df", "shown"),
    [
        ("F", 10.857, (1.0, 11.0), "F(1, 11) = 10.86"),
        ("F", 5.6e-32, (1.0, 11.0), "F(1, 11) = 0.00"),
        ("W+", 67.5, (None, None), "W₊ = 67.5"),
        ("W+", 60.0, (None, None), "W₊ = 60"),
        ("U", 112.0, (None, None), "U = 112"),
        ("chi2", 5.2, (2.0, None), "χ²(2) = 5.20"),
        ("t", -0.0123, (None, 14.5), "t(14.50) = −0.01"),
        ("BF10", 0.0421, (None, None), "BF₁₀ = 0.0421"),
    ],
)
def test_statistics(name: str, value: float, df: tuple[float | None, float | None], shown: str) -> None:
    assert statistic({"statistic_name": name, "statistic": value, "df1": df[0], "df2": df[1]}) == shown


def test_effect_sizes() -> None:
    row = {"effect_size_name": "generalized eta squared", "effect_size": 0.157, "ci_low": 0.01, "ci_high": 0.354}
    assert effect_size(row) == "η²G = .16 [.01, .35]"
    assert effect_size({**row, "effect_size_name": "Cohen's d_z"}, ", 95 % CI ") == "d_z = 0.16, 95 % CI [0.01, 0.35]"


def test_measures_as_subjects() -> None:
    names = ("selection_mse_px2", "completion_time_s", "nasa_tlx/mental", "grip_force, left_s")
    assert [measure_as_subject(name) for name in names] == [
        "Selection error (MSE)",
        "Completion time",
        "NASA-TLX mental",
        "Grip force, left",
    ]


def test_both_bounds_of_an_interval_have_as_many_decimals() -> None:
    assert interval(-0.0287, 0.852) == "[−0.03, 0.85]"
    assert interval(-0.001, 0.85) == "[0.00, 0.85]"
    assert interval(None, 1.0) == "–"
    assert interval(-2846.2, -373.04) == "[−2\u2009846, −373]"


def test_a_value_and_its_interval_have_as_many_decimals() -> None:
    """Side by side `−682.06 mm²` and `−2 408` would state one of them to a hundredth and the other to a whole."""
    assert estimate(11.8, 4.319, 19.281, "s") == "11.80 s [4.32, 19.28]"
    assert estimate(-682.06, -2407.9, 1043.8, "mm²") == "−682 mm² [−2\u2009408, 1\u2009044]"
    assert estimate(2.083, None, None) == "2.08"


def test_names_carry_their_units_and_scales_their_order() -> None:
    assert measure_label("selection_mse_px2") == "Selection error, MSE (px²)"
    assert measure_label("peak_speed_mm_s") == "Peak speed (mm/s)"
    assert measure_label("nasa_tlx/mental") == "NASA-TLX: mental"
    assert short_label("nasa_tlx/mental") == "Mental"
    scales = ["nasa_tlx/total", "nasa_tlx/effort", "nasa_tlx/mental"]
    assert sorted(scales, key=measure_order) == ["nasa_tlx/mental", "nasa_tlx/effort", "nasa_tlx/total"]
