"""The scripts of docs/live_senders.md, run against stand-ins that answer as the sources named there say.

No vendor's software, device or app was at hand, so this shows no more than that the scripts do what the sources say.
"""

from __future__ import annotations

import io
import json
import re
import socket
import sys
import threading
import time
import urllib.request
from collections import namedtuple
from collections.abc import Iterator
from contextlib import suppress
from http.server import HTTPServer
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from pipeline.live.messages import Datagram, parse_datagram
from tests.conftest import CLONE

PAGE = (CLONE / "docs" / "live_senders.md").read_text(encoding="utf-8")
SCRIPTS: dict[str, str] = dict(re.findall(r"```python\n# (\w+)\.py\n(.*?)```", PAGE, re.DOTALL))
Place = namedtuple("Place", "x y z")


class OverError(Exception):
    """A script that goes on for ever has done enough."""


def module(name: str, **content: Any) -> ModuleType:
    made = ModuleType(name)
    vars(made).update(content)
    return made


def over(*_: object) -> None:
    raise OverError


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Datagram]]:
    """What a script has sent, read as the recorder reads it."""
    found: list[Datagram] = []

    class Out:
        def sendto(self, data: bytes, address: tuple[str, int]) -> None:
            assert address == ("127.0.0.1", 9700)
            found.extend(parse_datagram(data))

    monkeypatch.setattr(sys, "argv", ["script.py", "secret"])
    send = module("send")
    exec(SCRIPTS["send"], vars(send))  # noqa: S102 - it is our own page
    vars(send)["_out"].close()
    vars(send)["_out"] = Out()
    monkeypatch.setitem(sys.modules, "send", send)
    yield found
    assert [one.seq for one in found] == list(range(1, len(found) + 1))
    assert all(one.key == "secret" for one in found)


def run(name: str, **names: Any) -> None:
    with suppress(OverError):
        exec(compile(SCRIPTS[name], f"{name}.py", "exec"), {"__name__": "__main__", **names})  # noqa: S102


def test_every_script_is_short_and_tried_here() -> None:
    assert set(SCRIPTS) == {"send", "optitrack", "vicon", "qualisys", "steamvr", "sensor_logger", "phyphox"}
    assert max(script.count("\n") for script in SCRIPTS.values()) <= 25


def test_a_reading_of_another_computer_goes_to_the_address_that_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5)
        monkeypatch.setattr(sys, "argv", ["script.py", "secret", "localhost"])
        made: dict[str, Any] = {}
        exec(SCRIPTS["send"].replace("9700", str(receiver.getsockname()[1])), made)  # noqa: S102
        made["send"](stream="tracker", position=[1, 2, 3])
        made["_out"].close()
        (reading,) = parse_datagram(receiver.recv(2000))
    assert (reading.key, reading.seq, reading.position) == ("secret", 1, (1.0, 2.0, 3.0))


def test_optitrack_s_rigid_body_is_sent_while_it_moves(monkeypatch: pytest.MonkeyPatch, heard: list[Datagram]) -> None:
    class NatNetClient:
        rigid_body_listener: Any = None

        def set_client_address(self, address: str) -> None: ...
        def set_server_address(self, address: str) -> None: ...
        def set_use_multicast(self, multicast: bool) -> None: ...
        def shutdown(self) -> None: ...

        def run(self, thread_option: str) -> bool:
            for body, place in ((1, (0.1, 1.2, 0.3)), (2, (9.0, 9.0, 9.0)), (1, (0.1, 1.2, 0.3)), (1, (0.2, 1.2, 0.3))):
                self.rigid_body_listener(body, place, (0.0, 0.0, 0.0, 1.0))
            return True

    monkeypatch.setitem(sys.modules, "NatNetClient", module("NatNetClient", NatNetClient=NatNetClient))
    run("optitrack", input=lambda _: "")
    assert [one.position for one in heard] == [(0.1, 1.2, 0.3), (0.2, 1.2, 0.3)]


def test_vicon_s_subject_is_sent_while_it_is_seen(monkeypatch: pytest.MonkeyPatch, heard: list[Datagram]) -> None:
    frames = iter([((1500.0, -2500.0, 900.0), False), ((0.0, 0.0, 0.0), True)])

    class Client:
        StreamMode = SimpleNamespace(EServerPush=2)

        def Connect(self, host: str) -> None: ...  # noqa: N802 - the SDK's names
        def EnableSegmentData(self) -> None: ...  # noqa: N802
        def SetStreamMode(self, mode: int) -> None: ...  # noqa: N802

        def GetFrame(self) -> bool:  # noqa: N802
            self.frame = next(frames, None)
            if self.frame is None:
                over()
            return True

        def GetSubjectRootSegmentName(self, subject: str) -> str:  # noqa: N802
            return f"{subject} root"

        def GetSegmentGlobalTranslation(self, subject: str, segment: str) -> Any:  # noqa: N802
            assert (subject, segment) == ("Hand", "Hand root")
            return self.frame

    stand_in = module("ViconDataStream", Client=Client)
    monkeypatch.setitem(sys.modules, "vicon_dssdk", module("vicon_dssdk", ViconDataStream=stand_in))
    run("vicon")
    assert [one.position for one in heard] == [(1500.0, -2500.0, 900.0)]


def test_qualisys_s_body_is_sent_while_it_is_seen(monkeypatch: pytest.MonkeyPatch, heard: list[Datagram]) -> None:
    nan = float("nan")

    class Connection:
        async def stream_frames(self, components: list[str], on_packet: Any) -> None:
            assert components == ["6d"]
            for place in (Place(1.0, 2.0, 3.0), Place(nan, nan, nan)):
                on_packet(SimpleNamespace(get_6d=lambda place=place: (None, [(place, None)])))
            over()

    async def connect(host: str) -> Connection:
        return Connection()

    monkeypatch.setitem(sys.modules, "qtm_rt", module("qtm_rt", connect=connect))
    run("qualisys")
    assert [one.position for one in heard] == [(1.0, 2.0, 3.0)]


def test_steamvr_s_tracker_is_sent_while_its_pose_is_valid(
    monkeypatch: pytest.MonkeyPatch, heard: list[Datagram]
) -> None:
    class Pose:
        bPoseIsValid = False  # noqa: N815

        def __mul__(self, count: int) -> Any:
            return lambda: [Pose() for _ in range(count)]

    def fill(origin: int, ahead_s: float, poses: list[Any]) -> None:
        rows = [[1.0, 0.0, 0.0, 0.4], [0.0, 1.0, 0.0, 1.1], [0.0, 0.0, 1.0, -0.6]]
        poses[1].bPoseIsValid, poses[1].mDeviceToAbsoluteTracking = True, SimpleNamespace(m=rows)

    vr = SimpleNamespace(getTrackedDeviceClass=lambda number: (1, 3)[number], getDeviceToAbsoluteTrackingPose=fill)
    stand_in = module(
        "openvr",
        init=lambda kind: vr,
        VRApplication_Other=0,
        k_unMaxTrackedDeviceCount=2,
        TrackedDeviceClass_GenericTracker=3,
        TrackingUniverseStanding=1,
        TrackedDevicePose_t=Pose(),
    )
    monkeypatch.setitem(sys.modules, "openvr", stand_in)
    monkeypatch.setattr(time, "sleep", over)
    run("steamvr")
    (reading,) = heard
    assert reading.position == (0.4, 1.1, -0.6)
    assert reading.t == pytest.approx(time.time(), abs=60)


# As Sensor Logger's page on pushing has it: the fields, and the names of its type XYZReading.
PUSHED = {
    "messageId": 0,
    "sessionId": "identifier",
    "deviceId": "identifier",
    "payload": [
        {"name": "accelerometeruncalibrated", "time": 1698501144411773000, "values": {"z": 9.8, "y": 0.2, "x": 0.1}},
        {"name": "gyroscope", "time": 1698501144401773000, "values": {"z": 0.3, "y": -0.2, "x": 0.1}},
        {"name": "accelerometer", "time": 1698501144411773000, "values": {"z": 0.0, "y": 0.0, "x": 0.0}},
    ],
}


def test_what_sensor_logger_pushes_is_sent_with_its_times(
    monkeypatch: pytest.MonkeyPatch, heard: list[Datagram]
) -> None:
    def once(server: HTTPServer) -> None:
        where = f"http://127.0.0.1:{server.server_address[1]}/"
        push = urllib.request.Request(where, json.dumps(PUSHED).encode())
        pushing = threading.Thread(target=lambda: urllib.request.urlopen(push).close())  # noqa: S310
        pushing.start()
        server.handle_request()
        pushing.join()
        server.server_close()

    monkeypatch.setattr(HTTPServer, "serve_forever", once)
    monkeypatch.setattr("http.server.BaseHTTPRequestHandler.log_message", lambda *_: None)
    monkeypatch.setitem(
        SCRIPTS, "sensor_logger", SCRIPTS["sensor_logger"].replace('("0.0.0.0", 9701)', '("127.0.0.1", 0)')
    )
    run("sensor_logger")
    (reading,) = heard
    assert (reading.acceleration, reading.angular_velocity) == ((0.1, 0.2, 9.8), (0.1, -0.2, 0.3))
    assert reading.t == pytest.approx(1698501144.411773)


def test_what_phyphox_answers_is_sent_once(monkeypatch: pytest.MonkeyPatch, heard: list[Datagram]) -> None:
    asked: list[str] = []

    def answer(url: str) -> io.BytesIO:
        asked.append(url)
        times = [0.01, 0.02] if len(asked) == 1 else []
        held = {name: {"size": 0, "updateMode": "partial", "buffer": times} for name in ("acc_time", "accX", "accY")}
        held["accZ"] = {"size": 0, "updateMode": "partial", "buffer": [9.8] * len(times)}
        held |= {f"gyr{axis}": {"size": 0, "updateMode": "single", "buffer": [-1.1e-3]} for axis in "XYZ"}
        status = {"session": "883b13", "measuring": True, "timedRun": False, "countDown": 0}
        return io.BytesIO(json.dumps({"buffer": held, "status": status}).encode())

    monkeypatch.setattr(urllib.request, "urlopen", answer)
    monkeypatch.setattr(time, "sleep", lambda _: over() if len(asked) == 2 else None)
    run("phyphox")
    assert [(one.t, one.acceleration) for one in heard] == [(0.01, (0.01, 0.01, 9.8)), (0.02, (0.02, 0.02, 9.8))]
    assert heard[0].angular_velocity == (-1.1e-3,) * 3
    assert asked[1].endswith(
        "/get?acc_time=0.02&accX=0.02%7Cacc_time&accY=0.02%7Cacc_time&accZ=0.02%7Cacc_time&gyrX&gyrY&gyrZ"
    )
