"""The server over real sockets: who is let in, what a page and a sender may send, and a task played by them."""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from collections import Counter
from collections.abc import Awaitable, Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import websockets
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_message_builder import OscMessageBuilder

from pipeline.live import server
from pipeline.live.access import Access
from pipeline.live.adapters import osc
from pipeline.live.adapters.newcomers import NOT_ACCEPTED, Newcomers
from pipeline.live.adapters.osc import Receiver as OscReceiver
from pipeline.live.adapters.udp import Limited, Receiver, expected, listen
from pipeline.live.certificates import Certificates
from pipeline.live.events import Reading
from pipeline.live.journal import Journal
from pipeline.live.record import opened, serve
from pipeline.live.setup import warm_up
from pipeline.sessions.logs import mcap
from pipeline.sessions.logs.log import Wanted
from tests.pipeline.helpers import Steadyhand, exit_code
from tests.pipeline.live.studies import STUDY, study_in

Page = Any
SENDERS = (
    "senders: {tracker: {udp_json: {port: PORT}, axes: [x, z, -y], unit: cm}, imu: {udp_json: {port: PORT}, unit: g}}"
)


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    """A port that nobody listens on."""
    with socket.socket(socket.AF_INET, kind) as made:
        made.bind(("127.0.0.1", 0))
        return int(made.getsockname()[1])


@dataclass
class Running:
    """A study that is served."""

    access: Access
    folder: Path
    udp_port: int

    def headers(self, role: str) -> dict[str, Any]:
        """Those of a page that was let in."""
        name, token = self.access.cookie(role), self.access.tokens[role]  # type: ignore[arg-type,index]
        return {"Cookie": f"{name}={token}"}

    def page(self, role: str, **changes: Any) -> Any:
        """A page's socket."""
        given = {"additional_headers": self.headers(role), "origin": self.access.origin, **changes}
        return websockets.connect(f"ws://127.0.0.1:{self.access.port}/socket/{role}", **given)

    async def asks(
        self, method: str, path: str, body: bytes = b"", **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """A request and its answer: status, headers, body."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.access.port)
        sent = {
            "Host": f"127.0.0.1:{self.access.port}",
            "Content-Length": str(len(body)),
            "Connection": "close",
            **headers,
        }
        lines = [f"{method} {path} HTTP/1.1", *(f"{name}: {value}" for name, value in sent.items()), "", ""]
        writer.write("\r\n".join(lines).encode() + body)
        answer = await reader.read()
        writer.close()
        head, _, content = answer.partition(b"\r\n\r\n")
        first, *rest = head.decode().split("\r\n")
        return int(first.split()[1]), {n.lower(): v for n, _, v in (line.partition(": ") for line in rest)}, content


def served(
    folder: Path,
    play: Callable[[Running], Awaitable[None]],
    text: str = STUDY,
    access: Access | None = None,
    certificates: Certificates | None = None,
) -> None:
    """Serve a study while `play` is played; on this computer alone unless `access` says otherwise."""
    udp_port = free_port(socket.SOCK_DGRAM)
    access = access or Access("http", "127.0.0.1", free_port())
    port = access.port
    study, setup = study_in(folder, text.replace("PORT", str(udp_port)))
    journal = Journal(folder, study)
    journal.hold()
    warm_up(setup)

    async def run() -> None:
        with closing(opened(access, certificates)) as doors:
            serving = asyncio.create_task(serve(setup, folder, journal, access, doors, setup.empty_plan()))
            try:
                await _answers(port)
                await asyncio.wait_for(play(Running(access, folder, udp_port)), 60)
            finally:
                serving.cancel()
                with suppress(asyncio.CancelledError):
                    await serving

    try:
        asyncio.run(run())
    finally:
        journal.release()


async def _answers(port: int) -> None:
    """Wait until the server answers."""
    while True:
        try:
            _, writer = await asyncio.open_connection("127.0.0.1", port)
        except OSError:
            await asyncio.sleep(0.02)
            continue
        writer.close()
        return


async def says(page: Page, /, **message: object) -> None:
    await page.send(json.dumps(message))


async def hears(page: Page, kind: str, /, **fields: object) -> dict[str, Any]:
    """The next message of a type and with these fields."""
    while True:
        message: dict[str, Any] = json.loads(await page.recv())
        if message["type"] == kind and all(message.get(name) == value for name, value in fields.items()):
            return message


def test_a_key_is_exchanged_for_the_cookie_of_its_role(tmp_path: Path) -> None:
    async def play(running: Running) -> None:
        own: dict[str, Any] = {"Origin": running.access.origin}
        for role, key in running.access.keys.items():
            status, headers, body = await running.asks("POST", "/join", json.dumps({"k": key}).encode(), **own)
            assert (status, json.loads(body)) == (200, {"role": role, "go": f"/{role}"})
            assert "HttpOnly" in headers["set-cookie"] and "SameSite=strict" in headers["set-cookie"]
            assert key not in headers["set-cookie"]
        bad: bytes
        for bad in (b"", b"{}", b'{"k": 1}', b'{"k": "guessed"}', b'{"k": "\\ud800"}', b"[" * 400, b"x" * 5000):
            status, headers, _ = await running.asks("POST", "/join", bad, **own)
            assert status in (403, 413)
            assert "set-cookie" not in headers
        good = json.dumps({"k": running.access.keys["phone"]}).encode()
        assert (await running.asks("POST", "/join", good, Origin="http://evil.example"))[0] == 403
        status, headers, _ = await running.asks("GET", "/qr/phone.svg")
        assert status == 403
        assert headers["content-security-policy"].startswith("default-src 'self'")
        status, _, picture = await running.asks("GET", "/qr/phone.svg", **running.headers("operator"))
        assert status == 200 and picture.startswith(b"<svg")
        assert (await running.asks("GET", "/qr/ca.svg", **running.headers("operator")))[0] == 403  # nothing to trust
        assert (await running.asks("GET", "/operator", Host="evil.example"))[0] == 421
        for path in ("/pages/../server.py", "/pages/..%2fserver.py", "/pages/texts/../en.json", "/socket/phone", "/x"):
            assert (await running.asks("GET", path))[0] in (404, 405)

    served(tmp_path, play)


def test_a_socket_is_for_its_role_alone_and_from_our_pages(tmp_path: Path) -> None:
    async def play(running: Running) -> None:
        refused: tuple[dict[str, Any], ...] = (
            {"origin": "http://evil.example"},
            {"origin": None},
            {"additional_headers": {}},
            {"additional_headers": running.headers("questionnaire")},
            {"additional_headers": {"Cookie": f"{running.access.cookie('phone')}=guessed"}},
        )
        for changes in refused:
            async with running.page("phone", **changes) as page:
                with pytest.raises(websockets.ConnectionClosed) as closed:
                    await page.recv()
                assert closed.value.rcvd is not None and closed.value.rcvd.code == 4403
        pages = [await running.page("questionnaire") for _ in range(16)]
        async with running.page("questionnaire") as page:
            with pytest.raises(websockets.ConnectionClosed) as closed:
                await page.recv()
            assert closed.value.rcvd is not None and closed.value.rcvd.code == 4429
        for page in pages:
            await page.close()

    served(tmp_path, play)


def test_hostile_pages_and_senders_change_nothing(tmp_path: Path) -> None:
    async def play(running: Running) -> None:
        async with running.page("phone") as phone, running.page("operator") as operator:
            await hears(phone, "state", state="checks")
            await hears(operator, "state", phase="ready")
            for frame in (
                "{",
                "[]",
                '{"type":"do"}',
                "[" * 4000,
                '{"type":"motion","seq":1,"t":1e400}',
                "null",
                "\x00",
            ):
                await phone.send(frame)
            await says(phone, type="select", n=10**12, t=1)
            for number in range(1500):  # two seconds' worth is taken at once
                await says(phone, type="drawn", n=number, t=1)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                for data in (b"", b"\xff" * 1400, b'{"stream":"tracker","position":[1,2,3]}', b"[" * 60_000):
                    sender.sendto(data, ("127.0.0.1", running.udp_port))
                for _ in range(3000):
                    sender.sendto(b"x" * 100, ("127.0.0.1", running.udp_port))
            await asyncio.sleep(1.0)  # what is over the limit is dropped, pings too
            await says(phone, type="ping", t1=5)
            assert (await hears(phone, "pong"))["t1"] == 5
            lights = await hears(operator, "lights")
            said = f"Nothing has come to UDP port {running.udp_port}: see the sender's address, and the firewall."
            assert lights["lights"]["tracker"] == {"light": "red", "text": said}
            while (senders := (await hears(operator, "lights"))["lights"]["senders"])["light"] != "amber":
                pass
            for reason in (
                "phone: not understood (",
                "phone: too many frames (",
                "wrong key (1)",
                "too many datagrams (",
            ):
                assert reason in senders["text"]
            with suppress(websockets.ConnectionClosed):
                await phone.send("x" * 5000)  # longer than any message: the connection is closed
                await asyncio.wait_for(hears(phone, "never"), 10)
            assert phone.close_code == 1009

    served(tmp_path, play, STUDY.replace("senders: {tracker: {demo: {}}, imu: {demo: {}}}", SENDERS))


def test_a_task_over_sockets_from_start_to_questionnaire(tmp_path: Path) -> None:
    async def send(running: Running, stop: asyncio.Event) -> None:
        """A tracker that sends cm in axes of its own, and an IMU that sends g."""
        common = {"key": running.access.sensors}
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            number = 0
            while not stop.is_set():
                at = asyncio.get_running_loop().time()
                imu = {"stream": "imu", "seq": number, "t": at, "acceleration": [0, 1, 0], "orientation": [0, 0, 0, 1]}
                sender.sendto(json.dumps({**common, **imu}).encode(), ("127.0.0.1", running.udp_port))
                if number % 3 == 0:
                    place = {"stream": "tracker", "seq": number // 3, "position": [-10.0, -120.0, 50.0]}
                    sender.sendto(json.dumps([{**common, **place}]).encode(), ("127.0.0.1", running.udp_port))
                number += 1
                await asyncio.sleep(0.011)

    async def play(running: Running) -> None:
        stop = asyncio.Event()
        sending = asyncio.create_task(send(running, stop))
        async with (
            running.page("operator") as operator,
            running.page("phone") as phone,
            running.page("questionnaire") as form,
        ):
            await hears(form, "state", state="waiting")
            await says(phone, type="hello", page="phone", version=1, agent="a test", wake_lock=True)
            await asyncio.sleep(0.3)
            await says(operator, type="do", what="start", text="nobody holds a phone", id="d1")
            await hears(operator, "done", id="d1")
            await press_through(phone)
            questions = await hears(form, "form")
            assert questions["task"] == "Task 1"
            assert "kinect" not in json.dumps(questions)
            for number, item in enumerate(questions["items"]):
                await says(
                    form, type="answer", questionnaire="nasa_tlx", item=item["id"], value=number, id=f"a{number}"
                )
                await hears(form, "saved", id=f"a{number}")
            answers = (running.folder / "data/.recorder/answers.jsonl").read_text(encoding="utf-8")
            assert answers.count('"answer"') == 6
            await says(form, type="submit", questionnaire="nasa_tlx", id="s")
            await hears(form, "state", state="thanks")
            state = await hears(operator, "state", phase="ready")
            while not state["agreement"]:
                state = await hears(operator, "state")
            assert state["agreement"]["mm"] <= 1e-9
            assert state["agreement"]["n"] > 50
            assert state["participants"][0]["tasks"][0]["state"] == "done"
        stop.set()
        await sending

    served(tmp_path, play, STUDY.replace("senders: {tracker: {demo: {}}, imu: {demo: {}}}", SENDERS))
    log = mcap.read(
        tmp_path / "data/P01_kinect.mcap",
        [Wanted("/tracker/position", "position"), Wanted("/phone/imu", "acceleration")],
    )
    assert log.faults == ()
    assert log.topics["/tracker/position"].values[5].tolist() == pytest.approx([-0.1, 0.5, 1.2])
    assert log.topics["/phone/imu"].values[5][:3].tolist() == pytest.approx([0, 9.80665, 0])


async def agreed(operator: Page) -> dict[str, Any]:
    """What the operator is told, after a task, of what was shown and its replay."""
    state = await hears(operator, "state", phase="questionnaire")
    while not state["agreement"]:
        state = await hears(operator, "state")
    agreement: dict[str, Any] = state["agreement"]
    return agreement


async def press_through(phone: Page) -> None:
    """Draw whatever comes, and press once a trial, until the task is done."""
    pressed, state = 0, ""
    while state != "done":
        message = json.loads(await phone.recv())
        if message["type"] == "state":
            state = message["state"]
        if message["type"] == "show":
            await says(phone, type="drawn", n=message["n"], t=0)
            if state == "running" and message["trial"] > pressed:
                pressed = message["trial"]
                await asyncio.sleep(0.2)
                await says(phone, type="select", n=message["n"], t=1)


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


def test_pages_are_files_beside_the_server() -> None:
    assert server.PAGES.name == "pages"


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str]]:
    def run(*words: str | Path) -> tuple[int, str]:
        code = exit_code(monkeypatch, "record", *words)
        return code, capsys.readouterr().err

    return run


def test_what_stands_in_the_way_is_said_with_its_remedy(
    told: Callable[..., tuple[int, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study_in(tmp_path / "study")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        code, text = told(tmp_path / "study", "--port", str(taken.getsockname()[1]))
    assert code == 2
    assert "choose another with --port" in text
    (tmp_path / "none").mkdir()
    (tmp_path / "none/study.yaml").write_text(STUDY.split("recording:")[0], encoding="utf-8")
    code, text = told(tmp_path / "none")
    assert code == 2
    assert "has no `recording:`" in text
    assert told(tmp_path / "study", "--host", "0.0.0.0")[0] == 2  # noqa: S104
    assert told(tmp_path / "study", "--bots")[0] == 2
    assert told(tmp_path / "study", "--demo", "--out", tmp_path / "study")[0] == 2
    monkeypatch.setattr("pipeline.commands.record.find_spec", lambda name: None)
    code, text = told(tmp_path / "study")
    assert code == 2
    assert 'pip install "steadyhand[live]"' in text


def test_a_demo_played_by_bots_is_a_study_with_a_report(
    told: Callable[..., tuple[int, str]], tmp_path: Path, steadyhand: Steadyhand
) -> None:
    mounted = STUDY.replace("noise_sd_mm_s2: 100,", "noise_sd_mm_s2: 100, lever_arm_mm: [40, 0, 0],")
    study_in(tmp_path / "study", mounted)
    code, text = told(tmp_path / "study", "--demo", "--bots", "--participants", "1", "--out", tmp_path / "demo")
    assert (code, text) == (0, "")
    assert not (tmp_path / "study/data").exists()
    ran = steadyhand("compare", tmp_path / "demo")
    assert ran.code == 0, ran.err
    assert all(row["max_mm"] <= 1e-9 for row in steadyhand.results()["replay_agreement"])
    changed = (tmp_path / "demo/study.yaml").read_text(encoding="utf-8").replace("noise_sd_mm: 8", "noise_sd_mm: 9")
    (tmp_path / "demo/study.yaml").write_text(changed, encoding="utf-8")
    code, text = told(tmp_path / "demo", "--port", str(free_port()))
    assert code == 2
    assert "has changed since P01 in fusion was recorded" in text
    assert "--continue" in text
