"""How many samples a stream lacks, by its own stamps.

A gap is as many samples wide as the usual step fits into it, less the samples that stand at its ends with the stamp of
another: a driver that stamps two readings alike has lost neither. That holds only where steps are whole multiples of
the usual one. Stamps of a packet's arrival come in bursts, and those of two senders fall between each other; of such
streams nobody can say how many samples are missing, and no number is given.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.sessions.logs.log import IntArray
from pipeline.tables.columns import S_PER_NS

BUNCHED = 0.3
"""Of the mean step: the median of stamps that come in bursts is below it."""
_OFF = 0.25  # of a step: a stamp that is further from the grid does not count as regular
_IRREGULAR = 0.2  # of the steps off the grid; recordings without a fault have up to 0.06
_FEWEST = 20  # steps


class Sampling(NamedTuple):
    """`missing` samples of `expected`; None where that cannot be told, and then `how` says what the stamps are like."""

    missing: int | None
    expected: int
    how: str = ""

    @property
    def share(self) -> float:
        """The share that is missing; 0 where it cannot be told."""
        return (self.missing or 0) / self.expected if self.expected else 0.0


def sampling(stamp_ns: IntArray) -> Sampling:
    """What stamps (n,), in any order, say of missing samples."""
    stamps, doubled = stamp_ns, np.zeros(0, np.int64)
    if (stamp_ns[1:] <= stamp_ns[:-1]).any():
        stamps, count = np.unique(stamp_ns, return_counts=True)
        doubled = count - 1
    steps = np.diff(stamps).astype(np.float64)
    steps *= S_PER_NS
    if not len(steps):
        return Sampling(None, len(stamp_ns), "have a single stamp")
    usual = float(np.median(steps))
    units = steps / usual
    if len(steps) >= _FEWEST:
        mean = float(np.mean(steps[steps <= np.percentile(steps, 99.5)]))
        if usual < BUNCHED * mean:
            return Sampling(None, len(stamp_ns), "come in bursts")
        if float(np.mean(np.abs(units - np.round(units)) > _OFF)) > _IRREGULAR:
            return Sampling(None, len(stamp_ns), "are irregular")
    gaps = np.where(units > 1.5, np.round(units) - 1, 0)
    if len(doubled):
        gaps = np.maximum(gaps - doubled[:-1] - doubled[1:], 0)
    missing = int(np.sum(gaps))
    return Sampling(missing, missing + len(stamp_ns))
