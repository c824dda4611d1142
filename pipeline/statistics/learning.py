"""Practice: whether people become faster from trial to trial, by the power law of practice of each participant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from pipeline.statistics import NOT_POSITIVE
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.paired import t_paired
from pipeline.statistics.result import IntArray, Result

EFFECT = "trial order"
_METHOD = "power law of practice: slope of log value on log trial number of each participant, t test"


def learning(
    values: FloatArray, orders: FloatArray, participants: Sequence[str], conditions: IntArray, levels: Sequence[str]
) -> list[Result]:
    """The slopes of log value on log order (Newell and Rosenbloom 1981), against zero and between conditions.

    One row per trial (N,): its value, such as a time, which must be above 0; its number in the condition from 1 on;
    its participant; its condition. First one row per condition, its slopes against zero (contrast: the condition),
    then one of every two (contrast `a - b`), of the participants who have a slope in both. A slope needs two
    orders. Effect size: d_z of the slopes, or of their differences; the mean slope, what it makes of a
    value when trials double, and the value that the curve of a condition begins with, are in the details.
    """
    curves = _curves(values, orders, participants, conditions, len(levels))
    if isinstance(curves, str):
        names = [*levels, *(f"{first} - {second}" for first, second in combinations(levels, 2))]
        people = len(set(participants))
        return [Result(EFFECT, "t", _METHOD, "Cohen's d_z", people, contrast=name, status=curves) for name in names]
    slopes, starts = curves
    rows = []
    for slope, start, name in zip(slopes.T, starts.T, levels, strict=True):
        known = slope[np.isfinite(slope)]
        begin = float(np.exp(np.mean(start[np.isfinite(slope)]))) if len(known) else None
        rows.append(_row(known, np.zeros(len(known)), name, len(slope), begin))
    for (i, first), (j, second) in combinations(enumerate(levels), 2):
        both = np.isfinite(slopes[:, i]) & np.isfinite(slopes[:, j])
        rows.append(_row(slopes[both, i], slopes[both, j], f"{first} - {second}", len(slopes)))
    return rows


def _curves(
    values: FloatArray, orders: FloatArray, participants: Sequence[str], conditions: IntArray, k: int
) -> tuple[FloatArray, FloatArray] | str:
    """Slope, and log value at the first trial, of each participant in each condition (n, k); or why there are none.

    Both are NaN where there are not two orders.
    """
    if not ((values > 0).all() and (orders > 0).all()):
        return NOT_POSITIVE
    people = {name: index for index, name in enumerate(dict.fromkeys(participants))}
    cell = np.array([people[name] for name in participants], dtype=np.int64) * k + conditions
    slopes, starts = np.full((2, len(people), k), np.nan)
    in_order = np.argsort(cell, kind="stable")
    cells, begins = np.unique(cell[in_order], return_index=True)
    for number, rows in zip(cells.tolist(), np.split(in_order, begins[1:]), strict=False):
        at = divmod(number, k)
        x, y = np.log(orders[rows]), np.log(values[rows])
        if np.ptp(x) > 0:
            slopes[at] = np.sum((x - x.mean()) * (y - y.mean())) / np.sum((x - x.mean()) ** 2)
            starts[at] = y.mean() - slopes[at] * x.mean()
    return slopes, starts


def _row(first: FloatArray, second: FloatArray, contrast: str, people: int, begin: float | None = None) -> Result:
    tested = t_paired(first, second, EFFECT)
    details: dict[str, Any] = {
        "slope": None,
        "ratio_when_trials_double": None,
        "ci_slope": None,
        "value_at_first_trial": begin,
        "n_without_slope": people - len(first),
    }
    if len(first):
        slope = float(np.mean(first - second))
        details |= {"slope": slope, "ratio_when_trials_double": float(2**slope)}
    if "ci_difference" in tested.details:
        details["ci_slope"] = tested.details["ci_difference"]
    others = {name: value for name, value in tested.details.items() if name not in ("ci_difference", "d_av")}
    return replace(tested, method=_METHOD, contrast=contrast, details={**details, **others})
