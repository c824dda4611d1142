"""A log is decoded in blocks as it is read: of whatever size, with the same result, and its bytes are not kept."""

from __future__ import annotations

import json
import struct
import tracemalloc
from collections.abc import Iterator
from dataclasses import astuple
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Content, Readings, Source, Wanted
from pipeline.sessions.logs.mcap import Message, container, records, write
from pipeline.sessions.logs.mcap.decoding import Decoding
from pipeline.sessions.logs.mcap.messages import Messages, joined
from pipeline.sessions.logs.mcap.schemas import SCHEMAS
from pipeline.sessions.logs.mcap.walk import Walk
from pipeline.sessions.logs.mcap.writer import IMU

COUNT = 200
EXPECTED_BYTES_PER_MESSAGE = 8 * 13  # stamp, arrival, ten values, the orientation's length


def imu_payload(random: np.random.Generator, frame: bytes) -> bytes:
    """A sensor_msgs/Imu in CDR: its doubles are aligned to eight bytes behind the header."""
    text = frame + b"\0"
    numbers = random.normal(0, 1, 37)
    numbers[:4] = (0.0, 0.6, 0.0, 0.8) if random.random() < 0.9 else random.normal(0, 1, 4)
    numbers[[4, 16, 28]] = np.where(random.random(3) < 0.2, -1.0, 0.0)
    head = struct.pack("<4siII", b"\x00\x01\x00\x00", 7, int(random.integers(10**9)), len(text)) + text
    return head + b"\0" * (-(len(head) - 4) % 8) + struct.pack("<37d", *numbers)


def json_payload(random: np.random.Generator) -> bytes:
    vector = dict(zip("xyz", random.normal(0, 1, 3).tolist(), strict=True))
    stamp = {"sec": 7, "nanosec": int(random.integers(10**9))}
    header = {"stamp": stamp, "frame_id": "not read of the usual layout"}
    return json.dumps({"header": header, "linear_acceleration": vector, "angular_velocity": vector}).encode()


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Walk, Messages]:
    """A topic of two types with frames of several names, unusual messages and damaged ones."""
    path, random = tmp_path_factory.mktemp("logs") / "mixed.mcap", np.random.default_rng(0)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        in_cdr = writer.register_schema(SCHEMAS["acceleration"], "ros2msg", IMU.encode())
        in_json = writer.register_schema("Imu", "jsonschema", b"{}")
        cdr, other = writer.register_channel("/t", "cdr", in_cdr), writer.register_channel("/t", "json", in_json)
        for time in range(COUNT):
            if random.random() < 0.1:
                writer.add_message(other, time, json_payload(random), time)
                continue
            payload = imu_payload(
                random, [b"phone", b"a phone by its long name", b"other"][random.choice(3, p=[0.8, 0.1, 0.1])]
            )
            writer.add_message(cdr, time, payload if random.random() < 0.9 else payload[: random.integers(300)], time)
        writer.finish()  # type: ignore[no-untyped-call]
    walk = container.walk_log(path, {"/t": {}})
    return walk, joined(walk.topics["/t"].parts)


@given(st.lists(st.integers(0, COUNT), max_size=12), st.sampled_from(["acceleration", "position"]))
def test_blocks_of_any_size_give_what_reading_at_once_gives(
    mixed: tuple[Walk, Messages], cuts: list[int], content: Content
) -> None:
    walk, messages = mixed
    edges = [0, *sorted(cuts), COUNT]
    in_blocks, at_once = Decoding(content), Decoding(content, Source())
    at_once.add(walk, messages)
    for begin, end in pairwise(edges):
        in_blocks.add(walk, messages.chosen(np.arange(begin, end)))
    assert_same(in_blocks.readings(walk, "/t"), at_once.readings(walk, "/t"))


def assert_same(one: Readings, other: Readings) -> None:
    for name in ("stamp_ns", "arrival_ns", "values"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.lost, one.notes, one.sampled) == (other.lost, other.notes, other.sampled)
    for ours, theirs in zip(astuple(one.claims), astuple(other.claims), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_the_log_has_what_it_is_to_have(mixed: tuple[Walk, Messages]) -> None:
    walk, messages = mixed
    decoding = Decoding("acceleration")
    decoding.add(walk, messages)
    readings = decoding.readings(walk, "/t")
    assert 0.8 * COUNT < readings.read < COUNT and readings.lost == COUNT - readings.read
    assert readings.claims.frames == ("phone", "other", "a phone by its long name")
    assert readings.claims.force_disclaimed.any() and np.isnan(readings.claims.orientation_length).any()


def accelerations(count: int) -> Iterator[Message]:
    random = np.random.default_rng(0)
    for time in range(count):
        yield Message("/imu", "acceleration", time, time, np.array([*random.normal(0, 1, 6), 0.0, 0.0, 0.0, 1.0]))


def test_what_is_kept_of_a_message_is_its_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By how much more memory a log of more messages takes while it is read."""
    monkeypatch.setattr(records, "DECODED_AT_ONCE", 2**18)
    monkeypatch.setattr(records, "BLOCK_BYTES", 2**17)
    peaks = []
    for count in (4_000, 20_000):
        path = tmp_path / f"{count}.mcap"
        write(path, {}, accelerations(count))
        read_log(path, [Wanted("/imu", "acceleration")])  # and with it all that is loaded and compiled once
        tracemalloc.start()
        log = read_log(path, [Wanted("/imu", "acceleration")])
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert log.topics["/imu"].read == count
    # A growing array has room for a sixteenth more.
    assert (peaks[1] - peaks[0]) / 16_000 < 1.2 * EXPECTED_BYTES_PER_MESSAGE
