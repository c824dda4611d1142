"""Bags of ROS 1 and 2, written by the package `rosbags`, and recordings in several parts."""

from __future__ import annotations

import builtins
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer

from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log, read_logs
from pipeline.sessions.logs.log import Limits, Readings, Wanted
from tests.conftest import session_messages, write_session
from tests.pipeline.sessions.logs.ros_messages import IN_ROS1, IN_ROS2, ROS1, ROS2, Maker

POSE, IMU, TEXT = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/Imu", "std_msgs/msg/String"
WANTED = [Wanted("/pose", "position"), Wanted("/imu", "acceleration"), Wanted("/events", "events")]
START_NS = 1_700_000_000 * 10**9
STEP_NS = 10**7


def sent(maker: Maker, begin: int, end: int) -> list[tuple[str, int, Any]]:
    """Topic, arrival and message, at 100 Hz; a pose every third, and one event."""
    found: list[tuple[str, int, Any]] = []
    for at in range(begin, end):
        now = START_NS + at * STEP_NS
        found.append(("/imu", now, maker.imu(now - 5, (at, 0, 9.8), (0, 0, 0.1), (0, 0, 0, 1))))
        if at % 3 == 0:
            found.append(("/pose", now + 1, maker.position(POSE, now - 7, (at, 1, 2))))
    found.append(("/events", now + 2, maker.make(TEXT, data='{"type": "selection", "trial": 1}')))
    return found


def write_bag2(folder: Path, messages: Sequence[tuple[str, int, Any]], plugin: StoragePlugin) -> Path:
    with Bag2Writer(folder, version=9, storage_plugin=plugin) as writer:
        _fill(writer, messages, ROS2)
    return folder


def write_bag1(path: Path, messages: Sequence[tuple[str, int, Any]]) -> Path:
    with Bag1Writer(path) as writer:
        _fill(writer, messages, ROS1)
    return path


def _fill(writer: Any, messages: Sequence[tuple[str, int, Any]], store: Any) -> None:
    connections: dict[str, Connection] = {}
    for topic, time, message in messages:
        name = message.__msgtype__
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, name, typestore=store)
        is_bag1 = isinstance(writer, Bag1Writer)
        payload = store.serialize_ros1(message, name) if is_bag1 else store.serialize_cdr(message, name)
        writer.write(connections[topic], time, payload)


def assert_whole(topics: dict[str, Readings], begin: int, end: int) -> None:
    imu, pose = topics["/imu"], topics["/pose"]
    assert imu.values[:, 0].tolist() == list(range(begin, end))
    assert pose.values[:, 0].tolist() == [at for at in range(begin, end) if at % 3 == 0]
    assert imu.arrival_ns.tolist() == [START_NS + at * STEP_NS for at in range(begin, end)]
    np.testing.assert_array_equal(imu.arrival_ns - imu.stamp_ns, 5)
    assert {one["type"] for one in topics["/events"].events} == {"selection"}
    assert (imu.lost, pose.lost, imu.notes, pose.notes) == (0, 0, (), ())


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_bag_of_ros_2(plugin: StoragePlugin, tmp_path: Path) -> None:
    log = read_log(write_bag2(tmp_path / "bag", sent(IN_ROS2, 0, 60), plugin), WANTED)
    assert log.faults == ()
    assert_whole(dict(log.topics), 0, 60)
    assert log.types["/pose"].name == POSE
    every = read_log(tmp_path / "bag", [])
    assert {name: readings.read for name, readings in every.topics.items()} == {"/imu": 60, "/pose": 20, "/events": 1}


def test_a_bag_of_ros_1(tmp_path: Path) -> None:
    log = read_log(write_bag1(tmp_path / "a.bag", sent(IN_ROS1, 0, 60)), WANTED)
    assert log.faults == ()
    assert_whole(dict(log.topics), 0, 60)


def test_publishers_of_one_topic_in_ros_1_are_one_stream_in_the_order_of_times(tmp_path: Path) -> None:
    path, store = tmp_path / "a.bag", ROS1
    with Bag1Writer(path) as writer:
        both = [writer.add_connection("/pose", POSE, typestore=store, callerid=name) for name in ("/left", "/right")]
        for at in range(40):
            message = IN_ROS1.position(POSE, START_NS + at * STEP_NS - 7, (at, 1, 2))
            writer.write(both[at // 3 % 2], START_NS + at * STEP_NS, store.serialize_ros1(message, POSE))
    pose = read_log(path, WANTED[:1]).topics["/pose"]
    assert pose.values[:, 0].tolist() == list(range(40))
    assert pose.arrival_ns.tolist() == [START_NS + at * STEP_NS for at in range(40)]


def test_a_bag_of_ros_1_without_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_bag1(tmp_path / "a.bag", sent(IN_ROS1, 0, 3))
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.startswith("rosbags"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name.split(".", maxsplit=1)[0])
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(SessionError, match=r'a further package \(rosbags\): pip install "steadyhand\[ros\]"'):
        read_log(path, WANTED)


def test_definitions_are_those_of_the_bag_or_well_known(tmp_path: Path) -> None:
    """Bags of ROS 2 before Iron have none."""
    folder = write_bag2(tmp_path / "bag", sent(IN_ROS2, 0, 60), StoragePlugin.SQLITE3)
    (file,) = folder.glob("*.db3")
    bag = sqlite3.connect(file)
    bag.execute("DROP TABLE message_definitions")
    bag.commit()
    bag.close()
    assert_whole(dict(read_log(file, WANTED).topics), 0, 60)


def test_a_bag_packed_as_a_whole(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "bag", sent(IN_ROS2, 0, 60), StoragePlugin.SQLITE3)
    (file,) = folder.glob("*.db3")
    file.with_suffix(".db3.zstd").write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()
    log = read_log(folder, WANTED)
    assert log.faults == ()
    assert_whole(dict(log.topics), 0, 60)


@pytest.mark.parametrize("name", ["a.db3", "a.bag"])
@pytest.mark.parametrize("content", [b"", b"no bag", b"SQLite format 3\0" + b"x" * 200, b"#ROSBAG V2.0\n" + b"x" * 50])
def test_what_is_no_bag_is_refused(name: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(SessionError, match=r"the file is empty|not a (ROS 2 )?bag|holds no message"):
        read_log(path, WANTED)


def test_a_damaged_bag_is_read_as_far_as_it_goes_or_refused(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "bag", sent(IN_ROS2, 0, 300), StoragePlugin.SQLITE3)
    (file,) = folder.glob("*.db3")
    whole = file.read_bytes()
    for share in (0.3, 0.6, 0.9):
        file.write_bytes(whole[: int(len(whole) * share)])
        try:
            log = read_log(file, WANTED)
        except SessionError:
            continue
        assert "the bag is damaged" in log.faults[0]
        assert log.topics["/imu"].lost is None


def test_limits_of_a_bag(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "bag", sent(IN_ROS2, 0, 60), StoragePlugin.SQLITE3)
    with pytest.raises(SessionError, match=r"more than 50 messages.*log_limits: \{messages: N\}"):
        read_log(folder, WANTED, Limits(messages=50))
    with pytest.raises(SessionError, match=r"log_limits: \{unpacked_mib: N\}"):
        read_log(folder, WANTED, Limits(unpacked_bytes=5000))


def split(tmp_path: Path, plugin: StoragePlugin, *spans: tuple[int, int]) -> list[Path]:
    """Parts of one recording, named as rosbag2 names them."""
    files = []
    for index, (begin, end) in enumerate(spans):
        folder = write_bag2(tmp_path / f"part_{index}", sent(IN_ROS2, begin, end), plugin)
        (file,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
        files.append(file.rename(tmp_path / f"bag_{index}{file.suffix}"))
    return files


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_parts_of_a_recording_are_joined(plugin: StoragePlugin, tmp_path: Path) -> None:
    log = read_logs(split(tmp_path, plugin, (0, 60), (60, 90))[::-1], WANTED)
    assert log.faults == ()
    assert_whole(dict(log.topics), 0, 90)
    assert log.topics["/pose"].claims.frames == ("room",)
    assert len(log.topics["/pose"].claims.frame) == 30


def test_a_missing_part_is_said(tmp_path: Path) -> None:
    log = read_logs(split(tmp_path, StoragePlugin.MCAP, (0, 60), (160, 190)), WANTED)
    assert log.faults == ("nothing was recorded for 1.0 s between bag_0.mcap and bag_1.mcap",)


def test_parts_that_overlap_are_not_joined(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match=r"bag_0.mcap and bag_1.mcap overlap by 3\.0 s"):
        read_logs(split(tmp_path, StoragePlugin.MCAP, (0, 300), (3, 303)), WANTED)


def test_a_part_that_cannot_be_read_costs_itself(tmp_path: Path) -> None:
    files = split(tmp_path, StoragePlugin.MCAP, (0, 60), (60, 90))
    files[0].write_bytes(b"no log")
    log = read_logs(files, WANTED)
    assert log.faults == ("bag_0.mcap: not an MCAP file: it does not begin with the MCAP mark",)
    assert log.topics["/imu"].read == 30


def test_facts_of_parts_must_agree(tmp_path: Path) -> None:
    files = [
        write_session(tmp_path / f"{name}.mcap", session_messages(1.0), participant=name) for name in ("P01", "P02")
    ]
    with pytest.raises(SessionError, match=r'its parts disagree: participant is "P01" and, in P02.mcap, "P02"'):
        read_logs(files, [Wanted("/tracker/position", "position")])


def test_what_the_metadata_of_a_bag_lists(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "bag", sent(IN_ROS2, 0, 60), StoragePlugin.MCAP)
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("message_count: 20", "message_count: 25"))
    assert read_log(folder, WANTED).faults == ("metadata.yaml counts 5 more messages of /pose than its files hold",)
    listed = "  relative_file_paths:\n  - bag_0.mcap\n"
    (folder / "metadata.yaml").write_text(text.split("  relative_file_paths:")[0] + listed)
    assert read_log(folder, WANTED).faults == ("metadata.yaml lists bag_0.mcap, which is not there",)


def test_a_folder_without_any_log(tmp_path: Path) -> None:
    for name in ("a.txt", "b.txt"):
        (tmp_path / name).touch()
    with pytest.raises(SessionError, match=r"no reader for any of its files \(a.txt, b.txt\); known: .mcap"):
        read_log(tmp_path, WANTED)
