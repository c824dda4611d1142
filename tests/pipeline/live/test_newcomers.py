"""A sender without a key: counted and shown until the operator accepts it, then the only one of its stream."""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from pythonosc.osc_message_builder import OscMessageBuilder

from pipeline.live import desk, offers
from pipeline.live.adapters import osc, udp
from pipeline.live.adapters.newcomers import NOT_ACCEPTED, Newcomers
from pipeline.live.events import Accept, Closed, Joined, Offer, Offered, Open, Reading, Said, Save
from pipeline.live.messages import Do
from tests.pipeline.live.lab import OPERATOR, Lab, lab, notes, refusals
from tests.pipeline.live.running import Running, hears, says, served
from tests.pipeline.live.studies import STUDY, study_in

__all__ = ["lab"]  # a fixture

HERE, PHONE, OTHER = "127.0.0.1", "192.168.1.7", "192.168.1.8"
OFFER = Offer("tracker", PHONE, "/hand/position", 30)
_DEMO = "senders: {tracker: {demo: {}}, imu: {demo: {}}}"


def osc_position() -> bytes:
    message = OscMessageBuilder("/hand/position")
    for number in (1.0, 2.0, 3.0):
        message.add_arg(number)
    return message.build().dgram


def sent_by(folder: Path, sender: str, data: bytes) -> tuple[Callable[..., bool], udp.Limited, Newcomers]:
    """What sends a tracker's datagram from an address and says whether it was used; the receiver; who waits."""
    _, setup = study_in(folder, STUDY.replace(_DEMO, f"senders: {{tracker: {{{sender}}}, imu: {{demo: {{}}}}}}"))
    newcomers, taken = Newcomers(), list[Reading]()
    receiver: udp.Limited
    if "osc" in sender:
        receiver = osc.Receiver(osc.expected(setup, 9000), newcomers, taken.append, lambda: 5)
    else:
        receiver = udp.Receiver(udp.expected(setup, 9000), "secret", newcomers, taken.append, lambda: 5)

    def send(source: str, data: bytes = data) -> bool:
        before = len(taken)
        receiver.datagram_received(data, (source, 1))
        return len(taken) > before

    return send, receiver, newcomers


KEYLESS = b'{"stream":"tracker","position":[1,2,3]}'


@pytest.mark.parametrize(
    ("sender", "data", "sends"),
    [
        ("osc: {port: 9000, address: /hand/position}", osc_position(), "/hand/position"),
        ("udp_json: {port: 9000}", KEYLESS, "tracker"),
    ],
)
def test_readings_of_another_computer_are_counted_until_it_is_accepted(
    tmp_path: Path, sender: str, data: bytes, sends: str
) -> None:
    send, receiver, newcomers = sent_by(tmp_path, sender, data)
    assert [send(PHONE) for _ in range(60)] == [False] * 60
    assert receiver.refused == {NOT_ACCEPTED: 60}
    assert newcomers.waiting(2.0) == (Offer("tracker", PHONE, sends, 30),)
    assert newcomers.waiting(2.0) == ()  # silent since
    newcomers.accept("tracker", PHONE)
    assert send(PHONE)
    assert not send(OTHER)
    newcomers.accept("tracker", OTHER)  # the first one stays
    assert not send(OTHER) and send(PHONE)
    assert newcomers.waiting(1.0) == (Offer("tracker", OTHER, sends, 2),)


def test_what_is_trusted_already_is_used_until_another_was_accepted(tmp_path: Path) -> None:
    send, receiver, newcomers = sent_by(tmp_path, "osc: {port: 9000, address: /hand/position}", osc_position())
    assert send(HERE)
    newcomers.accept("tracker", PHONE)
    assert not send(HERE)
    assert receiver.refused == {NOT_ACCEPTED: 1}
    send, receiver, newcomers = sent_by(tmp_path, "udp_json: {port: 9000}", KEYLESS)
    with_key = KEYLESS.replace(b"{", b'{"key":"secret",')
    assert send(OTHER, with_key) and send(HERE, with_key)
    newcomers.accept("tracker", PHONE)
    assert send(PHONE, with_key) and not send(OTHER, with_key)


@pytest.mark.parametrize(
    ("sender", "source", "data", "reason"),
    [
        ("udp_json: {port: 9000}", PHONE, KEYLESS.replace(b"{", b'{"key":"guessed",'), "wrong key"),
        ("udp_json: {port: 9000}", HERE, KEYLESS, "wrong key"),
        (f"udp_json: {{port: 9000, source: {OTHER}}}", PHONE, KEYLESS, "wrong key"),
        (f"udp_json: {{port: 9000, source: {PHONE}}}", PHONE, KEYLESS, "wrong key"),
        ("udp_json: {port: 9000}", PHONE, KEYLESS.replace(b"tracker", b"<b>x</b>"), "wrong key"),
        ("udp_json: {port: 9000}", PHONE, KEYLESS.replace(b"position", b"acceleration"), "not of the stream's kind"),
        (
            f"osc: {{port: 9000, address: /hand/position, source: {OTHER}}}",
            PHONE,
            osc_position(),
            "not from its source",
        ),
        ("osc: {port: 9000, address: /other}", PHONE, osc_position(), "no such address"),
        (
            "osc: {port: 9000, address: /hand/position, fields: [3, 4, 5]}",
            PHONE,
            osc_position(),
            "not of the stream's kind",
        ),
    ],
)
def test_what_could_not_feed_the_stream_is_not_offered(
    tmp_path: Path, sender: str, source: str, data: bytes, reason: str
) -> None:
    send, receiver, newcomers = sent_by(tmp_path, sender, data)
    assert not send(source)
    assert receiver.refused == {reason: 1}
    assert newcomers.waiting(1.0) == ()


def test_senders_that_pretend_to_be_many_are_bounded() -> None:
    newcomers = Newcomers()
    for number in range(1000):
        assert not newcomers.hears("tracker", f"10.0.{number // 250}.{number % 250}" + "%x" * 100, "/hand", False)
    waiting = newcomers.waiting(1.0)
    assert len(waiting) == 8
    assert max(len(one.source) for one in waiting) == 64


def test_one_click_accepts_it_and_the_log_says_so(lab: Lab) -> None:
    lab.goes_on(0.5)
    lab.does("start")
    lab.goes_on(1.5, tracker=False)
    lab.happens(Offered((OFFER,), lab.now))
    assert desk.state(lab.run, OPERATOR).content["offers"] == [
        {"id": f"tracker {PHONE}", **vars(OFFER), "accepted": None}
    ]
    actions = lab.does("accept", f"tracker {PHONE}")
    assert Accept("tracker", PHONE) in actions
    assert notes(actions) == ["note"]
    (saved,) = (one.record for one in actions if isinstance(one, Save))
    assert saved["text"] == f"{PHONE}, which sends /hand/position, was accepted as tracker"
    lab.does("abort", "too early")
    lab.happens(Closed("data/set-aside/P01_kinect.1.mcap", lab.now))
    (opened,) = (one for one in lab.does("start", "it is silent") if isinstance(one, Open))
    assert opened.facts["accepted_tracker"] == PHONE


def test_another_one_is_shown_and_not_used(lab: Lab) -> None:
    other = Offer("tracker", OTHER, "/hand/position", 60)
    lab.happens(Offered((OFFER,), lab.now))
    lab.does("accept", f"tracker {PHONE}")
    lab.happens(Offered((other,), lab.now))
    assert [one["accepted"] for one in offers.shown(lab.run)] == [PHONE]
    actions = lab.does("accept", f"tracker {OTHER}")
    assert refusals(actions) == [
        f"tracker comes from {PHONE} until the end of this run. To change that, start the recorder anew."
    ]
    assert not any(isinstance(one, Accept) for one in actions)


def test_a_sender_is_not_accepted_where_that_would_mix_two_or_none_sends(lab: Lab) -> None:
    lab.goes_on(0.5)
    lab.happens(Offered((OFFER,), lab.now))
    assert refusals(lab.does("accept", f"tracker {PHONE}")) == [
        "tracker comes from another sender already. Turn that one off, then accept this one."
    ]
    lab.goes_on(0.5, tracker=False)
    lab.happens(Offered((), lab.now))
    for offer_id in (f"tracker {PHONE}", "imu", ""):
        assert refusals(lab.does("accept", offer_id)) == [
            "This sender is silent now. Turn it on again, then accept it."
        ]
    lab.happens(Offered((OFFER,), lab.now))
    lab.happens(Joined("operator", 9, lab.now))
    actions = lab.happens(Said("operator", 9, Do("accept", f"tracker {PHONE}", "d"), lab.now))
    assert refusals(actions) == ["Another page may act; press “Take over” first."]
    assert lab.run.accepted == {}


@pytest.mark.skipif(sys.platform != "linux", reason="needs addresses 127.0.0.2 and 127.0.0.3")
def test_over_real_sockets(tmp_path: Path) -> None:
    async def send(running: Running, source: str) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.bind((source, 0))
            while True:
                sender.sendto(osc_position(), ("127.0.0.1", running.udp_port))
                await asyncio.sleep(0.03)

    async def offered(operator: object, source: str) -> dict[str, object]:
        while True:
            for offer in (await hears(operator, "state"))["offers"]:
                if offer["source"] == source:
                    return dict(offer)

    async def play(running: Running) -> None:
        async with running.page("operator") as operator:
            sending = asyncio.create_task(send(running, "127.0.0.2"))
            offer = await offered(operator, "127.0.0.2")
            assert (offer["stream"], offer["sends"], offer["accepted"]) == ("tracker", "/hand/position", None)
            lights = (await hears(operator, "lights"))["lights"]
            assert lights["tracker"]["text"].startswith(f"Nothing has come to UDP port {running.udp_port}: ")
            assert f"{NOT_ACCEPTED} (" in lights["senders"]["text"]
            await says(operator, type="do", what="accept", text=offer["id"], id="d1")
            await hears(operator, "done", id="d1")
            while "rate_hz" not in (await hears(operator, "lights"))["lights"]["tracker"]:
                pass
            further = asyncio.create_task(send(running, "127.0.0.3"))
            offer = await offered(operator, "127.0.0.3")
            assert offer["accepted"] == "127.0.0.2"
            for task in (sending, further):
                task.cancel()

    text = "senders: {tracker: {osc: {port: PORT, address: /hand/position}}, imu: {demo: {}}}"
    served(tmp_path, play, STUDY.replace(_DEMO, text))
    answers = (tmp_path / "data/.recorder/answers.jsonl").read_text(encoding="utf-8").splitlines()
    texts = [json.loads(line).get("text") for line in answers]
    assert "127.0.0.2, which sends /hand/position, was accepted as tracker" in texts
