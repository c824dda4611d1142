"""Decoding many messages at once, held against the stock decoder message by message."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader
from mcap.records import Schema
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Content, Readings, Wanted
from pipeline.sessions.logs.mcap import ros2, templates, wire
from pipeline.sessions.logs.mcap.schemas import SCHEMAS
from pipeline.sessions.logs.mcap.writer import IMU, POINT_STAMPED
from tests.conftest import CLONE, write_session
from tests.pipeline.sessions.logs.test_mcap import faulty

TEXTS = {"position": POINT_STAMPED, "acceleration": IMU}
CONTENTS: dict[str, Content] = {"geometry_msgs/msg/PointStamped": "position", "sensor_msgs/msg/Imu": "acceleration"}


def by_the_stock_decoder(path: Path) -> dict[str, list[tuple[int, int, list[float]]]]:
    """Arrival, stamp and figures of every message of each topic, read and decoded by the stock packages."""
    found: dict[str, list[tuple[int, int, list[float]]]] = {}
    with path.open("rb") as file, contextlib.suppress(EndOfFile):
        factory = DecoderFactory()
        for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            if schema is None or schema.name not in CONTENTS:
                continue
            decode = factory.decoder_for(channel.message_encoding, schema)
            assert decode is not None
            decoded = decode(message.data)
            stamp = decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec
            values = figures(decoded, CONTENTS[schema.name])
            found.setdefault(channel.topic, []).append((message.log_time, stamp, values))
    return found


def figures(message: object, content: str) -> list[float]:
    if content == "position":
        return [getattr(message.point, axis) for axis in "xyz"]  # type: ignore[attr-defined]
    values = [getattr(message.linear_acceleration, axis) for axis in "xyz"]  # type: ignore[attr-defined]
    values += [getattr(message.angular_velocity, axis) for axis in "xyz"]  # type: ignore[attr-defined]
    turn = [getattr(message.orientation, axis) for axis in "xyzw"]  # type: ignore[attr-defined]
    known = message.orientation_covariance[0] != -1 and 0.8 < sum(part * part for part in turn) < 1.25  # type: ignore[attr-defined]
    return values + (turn if known else [np.nan] * 4)


def assert_same(ours: Readings, stock: Sequence[tuple[int, int, list[float]]]) -> None:
    np.testing.assert_array_equal(ours.arrival_ns, [row[0] for row in stock])
    np.testing.assert_array_equal(ours.stamp_ns, [row[1] for row in stock])
    np.testing.assert_array_equal(ours.values, np.reshape([row[2] for row in stock], ours.values.shape))


def assert_every_topic_same(path: Path, contents: dict[str, Content]) -> None:
    stock = by_the_stock_decoder(path)
    log = read_log(path, [Wanted(topic, content) for topic, content in contents.items()])
    assert log.topics.keys() == contents.keys()
    for topic in contents:
        assert_same(log.topics[topic], stock[topic])


OURS: dict[str, Content] = {
    "/tracker/position": "position",
    "/reference/position": "position",
    "/phone/imu": "acceleration",
}


def test_the_tests_own_log_as_the_stock_decoder_reads_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_session(tmp_path / "a.mcap")
    assert_every_topic_same(path, OURS)
    monkeypatch.setattr(templates, "TEMPLATES", 0)
    assert_every_topic_same(path, OURS)  # the way of what fits no template


@pytest.mark.parametrize(
    "path", sorted((CLONE / "studies" / "reach" / "data").glob("*.mcap"))[::3], ids=lambda p: p.stem
)
def test_bundled_logs_as_the_stock_decoder_reads_them(path: Path) -> None:
    assert_every_topic_same(path, OURS)


@pytest.mark.parametrize("name", ["good", "noidx", "shuffled", "afterchunk", "nodataend"])
def test_others_logs_as_the_stock_decoder_reads_them(name: str) -> None:
    """As far as it does: of a log cut off it reads every whole chunk, then raises EndOfFile."""
    assert_every_topic_same(faulty(name), {"/kinect/position": "position", "/phone/imu": "acceleration"})


def test_a_loose_message_of_another_type_is_not_taken_for_a_position() -> None:
    """The one outside of any chunk holds an Imu's bytes, which the stock decoder reads as (0, 0, 0)."""
    path = faulty("loose")
    readings = read_log(path, [Wanted("/kinect/position", "position")]).topics["/kinect/position"]
    assert by_the_stock_decoder(path)["/kinect/position"][-1][2] == [0.0, 0.0, 0.0]
    assert (readings.read, readings.lost) == (300, 1)
    assert "the bytes do not fit the schema" in readings.notes[0]


def write_log(
    path: Path, content: str, payloads: Iterable[bytes], text: str | None = None, encoding: str = "ros2msg"
) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(SCHEMAS[content], encoding, (text or TEXTS[content]).encode())
        channel = writer.register_channel("/t", "cdr", schema)
        for time, data in enumerate(payloads):
            writer.add_message(channel, time, data, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def read_topic(path: Path, content: Content) -> Readings:
    return read_log(path, [Wanted("/t", content)]).topics["/t"]


def encoded(
    order: str, seconds: int, nanoseconds: int, frame: bytes, numbers: Sequence[float], terminated: bool = True
) -> bytes:
    """A message in CDR, by `struct` alone."""
    name = frame + b"\0" if frame or terminated else b""
    head = struct.pack(f"{order}iII", seconds, nanoseconds, len(name)) + name
    padded = head + b"\0" * (-len(head) % 8)
    return bytes([0, order == "<", 0, 0]) + padded + struct.pack(f"{order}{len(numbers)}d", *numbers)


numbers = st.one_of(st.floats(-10, 10), st.floats(), st.sampled_from([np.nan, np.inf, -1.0, 0.5, 9999.0, 1e6]))


@st.composite
def messages(draw: st.DrawFn, count: int) -> bytes:
    name = draw(st.one_of(st.sampled_from([b"", b"phone", b"\xff\xfe"]), st.text(max_size=20).map(str.encode)))
    return encoded(
        draw(st.sampled_from("<>")),
        draw(st.integers(-(2**31), 2**31 - 1)),
        draw(st.one_of(st.integers(0, 10**9 - 1), st.integers(0, 2**32 - 1))),
        name,
        draw(st.lists(numbers, min_size=count, max_size=count)),
        draw(st.booleans()),
    )


@settings(deadline=None, max_examples=40)
@given(data=st.data(), content=st.sampled_from(["position", "acceleration"]))
def test_random_messages_as_the_stock_decoder_reads_them(
    data: st.DataObject, content: Content, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Frame names of any length and script, both byte orders, NaN, stamps out of range, bytes too few or too many."""
    drawn = data.draw(st.lists(messages({"position": 3, "acceleration": 37}[content]), min_size=1, max_size=12))
    cut = data.draw(st.integers(-9, 9))
    drawn[0] = drawn[0] + b"\0" * cut if cut >= 0 else drawn[0][:cut]
    path = write_log(tmp_path_factory.getbasetemp() / "random.mcap", content, drawn)
    fast = read_topic(path, content)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(templates, "TEMPLATES", 0)
        slow = read_topic(path, content)
    assert_same(fast, list(zip(slow.arrival_ns.tolist(), slow.stamp_ns.tolist(), slow.values.tolist(), strict=True)))
    assert (fast.lost, fast.notes) == (slow.lost, slow.notes)
    stock = dict(by_the_stock_decoder_if_sound(drawn, content))
    read = fast.arrival_ns.tolist()
    assert {at for at in stock if at > 0 or cut == 0} <= set(read) <= stock.keys()
    assert_same(fast, [(at, *stock[at]) for at in read])


def by_the_stock_decoder_if_sound(
    payloads: Sequence[bytes], content: Content
) -> Iterator[tuple[int, tuple[int, list[float]]]]:
    """Stamp and figures of each message that it can read, of which no figure is out of all range."""
    schema = Schema(data=TEXTS[content].encode(), encoding="ros2msg", id=1, name=SCHEMAS[content])
    decode = DecoderFactory().decoder_for("cdr", schema)
    assert decode is not None
    for at, payload in enumerate(payloads):
        with contextlib.suppress(UnicodeDecodeError, struct.error):
            decoded = decode(payload)
            stamp, values = decoded.header.stamp, figures(decoded, content)
            finite = [abs(value) for value in values[:6] if np.isfinite(value)]
            if stamp.nanosec < 10**9 and max(finite, default=0.0) <= {"position": 1e4, "acceleration": 1e5}[content]:
                yield at, (stamp.sec * 10**9 + stamp.nanosec, values)


def payloads_decoded_by(factory: type[Any], monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """What a stock package's decoders are given from now on."""
    payloads: list[bytes] = []
    decoder_for = factory.decoder_for

    def counting(self: object, encoding: str, schema: Schema | None) -> Callable[[bytes], Any]:
        decode = decoder_for(self, encoding, schema)

        def counted(payload: bytes) -> Any:
            payloads.append(payload)
            return decode(payload)

        return counted

    monkeypatch.setattr(factory, "decoder_for", counting)
    return payloads


def test_messages_are_not_walked_through_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    walked: list[bytes] = []
    walk = wire.places

    def counting(payload: bytes, *rest: Any) -> Any:
        walked.append(payload)
        return walk(payload, *rest)

    monkeypatch.setattr(ros2, "places", counting)
    frames = [b"a", b"a name of another length", "имя".encode()]
    numbers = [float(value) for value in range(37)]
    sent = [encoded("<>"[at % 2], at, 0, frames[at % 3], numbers) for at in range(600)]
    readings = read_topic(write_log(tmp_path / "a.mcap", "acceleration", sent), "acceleration")
    assert readings.read == 600
    assert len(walked) == 6  # one for every name of a frame and byte order


def test_a_definition_in_another_order_is_followed(tmp_path: Path) -> None:
    """Its messages are as long; only the log's own definition tells which figure is which."""
    turned = POINT_STAMPED.replace("float64 x\nfloat64 y\nfloat64 z", "float64 z\nfloat64 y\nfloat64 x")
    sent = [encoded("<", 5, 6, b"tracker", [1.0, 2.0, 3.0])] * 3
    readings = read_topic(write_log(tmp_path / "a.mcap", "position", sent, turned), "position")
    assert readings.values.tolist() == [[3.0, 2.0, 1.0]] * 3


def test_a_stamp_without_a_sign_is_followed(tmp_path: Path) -> None:
    unsigned = POINT_STAMPED.replace("int32 sec", "uint32 sec")
    sent = [encoded("<", -1, 0, b"tracker", [1.0, 2.0, 3.0])]
    readings = read_topic(write_log(tmp_path / "a.mcap", "position", sent, unsigned), "position")
    assert readings.stamp_ns.tolist() == [(2**32 - 1) * 10**9]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("B[4000000000] b\n" + POINT_STAMPED + "=====\nMSG: geometry_msgs/B\nuint8[1] c", "the bytes do not fit"),
        ("B[] b\n" + POINT_STAMPED + "=====\nMSG: geometry_msgs/B\nuint8[0] c", "the bytes do not fit"),
        ("A a\n===\nMSG: geometry_msgs/A\nA a", "messages within messages"),
        ("float64 x\n" * 100_000, "KiB long"),
        ("!!", "its schema cannot be read"),
        ("float64 X", "it holds geometry_msgs/msg/PointStamped, and a stream of kind position needs"),
        ("wstring x\n" + POINT_STAMPED, "its schema has a field of type wstring, which is not read"),
    ],
)
def test_a_definition_that_cannot_be_followed_costs_its_topic(tmp_path: Path, text: str, message: str) -> None:
    sent = [encoded("<", 5, 6, b"tracker", [1.0, 2.0, 3.0])] * 3
    readings = read_topic(write_log(tmp_path / "a.mcap", "position", sent, text), "position")
    assert (readings.read, readings.lost) == (0, 3)
    assert message in readings.notes[0]
