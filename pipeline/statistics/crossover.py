"""The 2 × 2 crossover: two conditions in two periods, in either order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pipeline.statistics import ALL_ZERO, NO_COMPLETE, NO_ERROR, ONE_ORDER, TOO_FEW_VALUES
from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.result import (
    Result,
    negligible,
    room_of,
    rounded_differences,
    step_of,
    tied,
)
from pipeline.statistics.tails import t_above, t_quantile

EFFECTS = ("treatment", "period", "carry-over")


def crossover(
    values: FloatArray,
    first_came_first: Sequence[bool],
    conditions: tuple[str, str],
    sequences: tuple[str, str] | None = None,
) -> list[Result]:
    """Treatment, period and carry-over of values (n, 2) in two conditions (Jones and Kenward 2014, chapter 2).

    The groups are those who met the first condition first, and the others. Treatment and period are half the sum and
    half the difference of the groups' mean differences first − second, carry-over is the difference of their mean
    sums; each is tested by t with the groups' common variance. Effect size: the estimate.
    """
    (n, _), early = values.shape, np.asarray(first_came_first, dtype=bool)
    names = sequences or (", ".join(conditions), ", ".join(reversed(conditions)))
    contrasts = (f"{conditions[0]} - {conditions[1]}", "1 - 2", f"{names[0]} - {names[1]}")
    details = {"sequences": {names[0]: int(early.sum()), names[1]: int(n - early.sum())}}
    blank = [
        Result(
            effect, "t", "2 × 2 crossover, t of the sequence groups", "estimate", n, contrast=contrast, details=details
        )
        for effect, contrast in zip(EFFECTS, contrasts, strict=True)
    ]
    status = None
    if n == 0:
        status = NO_COMPLETE
    elif early.all() or not early.any():
        status = ONE_ORDER
    elif n < 3:
        status = TOO_FEW_VALUES
    if status is not None:
        return [replace(result, status=status) for result in blank]
    differences = rounded_differences(values[:, 0], values[:, 1])
    sums = tied(values.sum(axis=1), room_of(np.abs(values).sum(axis=1), step_of(values)))
    return [
        _tested(blank[0], differences, early, (0.5, 0.5)),
        _tested(blank[1], differences, early, (0.5, -0.5)),
        _tested(blank[2], sums, early, (1.0, -1.0)),
    ]


def _tested(blank: Result, values: FloatArray, early: npt.NDArray[np.bool_], weights: tuple[float, float]) -> Result:
    """The t of a weighted sum of the groups' means; the weights differ in sign at most."""
    (values,), exponent = at_unit_scale([values])
    groups = values[early], values[~early]
    df = len(values) - 2
    squares = sum(float(np.sum((group - group.mean()) ** 2)) for group in groups)
    if negligible(squares, values):
        return replace(blank, status=NO_ERROR if np.any(values) else ALL_ZERO)
    error = abs(weights[0]) * float(np.sqrt(squares / df * (1 / len(groups[0]) + 1 / len(groups[1]))))
    estimate = sum(weight * float(group.mean()) for weight, group in zip(weights, groups, strict=True))
    margin = t_quantile(0.975, df) * error
    effect_size, low, high = (
        float(np.ldexp(figure, exponent)) for figure in (estimate, estimate - margin, estimate + margin)
    )
    return replace(
        blank,
        statistic=estimate / error,
        df2=float(df),
        p=2 * t_above(abs(estimate) / error, df),
        effect_size=effect_size,
        ci_low=low,
        ci_high=high,
    )
