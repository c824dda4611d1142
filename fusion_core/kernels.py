"""Covariance functions and the covariances of their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fusion_core.checks import require_positive
from fusion_core.samples import FloatArray

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class SquaredExponential:
    """k(t, t') = signal_variance · exp(−inverse_scale · (t − t')²), paper eq. (3), without a factor ½.

    `signal_variance_mm2` in mm², `inverse_scale_s2` in 1/s².
    """

    signal_variance_mm2: float
    inverse_scale_s2: float

    def __post_init__(self) -> None:
        require_positive(signal_variance_mm2=self.signal_variance_mm2, inverse_scale_s2=self.inverse_scale_s2)

    def covariance(
        self, time: FloatArray, order: IntArray, other_time: FloatArray, other_order: IntArray
    ) -> FloatArray:
        """Covariances of derivatives, shape (…, n, m), for times (…, n) and (…, m) and orders (n,) and (m,).

        cov(f⁽ⁱ⁾(t), f⁽ʲ⁾(t')) = (−1)ʲ k⁽ⁱ⁺ʲ⁾(t − t'): with i = j = 2 and i = 2, j = 0 these are the exact forms in
        place of the paper's second difference (18).
        """
        lag = time[..., :, None] - other_time[..., None, :]
        total = order[:, None] + other_order[None, :]
        sign = np.where(other_order % 2 == 0, 1.0, -1.0)
        w, squared = self.inverse_scale_s2, lag * lag
        factor = np.ones_like(lag)
        if np.any(total == 1):
            factor = np.where(total == 1, -2 * w * lag, factor)
        if np.any(total == 2):
            factor = np.where(total == 2, 4 * w**2 * squared - 2 * w, factor)
        if np.any(total == 3):
            factor = np.where(total == 3, (12 * w**2 - 8 * w**3 * squared) * lag, factor)
        if np.any(total == 4):
            factor = np.where(total == 4, (16 * w**4 * squared - 48 * w**3) * squared + 12 * w**2, factor)
        covariance: FloatArray = sign * factor * (self.signal_variance_mm2 * np.exp(-w * squared))
        return covariance
