"""What senders send by OSC and as datagrams: taken, refused or counted."""

from __future__ import annotations

import asyncio
import socket
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_message_builder import OscMessageBuilder

from pipeline.live.adapters import osc
from pipeline.live.adapters.newcomers import NOT_ACCEPTED, Newcomers
from pipeline.live.adapters.osc import Receiver as OscReceiver
from pipeline.live.adapters.udp import Limited, Receiver, expected, listen
from pipeline.live.events import Reading
from tests.pipeline.live.running import SENDERS, free_port
from tests.pipeline.live.studies import STUDY, study_in


def test_what_a_receiver_refuses_is_counted(tmp_path: Path) -> None:
    _, setup = study_in(
        tmp_path, STUDY.replace("senders: {tracker: {demo: {}}, imu: {demo: {}}}", SENDERS.replace("PORT", "9700"))
    )
    taken: list[Reading] = []
    clock = iter(range(0, 10**12, 1000))
    receiver = Receiver(expected(setup, 9700), "secret", Newcomers(), taken.append, lambda: next(clock))
    good = b'{"key":"secret","stream":"tracker","t":1.5,"position":[1,2,3]}'
    source = ("127.0.0.1", 5)
    for data in (good, b"x", good.replace(b"secret", b"wrong"), good.replace(b"tracker", b"other"), b"[" + b" " * 1500):
        receiver.datagram_received(data, source)
    receiver.datagram_received(good.replace(b"position", b"acceleration"), source)
    assert [reading.values for reading in taken] == [pytest.approx((0.01, 0.03, -0.02))]
    assert taken[0].sent_ms == 1500
    assert receiver.refused == {
        "not understood": 1,
        "wrong key": 1,
        "no such stream": 1,
        "too long": 1,
        "not of the stream's kind": 1,
    }
    for _ in range(2000):
        receiver.datagram_received(good, source)
    assert receiver.refused["too many datagrams"] > 900
    for number in range(100):
        receiver.datagram_received(good, (f"10.0.0.{number}", 5))
    assert receiver.refused["too many sources"] == 37


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says how many datagrams it had no room for")
@pytest.mark.parametrize("count", [50, 20_000])
def test_what_comes_faster_than_it_is_read_is_counted_too(count: int) -> None:
    class Counting(Limited):
        taken = 0

        def datagram_received(self, data: bytes, address: tuple[Any, int]) -> None:
            self.taken += 1

    async def run() -> tuple[int, Counter[str]]:
        receiver, port = Counting(lambda _: None, lambda: 0), free_port(socket.SOCK_DGRAM)
        opened = await listen("127.0.0.1", port, receiver)
        with closing(opened), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for _ in range(count):  # the loop does not get its turn meanwhile
                sender.sendto(b"x" * 1400, ("127.0.0.1", port))
            before = -1
            while receiver.taken != before:
                before = receiver.taken
                await asyncio.sleep(0.05)
            sender.sendto(b"x", ("127.0.0.1", port))  # what did not fit is said with what comes after it
            while receiver.taken == before:
                await asyncio.sleep(0.01)
        return receiver.taken, receiver.refused

    taken, refused = asyncio.run(asyncio.wait_for(run(), 20))
    assert taken + refused["came faster than they were read"] == count + 1
    assert (not refused) == (count == 50)


def test_osc_messages_to_an_address_are_readings(tmp_path: Path) -> None:
    senders = (
        "senders: {tracker: {osc: {port: 9000, address: /hand, fields: [2, 0, 1]}, unit: m},"
        " imu: {osc: {port: 9000, address: /imu, fields: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]}}}"
    )
    _, setup = study_in(tmp_path, STUDY.replace("senders: {tracker: {demo: {}}, imu: {demo: {}}}", senders))
    taken: list[Reading] = []
    receiver = OscReceiver(osc.expected(setup, 9000), Newcomers(), taken.append, lambda: 5)

    def sends(address: str, *arguments: object) -> None:
        message = OscMessageBuilder(address)
        for argument in arguments:
            message.add_arg(argument)  # type: ignore[arg-type]
        receiver.datagram_received(message.build().dgram, ("127.0.0.1", 1))

    sends("/hand", 0.25, 0.5, 1, "more")
    sends("/imu", *[0.5] * 6, 0.0, 0.0, 0.0, 1.0)
    assert taken == [
        Reading("tracker", None, 5, (1.0, 0.25, 0.5)),
        Reading("imu", None, 5, (*[0.5] * 6, 0.0, 0.0, 0.0, 1.0)),
    ]
    sends("/hand", 0.25, 0.5)
    sends("/hand", 0.25, 0.5, "one")
    sends("/hand", 0.25, 0.5, float("nan"))
    sends("/other", 1.0)
    for data in (b"", b"/hand", b"#bundle\0" + b"\xff" * 40, b"\0" * 100):
        receiver.datagram_received(data, ("127.0.0.1", 1))
    assert len(taken) == 2
    assert receiver.refused["not of the stream's kind"] == 3
    assert receiver.refused["no such address"] == 1


@pytest.mark.parametrize(
    ("source", "heard", "reason"),
    [
        ("", ["127.0.0.1"], NOT_ACCEPTED),
        (", source: 10.1.2.3", ["10.1.2.3"], "not from its source"),
        (", source: any", ["127.0.0.1", "10.1.2.3", "10.1.2.4"], "not from its source"),
    ],
)
def test_osc_is_heard_from_this_computer_or_whom_study_yaml_names(
    tmp_path: Path, source: str, heard: list[str], reason: str
) -> None:
    senders = f"senders: {{tracker: {{osc: {{port: 9000, address: /hand{source}}}}}, imu: {{demo: {{}}}}}}"
    _, setup = study_in(tmp_path, STUDY.replace("senders: {tracker: {demo: {}}, imu: {demo: {}}}", senders))
    message = OscMessageBuilder("/hand")
    for number in (1.0, 2.0, 3.0):
        message.add_arg(number)
    found = []
    for address in ("127.0.0.1", "10.1.2.3", "10.1.2.4"):
        receiver = OscReceiver(
            osc.expected(setup, 9000),
            Newcomers(),
            lambda _, one=address: found.append(one),  # type: ignore[misc]
            lambda: 5,
        )
        receiver.datagram_received(message.build().dgram, (address, 1))
        assert receiver.refused[reason] == (address not in heard)
    assert found == heard


@given(st.binary(max_size=200))
def test_random_bytes_are_no_osc(data: bytes) -> None:
    receiver = OscReceiver({}, Newcomers(), lambda reading: None, lambda: 0)
    receiver.datagram_received(data, ("127.0.0.1", 1))
    receiver.datagram_received(b"/a\0\0" + data, ("127.0.0.1", 1))
    receiver.datagram_received(b"#bundle\0" + data, ("127.0.0.1", 1))
