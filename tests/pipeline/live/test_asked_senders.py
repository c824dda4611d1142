"""Senders that are asked for readings, over real sockets: connections that fail, break and return; whole tasks."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.server import ServerConnection

from pipeline.live import desk, panel
from pipeline.live.adapters import client, lsl
from pipeline.live.adapters.client import Client
from pipeline.live.events import ClockOffset, Link
from pipeline.sessions.logs import mcap
from pipeline.sessions.logs.log import Wanted
from tests.pipeline.live import servers
from tests.pipeline.live.asked import SUBPROTOCOLS, heard, outlet, problems, readings, talk
from tests.pipeline.live.lab import Lab, notes
from tests.pipeline.live.running import Running, agreed, at_once, free_port, hears, press_through, says, served
from tests.pipeline.live.servers import IMU, POSITION, point_stamped, published, serving
from tests.pipeline.live.studies import STUDY


def test_a_connection_that_is_lost_is_said_and_there_again_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "BACK_OFF_S", (0.01, 0.02))
    port = free_port()
    found: list[Any] = []

    async def brief(socket: ServerConnection) -> None:
        await socket.recv()
        await socket.send(published(POSITION, point_stamped(time.time_ns())))

    async def begins_late() -> None:
        while not problems(found):
            await asyncio.sleep(0.005)
        async with serving(brief, port):
            await asyncio.sleep(60)

    @asynccontextmanager
    async def beside() -> AsyncIterator[None]:
        server = asyncio.create_task(begins_late())
        try:
            yield
        finally:
            server.cancel()
            await asyncio.gather(server, return_exceptions=True)

    def until(said: list[Any]) -> bool:
        found[:] = said
        return len(readings(said)) >= 2

    heard(talk(port), until, beside())
    said = problems(found)
    begin = f"tracker: ws://127.0.0.1:{port}"
    assert said[0].startswith(f"{begin} cannot be connected to (Connection refused); ")
    assert said[0].endswith("start the server, or correct the url. Trying again.")
    assert said[1] == ""
    assert said[2] == (
        f"{begin} has closed the connection, or does not answer any more; see whether it runs, and the network."
        " Trying again."
    )
    assert said[3] == ""


def test_waiting_for_a_server_takes_longer_each_time_up_to_two_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    sleep = asyncio.sleep

    async def note(seconds: float) -> None:
        slept.append(seconds)
        await sleep(0)

    async def run() -> None:
        asked = asyncio.create_task(Client(talk(free_port()), lambda _: None, time.time_ns).run())
        while len(slept) < 6:
            await sleep(0.005)
        asked.cancel()
        with suppress(asyncio.CancelledError):
            await asked

    monkeypatch.setattr(asyncio, "sleep", note)
    asyncio.run(run())
    assert slept[:6] == [0.25, 0.5, 1.0, 2.0, 2.0, 2.0]


def test_what_no_server_of_readings_says_is_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "NOTHING_YET_S", 0.05)
    port = free_port()

    async def huge(socket: ServerConnection) -> None:
        await socket.send("x" * 100_000)
        await socket.wait_closed()

    async def other(socket: ServerConnection) -> None:
        await socket.send("hello")
        await socket.send("x" * 1000)
        await socket.send(b"\xff" * 1000)
        await socket.wait_closed()

    async def advertises(socket: ServerConnection) -> None:
        await socket.send(servers.advertised({"id": 1, **servers.CDR_IMU}))
        await socket.wait_closed()

    async def plain(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
        writer.close()

    def over(handle: Any, subprotocols: Sequence[str] = ()) -> Any:
        return serving(handle, port, subprotocols)

    @asynccontextmanager
    async def web() -> AsyncIterator[None]:
        async with await asyncio.start_server(plain, "127.0.0.1", port):
            yield

    beside: Any
    for beside, kind, said in (
        (over(huge), "rosbridge", "sent a frame of over 64 KiB, which no sensor's is; name another topic. Trying"),
        (over(other), "rosbridge", "is connected, and nothing comes on /hand. See whether it is sent: `ros2 topic hz"),
        (over(other), "foxglove", "does not speak foxglove.websocket.v1; start foxglove_bridge there, or correct"),
        (over(advertises, SUBPROTOCOLS), "foxglove", "has no topic /hand; it has /phone. Correct the topic, or start"),
        (web(), "rosbridge", "answers with HTTP 404 and no WebSocket; correct the url. Trying again."),
    ):
        expected = f"tracker: ws://127.0.0.1:{port} {said}"

        def is_said(found: list[Any], expected: str = expected) -> bool:
            return any(one.startswith(expected) for one in problems(found))

        found, refused = heard(talk(port, kind), is_said, beside)
        assert readings(found) == []
        if "nothing comes" in said:
            assert refused == {"tracker: not understood": 3}


@pytest.mark.parametrize("kind", ["rosbridge", "foxglove"])
def test_how_bytes_are_cut_makes_no_difference(kind: str) -> None:
    """A relay hands the server's bytes on in pieces, and the server sends its messages in fragments of frames."""
    places = [(number * 0.1, 0.5, 1.0) for number in range(8)]

    async def fragments(socket: ServerConnection) -> None:
        if kind == "foxglove":
            await socket.send(servers.advertised({"id": 1, "topic": POSITION, "encoding": "json", "schemaName": "P"}))
        await socket.recv()
        for number, place in enumerate(places):
            message = point_stamped(1_000_000_000 + number, place)
            if kind == "foxglove":
                frame: Any = servers.data(json.dumps(message).encode())
            else:
                frame = published(POSITION, message)
            size = 1 + 7 * number
            await socket.send([frame[at : at + size] for at in range(0, len(frame), size)])
        await socket.wait_closed()

    def through(piece: int) -> list[tuple[Any, ...]]:
        front, back = free_port(), free_port()

        async def relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", back)

            async def pump(source: asyncio.StreamReader, target: asyncio.StreamWriter, most: int) -> None:
                with suppress(OSError):
                    while data := await source.read(most):
                        target.write(data)
                        await target.drain()
                target.close()

            await asyncio.gather(pump(reader, inner_writer, 4096), pump(inner_reader, writer, piece))

        @asynccontextmanager
        async def beside() -> AsyncIterator[None]:
            spoken = SUBPROTOCOLS if kind == "foxglove" else ()
            async with serving(fragments, back, spoken), await asyncio.start_server(relay, "127.0.0.1", front):
                yield

        found, refused = heard(talk(front, kind), lambda found: len(readings(found)) == len(places), beside())
        assert not refused
        return [(one.values, one.sent_ms) for one in readings(found)]

    whole = through(65_536)
    assert [values for values, _ in whole] == places
    assert through(1) == through(13) == whole


def test_a_sender_s_connection_is_a_light_a_reason_and_a_note(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.goes_on(1.0)
    problem = "tracker: ws://h:9090 cannot be connected to (refused); start the server. Trying again."
    lab.happens(Link("tracker", problem, lab.now))
    lights: Any = panel.lights(lab.run, lab.now).content["lights"]
    assert (lights["tracker"]["light"], lights["tracker"]["text"]) == ("red", problem)
    assert lights["imu"]["light"] == "green"
    lab.goes_on(0.5, tracker=False)
    assert desk.red_lights(lab.run, lab.now) == [problem]
    assert lab.happens(ClockOffset("tracker", 5.0, lab.now)) == []  # no log is open
    lab.happens(Link("tracker", "", lab.now))
    lab.goes_on(0.5)
    lab.does("start")
    lab.goes_on(0.2)
    assert notes(lab.happens(Link("tracker", problem, lab.now))) == ["sender"]
    assert notes(lab.happens(Link("tracker", "", lab.now))) == ["sender"]
    (logged,) = lab.happens(ClockOffset("tracker", 5.0, lab.now))
    assert logged.message.event == {"sender": "tracker", "offset_ms": 5.0}  # type: ignore[union-attr]


# --- whole tasks


@contextmanager
def sent_by(kind: str) -> Iterator[str]:
    """Tracker and phone that send by that kind, and what study.yaml says of them."""
    if kind == "lsl":
        with (
            outlet("SteadyhandHand", 5, (0.0, 0.0, *(part * 1e3 for part in servers.PLACE_M)), 100),
            outlet("SteadyhandPhone", 10, (*servers.FORCE_M_S2, 0.0, 0.0, 0.0, *servers.UPRIGHT), 250),
        ):
            yield (
                "tracker: {lsl: {name: SteadyhandHand, channels: [2, 3, 4]}},"
                " imu: {lsl: {name: SteadyhandPhone, channels: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]}}"
            )
        return
    port = free_port()
    started, stop = threading.Event(), asyncio.Event()
    running = asyncio.new_event_loop()
    handle, spoken = (servers.rosbridge, ()) if kind == "rosbridge" else (servers.foxglove, SUBPROTOCOLS)

    async def serve() -> None:
        async with serving(handle, port, spoken):
            started.set()
            await stop.wait()

    thread = threading.Thread(target=lambda: running.run_until_complete(serve()))
    thread.start()
    started.wait(5)
    try:
        of = {
            "rosbridge": (", type: geometry_msgs/msg/PointStamped", ", type: sensor_msgs/Imu"),
            "foxglove": ("", ""),
        }[kind]
        topics = zip(("tracker", "imu"), (POSITION, IMU), of, strict=True)
        url = f"url: 'ws://127.0.0.1:{port}'"
        yield ", ".join(f"{name}: {{{kind}: {{{url}, topic: {topic}{more}}}}}" for name, topic, more in topics)
    finally:
        running.call_soon_threadsafe(stop.set)
        thread.join(10)
        running.close()


@pytest.mark.parametrize("kind", ["rosbridge", "foxglove", "lsl"])
def test_a_task_whose_tracker_and_phone_come_by_it_is_logged_and_replays(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lsl, "LOOK_S", 0.1)

    async def play(running: Running) -> None:
        async with running.page("operator") as operator, running.page("phone") as phone:
            await says(phone, type="hello", page="phone", version=1, agent="a test", wake_lock=True)
            lights: dict[str, Any] = {}
            while any(lights.get(name, {}).get("rate_hz") is None for name in ("tracker", "imu")):
                lights = (await hears(operator, "lights"))["lights"]
            await says(operator, type="do", what="start", text="a test", id="d1")
            await hears(operator, "done", id="d1")
            await press_through(phone, drawn=20)
            agreement = await agreed(operator)
            assert agreement["mm"] <= 1e-9
            assert agreement["n"] >= 3  # something was shown in each trial

    with sent_by(kind) as senders:
        text = at_once(STUDY.replace("tracker: {demo: {}}, imu: {demo: {}}", senders))
        text = text.replace("shown: {kinect: kinect, fusion: fusion}", "shown: {kinect: fusion, fusion: fusion}")
        served(tmp_path, play, text)
    topics = [Wanted("/tracker/position", "position"), Wanted("/phone/imu", "acceleration")]
    log = mcap.read(tmp_path / "data/P01_kinect.mcap", [*topics, Wanted("/recorder/clock", "anything")])
    assert log.faults == ()
    tracker, imu = (log.topics[want.key] for want in topics)
    assert tracker.values[5].tolist() == pytest.approx(list(servers.PLACE_M))
    assert imu.values[5].tolist() == pytest.approx([*servers.FORCE_M_S2, 0, 0, 0, *servers.UPRIGHT])
    late_s = (imu.arrival_ns - imu.stamp_ns) / 1e9
    assert (late_s >= 0).all() and late_s.min() < 0.1  # stamps are the sender's, in recorder time
    assert (late_s > 0).mean() > 0.5  # not arrivals
    assert (imu.stamp_ns[1:] > imu.stamp_ns[:-1]).all()
