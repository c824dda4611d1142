"""A long recording replayed piece by piece: an estimator goes on from its state, and no more is in memory at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from fusion_core import Samples, Track
from fusion_core.estimator import Resuming
from fusion_core.sensors import position_sensor
from pipeline.statistics.arrays import FloatArray
from pipeline.tables import table as tables

_Stretch = tuple[dict[str, Samples], float]
"""The long stream's readings of a stretch of time, and when the next stretch begins, in s."""


def replayed(
    estimator: Resuming,
    short: Mapping[str, Samples],
    long: tuple[str, Iterable[Samples]] | None,
    times: FloatArray,
) -> Iterator[tuple[Track, Any]]:
    """Each piece's part of the track at rising `times` (n,) in s, and the estimator's state after it.

    `short` are streams that are in memory, `long` is the name of one more and its pieces by arrival, of which no two
    share an instant; without it a piece is so many times. Everything arrives in order, as in a replay of the whole.
    """
    state, begin, since_s = estimator.start(), 0, -np.inf
    for readings, until_s in _by_times(times) if long is None else _by_arrival(estimator, short, *long):
        end = int(np.searchsorted(times, until_s))
        cut = {name: arrived(samples, since_s, until_s) for name, samples in short.items()}
        track, state = estimator.resume(state, cut | readings, times[begin:end])
        yield track, state
        begin, since_s = end, until_s


def _by_times(times: FloatArray) -> Iterator[_Stretch]:
    for begin in range(0, max(len(times), 1), tables.ROWS_AT_ONCE):
        end = begin + tables.ROWS_AT_ONCE
        yield {}, float(times[end]) if end < len(times) else np.inf


def _by_arrival(
    estimator: Resuming, short: Mapping[str, Samples], name: str, pieces: Iterable[Samples]
) -> Iterator[_Stretch]:
    """The first stretch goes on to the first position, as estimators need it to begin."""
    frames = short.get(position_sensor(estimator.sensors))
    first_s = float(frames.arrival[0]) if frames is not None and len(frames) else np.inf
    waiting: list[Samples] = []
    for piece in pieces:
        if waiting and piece.arrival[0] > first_s:
            yield {name: joined(waiting)}, float(piece.arrival[0])
            waiting = []
        waiting.append(piece)
    yield {name: joined(waiting)}, np.inf


def joined(parts: list[Samples]) -> Samples:
    """Samples that follow each other as one."""
    if len(parts) == 1:
        return parts[0]
    time, arrival, value = (np.concatenate([getattr(p, key) for p in parts]) for key in ("time", "arrival", "value"))
    turned = [part.rotation for part in parts if part.rotation is not None]
    felt = [part.force for part in parts if part.force is not None]
    return Samples(
        time, arrival, value, np.concatenate(turned) if turned else None, np.concatenate(felt) if felt else None
    )


def arrived(samples: Samples, since_s: float, until_s: float) -> Samples:
    """The readings that arrived from `since_s` until `until_s`."""
    return marked(samples, (samples.arrival >= since_s) & (samples.arrival < until_s))


def marked(samples: Samples, which: np.ndarray[Any, np.dtype[np.bool_]]) -> Samples:
    """The readings that are marked (n,)."""
    rotation = None if samples.rotation is None else samples.rotation[which]
    force = None if samples.force is None else samples.force[which]
    return Samples(samples.time[which], samples.arrival[which], samples.value[which], rotation, force)
