"""Types of arrays, and scaling that keeps squares within the range of floats."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def run_of(which: npt.NDArray[np.bool_]) -> slice | npt.NDArray[np.bool_]:
    """What chooses the same as marks (n,) do: a slice where they are one run, so that long arrays are not copied."""
    count, first = int(which.sum()), int(np.argmax(which)) if len(which) else 0
    run = slice(first, first + count)
    return run if which[run].all() else which


def at_unit_scale(arrays: Sequence[FloatArray]) -> tuple[list[FloatArray], int]:
    """The arrays divided by 2ᵉ so that their largest value is near 1, and e.

    Squares of squares of values beyond 1e77 would be larger than any float. A power of two rounds nothing.
    """
    largest = max((float(np.max(np.abs(array), initial=0.0)) for array in arrays), default=0.0)
    exponent = int(np.frexp(largest)[1])
    return [np.ldexp(array, -exponent) for array in arrays], exponent
