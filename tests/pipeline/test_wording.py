"""Numbers and names as people read them."""

from __future__ import annotations

import pytest

from pipeline.wording import interval, measure_label, measure_order, number, p_phrase, percent, seconds, short_label


@pytest.mark.parametrize(
    ("value", "shown"),
    [(44.208, "44.21"), (-0.5, "−0.50"), (372633.4, "372\u2009633"), (0.01234, "0.0123"), (0.0, "0.00"), (None, "–")],
)
def test_numbers(value: float | None, shown: str) -> None:
    assert number(value) == shown


def test_p_values_lags_and_shares() -> None:
    assert p_phrase(0.0071) == "p = .0071"
    assert p_phrase(3e-9) == "p < .0001"
    assert (seconds(0.1166), seconds(-0.0004), seconds(-0.0123), seconds(None)) == ("+117", "0", "−12", "–")
    assert percent(0.3834) == "38.3 %"


def test_both_bounds_of_an_interval_have_as_many_decimals() -> None:
    assert interval(-0.0287, 0.852) == "[−0.03, 0.85]"
    assert interval(-0.001, 0.85) == "[0.00, 0.85]"
    assert interval(None, 1.0) == "–"


def test_names_carry_their_units_and_scales_their_order() -> None:
    assert measure_label("selection_mse_px2") == "Selection error, MSE (px²)"
    assert measure_label("peak_speed_mm_s") == "Peak speed (mm/s)"
    assert measure_label("nasa_tlx/mental") == "NASA-TLX: mental"
    assert short_label("nasa_tlx/mental") == "Mental"
    scales = ["nasa_tlx/total", "nasa_tlx/effort", "nasa_tlx/mental"]
    assert sorted(scales, key=measure_order) == ["nasa_tlx/mental", "nasa_tlx/effort", "nasa_tlx/total"]
