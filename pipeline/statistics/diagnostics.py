"""Diagnostics of paired differences: are they normally distributed, and is any an outlier?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.result import negligible, rounded_differences

OUTLIER_RULE = "modified z beyond 3.5 (Iglewicz and Hoaglin 1993)"
_FAR_OUT = 3.5
_NORMAL_QUARTILE = 0.6745  # of the standard normal distribution: what turns a median deviation into an SD
_SHAPIRO_UP_TO = 5000  # values, as far as Royston's approximation was made for


def differences(first: FloatArray, second: FloatArray, participants: Sequence[str]) -> dict[str, Any]:
    """Shapiro and Wilk's test of the differences first − second, and the participants whose difference is an outlier.

    `outliers` is None where more than half of the differences are equal: then no spread is left to judge by.
    """
    values = rounded_differences(first, second)
    far_out_places = far_out(values)
    outliers = None if far_out_places is None else [participants[index] for index in far_out_places]
    return {**normality(values), "outliers": outliers, "outlier_rule": OUTLIER_RULE}


def normality(values: FloatArray, prefix: str = "") -> dict[str, float | None]:
    """Shapiro and Wilk's W and p by their names in details; None below three values, or where they do not vary."""
    w = p = None
    (values,), _ = at_unit_scale([values])
    apart = values - np.mean(values) if len(values) else values
    if 3 <= len(values) <= _SHAPIRO_UP_TO and not negligible(float(np.sum(apart**2)), values):
        shapiro = stats.shapiro(apart / np.max(np.abs(apart)))  # SciPy takes a range below 1e-19 for none
        w, p = float(shapiro.statistic), float(shapiro.pvalue)
    return {f"{prefix}shapiro_w": w, f"{prefix}shapiro_p": p}


def far_out(values: FloatArray) -> list[int] | None:
    """Where |0.6745·(x − median) / MAD| is beyond 3.5 (Iglewicz and Hoaglin 1993); None where the MAD is zero."""
    if not len(values):
        return None
    (values,), _ = at_unit_scale([values])
    apart = values - np.median(values)
    spread = float(np.median(np.abs(apart)))
    if negligible(spread**2, values):
        return None
    return [int(index) for index in np.flatnonzero(np.abs(_NORMAL_QUARTILE * apart / spread) > _FAR_OUT)]
