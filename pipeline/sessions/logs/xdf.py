"""Lab Streaming Layer recordings (.xdf), read by the package `pyxdf`.

Times are those of the recording computer: `pyxdf` takes off the clock offsets that LSL measured, and follows a clock
that was reset. They are not smoothed ("dejittered"), which would use later samples for earlier ones. A stream is a
topic by its name; its channels are found by their labels, as the columns of a table are. A reading arrived when it was
stamped.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import SessionError
from pipeline.sessions.logs.extras import needs
from pipeline.sessions.logs.log import DEFAULT_LIMITS, IntArray, Limits, Log, MessageType, Readings, Wanted
from pipeline.sessions.logs.mcap.events import checked_event
from pipeline.sessions.logs.tables.named import vectors_of
from pipeline.sessions.logs.tables.readings import readings_of
from pipeline.sessions.logs.tables.sheet import Sheet
from pipeline.statistics.arrays import FloatArray

_MARK = b"XDF:"
_TIME = "time"
_FARTHEST_M = 1e4


def read(path: Path, wanted: Iterable[Wanted], limits: Limits = DEFAULT_LIMITS) -> Log:
    """The wanted streams of a recording. SessionError for a file that is none, or that cannot be read."""
    with needs("xdf", "recordings of Lab Streaming Layer"):
        import pyxdf
    with path.open("rb") as file:
        head = file.read(len(_MARK))
    if not head:
        raise SessionError("the file is empty")
    if head != _MARK and not path.name.endswith(".xdfz"):
        raise SessionError("not an XDF file: it does not begin with the XDF mark")
    if path.stat().st_size > limits.unpacked_bytes:
        raise SessionError(
            f"refused: it has {path.stat().st_size // 2**20} MiB; if it is sound, write "
            "`log_limits: {unpacked_mib: N}` in study.yaml"
        )
    try:
        streams, _ = pyxdf.load_xdf(str(path), synchronize_clocks=True, dejitter_timestamps=False)
    except Exception as error:  # noqa: BLE001 (the package raises whatever its parsing meets)
        raise SessionError(f"it cannot be read: {type(error).__name__}: {error}") from None
    sheets = {sheet.topic: sheet for sheet in map(_sheet, streams)}
    wants = tuple(wanted) or tuple(Wanted(name, "anything") for name in sheets)
    topics = {want.key: _readings(sheets[want.topic], want, sheets) for want in wants if want.topic in sheets}
    types = {name: MessageType(sheet.kind, "xdf", None) for name, sheet in sheets.items()}
    return Log({}, topics, (), types)


@dataclass(frozen=True)
class _Channels:
    """A stream's channels as columns: figures (n, k), or texts."""

    names: tuple[str, ...]
    samples: Any
    times_s: FloatArray
    lost: int = 0

    @property
    def columns(self) -> Mapping[str, int]:
        """The place of each channel."""
        return {name: place for place, name in enumerate(self.names)} | {_TIME: -1}

    @property
    def rows(self) -> int:
        """How many samples there are."""
        return len(self.times_s)

    def numbers(self, name: str) -> FloatArray:
        """A channel's figures (n,)."""
        if name == _TIME:
            return self.times_s
        if not isinstance(self.samples, np.ndarray):
            raise ValueError(f'the channel "{name}" holds texts')
        return self.samples[:, self.columns[name]].astype(np.float64)

    def times_ns(self, name: str, unit_s: float) -> IntArray:
        """A channel's times in ns (n,)."""
        seconds = self.numbers(name) * unit_s
        if not np.isfinite(seconds).all():
            raise ValueError(f'"{name}" holds values that are no times')
        return np.rint(seconds * 1e9).astype(np.int64)

    def texts(self, name: str) -> list[str]:
        """A channel's samples as text."""
        place = self.columns[name]
        return [str(sample[place]).strip() for sample in self.samples]


def _sheet(stream: Mapping[str, Any]) -> Sheet:
    info = stream["info"]
    name, kind = _first(info, "name"), _first(info, "type")
    labels = _labels(info)
    samples, times = stream["time_series"], np.asarray(stream["time_stamps"], dtype=np.float64)
    count = samples.shape[1] if isinstance(samples, np.ndarray) and samples.ndim == 2 else 1
    names = labels if len(labels) == count else tuple(f"channel_{place}" for place in range(count))
    vectors, units = vectors_of(names, kind)
    return Sheet(name, kind or "stream", _Channels(names, samples, times), _TIME, {_TIME: 1.0}, vectors, units)


def _first(info: Mapping[str, Any], key: str) -> str:
    values = info.get(key)
    return str(values[0]) if isinstance(values, list) and values and values[0] is not None else ""


def _labels(info: Mapping[str, Any]) -> tuple[str, ...]:
    """The channels' labels, with their units in brackets where they have some, as in the header of a table."""
    try:
        channels = info["desc"][0]["channels"][0]["channel"]
    except (KeyError, IndexError, TypeError):
        return ()
    labels = []
    for channel in channels:
        label, unit = _first(channel, "label"), _first(channel, "unit")
        labels.append(f"{label} ({unit})" if unit else label)
    return tuple(labels)


def _readings(sheet: Sheet, want: Wanted, sheets: Mapping[str, Sheet]) -> Readings:
    if want.content != "events":
        return readings_of(sheet, want, sheets)
    times = sheet.table.times_ns(_TIME, 1.0)
    events, kept, reasons = [], [], []
    name = next(name for name in sheet.table.columns)
    for index, text in enumerate(sheet.table.texts(name)):
        try:
            events.append(checked_event(json.loads(text) if text.startswith("{") else {"type": text}, _FARTHEST_M))
            kept.append(index)
        except ValueError as error:
            reasons.append(str(error))
    notes = (f"{len(reasons)} markers cannot be read: {reasons[0]}",) if reasons else ()
    own = times[kept]
    return Readings(own, own, np.zeros((len(own), 0)), tuple(events), len(reasons), notes)
