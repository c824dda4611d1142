"""Messages of the usual ROS types, held against the packages `rosbags` and `mcap-ros2-support`."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Content, Readings, Source, Wanted
from pipeline.sessions.logs.mcap import ros2, templates, well_known, wire
from pipeline.sessions.logs.mcap.places import Places
from tests.pipeline.sessions.logs.ros_messages import (
    IN_ROS1,
    IN_ROS2,
    POSITIONS,
    Maker,
    write_messages,
    write_payloads,
)

PLACES = [(0.5 + at, -1.25 * at, 3.0) for at in range(6)]


def read_topic(path: Path, content: Content = "position", source: Source | None = None) -> Readings:
    wanted = Wanted("/t", content, source or Source())
    return read_log(path, [wanted]).topics[wanted.key]


@pytest.mark.parametrize("maker", [IN_ROS2, IN_ROS1], ids=["ros2", "ros1"])
@pytest.mark.parametrize("name", POSITIONS)
def test_positions_of_every_type(name: str, maker: Maker, tmp_path: Path) -> None:
    sent = [maker.position(name, 10**9 * at + 5, place) for at, place in enumerate(PLACES)]
    readings = read_topic(write_messages(tmp_path / "a.mcap", sent, maker))
    assert readings.values.tolist() == [list(place) for place in PLACES]
    assert readings.stamp_ns.tolist() == [10**9 * at + 5 for at in range(6)]
    assert (readings.lost, readings.notes) == (0, ())
    if name != "geometry_msgs/msg/PointStamped" or maker.is_ros1:
        assert (readings.claims.frames, readings.claims.frame.tolist()) == (("room",), [0] * 6)


@pytest.mark.parametrize("maker", [IN_ROS2, IN_ROS1], ids=["ros2", "ros1"])
def test_accelerations_of_both_versions(maker: Maker, tmp_path: Path) -> None:
    sent = [maker.imu(at, (1, 2, 9.8 + at), (0.1, 0.2, 0.3), (0, 0.6, 0, 0.8)) for at in range(4)]
    readings = read_topic(write_messages(tmp_path / "a.mcap", sent, maker), "acceleration")
    assert readings.values.tolist() == [[1, 2, 9.8 + at, 0.1, 0.2, 0.3, 0, 0.6, 0, 0.8] for at in range(4)]


def test_accelerations_without_turning(tmp_path: Path) -> None:
    """A Vector3Stamped holds a force alone: it has no orientation, and its angular velocity is to be disregarded."""
    sent = [IN_ROS2.position("geometry_msgs/msg/Vector3Stamped", at, (1, 2, 9.8)) for at in range(3)]
    readings = read_topic(write_messages(tmp_path / "a.mcap", sent), "acceleration")
    assert readings.values[:, :6].tolist() == [[1, 2, 9.8, 0, 0, 0]] * 3
    assert np.isnan(readings.values[:, 6:]).all()
    assert readings.claims.gyroscope_disclaimed.all()


def test_velocities(tmp_path: Path) -> None:
    name = "geometry_msgs/msg/TwistStamped"
    sent = [IN_ROS2.make(name, header=IN_ROS2.header(at, "room"), twist=IN_ROS2.twist((1, 2, 3))) for at in range(3)]
    assert read_topic(write_messages(tmp_path / "a.mcap", sent), "velocity").values.tolist() == [[1, 2, 3]] * 3


@pytest.mark.parametrize("name", sorted(POSITIONS))
def test_a_well_known_type_without_its_definition(name: str, tmp_path: Path) -> None:
    sent = [IN_ROS2.bytes_of(IN_ROS2.position(name, at, place)) for at, place in enumerate(PLACES)]
    for written in (name, name.replace("/msg/", "/")):
        readings = read_topic(write_payloads(tmp_path / "a.mcap", written, sent, ""))
        assert readings.values.tolist() == [list(place) for place in PLACES]


@pytest.mark.parametrize("name", sorted(well_known.NAMES - {"builtin_interfaces/Time"}))
@pytest.mark.parametrize("maker", [IN_ROS2, IN_ROS1], ids=["ros2", "ros1"])
def test_well_known_definitions_are_those_of_ros(name: str, maker: Maker) -> None:
    from pipeline.sessions.logs.mcap.definition_text import parse

    full = name.replace("/", "/msg/")
    theirs = parse(name, maker.definition(full).encode())
    assert well_known.definition_of(name, ros1=maker.is_ros1).leaves() == theirs.leaves()
    ours = well_known.definition_of(name, ros1=maker.is_ros1).messages
    for message, fields in theirs.messages.items():
        assert message not in ours or [(f.kind, f.count) for f in ours[message]] == [(f.kind, f.count) for f in fields]


def transforms(*children: str, place: tuple[float, ...] = (1.0, 2.0, 3.0)) -> Any:
    made = [IN_ROS2.transform(10 + at, f"parent_{at}", child, place) for at, child in enumerate(children)]
    return IN_ROS2.make("tf2_msgs/msg/TFMessage", transforms=made)


def test_one_frame_of_many(tmp_path: Path) -> None:
    sent = [transforms("a", "hand"), transforms("hand"), transforms("b"), transforms(), transforms("hand", "a")]
    path = write_messages(tmp_path / "a.mcap", sent)
    readings = read_topic(path, source=Source(child="hand"))
    assert readings.stamp_ns.tolist() == [11, 10, 10]
    assert readings.arrival_ns.tolist() == [0, 1000, 4000]
    assert (readings.lost, readings.notes) == (0, ())
    parents = [readings.claims.frames[at] for at in readings.claims.frame]
    assert parents == ["parent_1", "parent_0", "parent_0"]
    assert read_topic(path, source=Source(child="hand", parent="parent_1")).stamp_ns.tolist() == [11]
    nothing = read_topic(path, source=Source(child="foot"))
    assert (nothing.read, nothing.lost, nothing.notes) == (0, 0, ('none of its messages is of child "foot"',))


@pytest.mark.parametrize("sent", [[transforms("a", "hand")], [transforms("a"), transforms("hand")]])
def test_several_frames_without_a_choice_are_not_mixed(sent: list[Any], tmp_path: Path) -> None:
    readings = read_topic(write_messages(tmp_path / "a.mcap", sent))
    assert readings.read == 0
    assert 'the frames "a", "hand"; say in study.yaml which one is meant by `child:`' in readings.notes[0]


def test_fields_that_stand_elsewhere(tmp_path: Path) -> None:
    """A joint of an arm that is the tracker: three of its positions."""
    name = "sensor_msgs/msg/JointState"
    sent = [
        IN_ROS2.make(
            name,
            header=IN_ROS2.header(at, "arm"),
            name=["one", "two", "three"],
            position=np.array([1.0, 2.0, 3.0 + at]),
            velocity=np.zeros(3),
            effort=np.zeros(0),
        )
        for at in range(3)
    ]
    path = write_messages(tmp_path / "a.mcap", sent)
    stated = Source(fields={"position": ("position[2]", "position[0]", "position[1]")}, scale=0.001)
    assert read_topic(path, source=stated).values.tolist() == [[0.003 + 0.001 * at, 0.001, 0.002] for at in range(3)]
    wrong = read_topic(path, source=Source(fields={"position": ("place",)}))
    assert "which has no number place.x for fields: position" in wrong.notes[0]
    missing = read_topic(path, source=Source(fields={"position": ("position[0]", "position[1]", "position[7]")}))
    assert "it has no position[7]" in missing.notes[0]


def test_senders_that_do_not_stamp(tmp_path: Path) -> None:
    sent = [IN_ROS2.vector("Point", place) for place in PLACES]
    path = write_messages(tmp_path / "a.mcap", sent)
    assert "`stamp: log_time` takes the times at which its messages were recorded" in read_topic(path).notes[0]
    readings = read_topic(path, source=Source(unstamped=True))
    assert readings.stamp_ns.tolist() == readings.arrival_ns.tolist() == [1000 * at for at in range(6)]
    assert readings.values.tolist() == [list(place) for place in PLACES]


def test_arrivals_of_another_clock_are_left_aside(tmp_path: Path) -> None:
    sent = [IN_ROS2.position("geometry_msgs/msg/PoseStamped", 50 + at, (1, 2, 3)) for at in range(3)]
    readings = read_topic(write_messages(tmp_path / "a.mcap", sent), source=Source(arrives_as_stamped=True))
    assert readings.arrival_ns.tolist() == readings.stamp_ns.tolist() == [50, 51, 52]


def test_another_type_is_refused_with_what_would_do(tmp_path: Path) -> None:
    sent = [IN_ROS2.make("std_msgs/msg/String", data="x")]
    (note,) = read_topic(write_messages(tmp_path / "a.mcap", sent)).notes
    assert "it holds std_msgs/msg/String, and a stream of kind position needs geometry_msgs/msg/PointStamped" in note
    assert "`fields:` says where it stands in any other" in note


def test_events_as_text(tmp_path: Path) -> None:
    sent = [IN_ROS2.make("std_msgs/msg/String", data='{"type": "selection", "x": 0.5}')] * 3
    assert (
        read_topic(write_messages(tmp_path / "a.mcap", sent), "events").events
        == ({"type": "selection", "trial": None, "x": 0.5},) * 3
    )
    sent = [IN_ROS1.make("std_msgs/msg/String", data='{"type": "selection"}')]
    assert read_topic(write_messages(tmp_path / "b.mcap", sent, IN_ROS1), "events").read == 1
    poses = [IN_ROS2.position("geometry_msgs/msg/PoseStamped", 0, (1, 2, 3))]
    (note,) = read_topic(write_messages(tmp_path / "c.mcap", poses), "events").notes
    assert "events need JSON, by itself or in a std_msgs/msg/String" in note


# In CDR 2 no figure is aligned to more than four bytes (OMG DDS-XTypes 1.3, 7.4.1): doubles follow the name at once.
@pytest.mark.parametrize(("kind", "order"), [(7, "<"), (6, ">")])
@pytest.mark.parametrize("name", ["geometry_msgs/msg/PointStamped", "geometry_msgs/msg/PoseStamped"])
def test_cdr_2(kind: int, order: str, name: str, tmp_path: Path) -> None:
    turn = (0.0, 0.0, 0.0, 1.0) if "Pose" in name else ()
    for frame in (b"room\0", b"hall\0\0\0\0"[:5] + b"", b"\0"):
        padded = frame + b"\0" * (-len(frame) % 4)
        head = bytes([0, kind, 0, 0]) + struct.pack(f"{order}iII", 5, 6, len(frame)) + padded
        sent = [head + struct.pack(f"{order}{3 + len(turn)}d", 1.0, 2.0, 3.0, *turn)] * 3
        readings = read_topic(write_payloads(tmp_path / "a.mcap", name, sent, IN_ROS2.definition(name)))
        assert readings.values.tolist() == [[1.0, 2.0, 3.0]] * 3
        assert readings.stamp_ns.tolist() == [5_000_000_006] * 3


def test_sequences_in_cdr_2_state_their_bytes(tmp_path: Path) -> None:
    """A DHEADER before a sequence whose elements are no plain numbers (DDS-XTypes 1.3, 7.4.3.5)."""
    body = struct.pack("<IiII5s3xI5s3x7d", 1, 5, 6, 5, b"room\0", 5, b"hand\0", 1.0, 2.0, 3.0, 0, 0, 0, 1)
    sent = [bytes([0, 7, 0, 0]) + struct.pack("<I", len(body)) + body]
    name = "tf2_msgs/msg/TFMessage"
    readings = read_topic(write_payloads(tmp_path / "a.mcap", name, sent, IN_ROS2.definition(name)))
    assert readings.values.tolist() == [[1.0, 2.0, 3.0]]


def test_a_representation_that_is_not_read_is_named(tmp_path: Path) -> None:
    name = "geometry_msgs/msg/PoseStamped"
    path = write_payloads(tmp_path / "a.mcap", name, [b"\0\x03\0\0" + b"\0" * 80], IN_ROS2.definition(name))
    assert "a representation of CDR that is not read (00 03)" in read_topic(path).notes[0]


names = st.one_of(
    st.sampled_from(["", "room", "hand"]), st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
)
figures = st.floats(-1e3, 1e3)


@settings(deadline=None, max_examples=60)
@given(data=st.data(), name=st.sampled_from(POSITIONS[1:]), maker=st.sampled_from([IN_ROS2, IN_ROS1]))
def test_random_messages_as_the_stock_decoders_read_them(
    data: st.DataObject, name: str, maker: Maker, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """By templates, one by one, and by `rosbags` and `mcap-ros2-support`: the same stamps and figures."""
    drawn = data.draw(
        st.lists(
            st.tuples(st.integers(0, 2**31 * 10**9 - 1), st.tuples(figures, figures, figures), names),
            min_size=1,
            max_size=10,
        )
    )
    sent = [maker.position(name, stamp, place, frame) for stamp, place, frame in drawn]
    path = write_messages(tmp_path_factory.getbasetemp() / "random.mcap", sent, maker)
    fast = read_topic(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(templates, "TEMPLATES", 0)
        slow = read_topic(path)
    for readings in (fast, slow):
        assert readings.stamp_ns.tolist() == [stamp for stamp, _, _ in drawn]
        assert readings.values.tolist() == [list(place) for _, place, _ in drawn]
        assert [readings.claims.frames[at] for at in readings.claims.frame] == [frame for _, _, frame in drawn]
    if not maker.is_ros1:
        schema = Schema(data=maker.definition(name).encode(), encoding="ros2msg", id=1, name=name)
        decode = DecoderFactory().decoder_for("cdr", schema)
        assert decode is not None
        for message, (stamp, place, _) in zip(sent, drawn, strict=True):
            assert stock_position(decode(maker.bytes_of(message))) == (stamp, list(place))


def stock_position(message: Any) -> tuple[int, list[float]]:
    """Stamp and place of a message that the stock decoder has decoded."""
    message = message.transforms[0] if hasattr(message, "transforms") else message
    stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    for path in ("point", "vector", "transform.translation", "pose.pose.position", "pose.position"):
        found = message
        for part in path.split("."):
            found = getattr(found, part, None)
        if found is not None:
            return stamp, [found.x, found.y, found.z]
    raise AssertionError


@settings(deadline=None, max_examples=60)
@given(data=st.data(), name=st.sampled_from(POSITIONS[1:]))
def test_damaged_messages_are_read_or_named_and_nothing_else(
    data: st.DataObject, name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Flipped or missing bytes: the fast way and the slow one agree, whatever they make of it."""
    payload = bytearray(IN_ROS2.bytes_of(IN_ROS2.position(name, 5, (1.0, 2.0, 3.0))))
    for _ in range(data.draw(st.integers(1, 3))):
        payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    damaged = bytes(payload)[: len(payload) - data.draw(st.integers(0, 9))]
    path = write_payloads(
        tmp_path_factory.getbasetemp() / "damaged.mcap", name, [damaged] * 2, IN_ROS2.definition(name)
    )
    fast = read_topic(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(templates, "TEMPLATES", 0)
        slow = read_topic(path)
    np.testing.assert_array_equal(fast.values, slow.values)
    assert (fast.stamp_ns.tolist(), fast.lost, fast.notes) == (slow.stamp_ns.tolist(), slow.lost, slow.notes)
    assert fast.read + (fast.lost or 0) == 2


def test_messages_are_not_walked_through_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    walked: list[bytes] = []

    def counting(payload: bytes, *rest: Any) -> Places:
        walked.append(payload)
        return wire.places(payload, *rest)

    monkeypatch.setattr(ros2, "places", counting)
    sent = [
        IN_ROS2.position("tf2_msgs/msg/TFMessage", at, (at, 2, 3), frame) for at in range(300) for frame in ("a", "bc")
    ]
    assert read_topic(write_messages(tmp_path / "a.mcap", sent)).read == 600
    assert len(walked) == 2
