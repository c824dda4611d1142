"""The effect size of a row of `comparisons`, with its interval."""

from __future__ import annotations

from pipeline.statistics import RATIO
from pipeline.words.comparison import Row
from pipeline.words.numbers import (
    NO_VALUE,
    fixed_decimals,
    fraction,
    fraction_interval,
    interval,
    number,
)

_EFFECT_SIZES = {
    "generalized eta squared": "η²G",
    "partial eta squared": "η²p",
    "Cohen's d_z": "d_z",
    "Cohen's d_av": "d_av",
    "Cohen's d": "d",
    "matched-pairs rank-biserial": "r_rb",
    "rank-biserial": "r_rb",
    "rank epsilon squared": "ε²",
    "odds ratio": "OR",
    "eta squared Q": "η²Q",
    "Kendall's W": "W",
}
_NEVER_OVER_1 = ("η²G", "η²p", "r_rb", "W", "ε²", "η²Q")  # printed without a leading zero, as APA has it


def effect_size(row: Row, before_interval: str = " ") -> str:
    """`d_z = 0.65 [0.01, 1.27]`, `η²G = .10 [.00, .29]`; a ratio of geometric means as `ratio_to_first` words it.

    Where the row has no effect size, the reason, or `NO_VALUE`; one without an interval says so.
    """
    if row["effect_size"] is None:
        return str((row["details"] or {}).get("no_effect_size", NO_VALUE))
    if row["effect_size_name"] == RATIO and ratio_to_first(row):
        return ratio_to_first(row, before_interval)
    bounds = effect_interval(row)
    value = f"{effect_name(row)} = {effect_value(row)}"
    if bounds == NO_VALUE:
        return f"{value} ({(row['details'] or {}).get('no_interval', 'no interval')})"
    return f"{value}{before_interval}{bounds}"


def effect_name(row: Row) -> str:
    """`η²G`, `d_z`."""
    return _EFFECT_SIZES.get(row["effect_size_name"], str(row["effect_size_name"]))


def effect_value(row: Row) -> str:
    """An effect size without its interval."""
    if row["effect_size"] is None:
        return NO_VALUE
    name = effect_name(row)
    if name in _NEVER_OVER_1:
        return fraction(row["effect_size"], 2)
    return number(row["effect_size"]) if name == "estimate" else fixed_decimals(row["effect_size"], 2)


def effect_interval(row: Row) -> str:
    """An effect size's 95 % interval, or `NO_VALUE`."""
    bounded = effect_name(row) in _NEVER_OVER_1
    return (fraction_interval if bounded else interval)(row["ci_low"], row["ci_high"])


def ratio_to_first(row: Row, before_interval: str = " ") -> str:
    """`geometric mean 0.81 times that of kinect [0.71, 0.91]`; empty unless logarithms are tested."""
    details = row["details"] or {}
    if details.get("ratio_to_first") is None:
        return ""
    first = "the first" if details["first"] is None else details["first"]
    bounds = interval(*details["ratio_to_first_ci"])
    value = f"geometric mean {number(details['ratio_to_first'])} times that of {first}"
    return value if bounds == NO_VALUE else f"{value}{before_interval}{bounds}"
