"""Answers of a questionnaire that run on another range than its rule takes, such as 1 to 7 for 0 to 6.

Such answers are not wrong one by one: those that happen to lie in the range are off by the same step. So no score is
made of any, and the remedy is one line in study.yaml.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from pipeline.statistics.arrays import FloatArray
from pipeline.study.scoring_rules import ScoringRule

_AT_LEAST = 2  # people and items with an answer outside: fewer are slips of the pen


def shifted_range(answers: pd.DataFrame, limits: tuple[float, float]) -> tuple[float, float] | None:
    """The range on which the answers seem to run: that of the rule, moved; None where they do not look moved.

    `answers` has participant, measure and value, one answer a row, of one questionnaire's items.
    """
    low, high = limits
    known = answers[np.isfinite(answers["value"])]
    value: FloatArray = known["value"].to_numpy(np.float64)
    outside = known[(value < low) | (value > high)]
    if any(outside[name].nunique() < _AT_LEAST for name in ("participant", "measure")):
        return None
    above, below = max(0.0, float(value.max()) - high), max(0.0, low - float(value.min()))
    if above and below:
        return None
    step = float(math.ceil(above)) if above else -float(math.ceil(below))
    moved = (low + step, high + step)
    return moved if value.min() >= moved[0] and value.max() <= moved[1] else None


def remedy(questionnaire: str, rule: ScoringRule, limits: tuple[float, float], moved: tuple[float, float]) -> str:
    """What to write in study.yaml about answers that run on another range than the rule takes."""
    as_given = " (of items as they were answered, none of them turned yet)" if rule.reversed else ""
    (low, high), (first, last) = limits, moved
    key = f"scoring: {{{questionnaire}: {{rule: {rule.name}, range: [{first:g}, {last:g}]}}}}"
    return (
        f"answers seem to run from {first:g} to {last:g}, and rule {rule.name} takes {low:g} to {high:g}, so no score"
        f" is made of them; state {key}{as_given}, or range: [{low:g}, {high:g}] if those outside are slips"
    )
