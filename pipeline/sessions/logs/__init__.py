"""Log formats: one module per format, each with `read(path, wanted, limits) -> Log`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np

from pipeline.errors import SessionError
from pipeline.sessions.logs.joined import joined
from pipeline.sessions.logs.log import DEFAULT_LIMITS, Limits, Log, Readings, Source, Wanted
from pipeline.sessions.logs.rosbag2 import METADATA, missing_messages, missing_parts
from pipeline.study.session_files import PACKED

READERS = {
    ".mcap": "pipeline.sessions.logs.mcap",
    ".db3": "pipeline.sessions.logs.rosbag2_sqlite",
    ".bag": "pipeline.sessions.logs.rosbag1",
    ".xdf": "pipeline.sessions.logs.xdf",
    ".csv": "pipeline.sessions.logs.tables",
    ".tsv": "pipeline.sessions.logs.tables",
    ".txt": "pipeline.sessions.logs.tables",
    ".tum": "pipeline.sessions.logs.tables",
}
"""The module that reads a file, by its suffix."""

_TABLES = (".csv", ".tsv", ".tum")


def read_log(path: Path, wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """A log, read by the module for its suffix, in the units and times that the study states; or a folder of its parts.

    Raises SessionError if there is no reader for it, or it cannot be used.
    """
    if path.is_dir():
        return read_logs([file for file in sorted(path.iterdir()) if file.is_file()], wanted, limits)
    return read_logs([path], wanted, limits)


def read_logs(files: Sequence[Path], wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """The log whose parts are in these files. What is not a log among several files is left alone."""
    wants = tuple(wanted)
    if len(files) == 1:
        return _in_units(_read_one(files[0], wants, limits), wants)
    logs = [file for file in files if log_suffix(file) in READERS and file.suffix != ".txt"]
    if logs and all(log_suffix(file) in _TABLES for file in logs):
        from pipeline.sessions.logs.tables import read_all

        return _in_units(read_all(logs, wants, limits), wants)
    if not logs:
        names = ", ".join(file.name for file in files[:5])
        raise SessionError(f"no reader for any of its files ({names}); known: {', '.join(READERS)}")
    log = joined([(file, _read_part(file, wants, limits, logs)) for file in logs])
    metadata = next((file for file in files if file.name == METADATA), None)
    if metadata is not None:
        faults = missing_parts(metadata, files) or missing_messages(metadata, log)
        log = replace(log, faults=(*log.faults, *faults))
    return _in_units(log, wants)


def _read_part(file: Path, wants: Sequence[Wanted], limits: Limits, files: Sequence[Path]) -> Log:
    """One of several parts. One that cannot be read costs itself alone, unless it is the only one."""
    try:
        return _read_one(file, wants, limits)
    except SessionError as error:
        if len(files) == 1:
            raise SessionError(f"{file.name}: {error}") from None
        return Log({}, {}, (str(error),))


def _read_one(path: Path, wants: Sequence[Wanted], limits: Limits) -> Log:
    module = READERS.get(log_suffix(path))
    if module is None:
        raise SessionError(f"no reader for files ending in {path.suffix!r}; known: {', '.join(READERS)}")
    log: Log = import_module(module).read(path, wants, limits)
    return log


def log_suffix(path: Path) -> str:
    """The suffix that says how a log is read: .mcap of P01_a.mcap.zstd."""
    return (path.with_suffix("") if path.suffix.lower() in PACKED else path).suffix.lower()


def _in_units(log: Log, wants: Sequence[Wanted]) -> Log:
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
