"""A stream's samples as the channels of a tracking system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.commands.export_bids.files import NO_VALUE
from pipeline.study.settings import Study
from pipeline.tables import table as tables

_AXES = ("x", "y", "z")
_QUATERNION = tuple(f"quat_{axis}" for axis in "xyzw")


@dataclass(frozen=True)
class Kind:
    """Columns of a table of ingest that are one vector, and what they are called in BIDS."""

    columns: tuple[str, ...]
    type: str
    components: tuple[str, ...]
    units: str
    frame: str


_TABLES: Mapping[str, tuple[Kind, ...]] = {
    "positions": (Kind(tuple(f"{axis}_mm" for axis in _AXES), "POS", _AXES, "mm", "tracker"),),
    "readings": (Kind(_AXES, "VEL", _AXES, "mm/s", "tracker"),),
    "imu": (
        Kind(tuple(f"a{axis}_mm_s2" for axis in _AXES), "ACCEL", _AXES, "mm/s^2", "body"),
        Kind(tuple(f"g{axis}_rad_s" for axis in _AXES), "GYRO", _AXES, "rad/s", "body"),
        Kind(tuple(f"q{axis}" for axis in "xyzw"), "ORNT", _QUATERNION, NO_VALUE, "tracker"),
    ),
}
_TYPES = ("ACCEL", "ANGACCEL", "GYRO", "JNTANG", "LATENCY", "MAGN", "MISC", "ORNT", "POS", "VEL")
_TIMES = {"time_ns": "when it was measured or sent, as its sender stamped it", "arrival_ns": "when it was recorded"}


@dataclass(frozen=True)
class Track:
    """A stream's rows, in the order in which they arrived."""

    stream: str
    rows: pd.DataFrame
    kinds: tuple[Kind, ...]
    rate_hz: float

    @property
    def begin_ns(self) -> int:
        """The earliest of all its times."""
        return int(self.rows[list(_TIMES)].min().min())

    def samples(self, onset_ns: int) -> pd.DataFrame:
        """motion.tsv: a column per channel, the times in seconds from the onset at the end."""
        times = {name: (self.rows[name] - onset_ns) / 1e9 for name in _TIMES}
        return self.rows[[column for kind in self.kinds for column in kind.columns]].assign(**times)

    @property
    def channels(self) -> list[dict[str, Any]]:
        """channels.tsv: one row per column of the samples."""
        values = [
            self._channel(column, component, kind.type, kind.units, kind.frame, "")
            for kind in self.kinds
            for column, component in zip(kind.columns, kind.components, strict=True)
        ]
        return values + [
            self._channel(name.removesuffix("_ns"), NO_VALUE, "LATENCY", "s", NO_VALUE, about)
            for name, about in _TIMES.items()
        ]

    def _channel(self, name: str, component: str, kind: str, units: str, frame: str, about: str) -> dict[str, Any]:
        return {
            "name": f"{self.stream}_{name}",
            "component": component,
            "type": kind,
            "tracked_point": self.stream,
            "units": units,
            "reference_frame": frame,
            "sampling_frequency": round(self.rate_hz, 6),
            "description": about or NO_VALUE,
        }

    @property
    def facts(self) -> dict[str, Any]:
        """motion.json: what is known of the tracking system."""
        types = [channel["type"] for channel in self.channels]
        seconds = float(np.ptp(self.rows["arrival_ns"])) / 1e9
        return {
            "TrackingSystemName": self.stream,
            "SamplingFrequency": round(self.rate_hz, 6),
            "SamplingFrequencyEffective": round((len(self.rows) - 1) / seconds, 6) if seconds > 0 else self.rate_hz,
            "RecordingType": "continuous",
            "RecordingDuration": seconds,
            "TrackedPointsCount": 1,
            "MotionChannelCount": len(types),
            **{f"{kind}ChannelCount": types.count(kind) for kind in _TYPES},
            "MissingValues": NO_VALUE,
        }


def tracks_of(study: Study, ingest: Path) -> list[Track]:
    """The streams of one session that have readings, in the order of study.yaml."""
    rates = tables.read("quality", ingest).set_index("stream")["rate_hz"]
    found: dict[str, Track] = {}
    for table, kinds in _TABLES.items():
        rows = tables.read(table, ingest)
        for stream in rows["stream"].unique():
            own = rows[rows["stream"] == stream].reset_index(drop=True)
            found[stream] = Track(stream, own, _kinds(study, stream, kinds, own), _rate_hz(study, stream, rates))
    return [found[stream] for stream in study.streams if stream in found]


def _kinds(study: Study, stream: str, kinds: tuple[Kind, ...], rows: pd.DataFrame) -> tuple[Kind, ...]:
    """The kinds of channels of a stream; a quantity of which it has nothing is none."""
    if study.streams[stream].kind == "linear":
        kinds = tuple(Kind(kind.columns, "MISC", (NO_VALUE,) * 3, NO_VALUE, kind.frame) for kind in kinds)
    return tuple(kind for kind in kinds if rows[list(kind.columns)].notna().any(axis=None))


def _rate_hz(study: Study, stream: str, rates: pd.Series) -> float:
    """What study.yaml states, or what the stream shows."""
    stated = getattr(study.streams[stream], "rate_hz", None)
    measured = rates.get(stream)
    return float(stated or (0.0 if measured is None or pd.isna(measured) else measured))
