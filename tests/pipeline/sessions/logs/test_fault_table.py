"""Each fault that the stock readers meet badly: what is readable is read, what is lost is said."""

from __future__ import annotations

import contextlib
import struct
from io import BytesIO
from pathlib import Path

import pytest
import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import IndexType, Writer

from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Log, Wanted
from pipeline.sessions.logs.mcap import MAGIC
from tests.pipeline.sessions.logs.records_by_hand import channel_record, chunk, message_record, text

EVENT = b'{"type": "selection", "x": 0.5}'
COUNT = 200
WANTED = [Wanted("/events", "events")]


def whole_log(indexed: bool = True, order: int = 1) -> bytes:
    """A log of some chunks of events at times 0, 1, 2 …, or the other way round."""
    file = BytesIO()
    writer = Writer(file, chunk_size=2000, index_types=IndexType.ALL if indexed else IndexType.NONE)
    writer.start()
    channel = writer.register_channel("/events", "json", 0)
    for time in range(COUNT)[::order]:
        writer.add_message(channel, time, EVENT, time)
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()


def records(content: bytes) -> list[tuple[int, int, int]]:
    """Kind, begin and end of each record."""
    found, at = [], len(MAGIC)
    while at + 9 <= len(content) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", content, at)
        found.append((opcode, at, at + 9 + length))
        at += 9 + length
    return found


def spans(content: bytes, wanted: int) -> list[tuple[int, int]]:
    return [(begin, end) for opcode, begin, end in records(content) if opcode == wanted]


def read(path: Path, content: bytes) -> Log:
    path.write_bytes(content)
    return read_log(path, WANTED)


@pytest.mark.parametrize("where", ["in a chunk", "after a chunk", "before the end of the data"])
def test_a_log_that_was_cut_off(where: str, tmp_path: Path) -> None:
    """The stock reader gives none of its messages; the one that does not seek, those of every whole chunk."""
    content = whole_log()
    begin, end = spans(content, 6)[2]
    (data_end,) = spans(content, 15)
    at = {"in a chunk": (begin + end) // 2, "after a chunk": end, "before the end of the data": data_end[0]}[where]
    log = read(tmp_path / "a.mcap", content[:at])
    readings = log.topics["/events"]
    streamed = 0
    with (tmp_path / "a.mcap").open("rb") as file, contextlib.suppress(EndOfFile):
        for _ in NonSeekingReader(file).iter_messages(log_time_order=False):
            streamed += 1
    assert readings.read == streamed > 0
    assert readings.lost is None
    assert "cut off" in log.faults[0]
    with (tmp_path / "a.mcap").open("rb") as file, pytest.raises(McapError):
        next(make_reader(file).iter_messages())


@pytest.mark.parametrize("indexed", [True, False])
def test_a_flipped_byte_is_found_with_an_index_or_without(indexed: bool, tmp_path: Path) -> None:
    """The stock reader accepts it, unless asked to check; without an index also then."""
    content = bytearray(whole_log(indexed))
    begin, end = spans(bytes(content), 6)[1]
    content[(begin + end) // 2] ^= 1
    log = read(tmp_path / "a.mcap", bytes(content))
    readings = log.topics["/events"]
    assert "chunk 2 is damaged and left out" in log.faults[0]
    assert 0 < readings.read < COUNT
    assert readings.read + (readings.lost or 0) == COUNT


def test_a_message_outside_any_chunk_while_an_index_exists(tmp_path: Path) -> None:
    """The stock reader loses it silently."""
    content = whole_log()
    begin, _ = spans(content, 15)[0]
    log = read(tmp_path / "a.mcap", content[:begin] + message_record(EVENT) + content[begin:])
    assert (log.topics["/events"].read, log.topics["/events"].lost) == (COUNT + 1, 0)


def test_a_last_mark_that_is_missing(tmp_path: Path) -> None:
    log = read(tmp_path / "a.mcap", whole_log()[: -len(MAGIC)])
    assert log.topics["/events"].read == COUNT
    assert log.faults == ("the log's last bytes are missing",)


def test_a_log_without_any_index(tmp_path: Path) -> None:
    log = read(tmp_path / "a.mcap", whole_log(indexed=False))
    assert (log.topics["/events"].read, log.topics["/events"].lost, log.faults) == (COUNT, 0, ())


def test_messages_out_of_order(tmp_path: Path) -> None:
    log = read(tmp_path / "a.mcap", whole_log(order=-1))
    assert log.topics["/events"].read == COUNT
    assert log.topics["/events"].arrival_ns.tolist() == list(range(COUNT))[::-1]


def test_a_topic_that_is_registered_more_than_once(tmp_path: Path) -> None:
    channels = b""
    for number in (1, 2, 3):
        body = bytearray(channel_record(b"/events", b"json"))
        body[9:11] = struct.pack("<H", number)
        message = bytearray(message_record(EVENT))
        message[9:11] = struct.pack("<H", number)
        channels += bytes(body) + bytes(message)
    log = read(tmp_path / "a.mcap", MAGIC + chunk(channels, zstandard.compress(channels), b"zstd"))
    assert log.topics["/events"].read == 3


def test_a_channel_that_is_defined_anew_as_another(tmp_path: Path) -> None:
    both = channel_record(b"/events", b"json") + message_record(EVENT) + channel_record(b"/other", b"json")
    with pytest.raises(SessionError, match='channel 1 is defined twice, as "/events" and as "/other"'):
        read(tmp_path / "a.mcap", MAGIC + chunk(both, zstandard.compress(both), b"zstd"))


def test_a_schema_that_is_defined_anew_as_another(tmp_path: Path) -> None:
    def schema(name: bytes) -> bytes:
        body = struct.pack("<H", 1) + text(name) + text(b"jsonschema") + text(b"{}")
        return struct.pack("<BQ", 3, len(body)) + body

    both = schema(b"a") + schema(b"b") + channel_record(b"/events", b"json", 1) + message_record(EVENT)
    with pytest.raises(SessionError, match='schema 1 is defined twice, as "a" and as "b"'):
        read(tmp_path / "a.mcap", MAGIC + chunk(both, zstandard.compress(both), b"zstd"))


@pytest.mark.parametrize(
    ("compression", "stated", "message"),
    [
        (b"snappy", None, 'its compression "snappy" is not one of zstd, lz4'),
        (b"zstd", 10, "a chunk that states 10 bytes inflates to more"),
        (b"zstd", 10_000, "it states 10000 bytes and holds"),
    ],
)
def test_a_chunk_that_says_wrongly_what_it_holds_costs_itself_only(
    compression: bytes, stated: int | None, message: str, tmp_path: Path
) -> None:
    """The stock reader takes a compression it does not know for none, and checks no size."""
    inner = channel_record(b"/events", b"json") + message_record(EVENT)
    bad = chunk(inner, zstandard.compress(inner), compression, stated)
    log = read(tmp_path / "a.mcap", MAGIC + bad + chunk(inner, zstandard.compress(inner), b"zstd"))
    assert log.topics["/events"].read == 1
    assert any("chunk 1 is damaged and left out" in fault and message in fault for fault in log.faults)


@pytest.mark.parametrize("length", [2**32, 2**60, 2**64 - 1])
def test_a_record_or_name_longer_than_the_file(length: int, tmp_path: Path) -> None:
    for content in (
        MAGIC + struct.pack("<BQ", 6, length) + b"x" * 50,
        MAGIC + struct.pack("<BQHHI", 4, 100, 1, 0, min(length, 2**32 - 1)) + b"x" * 92,
    ):
        with pytest.raises(SessionError, match="holds no message that can be read"):
            read(tmp_path / "a.mcap", content)
