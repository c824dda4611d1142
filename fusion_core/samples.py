"""The types that every estimator takes and gives: sensor readings in, position estimates out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Sample:
    """One sensor reading.

    `time` is when it was true (s), `arrival` when it could first be used (s), `value` has shape (d,) in the
    operator's unit: mm, mm/s or mm/s². `rotation` (d, 3), where it is known, turned the reading from its own body's
    frame into the tracker's: in the body's frame a bias stays what it is. `force` (3,) is, with it, the specific force
    in the body's frame that an acceleration was made from, gravity still in it: it shows how the sensor is mounted.
    """

    time: float
    arrival: float
    value: FloatArray
    rotation: FloatArray | None = None
    force: FloatArray | None = None


@dataclass(frozen=True)
class Samples:
    """A sensor's readings in order of arrival: `time` (n,), `arrival` (n,), both in s, `value` (n, d).

    `rotation` (n, d, 3), where it is known, turned the readings from their own body's frame into the tracker's, and
    `force` (n, 3) is the specific force in the body's frame, as in `Sample`.

    Raises ValueError where shapes disagree, a figure is not finite or arrivals go backwards.
    """

    time: FloatArray
    arrival: FloatArray
    value: FloatArray
    rotation: FloatArray | None = None
    force: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.time)
        if self.time.shape != (n,) or self.arrival.shape != (n,) or self.value.ndim != 2 or len(self.value) != n:
            raise ValueError(
                "Samples need time (n,), arrival (n,) and value (n, d), got "
                f"{self.time.shape}, {self.arrival.shape} and {self.value.shape}"
            )
        if self.rotation is not None and self.rotation.shape != (*self.value.shape, 3):
            raise ValueError(f"rotation must be (n, d, 3) = {(*self.value.shape, 3)}, got {self.rotation.shape}")
        if self.force is not None and (self.rotation is None or self.force.shape != (n, 3)):
            raise ValueError(f"force must be (n, 3) = {(n, 3)} beside a rotation, got {self.force.shape}")
        figures = (self.time, self.arrival, self.value, self.rotation, self.force)
        if not all(np.isfinite(figure).all() for figure in figures if figure is not None):
            raise ValueError("Samples must be finite; leave a reading out rather than pass NaN or infinity")
        if n > 1 and np.any(np.diff(self.arrival) < 0):
            raise ValueError("Samples must be in order of arrival; sort them by `arrival` first")

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, index: int) -> Sample:
        rotation = None if self.rotation is None else self.rotation[index]
        force = None if self.force is None else self.force[index]
        return Sample(float(self.time[index]), float(self.arrival[index]), self.value[index], rotation, force)


@dataclass(frozen=True)
class Track:
    """An estimator's output: `time` (n,) in s, `mean` and `sd` (n, d) in mm; NaN before the first estimate."""

    time: FloatArray
    mean: FloatArray
    sd: FloatArray
