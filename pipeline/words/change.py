"""By how much, and in which direction, a measure differs between two conditions."""

from __future__ import annotations

from pipeline.study.measures import measure
from pipeline.study.statistical_tests import TESTS
from pipeline.words.comparison import Row
from pipeline.words.names import unit_of
from pipeline.words.numbers import number, percent

_PERCENTAGE_MAX = 10.0  # 1000 %


def change_phrase(row: Row) -> str:
    """`reduced by 38.3 %`, or where a percentage is not meaningful `higher by 0.42`."""
    reduction = meaningful_reduction(row)
    if reduction is not None:
        return reduction_phrase(reduction)
    if row["mean_difference"] == 0:
        return "the same mean"
    return f"{'lower' if row['mean_difference'] > 0 else 'higher'} by {amount_of_change(row)}"


def reduction_phrase(reduction: float) -> str:
    """`reduced by 38.3 %`, `increased by 4.0 %`."""
    return f"{'reduced' if reduction >= 0 else 'increased'} by {percent(abs(reduction))}"


def amount_of_change(row: Row) -> str:
    """How much a measure changes, without its direction: `38.3 %`, or the difference in its unit: `0.42 mm`."""
    reduction = meaningful_reduction(row)
    if reduction is not None:
        return percent(abs(reduction))
    return difference_phrase(row)


def difference_phrase(row: Row) -> str:
    """`0.42 mm`: the size of the difference of the means in the measure's unit; of answers in percentage points."""
    size = abs(row["mean_difference"])
    if TESTS[row["test"]].values == "answers":
        return f"{number(100 * size, 1)} percentage points"
    return f"{number(size)} {unit_of(row['measure'])}".strip()


def meaningful_reduction(row: Row) -> float | None:
    """The reduction relative to the first mean, or None where a percentage is not meaningful.

    It is on a ratio scale only, whose zero means "none" (Stevens 1946), and counts are one. Shares of answers are left
    out: a percentage of percentages is easily misread. So is a mean of more than eleven times the first: that much is
    said by a first mean near zero, which is hardly known.
    """
    if row["reduction"] is not None and abs(row["reduction"]) > _PERCENTAGE_MAX:
        return None
    values = TESTS[row["test"]].values
    is_ratio_scale = measure(row["measure"]).scale == "ratio" or values == "counts"
    return row["reduction"] if is_ratio_scale and values != "answers" else None


def direction(row: Row) -> str:
    """`lower (better)`: where the second mean lies, and whether that is better where the measure's record says so."""
    if row["mean_difference"] == 0:
        return "the same"
    side = "lower" if row["mean_difference"] > 0 else "higher"
    better = measure(row["measure"]).better
    return side if better == "unknown" else f"{side} ({'better' if side == better else 'worse'})"
