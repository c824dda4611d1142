"""n, mean, SD, median and the t interval of the mean."""

from __future__ import annotations

import numpy as np
from scipy import stats

from pipeline.statistics.arrays import FloatArray


def summarize(values: FloatArray) -> dict[str, float]:
    """Of `values` (n,), n ≥ 1: n, mean, median and, from two values on, sd, ci_low and ci_high (95 %, Student's t)."""
    n = len(values)
    row = {"n": n, "mean": float(values.mean()), "median": float(np.median(values))}
    if n > 1:
        sd = float(np.std(values, ddof=1))
        margin = float(stats.t.ppf(0.975, n - 1)) * sd / np.sqrt(n)
        row |= {"sd": sd, "ci_low": row["mean"] - margin, "ci_high": row["mean"] + margin}
    return row
