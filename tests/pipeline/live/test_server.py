"""The server over real sockets: who is let in, what a page and a sender may send, and a task played by them."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
import websockets

from pipeline.live import server
from pipeline.live.record import listening
from pipeline.sessions.logs import mcap
from pipeline.sessions.logs.log import Wanted
from tests.pipeline.helpers import Steadyhand, exit_code
from tests.pipeline.live.running import SENDERS, Running, at_once, free_port, hears, press_through, says, served
from tests.pipeline.live.studies import BRIEF, STUDY, study_in


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
    reasons = "phone: not understood (", "phone: too many frames (", "wrong key (1)", "too many datagrams ("

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
            pong: dict[str, Any] = {}
            while not pong:  # what is over the limit is dropped, pings too
                await says(phone, type="ping", t1=5)
                with suppress(TimeoutError):
                    pong = await asyncio.wait_for(hears(phone, "pong"), 0.05)
            assert pong["t1"] == 5
            lights = await hears(operator, "lights")
            said = f"Nothing has come to UDP port {running.udp_port}: see the sender's address, and the firewall."
            assert lights["lights"]["tracker"] == {"light": "red", "text": said}
            async with asyncio.timeout(10):
                while not all(reason in lights["lights"]["senders"]["text"] for reason in reasons):
                    lights = await hears(operator, "lights")
            assert lights["lights"]["senders"]["light"] == "amber"
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
                await asyncio.sleep(0.004)

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
            await says(operator, type="do", what="start", text="nobody holds a phone", id="d1")
            await hears(operator, "done", id="d1")
            await press_through(phone, drawn=20)
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

    study = STUDY.replace("senders: {tracker: {demo: {}}, imu: {demo: {}}}", SENDERS)
    served(tmp_path, play, at_once(study, countdown_s=0.2))
    log = mcap.read(
        tmp_path / "data/P01_kinect.mcap",
        [Wanted("/tracker/position", "position"), Wanted("/phone/imu", "acceleration")],
    )
    assert log.faults == ()
    assert log.topics["/tracker/position"].values[5].tolist() == pytest.approx([-0.1, 0.5, 1.2])
    assert log.topics["/phone/imu"].values[5][:3].tolist() == pytest.approx([0, 9.80665, 0])


def test_what_a_page_is_told_does_not_wait_until_it_has_acknowledged_what_came_before() -> None:
    at_once: list[int] = []

    async def told(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        at_once.append(writer.get_extra_info("socket").getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
        writer.close()

    async def run() -> None:
        with closing(listening("127.0.0.1", 0)) as door:
            async with await asyncio.start_server(told, sock=door):
                reader, writer = await asyncio.open_connection(*door.getsockname())
                await reader.read()
                writer.close()

    asyncio.run(run())
    assert at_once == [1]


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
    mounted = BRIEF.replace("noise_sd_mm_s2: 100,", "noise_sd_mm_s2: 100, lever_arm_mm: [40, 0, 0],")
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
