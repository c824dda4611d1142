"""Covariance functions and the covariances of their derivatives, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

IntArray = npt.NDArray[np.int64]


@njit(cache=True)
def squared_exponential(
    lag: float, derivative: int, other: int, signal_variance_mm2: float, inverse_scale_s2: float
) -> float:
    """Covariance of two derivatives of the position, `lag` = t − t' in s, of order 0, 1 or 2 each.

    k(t, t') = signal_variance · exp(−inverse_scale · (t − t')²), paper eq. (3), without a factor ½;
    cov(f⁽ⁱ⁾(t), f⁽ʲ⁾(t')) = (−1)ʲ k⁽ⁱ⁺ʲ⁾(t − t'): with i = j = 2 and i = 2, j = 0 these are the exact forms in place
    of the paper's second difference (18).
    """
    w, squared, total, factor = inverse_scale_s2, lag * lag, derivative + other, 1.0
    if total == 1:
        factor = -2.0 * w * lag
    elif total == 2:
        factor = 4.0 * w**2 * squared - 2.0 * w
    elif total == 3:
        factor = (12.0 * w**2 - 8.0 * w**3 * squared) * lag
    elif total == 4:
        factor = (16.0 * w**4 * squared - 48.0 * w**3) * squared + 12.0 * w**2
    sign = -1.0 if other == 1 else 1.0
    return float(sign * factor * signal_variance_mm2 * np.exp(-w * squared))
