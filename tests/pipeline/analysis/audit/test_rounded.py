"""A printed figure's interval holds what was rounded, and interval arithmetic holds every result."""

from __future__ import annotations

from decimal import ROUND_DOWN, ROUND_HALF_EVEN, ROUND_HALF_UP, Decimal
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.study.rounded import Interval, Rounded

VALUES = st.decimals(-(10**6), 10**6, places=7)
DIGITS = st.integers(0, 5)


def printed(value: Decimal, digits: int, rounding: str) -> str:
    return f"{value.quantize(Decimal(1).scaleb(-digits), rounding=rounding)}"


@given(VALUES, DIGITS, st.sampled_from([ROUND_HALF_UP, ROUND_HALF_EVEN]))
def test_the_interval_holds_what_was_rounded(value: Decimal, digits: int, rounding: str) -> None:
    interval = Rounded.read(printed(value, digits, rounding)).interval
    assert interval.low <= Fraction(value) <= interval.high


@given(VALUES, DIGITS)
def test_the_interval_holds_what_was_cut_off(value: Decimal, digits: int) -> None:
    for rounding in ("cut_off", "either"):
        interval = Rounded.read(printed(value, digits, ROUND_DOWN), rounding).interval
        assert interval.low <= Fraction(value) <= interval.high


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("12", "11.5", "12.5"),
        ("0.050", "0.0495", "0.0505"),
        (".05", "0.045", "0.055"),
        ("3.7263e5", "372625", "372635"),
        ("6.2e2", "615", "625"),
        ("\u22121.50", "-1.505", "-1.495"),
        ("38.3 %", "38.25", "38.35"),
        ("< .001", "0", "0.001"),
        ("<= 0.05", "0", "0.05"),
        ("> .05", "0.05", "1"),
    ],
)
def test_digits_as_printed_count(text: str, low: str, high: str) -> None:
    assert Rounded.read(text).interval == Interval(Fraction(low), Fraction(high))


@pytest.mark.parametrize(
    "text", ["", "about 5", "1,234", "7,17", "nan", "inf", "1e999", "0x10", "1_000", "5 6", "--5", "."]
)
def test_what_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="should be a number with its digits as printed"):
        Rounded.read(text)


@pytest.mark.parametrize(
    ("text", "value", "expected"),
    [("619", 621.0, "621"), ("0.0071", 0.00713, "0.0071"), ("3.7263e5", 412345.6, "4.1235e5"), ("6", 5.8, "6")],
)
def test_another_value_reads_with_as_many_digits(text: str, value: float, expected: str) -> None:
    assert Rounded.read(text).like(value) == expected


INTERVALS = st.tuples(st.fractions(-50, 50), st.fractions(0, 5)).map(lambda ends: Interval(ends[0], ends[0] + ends[1]))
PARTS = st.fractions(0, 1)


@given(INTERVALS, INTERVALS, PARTS, PARTS, st.fractions(-9, 9))
def test_arithmetic_holds_every_result(a: Interval, b: Interval, u: Fraction, v: Fraction, factor: Fraction) -> None:
    x, y = a.low + u * (a.high - a.low), b.low + v * (b.high - b.low)
    results = [(a + b, x + y), (a - b, x - y), (a * factor, x * factor), (a.size(), abs(x)), (a.squared(), x * x)]
    if not b.low <= 0 <= b.high:
        results.append((a / b, x / y))
    for interval, value in results:
        assert interval.low <= value <= interval.high
    assert a.meets(Interval(x, x))


def test_a_quotient_by_what_may_be_zero_is_refused() -> None:
    with pytest.raises(ZeroDivisionError):
        Interval(Fraction(1), Fraction(2)) / Interval(Fraction(-1), Fraction(1))
