"""Logs damaged at random and on purpose: what can be read is read, what is lost is said, and nothing blows up."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Log
from pipeline.sessions.logs.mcap import MAGIC
from tests.conftest import session_messages, write_session
from tests.pipeline.sessions.logs.test_mcap import WANTED, chunk_spans, counts, faulty

Rows = dict[str, set[tuple[int, int, str, str]]]


def rows(log: Log) -> Rows:
    """Every message of each topic; NaN as text, so that it equals itself."""
    found: Rows = {}
    for topic, readings in log.topics.items():
        texts = [json.dumps(event, sort_keys=True) for event in readings.events] or [""] * readings.read
        found[topic] = {
            (int(arrival), int(stamp), str(values.tolist()), event)
            for arrival, stamp, values, event in zip(
                readings.arrival_ns, readings.stamp_ns, readings.values, texts, strict=True
            )
        }
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, Rows]:
    """A log of some chunks, its bytes and its messages."""
    path = write_session(tmp_path_factory.mktemp("whole") / "a.mcap", session_messages(2.0))
    return path.read_bytes(), rows(read_log(path, WANTED))


def read_damaged(path: Path, content: bytes) -> Log | None:
    """The log of these bytes, None if it is refused; any other exception, or a long wait, fails the test."""
    path.write_bytes(content)
    began = time.perf_counter()
    try:
        return read_log(path, WANTED)
    except SessionError as error:
        assert str(error)
        return None
    finally:
        assert time.perf_counter() - began < 5.0


def assert_nothing_silent(log: Log, everything: Rows) -> None:
    """What is read stood in the log, and what is missing is said."""
    found = rows(log)
    for topic, expected in everything.items():
        readings = log.topics.get(topic)
        assert found.get(topic, set()) <= expected
        assert readings is None or readings.read == len(found[topic])  # none twice
        if len(found.get(topic, set())) < len(expected):
            assert log.faults or readings is None or readings.lost != 0


@settings(deadline=None, max_examples=80)
@given(data=st.data())
def test_a_log_cut_anywhere(
    data: st.DataObject, whole: tuple[bytes, Rows], tmp_path_factory: pytest.TempPathFactory
) -> None:
    content, everything = whole
    cut = content[: data.draw(st.integers(0, len(content) - 1))]
    log = read_damaged(tmp_path_factory.getbasetemp() / "cut.mcap", cut)
    complete = sum(end <= len(cut) for _, end in chunk_spans(content))
    assert (log is not None) == (complete > 0)
    if log is not None:
        assert log.faults
        assert_nothing_silent(log, everything)


@settings(deadline=None, max_examples=150)
@given(data=st.data())
def test_one_bit_flipped_anywhere(
    data: st.DataObject, whole: tuple[bytes, Rows], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Half of the flips where it hurts: in the heads of records, which hold kinds and lengths."""
    content, everything = whole
    heads = [place for begin, _ in chunk_spans(content) for place in range(begin - 69, begin)]
    at = data.draw(st.one_of(st.sampled_from(heads), st.integers(0, len(content) - 1)))
    flipped = bytearray(content)
    flipped[at] ^= 1 << data.draw(st.integers(0, 7))
    log = read_damaged(tmp_path_factory.getbasetemp() / "flip.mcap", bytes(flipped))
    if at >= len(MAGIC):
        assert log is not None
    if log is not None:
        assert_nothing_silent(log, everything)


@settings(deadline=None, max_examples=80)
@given(
    stretches=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 300), st.binary(max_size=300)), min_size=1, max_size=4)
)
def test_stretches_overwritten_left_out_or_put_in(
    stretches: list[tuple[float, int, bytes]], whole: tuple[bytes, Rows], tmp_path_factory: pytest.TempPathFactory
) -> None:
    content, everything = whole
    damaged = bytearray(content)
    for place, length, bytes_there in stretches:
        at = len(MAGIC) + int(place * (len(damaged) - len(MAGIC)))
        damaged[at : at + length] = bytes_there
    log = read_damaged(tmp_path_factory.getbasetemp() / "soup.mcap", bytes(damaged))
    if log is not None:
        assert_nothing_silent(log, everything)


@settings(deadline=None, max_examples=100)
@given(
    records=st.lists(st.tuples(st.integers(0, 16), st.binary(max_size=60)), max_size=12), tail=st.binary(max_size=40)
)
def test_records_of_soup(
    records: list[tuple[int, bytes]], tail: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Well-framed records with anything in them."""
    content = MAGIC + b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records) + tail
    read_damaged(tmp_path_factory.getbasetemp() / "records.mcap", content)


def test_a_chunk_with_a_damaged_length_costs_no_other(whole: tuple[bytes, Rows], tmp_path: Path) -> None:
    content, everything = whole
    spans = chunk_spans(content)
    assert len(spans) >= 2
    damaged = bytearray(content)
    length_at = spans[0][0] - 60 - 8
    damaged[length_at + 2] ^= 0x40
    log = read_damaged(tmp_path / "a.mcap", bytes(damaged))
    assert log is not None
    assert any("reading goes on" in fault and "at the next chunk" in fault for fault in log.faults)
    lost = {topic: readings.lost for topic, readings in log.topics.items()}
    assert {topic: readings.read + (lost[topic] or 0) for topic, readings in log.topics.items()} == {
        topic: len(messages) for topic, messages in everything.items()
    }
    assert sum(readings.read for readings in log.topics.values()) > 0


@pytest.mark.parametrize(("offset", "what"), [(16, "states"), (24, "checksum does not fit")])
def test_a_chunk_that_contradicts_itself_costs_no_other(
    whole: tuple[bytes, Rows], tmp_path: Path, offset: int, what: str
) -> None:
    """Its stated size (the eight bytes from 16), its checksum (the four from 24)."""
    content, _ = whole
    for flipped_byte in (0, 3):
        damaged = bytearray(content)
        damaged[chunk_spans(content)[0][0] - 60 + offset + flipped_byte] ^= 0x21
        log = read_damaged(tmp_path / "a.mcap", bytes(damaged))
        assert log is not None
        assert any("chunk 1 is damaged and left out" in fault and what in fault for fault in log.faults)
        assert sum(counts(log).values()) > 0


def test_a_record_that_swallows_chunks_by_a_wrong_length_costs_none(whole: tuple[bytes, Rows], tmp_path: Path) -> None:
    """The session's facts, whose length is nowhere checked, come before the first chunk."""
    content, everything = whole
    at = content.index(b"\x0c" + struct.pack("<Q", len(b"session") + 8))
    damaged = bytearray(content)
    damaged[at + 2] ^= 0x40
    log = read_damaged(tmp_path / "a.mcap", bytes(damaged))
    assert log is not None
    assert rows(log) == everything
    assert "the log is damaged" in log.faults[0]


def test_a_contradiction_in_the_summary_is_a_damaged_record(whole: tuple[bytes, Rows], tmp_path: Path) -> None:
    """The summary only repeats what the messages were read by."""
    content, everything = whole
    at = content.rindex(b"/phone/imu")
    log = read_damaged(tmp_path / "a.mcap", content[:at] + b"/phone/imv" + content[at + 10 :])
    assert log is not None
    assert "is defined twice" in log.faults[0]
    assert len(rows(log)["/phone/imu"]) == len(everything["/phone/imu"])


def test_a_log_without_chunks_is_read_as_one_with(tmp_path: Path, whole: tuple[bytes, Rows]) -> None:
    from mcap.reader import NonSeekingReader

    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    write_session(source, session_messages(2.0))
    with source.open("rb") as file, target.open("wb") as out:
        writer = Writer(out, use_chunking=False, compression=CompressionType.NONE)
        writer.start()
        ids: dict[int, int] = {}
        for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            assert schema is not None
            if channel.id not in ids:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(ids[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()  # type: ignore[no-untyped-call]
    assert rows(read_log(target, WANTED)) == whole[1]


def test_many_faults_are_counted_and_not_all_listed(tmp_path: Path) -> None:
    broken = struct.pack("<BQ", 4, 1) + b"x"
    path = write_session(tmp_path / "a.mcap", session_messages(0.5))
    content = path.read_bytes()
    path.write_bytes(MAGIC + broken * 1000 + content[len(MAGIC) :])
    log = read_log(path, WANTED)
    assert len(log.faults) == 21
    assert log.faults[-1] == "and 980 further faults"


def chunk(records: bytes, data: bytes, compression: bytes, stated: int | None = None) -> bytes:
    head = struct.pack("<QQQI", 0, 0, len(records) if stated is None else stated, 0)
    head += struct.pack("<I", len(compression)) + compression + struct.pack("<Q", len(data))
    return struct.pack("<BQ", 6, len(head) + len(data)) + head + data


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def channel_record(topic: bytes, encoding: bytes, schema: int = 0) -> bytes:
    body = struct.pack("<HH", 1, schema) + text(topic) + text(encoding) + struct.pack("<I", 0)
    return struct.pack("<BQ", 4, len(body)) + body


def message_record(payload: bytes) -> bytes:
    return struct.pack("<BQHIQQ", 5, 22 + len(payload), 1, 0, 0, 0) + payload


def zeros(compression: str, size: int) -> bytes:
    if compression == "lz4":
        return bytes(lz4.frame.compress(b"\0" * size, store_size=False))
    return zstandard.ZstdCompressor(write_content_size=False).compress(b"\0" * size)


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

READ_AND_WEIGH = """
import sys
from pathlib import Path
from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log
from tests.pipeline.sessions.logs.test_mcap import WANTED

def peak_mb():
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) // 1000

read_log(Path(sys.argv[1]), WANTED)
for name in sys.argv[2:]:
    before = peak_mb()
    try:
        read_log(Path(name), WANTED)
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
    for name, make in BOMBS.items():
        paths.append(tmp_path / f"{name}.mcap")
        paths[-1].write_bytes(MAGIC + make())
    command = [sys.executable, "-c", READ_AND_WEIGH, str(good), *map(str, paths)]
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
    path.write_bytes(MAGIC + BOMBS[name]())
    with pytest.raises(SessionError, match=message):
        read_log(path, WANTED)


@pytest.mark.parametrize(
    ("name", "message"),
    [("deep event", "is longer than 64 KiB"), ("huge event", "is longer than 64 KiB")],
)
def test_an_event_that_is_a_bomb_is_lost_and_said(tmp_path: Path, name: str, message: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + BOMBS[name]())
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


@pytest.mark.parametrize("name", ["crc_zstd", "crc_lz4"])
def test_others_flipped_bytes_are_counted(name: str) -> None:
    log = read_log(faulty(name), [])
    assert any("chunk 3 is damaged and left out" in fault for fault in log.faults)
    assert sum(readings.read + (readings.lost or 0) for readings in log.topics.values()) == 1210
