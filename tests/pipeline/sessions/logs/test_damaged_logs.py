"""Logs damaged at random and on purpose: what can be read is read, and what is lost is said."""

from __future__ import annotations

import json
import struct
import time
from pathlib import Path

import pytest
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


@pytest.mark.parametrize("name", ["crc_zstd", "crc_lz4"])
def test_others_flipped_bytes_are_counted(name: str) -> None:
    log = read_log(faulty(name), [])
    assert any("chunk 3 is damaged and left out" in fault for fault in log.faults)
    assert sum(readings.read + (readings.lost or 0) for readings in log.topics.values()) == 1210
