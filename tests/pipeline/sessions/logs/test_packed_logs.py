"""Logs and messages packed by zstd, files that are no logs, and limits that study.yaml lifts."""

from __future__ import annotations

from pathlib import Path

import pytest
import zstandard

from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Limits, Wanted
from pipeline.study.settings import Study
from tests.conftest import write_session
from tests.pipeline.sessions.logs.ros_messages import IN_ROS2, write_payloads
from tests.pipeline.sessions.logs.test_mcap import COUNTS, WANTED, bomb, counts

POSE = "geometry_msgs/msg/PoseStamped"


@pytest.mark.parametrize("name", ["a.mcap", "a.mcap.zstd", "a.mcap.zst"])
def test_a_log_packed_as_a_whole(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(zstandard.compress(write_session(tmp_path / "b.mcap").read_bytes()))
    log = read_log(path, WANTED)
    assert counts(log) == COUNTS
    assert log.faults == ()


def test_a_packed_log_that_was_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap.zstd"
    whole = write_session(tmp_path / "b.mcap").read_bytes()
    packer = zstandard.ZstdCompressor().compressobj()
    blocks = [
        packer.compress(whole[at : at + 4096]) + packer.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK)
        for at in range(0, len(whole), 4096)
    ]
    path.write_bytes(b"".join(blocks[: len(blocks) // 2]))
    log = read_log(path, WANTED)
    assert 0 < log.topics["/phone/imu"].read < COUNTS["/phone/imu"]
    assert log.topics["/phone/imu"].lost is None
    assert "cut off" in " ".join(log.faults)


def test_a_packed_bomb_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap.zstd"
    path.write_bytes(zstandard.compress(b"\x89MCAP0\r\n" + b"\0" * 2**27))
    with pytest.raises(SessionError, match="would unpack to more than 64 MiB"):
        read_log(path, WANTED)


def test_messages_packed_one_by_one(tmp_path: Path) -> None:
    sent = [IN_ROS2.bytes_of(IN_ROS2.position(POSE, at, (at, 2, 3))) for at in range(5)]
    packed = [zstandard.compress(payload) if at != 1 else payload for at, payload in enumerate(sent)]
    packed[3] = packed[3][:-9]
    path = write_payloads(tmp_path / "a.mcap", POSE, packed, IN_ROS2.definition(POSE))
    readings = read_log(path, [Wanted("/t", "position")]).topics["/t"]
    assert readings.values[:, 0].tolist() == [0, 1, 2, 4]
    assert readings.lost == 1


def test_a_message_that_would_unpack_to_too_much(tmp_path: Path) -> None:
    path = write_payloads(tmp_path / "a.mcap", POSE, [zstandard.compress(b"\0" * 2**20)], IN_ROS2.definition(POSE))
    (note,) = read_log(path, [Wanted("/t", "position")]).topics["/t"].notes
    assert "it is packed with zstd and cannot be unpacked: it is longer than 64 KiB" in note


def test_a_pointer_of_git_lfs_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(SessionError, match="it is a Git LFS pointer, not the log itself; run: git lfs pull"):
        read_log(path, WANTED)


def test_limits_are_lifted_by_study_yaml(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(bomb(2**28, 2**28))
    with pytest.raises(SessionError, match=r"write `log_limits: \{unpacked_mib: N\}` in study.yaml"):
        read_log(path, WANTED)
    with pytest.raises(SessionError, match=r"more than 600000 messages.*write `log_limits: \{messages: N\}`"):
        read_log(path, WANTED, Limits(unpacked_bytes=2**29, messages=600_000))
    study = Study.model_validate({"conditions": ["a"], "trials": "t.csv", "log_limits": {"unpacked_mib": 256}})
    assert (study.log_limits.unpacked_mib, study.log_limits.messages) == (256, 500_000)
