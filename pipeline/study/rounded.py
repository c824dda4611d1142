"""A printed figure as the interval of values it may stand for, and exact arithmetic on such intervals."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

Rounding = Literal["nearest", "cut_off", "either"]
Relation = Literal["=", "<", ">", "≤", "≥"]

_NUMBER = re.compile(r"([<>=≤≥]?)\s*([+-]?)(\d{1,30}(?:\.\d{0,30})?|\.\d{1,30})(?:[eE]([+-]?\d{1,2}))?\s*%?")
_MOST_DECIMALS = 12
_SPELLINGS = str.maketrans({"\u2212": "-", "\u2013": "-", "\u00a0": " ", "\u2009": " "})


@dataclass(frozen=True)
class Interval:
    """All values from low to high, both of them included."""

    low: Fraction
    high: Fraction

    def __add__(self, other: Interval) -> Interval:
        return Interval(self.low + other.low, self.high + other.high)

    def __sub__(self, other: Interval) -> Interval:
        return Interval(self.low - other.high, self.high - other.low)

    def __mul__(self, factor: Fraction | int) -> Interval:
        ends = (self.low * factor, self.high * factor)
        return Interval(min(ends), max(ends))

    def __truediv__(self, other: Interval) -> Interval:
        """The quotient of two figures that do not depend on each other; ZeroDivisionError where `other` holds zero."""
        if other.low <= 0 <= other.high:
            raise ZeroDivisionError
        ends = [a / b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Interval(min(ends), max(ends))

    def meets(self, other: Interval) -> bool:
        """Whether some value is in both."""
        return self.low <= other.high and other.low <= self.high

    def size(self) -> Interval:
        """The interval of the values' absolute sizes."""
        ends = sorted((abs(self.low), abs(self.high)))
        return Interval(Fraction(0) if self.low <= 0 <= self.high else ends[0], ends[1])

    def squared(self) -> Interval:
        """The interval of the values' squares."""
        size = self.size()
        return Interval(size.low**2, size.high**2)

    def at_least(self, low: int) -> Interval:
        """The part that is not below a bound; the bound itself if there is none."""
        return Interval(max(self.low, Fraction(low)), max(self.high, Fraction(low)))


@dataclass(frozen=True)
class Rounded:
    """A number as printed. `unit` is one in its last digit; `relation` is other than = only for p values."""

    text: str
    value: Fraction
    unit: Fraction
    relation: Relation = "="
    rounding: Rounding = "nearest"

    @classmethod
    def read(cls, text: str, rounding: Rounding = "nearest") -> Rounded:
        """From its text: 12, 0.050, .050, −1.5, 3.7263e5, 38.3 %, < .001. Raises ValueError for anything else."""
        spelt = text.strip().translate(_SPELLINGS).replace("<=", "≤").replace(">=", "≥")
        match = _NUMBER.fullmatch(spelt)
        if match is None:
            raise ValueError("should be a number with its digits as printed, such as 0.050, .050 or 3.7263e5")
        relation, sign, digits, exponent = match.groups()
        decimals = len(digits.partition(".")[2]) - int(exponent or 0)
        value = Fraction(f"{sign}0{digits}".removesuffix(".")) * Fraction(10) ** int(exponent or 0)
        return cls(text.strip(), value, Fraction(10) ** -decimals, relation or "=", rounding)  # type: ignore[arg-type]

    def as_read(self, rounding: Rounding) -> Rounded:
        """The same printed figure, assumed to be rounded in another way."""
        return replace(self, rounding=rounding)

    @property
    def interval(self) -> Interval:
        """The values it may stand for.

        Rounded to the nearest, half up or half to even: half a unit to both sides, the ends included. Cut off: a unit
        away from zero. A p value with < or > goes to 0 or to 1.
        """
        if self.relation in ("<", "≤"):
            return Interval(min(Fraction(0), self.value), self.value)
        if self.relation in (">", "≥"):
            return Interval(self.value, max(Fraction(1), self.value))
        inwards = 0 if self.rounding == "cut_off" else self.unit / 2
        outwards = self.unit / 2 if self.rounding == "nearest" else self.unit
        if self.value == 0:
            return Interval(-outwards, outwards)
        if self.value < 0:
            return Interval(self.value - outwards, self.value + inwards)
        return Interval(self.value - inwards, self.value + outwards)

    def like(self, value: Fraction | float) -> str:
        """Another value, written with as many decimals."""
        decimals = _decimals(self.unit)
        if decimals > _MOST_DECIMALS:
            return f"{float(value):.3g}"
        if decimals >= 0:
            return f"{float(value):.{decimals}f}"
        digits = len(str(abs(int(self.value / self.unit)))) - 1
        return re.sub(r"e\+0?", "e", f"{float(value):.{digits}e}")

    def span(self, low: Fraction | float, high: Fraction | float) -> str:
        """Two values, written with as many decimals; only one if they read the same."""
        return " to ".join(dict.fromkeys((self.like(low), self.like(high))))


def _decimals(unit: Fraction) -> int:
    """The number of decimals; negative where the last printed digit counts tens or more."""
    return len(str(unit.denominator)) - 1 if unit <= 1 else 1 - len(str(unit.numerator))
