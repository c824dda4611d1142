"""One session's log to arrays in each encoding: the container and payloads by the stock packages, beside ours."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory
from mcap_ros2.decoder import DecoderFactory as Ros2Factory

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Content, Wanted
from pipeline.sessions.logs.mcap import Message, in_order
from tests.benchmarks.timing import fastest
from tests.conftest import session_messages, write_session
from tests.pipeline.protobuf_types import ROS, message_class, schema_of

TOPICS: Mapping[str, Content] = {
    "/tracker/position": "position",
    "/reference/position": "position",
    "/phone/imu": "acceleration",
}
TYPES = {"position": "geometry_msgs.PointStamped", "acceleration": "sensor_msgs.Imu"}


def reading(seconds: float) -> None:
    """Milliseconds of each way, and how many times faster ours is."""
    wanted = [Wanted(topic, content) for topic, content in TOPICS.items()]
    messages = [message for message in in_order(session_messages(seconds)) if message.topic in TOPICS]
    print(f"Reading a session's log of {len(messages)} messages: milliseconds, ours, and how many times faster")
    with tempfile.TemporaryDirectory() as folder:
        for encoding, decoders in STOCK.items():
            path = Path(folder) / f"{encoding}.mcap"
            if encoding == "cdr":
                write_session(path, messages)
            else:
                write_encoded(path, messages, encoding)
            read = read_log(path, wanted)
            ours = fastest(lambda p=path: read_log(p, wanted), 5)  # type: ignore[misc]
            for name, decoder_of in decoders.items():
                expected = stock_arrays(path, decoder_of)
                for topic, readings in read.topics.items():
                    assert np.array_equal(readings.values, expected[topic][:, 2:])
                stock = fastest(lambda p=path, d=decoder_of: stock_arrays(p, d))  # type: ignore[misc]
                print(f"  {name:<36}{1e3 * stock:>8.1f}{1e3 * ours:>8.1f}{stock / ours:>8.1f} x")


def plain(message: Message) -> dict[str, Any]:
    """A message's fields by their names in ROS 2."""
    assert message.values is not None
    values = message.values.tolist()
    seconds, nanoseconds = divmod(message.stamp_ns, 1_000_000_000)
    fields: dict[str, Any] = {"header": {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "tracker"}}
    if message.content == "position":
        return {**fields, "point": dict(zip("xyz", values, strict=True))}
    return {
        **fields,
        "orientation": dict(zip("xyzw", values[6:], strict=True)),
        "orientation_covariance": [0.0] * 9,
        "angular_velocity": dict(zip("xyz", values[3:6], strict=True)),
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": dict(zip("xyz", values[:3], strict=True)),
        "linear_acceleration_covariance": [0.0] * 9,
    }


def write_encoded(path: Path, messages: list[Message], encoding: str) -> None:
    """The messages in protobuf or JSON."""
    classes = {content: message_class(name, ROS) for content, name in TYPES.items()}
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=64 * 1024)
        writer.start()
        channels: dict[str, int] = {}
        for message in messages:
            kind = classes[message.content]
            if message.topic not in channels:
                described = (encoding, schema_of(kind)) if encoding == "protobuf" else ("jsonschema", b"{}")
                number = writer.register_schema(TYPES[message.content], *described)
                channels[message.topic] = writer.register_channel(message.topic, encoding, number)
            fields = plain(message)
            payload = kind(**fields).SerializeToString() if encoding == "protobuf" else json.dumps(fields).encode()
            writer.add_message(channels[message.topic], message.arrival_ns, payload, message.stamp_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def stock_arrays(path: Path, decoder_of: Callable[[str, Any], Any]) -> dict[str, np.ndarray]:
    """Arrival, stamp (ns) and figures of each topic, by the stock reader and decoder, message by message."""
    rows: dict[str, list[list[float]]] = {topic: [] for topic in TOPICS}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(topics=list(TOPICS)):
            decoded = decoder_of(channel.message_encoding, schema)(message.data)
            figures = figures_of_objects(decoded) if isinstance(decoded, dict) else figures_of_messages(decoded)
            rows[channel.topic].append([message.log_time, *figures])
    return {topic: np.array(values) for topic, values in rows.items()}


def figures_of_messages(decoded: Any) -> list[float]:
    stamp = decoded.header.stamp.sec * 1_000_000_000 + decoded.header.stamp.nanosec
    if not hasattr(decoded, "linear_acceleration"):
        point = decoded.point
        return [stamp, point.x, point.y, point.z]
    force, rate, turn = decoded.linear_acceleration, decoded.angular_velocity, decoded.orientation
    return [stamp, force.x, force.y, force.z, rate.x, rate.y, rate.z, turn.x, turn.y, turn.z, turn.w]


def figures_of_objects(decoded: dict[str, Any]) -> list[float]:
    stamp = decoded["header"]["stamp"]["sec"] * 1_000_000_000 + decoded["header"]["stamp"]["nanosec"]
    if "linear_acceleration" not in decoded:
        point = decoded["point"]
        return [stamp, point["x"], point["y"], point["z"]]
    force, rate, turn = decoded["linear_acceleration"], decoded["angular_velocity"], decoded["orientation"]
    vectors = (force["x"], force["y"], force["z"], rate["x"], rate["y"], rate["z"])
    return [stamp, *vectors, turn["x"], turn["y"], turn["z"], turn["w"]]


STOCK: Mapping[str, Mapping[str, Callable[[str, Any], Any]]] = {
    "cdr": {"CDR: mcap and mcap-ros2-support": Ros2Factory().decoder_for},
    "protobuf": {"protobuf: and mcap-protobuf-support": ProtobufFactory().decoder_for},
    "json": {
        "JSON: mcap and the standard library": lambda *_: json.loads,
        "JSON: mcap and orjson": lambda *_: orjson.loads,
    },
}
