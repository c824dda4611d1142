"""Where values are far larger than what they differ by: is it the other program that runs out of digits, or ours?"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from pipeline.analysis.against import ways
from pipeline.analysis.against.problems import Problem
from pipeline.statistics.arrays import FloatArray

_EXACT = 1e-9  # how near ours has to be to the exact F
_OF_ROUND_OFF = 10.0  # errors of a decomposition are a few times the size of a single rounding
_WORTH_SAYING = 1e-8


def run_out(problem: Problem, theirs: ways.Figures, quantity: str) -> float | None:
    """The other program's figure of one factor, if exact fractions give ours and round-off is enough for its error."""
    data: Any = problem.data
    own = ways.ours(problem.row, quantity)
    f, df2 = problem.row["statistic"], problem.row["df2"]
    if own is None or f is None or data.values.ndim != 2:
        return None
    exact, error = _exact_f(data.values)
    lost = float(np.finfo(np.float64).eps) * float(np.max(np.abs(data.values))) / error
    # A change of F by a share of it changes p by df2 / 2 such shares at the most, for p falls as F^(−df2/2).
    room = _OF_ROUND_OFF * lost * (1.0 if quantity == "statistic" else 1 + df2 / 2)
    is_ours_exact = abs(f - exact) <= _EXACT * exact
    if lost < _WORTH_SAYING or not is_ours_exact or abs(theirs[quantity].value - own) > room * abs(own):
        return None
    return theirs[quantity].value


def _exact_f(values: FloatArray) -> tuple[float, float]:
    """F of conditions that the same people met, values (n, k), without round-off; and the root of its error."""
    exact = [[Fraction(float(value)) for value in row] for row in values]
    n, k = values.shape
    of_people = [sum(row, Fraction(0)) / k for row in exact]
    of_conditions = [sum((row[j] for row in exact), Fraction(0)) / n for j in range(k)]
    mean = sum(of_people, Fraction(0)) / n
    effect = n * sum(((value - mean) ** 2 for value in of_conditions), Fraction(0)) / (k - 1)
    error = sum(
        ((exact[i][j] - of_people[i] - of_conditions[j] + mean) ** 2 for i in range(n) for j in range(k)), Fraction(0)
    ) / ((n - 1) * (k - 1))
    return (float(effect / error), float(error) ** 0.5) if error else (np.inf, np.inf)
