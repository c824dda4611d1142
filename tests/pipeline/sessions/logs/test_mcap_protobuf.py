"""Positions and accelerations in protobuf, held against the stock decoder message by message."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.message import DecodeError
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Schema
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.schema import build_file_descriptor_set

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Content, Readings, Wanted
from pipeline.sessions.logs.mcap import protobuf
from pipeline.sessions.logs.mcap.protobuf_template import Template
from pipeline.sessions.logs.mcap.templates import Declined
from tests.pipeline.protobuf_types import FOXGLOVE, ROS, changed, message_class, schema_of
from tests.pipeline.sessions.logs.test_mcap_fast import assert_same, figures, payloads_decoded_by

POINT = message_class("foxglove.Point3InFrame", FOXGLOVE)
POSE = message_class("foxglove.PoseInFrame", FOXGLOVE)
STAMPED = message_class("geometry_msgs.PointStamped", ROS)
IMU = message_class("sensor_msgs.Imu", ROS)
KINDS: dict[str, tuple[Any, Content]] = {
    "Point3InFrame": (POINT, "position"),
    "PoseInFrame": (POSE, "position"),
    "PointStamped": (STAMPED, "position"),
    "Imu": (IMU, "acceleration"),
}


def write_log(path: Path, kind: Any, payloads: Iterable[bytes], schema: bytes | None = None) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        described = schema_of(kind) if schema is None else schema
        number = writer.register_schema(kind.DESCRIPTOR.full_name, "protobuf", described)
        channel = writer.register_channel("/t", "protobuf", number)
        for time, data in enumerate(payloads):
            writer.add_message(channel, time, data, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def read_topic(path: Path, content: Content) -> Readings:
    return read_log(path, [Wanted("/t", content)]).topics["/t"]


def read_slowly(path: Path, content: Content) -> Readings:
    """By the stock decoder alone."""

    def decline(*_: object) -> Template:
        raise Declined

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Template, "of", decline)
        return read_topic(path, content)


def reading(message: Any, content: str) -> tuple[int, list[float]]:
    """Stamp (ns) and figures of a decoded message."""
    if "timestamp" in message.DESCRIPTOR.fields_by_name:
        stamp = message.timestamp.seconds * 10**9 + message.timestamp.nanos
        point = message.pose.position if "pose" in message.DESCRIPTOR.fields_by_name else message.point
        return stamp, [point.x, point.y, point.z]
    stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    if content == "acceleration" and not message.orientation_covariance:
        message.orientation_covariance.append(0.0)
    return stamp, figures(message, content)


def by_the_stock_decoder(path: Path, content: str) -> list[tuple[int, int, list[float]]]:
    """Arrival, stamp and figures of every message that the stock decoder takes."""
    found = []
    with path.open("rb") as file:
        factory = DecoderFactory()
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            decode = factory.decoder_for(channel.message_encoding, schema)
            assert decode is not None
            with contextlib.suppress(DecodeError):
                found.append((message.log_time, *reading(decode(message.data), content)))
    return found


def vector(of: Any, values: Sequence[float], axes: str = "xyz") -> None:
    of.SetInParent()
    for axis, value in zip(axes, values, strict=True):
        setattr(of, axis, value)


def build(kind: Any, seconds: int, nanoseconds: int, frame: str, values: Sequence[float]) -> Any:
    """A message with these figures: a position's three, or force, rate, orientation and covariance's first."""
    message = kind()
    if kind in (POINT, POSE):
        message.timestamp.seconds, message.timestamp.nanos, message.frame_id = seconds, nanoseconds, frame
        message.timestamp.SetInParent()
    else:
        message.header.stamp.SetInParent()
        message.header.stamp.sec, message.header.stamp.nanosec, message.header.frame_id = seconds, nanoseconds, frame
    if kind is POSE:
        vector(message.pose.position, values[:3])
        vector(message.pose.orientation, values[3:7], "xyzw")
    elif kind is IMU:
        vector(message.linear_acceleration, values[:3])
        vector(message.angular_velocity, values[3:6])
        if values[6:10] != [0.0] * 4:
            vector(message.orientation, values[6:10], "xyzw")
        message.orientation_covariance.extend([values[10], *[0.0] * 8] if values[10] else [])
    else:
        vector(message.point, values[:3])
    return message


numbers = st.one_of(st.floats(-10, 10), st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5, np.nan, np.inf, 9999.0]))


@st.composite
def messages(draw: st.DrawFn, kind: Any) -> bytes:
    """A whole message, its fields in any order: those of a message written one after the other are one message."""
    message = build(
        kind,
        draw(st.integers(-5 if kind in (POINT, POSE) else -(2**31), 2**31 - 1)),
        draw(st.integers(0, 10**9 - 1)),
        draw(st.one_of(st.sampled_from(["", "phone"]), st.text(max_size=8))),
        draw(st.lists(numbers, min_size=11, max_size=11)),
    )
    parts = []
    for field, _ in message.ListFields():
        part = kind()
        part.CopyFrom(message)
        for other, _ in message.ListFields():
            if other.name != field.name:
                part.ClearField(other.name)
        parts.append(part.SerializeToString())
    return b"".join(draw(st.permutations(parts))) if draw(st.booleans()) else bytes(message.SerializeToString())


@pytest.mark.parametrize("name", KINDS)
@settings(deadline=None, max_examples=25)
@given(data=st.data())
def test_random_messages_as_the_stock_decoder_reads_them(
    data: st.DataObject, name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Any figures, zeros left out, fields in any order, stamps and names of any length."""
    kind, content = KINDS[name]
    drawn = data.draw(st.lists(messages(kind), min_size=1, max_size=12))
    path = write_log(tmp_path_factory.getbasetemp() / "random.mcap", kind, drawn)
    fast = read_topic(path, content)
    assert fast.lost == 0
    assert_same(fast, by_the_stock_decoder(path, content))


def cut(payload: bytes, at: int) -> bytes:
    return payload[: at % max(len(payload), 1)]


def flipped(payload: bytes, at: int) -> bytes:
    place = at // 8 % len(payload)
    return payload[:place] + bytes([payload[place] ^ 1 << at % 8]) + payload[place + 1 :]


def repeated(payload: bytes, _: int) -> bytes:
    return payload + payload


DAMAGES: Sequence[Callable[[bytes, int], bytes]] = (cut, flipped, repeated)


@pytest.mark.parametrize("name", KINDS)
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_damaged_messages_are_read_as_the_stock_decoder_does_or_lost_and_counted(
    data: st.DataObject, name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    kind, content = KINDS[name]
    same = build(kind, 1_700_000_000, 123_456_789, "phone", [0.1 * at for at in range(1, 12)]).SerializeToString()
    sent = [same] * 4 + data.draw(st.lists(messages(kind), min_size=1, max_size=3))
    for index in data.draw(st.lists(st.integers(0, len(sent) - 1), min_size=1, max_size=4, unique=True)):
        sent[index] = data.draw(st.sampled_from(DAMAGES))(sent[index], data.draw(st.integers(0, 10**4)))
    if data.draw(st.booleans()):
        sent.append(data.draw(st.binary(max_size=80)))
    path = write_log(tmp_path_factory.getbasetemp() / "damaged.mcap", kind, sent)
    fast, slow = read_topic(path, content), read_slowly(path, content)
    assert_same(fast, list(zip(slow.arrival_ns.tolist(), slow.stamp_ns.tolist(), slow.values.tolist(), strict=True)))
    assert (fast.lost, fast.notes) == (slow.lost, slow.notes)
    assert fast.lost == len(sent) - fast.read
    stock = {row[0]: row for row in by_the_stock_decoder(path, content)}
    assert_same(fast, [stock[time] for time in fast.arrival_ns.tolist()])


@pytest.mark.parametrize("name", KINDS)
def test_every_single_bit_flipped(name: str, tmp_path: Path) -> None:
    """Many damaged messages of one length, so that each is held against the template of a whole one."""
    kind, content = KINDS[name]
    whole = build(kind, 1_700_000_000, 123_456_789, "phone", [0.1 * at for at in range(1, 12)]).SerializeToString()
    sent = [whole, *(flipped(whole, at) for at in range(8 * len(whole)))]
    path = write_log(tmp_path / "a.mcap", kind, sent)
    fast, slow = read_topic(path, content), read_slowly(path, content)
    assert_same(fast, list(zip(slow.arrival_ns.tolist(), slow.stamp_ns.tolist(), slow.values.tolist(), strict=True)))
    assert (fast.lost, fast.notes) == (slow.lost, slow.notes)
    assert 0 < fast.read < len(sent)


def steady(kind: Any, count: int) -> list[bytes]:
    random = np.random.default_rng(0)
    times = 1_700_000_000_000_000_000 + np.arange(count) * 11_111_111
    return [
        build(kind, time // 10**9, time % 10**9, "phone", random.normal(0, 0.5, 11).tolist()).SerializeToString()
        for time in times.tolist()
    ]


@pytest.mark.parametrize("name", KINDS)
def test_the_stock_decoder_is_not_called_for_each_message(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind, content = KINDS[name]
    path = write_log(tmp_path / "a.mcap", kind, steady(kind, 900))
    expected = by_the_stock_decoder(path, content)
    calls = payloads_decoded_by(DecoderFactory, monkeypatch)
    assert_same(read_topic(path, content), expected)
    assert len(list(filter(None, calls))) <= 12  # twice for every length of a stamp


@pytest.mark.parametrize("kind_of_figures", ["float", "double"])
@pytest.mark.parametrize(
    ("seconds", "nanoseconds"),
    [("int64", "int32"), ("sint64", "sint32"), ("uint64", "uint32"), ("fixed64", "fixed32"), ("sfixed64", "sfixed32")],
)
def test_other_types_of_numbers_are_followed(
    kind_of_figures: str, seconds: str, nanoseconds: str, tmp_path: Path
) -> None:
    types = changed(FOXGLOVE, "google.protobuf.Timestamp", seconds=seconds, nanos=nanoseconds)
    types = changed(types, "foxglove.Point3", **dict.fromkeys("xyz", kind_of_figures))
    kind = message_class("foxglove.Point3InFrame", types)
    sent = []
    for at in range(20):
        message = kind(frame_id="a", point={"x": 0.1 * at, "y": 2.5, "z": -at})
        message.timestamp.seconds, message.timestamp.nanos = 1_000_000 + at, 999_000_000 + at
        sent.append(message.SerializeToString())
    path = write_log(tmp_path / "a.mcap", kind, sent)
    readings = read_topic(path, "position")
    assert (readings.read, readings.lost) == (20, 0)
    assert_same(readings, by_the_stock_decoder(path, "position"))


def test_a_signalling_nan_is_a_nan_like_any_other(tmp_path: Path) -> None:
    kind = message_class("foxglove.Point3InFrame", changed(FOXGLOVE, "foxglove.Point3", x="float"))
    whole = kind(timestamp={"seconds": 5}, frame_id="a", point={"x": 1.5}).SerializeToString()
    spoilt = whole.replace(struct.pack("<f", 1.5), struct.pack("<I", 0x7FA00000))
    readings = read_topic(write_log(tmp_path / "a.mcap", kind, [whole, spoilt]), "position")
    assert (readings.read, readings.lost) == (2, 0)
    assert np.isnan(readings.values[1, 0])


def test_a_message_of_another_type_is_not_taken_for_a_position(tmp_path: Path) -> None:
    """Protobuf passes over what it does not know, and takes what is not there for zero."""
    sent = steady(STAMPED, 3) + steady(IMU, 2)
    path = write_log(tmp_path / "a.mcap", STAMPED, sent)
    readings = read_topic(path, "position")
    assert (readings.read, readings.lost) == (3, 2)
    assert readings.notes == ("2 messages cannot be read: the bytes do not fit the schema",)


@pytest.mark.parametrize(("field", "message"), [("point", "it has no point"), ("timestamp", "it has no timestamp")])
def test_a_message_without_a_position_or_stamp_is_lost_and_said(field: str, message: str, tmp_path: Path) -> None:
    whole = build(POINT, 5, 6, "a", [1.0, 2.0, 3.0])
    part = POINT()
    part.CopyFrom(whole)
    part.ClearField(field)
    path = write_log(tmp_path / "a.mcap", POINT, [whole.SerializeToString(), part.SerializeToString()])
    readings = read_topic(path, "position")
    assert (readings.read, readings.lost) == (1, 1)
    assert readings.notes == (f"1 messages cannot be read: {message}",)


def test_an_imu_without_an_orientation_is_read_as_of_unknown_orientation(tmp_path: Path) -> None:
    sent = build(IMU, 5, 6, "a", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0]).SerializeToString()
    readings = read_topic(write_log(tmp_path / "a.mcap", IMU, [sent] * 3), "acceleration")
    assert readings.values[0, :6].tolist() == [1, 2, 3, 4, 5, 6]
    assert np.isnan(readings.values[:, 6:]).all()


def test_a_message_of_many_parts_is_not_unfolded(tmp_path: Path) -> None:
    sent = build(POINT, 5, 6, "a" * 70_000, [1.0, 2.0, 3.0]).SerializeToString()
    readings = read_topic(write_log(tmp_path / "a.mcap", POINT, [sent]), "position")
    assert (readings.read, readings.lost) == (0, 1)
    assert "longer than 64 KiB" in readings.notes[0]


@pytest.mark.parametrize(
    ("kind", "content", "message"),
    [
        (IMU, "position", "its schema, sensor_msgs.Imu, has no point or pose.position"),
        (POINT, "acceleration", "its schema, foxglove.Point3InFrame, has no linear_acceleration.x"),
        (message_class("foxglove.Point3", FOXGLOVE), "position", "has no header.stamp or timestamp"),
        (
            message_class("foxglove.Point3InFrame", changed(FOXGLOVE, "foxglove.Point3", y="string")),
            "position",
            "does not hold a number as point.y",
        ),
        (
            message_class("foxglove.Point3InFrame", changed(FOXGLOVE, "google.protobuf.Timestamp", nanos="double")),
            "position",
            "does not hold a whole number as timestamp.nanos",
        ),
    ],
)
def test_a_schema_of_something_else_costs_its_topic(kind: Any, content: Content, message: str, tmp_path: Path) -> None:
    readings = read_topic(write_log(tmp_path / "a.mcap", kind, [b"", b"\x0a\0"]), content)
    assert (readings.read, readings.lost) == (0, 2)
    assert message in readings.notes[0]


@pytest.mark.parametrize(
    ("schema", "message"),
    [
        (b"", "is missing that schema"),
        (b"\xff\xff", "its schema cannot be read"),
        (b"\0" * 300_000, "its schema is 292 KiB long"),
        (schema_of(POINT)[:-20], "its schema cannot be read"),
        (build_file_descriptor_set(POINT).file[-1].SerializeToString(), "schema"),
    ],
)
def test_a_schema_that_cannot_be_followed_costs_its_topic(schema: bytes, message: str, tmp_path: Path) -> None:
    readings = read_topic(write_log(tmp_path / "a.mcap", POINT, steady(POINT, 3), schema), "position")
    assert (readings.read, readings.lost) == (0, 3)
    assert message in readings.notes[0]


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_a_damaged_schema_is_followed_or_costs_its_topic(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    whole = bytearray(schema_of(POSE))
    for _ in range(data.draw(st.integers(1, 3))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path = write_log(tmp_path_factory.getbasetemp() / "schema.mcap", POSE, steady(POSE, 4), bytes(whole))
    readings = read_topic(path, "position")
    assert readings.lost == 4 - readings.read
    assert readings.read == 4 or readings.notes


def test_a_channel_without_a_schema_is_refused() -> None:
    with pytest.raises(ValueError, match="no schema"):
        protobuf.decoder(None, None, "position")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match='written as "jsonschema", not protobuf'):
        protobuf.decoder(None, Schema(1, b"", "jsonschema", "x"), "position")  # type: ignore[arg-type]
