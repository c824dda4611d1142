"""The two types everything speaks: sensor readings in, position estimates out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Sample:
    """One sensor reading.

    `time` is when it was true (s), `arrival` when it could first be used (s), `value` has shape (d,) in the
    operator's unit: mm, mm/s or mm/s².
    """

    time: float
    arrival: float
    value: FloatArray


@dataclass(frozen=True)
class Samples:
    """A sensor's readings in order of arrival: `time` (n,), `arrival` (n,), both in s, `value` (n, d).

    Raises ValueError where shapes disagree, a figure is not finite or arrivals go backwards.
    """

    time: FloatArray
    arrival: FloatArray
    value: FloatArray

    def __post_init__(self) -> None:
        n = len(self.time)
        if self.time.shape != (n,) or self.arrival.shape != (n,) or self.value.ndim != 2 or len(self.value) != n:
            raise ValueError(
                "Samples need time (n,), arrival (n,) and value (n, d), got "
                f"{self.time.shape}, {self.arrival.shape} and {self.value.shape}"
            )
        if not (np.isfinite(self.time).all() and np.isfinite(self.arrival).all() and np.isfinite(self.value).all()):
            raise ValueError("Samples must be finite; leave a reading out rather than pass NaN or infinity")
        if n > 1 and np.any(np.diff(self.arrival) < 0):
            raise ValueError("Samples must be in order of arrival; sort them by `arrival` first")

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, index: int) -> Sample:
        return Sample(float(self.time[index]), float(self.arrival[index]), self.value[index])


@dataclass(frozen=True)
class Track:
    """An estimator's output: `time` (n,) in s, `mean` and `sd` (n, d) in mm; NaN before the first estimate."""

    time: FloatArray
    mean: FloatArray
    sd: FloatArray
