"""The protocol of an estimator, and the plain loop that every faster path must agree with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any, Protocol, runtime_checkable

import numpy as np

from fusion_core.samples import FloatArray, Sample, Samples, Track
from fusion_core.sensors import Sensor


class Estimator(Protocol):
    """Parameters that do not change, and a state that is passed in and returned.

    An estimator is causal: its state depends only on the samples that were passed to `update`. `update` and `replay`
    raise ValueError for readings that do not have their sensor's dimension.
    """

    @property
    def sensors(self) -> Mapping[str, Sensor]:
        """The sensors it uses, by name."""

    def start(self) -> Any:
        """The state before any sample."""

    def update(self, state: Any, sensor: str, sample: Sample) -> Any:
        """The state after one more sample; `state` itself is not changed."""

    def predict(self, state: Any, time: float) -> tuple[FloatArray, FloatArray]:
        """Mean and SD of the position at `time` (s), each (d,) in mm; NaN before the first position."""

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """What the estimator would have shown at `times`, each from the samples that had arrived by then."""


@runtime_checkable
class Resuming(Estimator, Protocol):
    """An estimator whose replay can be done piece by piece, so that a long recording need not be in memory whole."""

    @property
    def resumes(self) -> bool:
        """Whether it can with its settings."""

    def resume(self, state: Any, samples: Mapping[str, Samples], times: FloatArray) -> tuple[Track, Any]:
        """What `replay` of all samples so far would show at rising `times`, and the state after these samples.

        `state` is that after the piece before, at first `start()`. A piece has every sample that arrives in a stretch
        of time, and its times are of that stretch. The first goes on at least to the first position.
        """


def resuming(estimator: Estimator) -> Resuming | None:
    """The estimator if it can be replayed piece by piece."""
    return estimator if isinstance(estimator, Resuming) and estimator.resumes else None


def require_readings(sensors: Mapping[str, Sensor], samples: Mapping[str, Samples]) -> None:
    """Raise ValueError, naming the sensor, where readings do not have its dimension."""
    for name, sensor in sensors.items():
        if name in samples and samples[name].value.shape[1] != sensor.dimension:
            raise ValueError(
                f"{name}: readings must have shape (n, {sensor.dimension}), as its dimension says, "
                f"got {samples[name].value.shape}"
            )


def require_reading(name: str, sensor: Sensor, sample: Sample) -> None:
    """Raise ValueError unless a reading has its sensor's dimension and is finite."""
    if sample.value.shape != (sensor.dimension,):
        raise ValueError(
            f"{name}: a reading must have shape ({sensor.dimension},), as its dimension says, got {sample.value.shape}"
        )
    if not (isfinite(sample.time) and isfinite(sample.arrival) and isfinite(sample.value.sum())):
        raise ValueError(f"{name}: a reading must be finite, got {sample.value} at {sample.time} s")


def arrivals(sensors: Mapping[str, Sensor], samples: Mapping[str, Samples]) -> Iterator[tuple[str, Sample]]:
    """Every sample of the sensors in order of arrival; samples that arrive at once in the order of the sensors."""
    names = [name for name in sensors if name in samples]
    arrival = np.concatenate([samples[name].arrival for name in names]) if names else np.empty(0)
    which = np.repeat(np.arange(len(names)), [len(samples[name]) for name in names])
    index = np.concatenate([np.arange(len(samples[name])) for name in names]) if names else np.empty(0, int)
    for position in np.lexsort((index, which, arrival)):
        name = names[which[position]]
        yield name, samples[name][int(index[position])]


def replay_loop(estimator: Estimator, samples: Mapping[str, Samples], times: FloatArray) -> Track:
    """Replay by one `update` per sample and one `predict` per time; every batch path must give the same.

    `times` (n,) in s, in any order; the track's mean and SD are (n, d) in mm.
    """
    return resume_loop(estimator, estimator.start(), samples, times)[0]


def resume_loop(
    estimator: Estimator, state: Any, samples: Mapping[str, Samples], times: FloatArray
) -> tuple[Track, Any]:
    """The same from a state on, and the state after all samples."""
    dimension = next(iter(estimator.sensors.values())).dimension
    mean = np.full((len(times), dimension), np.nan)
    sd = np.full((len(times), dimension), np.nan)
    pending = arrivals(estimator.sensors, samples)
    upcoming = next(pending, None)
    for index in np.argsort(times, kind="stable"):
        time = float(times[index])
        while upcoming is not None and upcoming[1].arrival <= time:
            state = estimator.update(state, *upcoming)
            upcoming = next(pending, None)
        mean[index], sd[index] = estimator.predict(state, time)
    while upcoming is not None:
        state = estimator.update(state, *upcoming)
        upcoming = next(pending, None)
    return Track(times, mean, sd), state


def unknown(dimension: int) -> tuple[FloatArray, FloatArray]:
    """Mean and SD (d,) before the first position: NaN."""
    return np.full(dimension, np.nan), np.full(dimension, np.nan)
