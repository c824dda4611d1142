"""Writing a log: ROS 2 messages in CDR by the stock encoder, events in JSON, the session's facts first."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.sessions.logs.log import Content
from pipeline.sessions.logs.mcap.schemas import SCHEMAS
from pipeline.statistics.arrays import FloatArray

_HEADER = """std_msgs/Header header
{body}
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_THREE = "=" * 80 + "\nMSG: {name}\nfloat64 x\nfloat64 y\nfloat64 z\n"
_POINT_STAMPED = _HEADER.format(body="geometry_msgs/Point point") + _THREE.format(name="geometry_msgs/Point")
_IMU = (
    _HEADER.format(
        body="geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"
    )
    + _THREE.format(name="geometry_msgs/Quaternion")
    + "float64 w\n"
    + _THREE.format(name="geometry_msgs/Vector3")
)
_EVENT_SCHEMA = {
    "title": "steadyhand.Event",
    "type": "object",
    "properties": {
        "type": {"type": "string"},
        "trial": {"type": "integer"},
        **{key: {"type": "number"} for key in ("target_x", "target_y", "target_z", "x", "y", "z")},
    },
    "required": ["type"],
}
_CHUNK_BYTES = 64 * 1024  # so that a crash loses seconds, not the session


@dataclass(frozen=True)
class Message:
    """One message to write: `values` as in `Readings.values`, or an event."""

    topic: str
    content: Content
    stamp_ns: int
    arrival_ns: int
    values: FloatArray | None = None
    event: Mapping[str, object] | None = None


def write(path: Path, facts: Mapping[str, str], messages: Iterable[Message]) -> None:
    """Write a log; it appears under its name only once it is whole."""
    from mcap.writer import CompressionType, Writer

    partial = path.with_name(path.name + ".partial")
    with partial.open("wb") as file:
        writer = Writer(file, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="steadyhand")
        writer.add_metadata("session", dict(facts))
        schemas = {
            "position": writer.register_schema(SCHEMAS["position"], "ros2msg", _POINT_STAMPED.encode()),
            "acceleration": writer.register_schema(SCHEMAS["acceleration"], "ros2msg", _IMU.encode()),
            "events": writer.register_schema("steadyhand.Event", "jsonschema", json.dumps(_EVENT_SCHEMA).encode()),
        }
        channels: dict[str, int] = {}
        encode = _Encoder()
        for sequence, message in enumerate(messages):
            if message.topic not in channels:
                encoding = "json" if message.content == "events" else "cdr"
                channels[message.topic] = writer.register_channel(message.topic, encoding, schemas[message.content])
            writer.add_message(channels[message.topic], message.arrival_ns, encode(message), message.stamp_ns, sequence)
        writer.finish()  # type: ignore[no-untyped-call]
    partial.replace(path)


class _Encoder:
    """Messages to bytes, by the stock ROS 2 encoder and by JSON."""

    def __init__(self) -> None:
        from mcap_ros2._dynamic import serialize_dynamic

        self._position = serialize_dynamic(SCHEMAS["position"], _POINT_STAMPED)[SCHEMAS["position"]]
        self._imu = serialize_dynamic(SCHEMAS["acceleration"], _IMU)[SCHEMAS["acceleration"]]

    def __call__(self, message: Message) -> bytes:
        if message.event is not None:
            return json.dumps(message.event, allow_nan=False).encode()
        assert message.values is not None  # noqa: S101
        header = {"stamp": dict(zip(("sec", "nanosec"), divmod(message.stamp_ns, 1_000_000_000), strict=True))}
        values = [float(value) for value in message.values]
        if message.content == "position":
            return bytes(self._position({"header": {**header, "frame_id": "tracker"}, "point": _xyz(values)}))
        known = bool(np.isfinite(values[6:]).all())
        return bytes(
            self._imu(
                {
                    "header": {**header, "frame_id": "phone"},
                    "orientation": {
                        **_xyz(values[6:9] if known else [0.0] * 3),
                        "w": values[9] if known else 1.0,
                    },
                    "orientation_covariance": [0.0 if known else -1.0] + [0.0] * 8,
                    "angular_velocity": _xyz(values[3:6]),
                    "angular_velocity_covariance": [0.0] * 9,
                    "linear_acceleration": _xyz(values[0:3]),
                    "linear_acceleration_covariance": [0.0] * 9,
                }
            )
        )


def _xyz(values: list[float]) -> dict[str, float]:
    return dict(zip("xyz", values, strict=True))


def in_order(messages: Iterable[Message]) -> Iterator[Message]:
    """Messages by arrival, as a recorder would have met them."""
    return iter(sorted(messages, key=lambda message: message.arrival_ns))
