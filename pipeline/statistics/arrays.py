"""Types of arrays, and scaling that keeps squares within the range of floats."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def at_unit_scale(arrays: Sequence[FloatArray]) -> tuple[list[FloatArray], int]:
    """The arrays divided by 2ᵉ so that their largest value is near 1, and e.

    Squares of squares of values beyond 1e77 would be larger than any float. A power of two rounds nothing.
    """
    largest = max((float(np.max(np.abs(array), initial=0.0)) for array in arrays), default=0.0)
    exponent = int(np.frexp(largest)[1])
    return [np.ldexp(array, -exponent) for array in arrays], exponent
