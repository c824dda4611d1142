"""The instants at which accuracy is judged, and the reference at them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fusion_core import Samples
from fusion_core.accuracy import interpolate
from pipeline.sessions.recording import SETTLED_S, Recording, Tracked
from pipeline.statistics.arrays import FloatArray, run_of
from pipeline.study.settings import Study


class Judged(NamedTuple):
    """Instants (n,) in s at which accuracy is judged; the estimate, its SD and the reference there, (n, d) in mm."""

    time: FloatArray
    mean: FloatArray
    sd: FloatArray
    truth: FloatArray


def judged(
    study: Study, loaded: Recording, reference: tuple[str, Samples] | None, tracked: Tracked
) -> Iterator[Judged]:
    """Where accuracy is judged, part by part: from 1 s after the first frame's arrival on, with a reference there."""
    tracker = study.tracker
    if reference is None or tracker is None or len(loaded.samples[tracker]) == 0:
        return
    settled_s = loaded.samples[tracker].arrival[0] + SETTLED_S
    for shown in tracked.parts():
        time = loaded.to_s(shown.time_ns)
        truth = interpolate(reference[1], time)
        known = (time >= settled_s) & np.isfinite(truth).all(axis=1)
        if known.any():
            where = run_of(known)
            yield Judged(time[where], shown.mean[where], shown.sd[where], truth[where])
