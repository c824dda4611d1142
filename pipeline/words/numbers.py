"""Numbers, intervals and p values as text, in the manner of the APA. No figure is computed here."""

from __future__ import annotations

import math

MINUS = "\u2212"
THIN_SPACE = "\u2009"
NO_VALUE = "–"
"""What stands for a value that is missing or undefined."""


_WHOLE_FROM = 1000  # numbers as large are shown without decimals


def number(value: float | None, digits: int = 2) -> str:
    """A number of any size.

    From 0.1 to 1000 it has `digits` decimals. Above, it is whole, its thousands set apart (`372 633`); below, it keeps
    `digits` + 1 significant digits (`0.0123`); very small and very large ones are written as powers of ten.
    """
    if value is None or not math.isfinite(value):
        return NO_VALUE
    size = abs(value)
    if size >= 1e15:
        text = f"{value:.{digits}e}"  # a float this large does not hold single units any more
    elif size >= _WHOLE_FROM:
        text = f"{value:,.0f}".replace(",", THIN_SPACE)
    elif size == 0 or size >= 0.1:
        text = f"{value:.{digits}f}"
    else:
        text = f"{value:.{digits + 1}g}" if size >= 1e-4 else f"{value:.1e}"
    return text.replace("-", MINUS)


def percent(value: float | None, digits: int = 1) -> str:
    """A share from 0 to 1 as percent: `38.3 %`."""
    return NO_VALUE if value is None or not math.isfinite(value) else f"{100 * value:.{digits}f} %".replace("-", MINUS)


def milliseconds(value: float | None) -> str:
    """A lag, given in seconds, as milliseconds with its sign: `+117`."""
    if value is None or not math.isfinite(value):
        return NO_VALUE
    text = f"{1000 * value:+.0f}"
    return "0" if text in ("+0", "-0") else text.replace("-", MINUS)


def fraction(value: float | None, digits: int = 3) -> str:
    """A number that cannot exceed 1, such as a correlation, without its leading zero: `.71` (APA 7, 6.36)."""
    if value is None or not math.isfinite(value):
        return NO_VALUE
    text = f"{value:.{digits}f}"
    text = text.replace("0.", ".", 1) if text.lstrip("-").startswith("0.") else text
    return text.removeprefix("-") if not float(text) else text.replace("-", MINUS)


def interval(low: float | None, high: float | None, digits: int = 2) -> str:
    """`[−0.03, 0.85]`, with as many decimals in both bounds; `NO_VALUE` where one is missing."""
    if low is None or high is None:
        return NO_VALUE
    digits = digits_beside(digits, low, high)
    if max(abs(low), abs(high)) >= 0.1:
        return f"[{fixed_decimals(low, digits)}, {fixed_decimals(high, digits)}]"
    return f"[{number(low, digits)}, {number(high, digits)}]"


def estimate(value: float, low: float | None, high: float | None, unit: str = "", digits: int = 2) -> str:
    """`11.80 s [4.32, 19.28]`: a value and its interval, or the value alone, with as many decimals in all three.

    Where one of the three is shown as a whole number for its size, so are the others: `−682 mm² [−2 408, 1 044]`.
    """
    if low is None or high is None:
        return f"{number(value, digits)} {unit}".strip()
    digits = digits_beside(digits, value, low, high)
    return " ".join(part for part in (number(value, digits), unit, interval(low, high, digits)) if part)


def digits_beside(digits: int, *values: float) -> int:
    """The decimals of numbers side by side: none where one of them is so large that `number` gives it none."""
    return 0 if any(abs(value) >= _WHOLE_FROM for value in values) else digits


def fraction_interval(low: float | None, high: float | None, digits: int = 2) -> str:
    """An interval of numbers that cannot exceed 1: `[.01, .35]`."""
    return NO_VALUE if low is None or high is None else f"[{fraction(low, digits)}, {fraction(high, digits)}]"


def fixed_decimals(value: float, digits: int) -> str:
    """A number with `digits` decimals even where that rounds it to zero, which then has no sign."""
    text = number(value, digits) if abs(value) >= 0.1 else f"{value:.{digits}f}".replace("-", MINUS)
    return text.removeprefix(MINUS) if float(text.replace(MINUS, "-").replace(THIN_SPACE, "")) == 0 else text


_MOST_DECIMALS = 12
_LEVEL = 0.05  # of significance, as nearly every study chooses it


def p_value(p: float | None, digits: int = 4) -> str:
    """A p value with `digits` decimals: `.0071`.

    A p value is never 0 or 1, so one that would be rounded to that is shown as `< .0001` or `> .9999`; one just below
    .05 is not rounded up to it, but has as many decimals as keep it below: `.04996`.
    """
    if p is None:
        return NO_VALUE
    while digits < _MOST_DECIMALS and p < _LEVEL <= round(p, digits):
        digits += 1
    smallest = 10.0**-digits
    if p < smallest:
        return f"< {fraction(smallest, digits)}"
    return f"> {fraction(1 - smallest, digits)}" if p > 1 - smallest / 2 else fraction(p, digits)


def p_phrase(p: float | None, symbol: str = "p", digits: int = 4) -> str:
    """`p = .0071`, `p < .0001`."""
    text = p_value(p, digits)
    return f"{symbol} {text}" if text.startswith(("<", ">")) else f"{symbol} = {text}"
