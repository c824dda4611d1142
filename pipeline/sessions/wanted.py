"""What a study's streams and events want of a log."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.sessions.logs.log import Content, Source, Wanted
from pipeline.study.settings import Events, Study
from pipeline.study.streams import AccelerationStream, Stream
from pipeline.study.units import G_M_S2, M_PER_INCH, RAD_PER_DEG

_CONTENT: Mapping[str, Content] = {
    "acceleration": "acceleration",
    "position": "position",
    "velocity": "velocity",
    "linear": "position",
    "reference": "position",
    "display": "position",
}
_SI: Mapping[str, float] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "in": M_PER_INCH,
    "m/s": 1.0,
    "cm/s": 0.01,
    "mm/s": 0.001,
    "m/s2": 1.0,
    "mm/s2": 0.001,
    "g": G_M_S2,
    "-g": -G_M_S2,
    "rad/s": 1.0,
    "deg/s": RAD_PER_DEG,
}
_STAMP_UNIT_S: Mapping[str | None, float | None] = {None: None, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def wanted_by(study: Study) -> list[Wanted]:
    """Every topic that the study reads."""
    wanted = [of_stream(stream) for stream in study.streams.values()]
    return wanted if study.events is None else [*wanted, of_events(study.events)]


def of_stream(stream: Stream) -> Wanted:
    """What a stream reads of its topic."""
    return Wanted(stream.topic, _CONTENT[stream.kind], _source(stream))


def of_events(events: Events) -> Wanted:
    """The topic of the events."""
    return Wanted(events.topic, "events", Source(arrives_as_stamped=events.arrival == "stamps"))


def _source(stream: Stream) -> Source:
    fields: dict[str, tuple[str, ...]] = {
        name: (paths,) if isinstance(paths, str) else tuple(paths) for name, paths in stream.fields.items()
    }
    turning = _SI[stream.turning_unit] if isinstance(stream, AccelerationStream) else 1.0
    return Source(
        stream.child,
        stream.parent,
        fields,
        _SI[stream.unit],
        turning,
        _STAMP_UNIT_S[stream.stamp_unit],
        stream.stamp == "log_time",
        stream.arrival == "stamps",
    )
