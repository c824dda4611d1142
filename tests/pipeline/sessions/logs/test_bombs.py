"""Small logs that unpack to very much: they are refused, and memory and time stay bounded."""

from __future__ import annotations

import pickle
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
import zstandard

from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.mcap import MAGIC
from tests.conftest import session_messages, write_session
from tests.pipeline.sessions.logs.records_by_hand import channel_record, chunk, message_record, text, zeros
from tests.pipeline.sessions.logs.test_mcap import WANTED


def honest_bomb(compression: str) -> bytes:
    return chunk(b"", zeros(compression, 2**28), compression.encode(), stated=2**28)


def lying_bomb(compression: str) -> bytes:
    return chunk(b"", zeros(compression, 2**28), compression.encode(), stated=100)


def deep_event() -> bytes:
    records = channel_record(b"/events", b"json") + message_record(b"[" * 50_000 + b"]" * 50_000)
    return chunk(records, zstandard.compress(records), b"zstd")


def huge_event() -> bytes:
    records = channel_record(b"/events", b"json") + message_record(b"[" + b"[],[]," * 10_000_000 + b"0]")
    return chunk(records, zstandard.compress(records), b"zstd")


def flood_of_events() -> bytes:
    records = channel_record(b"/events", b"json") + message_record(b'{"type": "selection", "x": 1.5}') * 450_000
    return chunk(records, zstandard.compress(records), b"zstd")


def flood_of_positions() -> bytes:
    schema = struct.pack("<H", 1) + text(b"geometry_msgs/msg/PointStamped") + text(b"ros2msg") + text(b"float64 x")
    records = struct.pack("<BQ", 3, len(schema)) + schema + channel_record(b"/tracker/position", b"cdr", 1)
    records += message_record(b"\0\1\0\0" + b"\0" * 60) * 450_000
    return chunk(records, zstandard.compress(records), b"zstd")


def flood_of_definitions() -> bytes:
    entries = b"".join(text(b"%d" % at) + text(b"") for at in range(400_000))
    body = struct.pack("<HH", 1, 0) + text(b"/events") + text(b"json") + struct.pack("<I", len(entries)) + entries
    records = (struct.pack("<BQ", 4, len(body)) + body) * 8
    return chunk(records, zstandard.compress(records), b"zstd")


def nested_lengths() -> bytes:
    """A chunk in which a message says it is longer than the chunk, and a name longer than its record."""
    records = channel_record(b"/events", b"json") + message_record(b'{"type": "selection"}')
    records += (
        struct.pack("<BQ", 4, 8) + struct.pack("<HHI", 2, 0, 2**32 - 1) + struct.pack("<BQ", 5, 2**63) + b"x" * 40
    )
    return chunk(records, zstandard.compress(records), b"zstd")


BOMBS: dict[str, Callable[[], bytes]] = {
    "honest zstd": lambda: honest_bomb("zstd"),
    "honest lz4": lambda: honest_bomb("lz4"),
    "lying zstd": lambda: lying_bomb("zstd"),
    "lying lz4": lambda: lying_bomb("lz4"),
    "many lying": lambda: lying_bomb("zstd") * 40,
    "deep event": deep_event,
    "huge event": huge_event,
    "flood of events": flood_of_events,
    "flood of positions": flood_of_positions,
    "flood of definitions": flood_of_definitions,
    "nested lengths": nested_lengths,
}


@cache
def bomb(name: str) -> bytes:
    """One of them as a log, made once: to deflate it takes a fifth of a second."""
    return MAGIC + BOMBS[name]()


READ_AND_WEIGH = """
import pickle, sys
from pathlib import Path
from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log

def peak_mb():
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) // 1000

wanted = pickle.loads(bytes.fromhex(sys.argv[1]))
read_log(Path(sys.argv[2]), wanted)
for name in sys.argv[3:]:
    before = peak_mb()
    try:
        read_log(Path(name), wanted)
    except SessionError:
        pass
    if peak_mb() > 500:
        sys.exit(f"{name} takes {peak_mb()} MB; before it was read, {before}")
    print(Path(name).stem, peak_mb())
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not say what a process took")
def test_no_bomb_takes_more_than_500_megabytes(tmp_path: Path) -> None:
    """The whole process, over all of them, one after the other."""
    good = write_session(tmp_path / "good.mcap", session_messages(0.5))
    paths = []
    for name in BOMBS:
        paths.append(tmp_path / f"{name}.mcap")
        paths[-1].write_bytes(bomb(name))
    command = [sys.executable, "-c", READ_AND_WEIGH, pickle.dumps(WANTED).hex(), str(good), *map(str, paths)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ran.returncode == 0, ran.stderr


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("honest zstd", "it would inflate to more than [0-9]+ MiB"),
        ("honest lz4", "it would inflate to more than [0-9]+ MiB"),
        ("lying zstd", "chunk 1 is damaged and left out: a chunk that states 100 bytes inflates to more"),
        ("lying lz4", "chunk 1 is damaged and left out: a chunk that states 100 bytes inflates to more"),
        ("flood of events", "it holds 450000 events, which no session does"),
        ("flood of definitions", "a record .channel. cannot be read: it is [0-9]+ KiB long"),
    ],
)
def test_a_bomb_is_refused_and_why(tmp_path: Path, name: str, message: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(bomb(name))
    with pytest.raises(SessionError, match=message):
        read_log(path, WANTED)


@pytest.mark.parametrize(
    ("name", "message"),
    [("deep event", "is longer than 64 KiB"), ("huge event", "is longer than 64 KiB")],
)
def test_an_event_that_is_a_bomb_is_lost_and_said(tmp_path: Path, name: str, message: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(bomb(name))
    readings = read_log(path, WANTED).topics["/events"]
    assert readings.read == 0
    assert message in readings.notes[0]


def test_lengths_that_lead_out_of_their_chunk_end_it(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + nested_lengths())
    log = read_log(path, WANTED)
    assert log.topics["/events"].read == 1
    assert log.topics["/events"].lost is None
    assert any("a record (channel) cannot be read" in fault for fault in log.faults)
    assert any("chunk 1 ends in mid-record" in fault for fault in log.faults)


def test_very_many_topics_take_no_longer_than_their_messages(tmp_path: Path) -> None:
    """With a channel and a message each."""
    count = 2**14
    channels, sent = [], []
    for number in range(1, count):
        body = struct.pack("<HH", number, 0) + text(b"/%d" % number) + text(b"json") + struct.pack("<I", 0)
        channels.append(struct.pack("<BQ", 4, len(body)) + body)
        sent.append(struct.pack("<BQHIQQ", 5, 22, number, 0, 0, 0))
    stated = b"".join(struct.pack("<HQ", number, 1) for number in range(1, count))
    statistics = struct.pack("<QHIIIIQQ", count - 1, 0, count - 1, 0, 0, 0, 0, 0) + text(stated)
    end = struct.pack("<BQI", 15, 4, 0) + struct.pack("<BQ", 11, len(statistics)) + statistics
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + b"".join(channels + sent) + end + struct.pack("<BQQQI", 2, 20, 0, 0, 0) + MAGIC)
    began = time.perf_counter()
    log = read_log(path, [])
    assert time.perf_counter() - began < 10.0
    assert {readings.read for readings in log.topics.values()} == {1}
    assert {readings.lost for readings in log.topics.values()} == {0}


def test_a_topic_of_very_many_types_is_bounded(tmp_path: Path) -> None:
    """Following a schema takes milliseconds, and a reason may quote a name as long as the log makes it."""
    inner = b""
    for number in range(1, 101):
        schema = struct.pack("<H", number) + text(b"n" * 5000) + text(b"ros2msg") + text(b"")
        body = struct.pack("<HH", number, number) + text(b"/tracker/position") + text(b"cdr") + struct.pack("<I", 0)
        inner += struct.pack("<BQ", 3, len(schema)) + schema + struct.pack("<BQ", 4, len(body)) + body
        inner += struct.pack("<BQHIQQ", 5, 22, number, 0, 0, 0)
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + chunk(inner, zstandard.compress(inner), b"zstd"))
    readings = read_log(path, WANTED).topics["/tracker/position"]
    assert readings.read == 0
    assert max(map(len, readings.notes)) < 400
    assert any("36 messages cannot be read: its topic holds more than 64 types" in note for note in readings.notes)
