"""Reading logs: every readable message, what was lost said, or a clear refusal."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Log, Wanted
from pipeline.sessions.logs.mcap import MAGIC
from pipeline.sessions.logs.mcap.writer import POINT_STAMPED
from tests.conftest import CLONE, session_messages, write_session

WANTED = [
    Wanted("/tracker/position", "position"),
    Wanted("/phone/imu", "acceleration"),
    Wanted("/reference/position", "position"),
    Wanted("/events", "events"),
]
COUNTS = {"/tracker/position": 120, "/phone/imu": 360, "/reference/position": 360, "/events": 7}


def counts(log: Log) -> dict[str, int]:
    return {topic: readings.read for topic, readings in log.topics.items()}


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    log = read_log(write_session(tmp_path / "a.mcap", participant="P1"), WANTED)
    assert counts(log) == COUNTS
    assert log.facts == {"participant": "P1"}
    assert log.faults == ()
    written = [m for m in session_messages() if m.topic == "/phone/imu"]
    np.testing.assert_array_equal(log.topics["/phone/imu"].values, [m.values for m in written])
    np.testing.assert_array_equal(log.topics["/phone/imu"].stamp_ns, [m.stamp_ns for m in written])
    assert log.topics["/events"].events[0]["type"] == "session_start"


def test_the_stock_reader_reads_the_same(tmp_path: Path) -> None:
    path = write_session(tmp_path / "a.mcap")
    log = read_log(path, WANTED)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        points = [
            (m.log_time, d.point.x, d.point.y, d.point.z)
            for _, _, m, d in reader.iter_decoded_messages(topics=["/tracker/position"])
        ]
    ours = log.topics["/tracker/position"]
    np.testing.assert_array_equal(np.column_stack([ours.arrival_ns, ours.values]), np.array(points))


def test_a_log_cut_off_gives_every_whole_chunk_and_says_so(tmp_path: Path) -> None:
    path = write_session(tmp_path / "a.mcap")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    log = read_log(path, WANTED)
    assert 0 < log.topics["/phone/imu"].read < 360
    assert log.topics["/phone/imu"].lost is None
    assert "cut off" in log.faults[0]


def chunk_spans(content: bytes) -> list[tuple[int, int]]:
    """Where the chunks' compressed bytes lie."""
    spans, position = [], len(MAGIC)
    while position + 9 <= len(content) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", content, position)
        if opcode == 6:
            spans.append((position + 9 + 60, position + 9 + length))
        position += 9 + length
    return spans


def test_a_flipped_byte_costs_its_chunk_only_and_the_loss_is_counted(tmp_path: Path) -> None:
    path = write_session(tmp_path / "a.mcap")
    content = bytearray(path.read_bytes())
    begin, end = chunk_spans(bytes(content))[1]
    content[(begin + end) // 2] ^= 0xFF
    path.write_bytes(bytes(content))
    log = read_log(path, WANTED)
    assert any("chunk 2 is damaged and left out" in fault for fault in log.faults)
    for topic, readings in log.topics.items():
        assert readings.lost is not None
        assert readings.read + readings.lost == COUNTS[topic]
    assert sum(readings.lost or 0 for readings in log.topics.values()) > 0


def bomb(stated: int, actual: int) -> bytes:
    """A file with one chunk that states one size and holds another."""
    compressor = zstandard.ZstdCompressor(level=1).compressobj()
    pieces = [compressor.compress(b"\0" * 2**20) for _ in range(actual // 2**20)]
    data = b"".join(pieces) + compressor.flush()
    body = struct.pack("<QQQI", 0, 0, stated, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(data)) + data
    header = struct.pack("<BQ", 1, 8) + struct.pack("<II", 0, 0)
    return MAGIC + header + struct.pack("<BQ", 6, len(body)) + body


@pytest.mark.parametrize(
    ("stated", "message"),
    [(2**30, "would inflate to more than 64 MiB"), (100, "a chunk that states 100 bytes inflates to more")],
)
def test_a_bomb_is_refused_before_it_goes_off(tmp_path: Path, stated: int, message: str) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(bomb(stated, 2**30))
    with pytest.raises(SessionError, match=message):
        read_log(path, WANTED)


def test_a_flood_of_empty_messages_is_refused(tmp_path: Path) -> None:
    """A few kilobytes can hold millions of messages without a byte in them."""
    message = struct.pack("<BQHIQQ", 5, 22, 1, 0, 0, 0)
    channel = struct.pack("<HH", 1, 0) + struct.pack("<I", 2) + b"/t" + struct.pack("<I", 4) + b"json" + b"\0" * 4
    records = struct.pack("<BQ", 4, len(channel)) + channel + message * 600_000
    data = zstandard.compress(records)
    head = struct.pack("<QQQI", 0, 0, len(records), 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(data))
    path = tmp_path / "flood.mcap"
    path.write_bytes(MAGIC + struct.pack("<BQ", 6, len(head) + len(data)) + head + data)
    with pytest.raises(SessionError, match="refused: it holds more than 500000 messages"):
        read_log(path, WANTED)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"hello world, not an mcap", "not an MCAP file"),
        (MAGIC + struct.pack("<BQ", 6, 2**60) + b"x" * 100, "holds no message that can be read"),
        (
            MAGIC + struct.pack("<BQ", 3, 100) + b"\x01\0\xff\xff\xff\xff" + b"x" * 94,
            "holds no message that can be read",
        ),
    ],
)
def test_what_is_no_log_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(SessionError, match=message):
        read_log(path, WANTED)


def test_a_schema_that_does_not_fit_its_bytes_is_detected(tmp_path: Path) -> None:
    path = write_session(tmp_path / "a.mcap")
    log = read_log(path, [Wanted("/phone/imu", "position")])
    readings = log.topics["/phone/imu"]
    assert readings.read == 0
    assert readings.lost == 360
    assert (
        "holds sensor_msgs/msg/Imu, and a stream of kind position needs geometry_msgs/msg/PointStamped"
        in readings.notes[0]
    )


def test_bytes_of_another_type_under_the_right_schema_are_not_decoded_to_zeros(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "a.mcap"
    imu = write_session(tmp_path / "b.mcap")
    with path.open("wb") as file, imu.open("rb") as source:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("geometry_msgs/msg/PointStamped", "ros2msg", POINT_STAMPED.encode())
        channel = writer.register_channel("/t", "cdr", schema)
        for _, _, message in make_reader(source).iter_messages(topics=["/phone/imu"]):
            writer.add_message(channel, message.log_time, message.data, message.publish_time)
        writer.finish()  # type: ignore[no-untyped-call]
    readings = read_log(path, [Wanted("/t", "position")]).topics["/t"]
    assert readings.read == 0
    assert "the bytes do not fit the schema" in readings.notes[0]


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_damage_anywhere_is_read_in_part_or_refused_never_worse(data: st.DataObject) -> None:
    """Random cuts and flips of a small log: messages, or a SessionError; nothing else."""
    content = bytearray(small_log())
    kind = data.draw(st.sampled_from(["cut", "flip", "splice", "soup"]))
    at = data.draw(st.integers(0, len(content) - 1))
    if kind == "cut":
        content = content[:at]
    elif kind == "flip":
        content[at] ^= data.draw(st.integers(1, 255))
    elif kind == "splice":
        content[at : at + 8] = struct.pack("<Q", data.draw(st.integers(0, 2**64 - 1)))
    else:
        content[len(MAGIC) :] = data.draw(st.binary(max_size=400))
    path = Path(os.environ.get("TMPDIR", "/tmp")) / f"steadyhand-damage-{os.getpid()}.mcap"  # noqa: S108
    path.write_bytes(bytes(content))
    try:
        log = read_log(path, WANTED)
    except SessionError:
        return
    finally:
        path.unlink()
    for topic, readings in log.topics.items():
        assert readings.read <= COUNTS[topic]
        if readings.read < SMALL[topic] and readings.lost == 0:
            assert log.faults


SMALL = {"/tracker/position": 30, "/phone/imu": 90, "/reference/position": 90, "/events": 7}
_small: list[bytes] = []


def small_log() -> bytes:
    if not _small:
        path = Path(os.environ.get("TMPDIR", "/tmp")) / f"steadyhand-small-{os.getpid()}.mcap"  # noqa: S108
        _small.append(write_session(path, session_messages(1.0)).read_bytes())
        path.unlink()
    return _small[0]


FAULTS = {
    "good": 1210,
    "midchunk": 680,
    "afterchunk": 911,
    "nodataend": 1210,
    "nofinish": 1140,
    "nomagic": 1210,
    "noidx": 1210,
    "crc_zstd": 981,
    "crc_lz4": 981,
    "shuffled": 1210,
    "loose": 1211,
    "dup": 15,
}
"""Others' broken logs and how many of their messages can be read."""


def faulty(name: str) -> Path:
    """One of others' broken logs; the test is skipped where it is not at hand."""
    folder = Path(os.environ.get("STEADYHAND_FAULTS", CLONE.parent / "shared" / "faults"))
    path = folder / f"{name}.mcap"
    if not path.exists():
        pytest.skip(f"{path.name} is not in STEADYHAND_FAULTS ({folder})")
    return path


@pytest.mark.parametrize("name", [*FAULTS, "redef", "empty", "text", "b1", "b2", "b9", "b12"])
def test_others_broken_logs(name: str) -> None:
    path = faulty(name)
    if name not in FAULTS:
        with pytest.raises(SessionError):
            read_log(path, [])
        return
    log = read_log(path, [])
    assert sum(counts(log).values()) == FAULTS[name]
    assert bool(log.faults) == (name not in ("good", "noidx", "shuffled", "loose", "dup"))


def test_a_log_checked_by_its_data_checksum(tmp_path: Path) -> None:
    """A log without chunks carries one checksum for all of its data; a flip in a message is told."""
    from mcap.writer import Writer

    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False, enable_data_crcs=True)
        writer.start()
        channel = writer.register_channel("/t", "json", writer.register_schema("s", "jsonschema", b"{}"))
        for time in range(5):
            writer.add_message(channel, time, b'{"type": "selection"}', time)
        writer.finish()  # type: ignore[no-untyped-call]
    content = path.read_bytes()
    assert read_log(path, []).faults == ()
    path.write_bytes(content.replace(b'"selection"', b'"selectiom"', 1))
    assert "checksum does not fit" in read_log(path, []).faults[0]
