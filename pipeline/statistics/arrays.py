"""Types of arrays, and scaling that keeps squares within the range of floats."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def at_unit_scale(arrays: Sequence[FloatArray]) -> tuple[list[FloatArray], int]:
    """The arrays over 2ᵉ with their largest value near 1, and e: the square of 1e95's square is no number.

    A power of two, so that nothing is rounded.
    """
    largest = max((float(np.max(np.abs(array), initial=0.0)) for array in arrays), default=0.0)
    exponent = int(np.frexp(largest)[1])
    return [np.ldexp(array, -exponent) for array in arrays], exponent
