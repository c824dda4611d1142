"""Positions and accelerations in JSON, held against the standard library message by message."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Content, Readings, Wanted
from pipeline.sessions.logs.mcap import json_payload
from tests.pipeline.sessions.logs.test_mcap_fast import assert_same

CONTENTS: tuple[Content, ...] = ("position", "acceleration")
Row = tuple[int, int, list[float]]


def write_log(path: Path, payloads: Iterable[bytes], schema: str | None = "jsonschema") -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        number = 0 if schema is None else writer.register_schema("geometry_msgs/msg/PointStamped", schema, b"{}")
        channel = writer.register_channel("/t", "json", number)
        for time, data in enumerate(payloads):
            writer.add_message(channel, time, data, time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def read_topic(path: Path, content: Content) -> Readings:
    return read_log(path, [Wanted("/t", content)]).topics["/t"]


def read_slowly(path: Path, content: Content) -> Readings:
    """Message by message."""
    decoder = json_payload.decoder
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(json_payload, "decoder", lambda *asked: replace(decoder(*asked), many=lambda *_: None))
        return read_topic(path, content)


def expected(payloads: Sequence[bytes], content: str) -> list[Row]:
    """Arrival, stamp and figures of whole messages, by the standard library."""
    rows = []
    for time, payload in enumerate(payloads):
        message = json.loads(payload)
        stamp = message["header"]["stamp"] if "header" in message else message["timestamp"]
        nanoseconds = stamp["nanosec"] if "nanosec" in stamp else stamp["nsec"]
        if content == "position":
            point = message["point"] if "point" in message else message["pose"]["position"]
            figures = [point[axis] for axis in "xyz"]
        else:
            figures = [message[name][axis] for name in ("linear_acceleration", "angular_velocity") for axis in "xyz"]
            turn = [(message.get("orientation") or {}).get(axis, 0.0) for axis in "xyzw"]
            known = (message.get("orientation_covariance") or [0.0])[0] != -1
            figures += turn if known and 0.8 < sum(part**2 for part in turn) < 1.25 else [np.nan] * 4
        rows.append((time, stamp["sec"] * 10**9 + nanoseconds, figures))
    return rows


numbers = st.one_of(
    st.floats(-10, 10), st.integers(-3, 3), st.sampled_from([0.0, -0.0, 1.0, 0.5, 1e-300, np.nan, np.inf, 9999.0])
)


def shuffled(draw: st.DrawFn, fields: dict[str, Any]) -> dict[str, Any]:
    return {name: fields[name] for name in draw(st.permutations(sorted(fields)))}


def vectors(draw: st.DrawFn, axes: str = "xyz") -> dict[str, Any]:
    return shuffled(draw, {axis: draw(numbers) for axis in axes})


@st.composite
def messages(draw: st.DrawFn, content: str) -> dict[str, Any]:
    """A whole message, its fields in any order and those that may be absent sometimes so."""
    seconds, nanoseconds = draw(st.integers(-(2**31), 2**31 - 1)), draw(st.integers(0, 10**9 - 1))
    fields: dict[str, Any] = {
        "header": {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": draw(st.text())}
    }
    if draw(st.integers(0, 3)) == 0:
        fields = {"timestamp": {"nsec": nanoseconds, "sec": seconds}}
    if content == "position":
        point = vectors(draw)
        fields |= {"point": point} if draw(st.integers(0, 3)) else {"pose": {"position": point}}
    else:
        fields |= {"linear_acceleration": vectors(draw), "angular_velocity": vectors(draw)}
        if draw(st.integers(0, 3)):
            fields["orientation"] = draw(st.one_of(st.none(), st.just({**dict.fromkeys("xyz", 0), "w": 1})))
        if draw(st.integers(0, 3)):
            fields["orientation_covariance"] = draw(st.sampled_from([[-1, *[0] * 8], [0.0] * 9, None]))
    return shuffled(draw, fields) if draw(st.booleans()) else fields


@pytest.mark.parametrize("content", CONTENTS)
@settings(deadline=None, max_examples=50)
@given(data=st.data())
def test_random_messages_as_the_standard_library_reads_them(
    data: st.DataObject, content: Content, tmp_path_factory: pytest.TempPathFactory
) -> None:
    some = data.draw(st.lists(messages(content), min_size=1, max_size=4))
    sent = [json.dumps(message).encode() for message in some * data.draw(st.integers(1, 3))]
    readings = read_topic(write_log(tmp_path_factory.getbasetemp() / "random.json.mcap", sent), content)
    assert readings.lost == 0
    assert_same(readings, expected(sent, content))


BAD_NUMBERS: Sequence[Any] = ("1.5", True, None, [1], {}, 10**400, 2**70, -(2**63) - 1, 1e300)


def leaves(message: Any) -> list[tuple[Any, Any]]:
    """Every object or list in a message with each of its keys."""
    if not isinstance(message, (dict, list)):
        return []
    keys = list(message) if isinstance(message, dict) else list(range(len(message)))
    return [(message, key) for key in keys] + [leaf for key in keys for leaf in leaves(message[key])]


def spoiled(data: st.DataObject, message: dict[str, Any]) -> bytes:
    """A message with a wrong value or a missing field, cut, or with other bytes in it."""
    how = data.draw(st.sampled_from(["value", "missing", "cut", "bytes", "joined"]))
    if how in ("value", "missing"):
        holder, key = data.draw(st.sampled_from(leaves(message)))
        if how == "missing":
            del holder[key]
        else:
            holder[key] = data.draw(st.sampled_from(BAD_NUMBERS))
    whole = json.dumps(message).encode()
    at = data.draw(st.integers(0, len(whole)))
    if how == "cut":
        return whole[:at]
    if how == "bytes":
        return whole[:at] + data.draw(st.binary(min_size=1, max_size=4)) + whole[at + 1 :]
    return whole + b"," + whole if how == "joined" else whole


@pytest.mark.parametrize("content", CONTENTS)
@settings(deadline=None, max_examples=120)
@given(data=st.data())
def test_damaged_messages_are_read_one_by_one_or_lost_and_counted(
    data: st.DataObject, content: Content, tmp_path_factory: pytest.TempPathFactory
) -> None:
    some = data.draw(st.lists(messages(content), min_size=1, max_size=3))
    sent = [json.dumps(message).encode() for message in some]
    sent.insert(data.draw(st.integers(0, len(sent))), spoiled(data, data.draw(messages(content))))
    path = write_log(tmp_path_factory.getbasetemp() / "damaged.json.mcap", sent)
    fast, slow = read_topic(path, content), read_slowly(path, content)
    assert_same(fast, list(zip(slow.arrival_ns.tolist(), slow.stamp_ns.tolist(), slow.values.tolist(), strict=True)))
    assert (fast.lost, fast.notes) == (slow.lost, slow.notes)
    assert fast.lost == len(sent) - fast.read <= 1
    assert fast.lost == 0 or fast.notes


def steady(content: str, count: int) -> list[bytes]:
    random = np.random.default_rng(0)
    sent = []
    for at in range(count):
        values = random.normal(0, 0.5, 6).tolist()
        fields: dict[str, Any] = {"header": {"stamp": {"sec": 1_700_000_000, "nanosec": at * 1000}, "frame_id": "a"}}
        if content == "position":
            fields["point"] = dict(zip("xyz", values[:3], strict=True))
        else:
            fields["linear_acceleration"] = dict(zip("xyz", values[:3], strict=True))
            fields["angular_velocity"] = dict(zip("xyz", values[3:], strict=True))
            fields["orientation"] = {"x": 0, "y": 0, "z": 0.6, "w": 0.8}
            fields["orientation_covariance"] = [0.0] * 9
        sent.append(json.dumps(fields).encode())
    return sent


@pytest.mark.parametrize("content", CONTENTS)
def test_the_standard_library_is_asked_for_what_is_unusual_only(
    content: Content, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A message that is not a number costs the block it is in, and no other."""
    sent = steady(content, 2000)
    sent[700] = sent[700].replace(b'"x": ', b'"x": NaN, "was": ', 1)
    calls: list[bytes] = []
    loads: Callable[[bytes], Any] = json.loads

    def counted(payload: bytes) -> Any:
        calls.append(payload)
        return loads(payload)

    path = write_log(tmp_path / "a.mcap", sent)
    wanted = expected(sent, content)
    monkeypatch.setattr(json, "loads", counted)
    assert_same(read_topic(path, content), wanted)
    assert len(calls) == json_payload.AT_ONCE


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((b'"header"', b'"head"'), "it has no header.stamp or timestamp"),
        ((b'"nanosec"', b'"nano"'), "it has no header.stamp.nanosec or header.stamp.nsec or header.stamp.nanos"),
        ((b"1700000000", b"1700000000.5"), "its header.stamp.sec is not a whole number"),
        ((b"1700000000", b"1" * 30), "the bytes do not fit the schema"),
        ((b'"point"', b'"pint"'), "it has no point or pose.position"),
        ((b'"z"', b'"zz"'), "it has no point.z"),
        ((b'"y": ', b'"y": "1", "was": '), "its point.y is not a number"),
        ((b'"y": ', b'"y": true, "was": '), "its point.y is not a number"),
        ((b'"y": ', b'"y": 1' + b"0" * 400 + b', "was": '), "too large"),
        ((b'"y": ', b'"y": 1' + b"0" * 30 + b', "was": '), "a figure is out of all range"),
        ((b'{"header"', b'[{"header"'), "Expecting ',' delimiter"),
        ((b'"frame_id": "a"', b'"frame_id": "' + b"a" * 70_000 + b'"'), "it is longer than 64 KiB"),
    ],
)
def test_what_is_wrong_with_a_message_is_said(change: tuple[bytes, bytes], message: str, tmp_path: Path) -> None:
    sent = steady("position", 3)
    sent[1] = sent[1].replace(*change)
    readings = read_topic(write_log(tmp_path / "a.mcap", sent), "position")
    assert (readings.read, readings.lost) == (2, 1)
    assert message in readings.notes[0]


def test_a_message_that_holds_the_end_of_another_shifts_none(tmp_path: Path) -> None:
    """Joined by commas, the three would be three sound messages, each at another's time."""
    first, second, third = steady("position", 3)
    sent = [first, second + b"," + third, third[:-1], b'"more": 1}']
    readings = read_topic(write_log(tmp_path / "a.mcap", sent), "position")
    assert (readings.arrival_ns.tolist(), readings.lost) == ([0], 3)


def test_no_schema_is_needed_but_none_of_another_encoding(tmp_path: Path) -> None:
    assert read_topic(write_log(tmp_path / "a.mcap", steady("position", 3), None), "position").read == 3
    readings = read_topic(write_log(tmp_path / "a.mcap", steady("position", 3), "ros2msg"), "position")
    assert (readings.read, readings.lost) == (0, 3)
    assert 'its schema is written as "ros2msg", not jsonschema' in readings.notes[0]


def test_an_encoding_that_is_not_read_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel("/t", "msgpack", 0), 0, b"x", 0)
        writer.finish()  # type: ignore[no-untyped-call]
    assert 'its encoding is "msgpack", not one of cdr, protobuf, json' in read_topic(path, "position").notes[0]
