"""Log formats: one module per format, each with `read(path, wanted, limits) -> Log`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import DEFAULT_LIMITS, Limits, Log, Readings, Source, Wanted

READERS = {".mcap": "pipeline.sessions.logs.mcap"}
"""The module that reads a file, by its suffix."""

_PACKED = (".zstd", ".zst")


def read_log(path: Path, wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """A log, read by the module for its suffix, in the units and times that the study states.

    Raises SessionError if there is no reader for it, or it cannot be used.
    """
    suffix = (path.with_suffix("") if path.suffix.lower() in _PACKED else path).suffix.lower()
    module = READERS.get(suffix)
    if module is None:
        raise SessionError(f"no reader for files ending in {path.suffix!r}; known: {', '.join(READERS)}")
    wants = tuple(wanted)
    log: Log = import_module(module).read(path, wants, limits)
    stated = {want.key: as_stated(log.topics[want.key], want.source) for want in wants if want.key in log.topics}
    return replace(log, topics={**log.topics, **stated})


def as_stated(readings: Readings, source: Source) -> Readings:
    """Readings in SI units and with the times that the study takes."""
    if source.unstamped:
        readings = replace(readings, stamp_ns=readings.arrival_ns)
    if source.arrives_as_stamped:
        readings = replace(readings, arrival_ns=readings.stamp_ns)
    if source.scale == 1.0 and source.turning_scale == 1.0:
        return readings
    width = readings.values.shape[1]
    scale = np.concatenate([np.full(3, source.scale), np.full(3, source.turning_scale), np.ones(4)])[:width]
    return replace(readings, values=readings.values * scale)
