"""Log formats: one module per format, each with `read(path, wanted) -> Log`."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

from pipeline.errors import SessionError
from pipeline.sessions.logs.log import Log, Wanted

READERS = {".mcap": "pipeline.sessions.logs.mcap"}
"""The module that reads a file, by its suffix."""


def read_log(path: Path, wanted: Iterable[Wanted]) -> Log:
    """A log, read by the module for its suffix. Raises SessionError if there is none, or the log cannot be used."""
    module = READERS.get(path.suffix.lower())
    if module is None:
        raise SessionError(f"no reader for files ending in {path.suffix!r}; known: {', '.join(READERS)}")
    log: Log = import_module(module).read(path, wanted)
    return log
