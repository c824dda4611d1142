"""Apps that send a phone's motion in a form of their own, as their documentation states it; none was tried itself."""

from __future__ import annotations

import asyncio
import json
import math
import socket
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.commands import record
from pipeline.errors import PipelineError
from pipeline.live import senders
from pipeline.live.access import Access
from pipeline.live.adapters import apps
from pipeline.live.adapters.newcomers import NOT_ACCEPTED, Newcomers
from pipeline.live.events import Offer, Reading
from pipeline.live.messages import MessageError
from tests.pipeline.live.running import Running, hears, served
from tests.pipeline.live.studies import STUDY, study_in

HERE, PHONE = "127.0.0.1", "192.168.1.7"
G = 9.80665
_DEMO = "senders: {tracker: {demo: {}}, imu: {demo: {}}}"

# The fields that ZIG SIM's source writes (ServiceManager.getJSON, MotionService.toJSON); an iPhone flat on a table.
ZIG_SIM = {
    "device": {
        "name": "iPhone",
        "uuid": "5Qmp4kEhcKlZ",
        "os": "ios",
        "osversion": "17.1",
        "displaywidth": 1170,
        "displayheight": 2532,
    },
    "timestamp": "2025_11_29_12:00:00.000",
    "sensordata": {
        "accel": {"x": 0.25, "y": 0.0, "z": 0.0},
        "gravity": {"x": 0.0, "y": 0.0, "z": -1.0},
        "gyro": {"x": 0.1, "y": -0.2, "z": 0.3},
        "quaternion": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    },
}
# A CSV packet as HyperIMU's documentation has its columns, with the time of its example; more sensors follow.
HYPERIMU = b"1518819953744,0.09279,0.148,9.81,0.1,-0.2,0.3,12.5,-3.1,40.2\n"


def without(*keys: str) -> bytes:
    """ZIG SIM's datagram without a sensor or, by two keys, another value."""
    sensors = {name: one for name, one in ZIG_SIM["sensordata"].items() if name not in keys}  # type: ignore[attr-defined]
    return json.dumps({**ZIG_SIM, "sensordata": sensors}).encode()


def test_zig_sim_s_acceleration_points_up_at_rest_after_reading() -> None:
    force, turning, sent_ms = apps.zig_sim(json.dumps(ZIG_SIM).encode())
    assert force == pytest.approx((-0.25 * G, 0.0, G))
    assert turning == (0.1, -0.2, 0.3)
    assert sent_ms is None


def test_hyperimu_s_row_is_read_as_its_columns_are_documented() -> None:
    assert apps.hyperimu(HYPERIMU) == ((0.09279, 0.148, 9.81), (0.1, -0.2, 0.3), 1518819953744.0)


@pytest.mark.parametrize(
    ("app", "data"),
    [
        ("zig_sim", without("gravity")),
        ("zig_sim", without("gyro")),
        ("zig_sim", json.dumps({**ZIG_SIM, "device": {"os": "android"}}).encode()),
        ("zig_sim", json.dumps({**ZIG_SIM, "sensordata": []}).encode()),
        ("zig_sim", json.dumps(ZIG_SIM).encode().replace(b"0.25", b"1e308")),
        ("zig_sim", HYPERIMU),
        ("hyperimu", HYPERIMU.partition(b",")[2]),  # its time is not sent
        ("hyperimu", b"1518819953744,0.1,0.2,9.8"),
        ("hyperimu", b"1518819953744,0.1,0.2,nan,0,0,0"),
        ("hyperimu", json.dumps(ZIG_SIM).encode()),
        ("hyperimu", b"\xff\xfe"),
    ],
)
def test_what_an_app_would_not_send_is_refused(app: str, data: bytes) -> None:
    with pytest.raises(MessageError):
        apps.PARSED[app](data)


@given(st.sampled_from(sorted(apps.PARSED)), st.one_of(st.binary(max_size=200), st.text(max_size=80).map(str.encode)))
def test_random_bytes_are_of_no_app(app: str, data: bytes) -> None:
    with pytest.raises(MessageError):
        apps.PARSED[app](data)


@pytest.mark.parametrize(
    ("app", "data", "sent_ms"),
    [("zig_sim", json.dumps(ZIG_SIM).encode(), None), ("hyperimu", HYPERIMU, 1518819953744.0)],
)
def test_an_app_is_a_sender_whose_orientation_is_found(
    tmp_path: Path, app: str, data: bytes, sent_ms: float | None
) -> None:
    text = f"senders: {{tracker: {{demo: {{}}}}, imu: {{app: {{name: {app}, port: 9000}}}}}}"
    _, setup = study_in(tmp_path, STUDY.replace(_DEMO, text))
    senders.check(setup, "study.yaml")
    assert setup.turned_stream == "imu" and setup.aligner is not None
    newcomers, taken = Newcomers(), list[Reading]()
    receiver = apps.Receiver(*apps.expected(setup, 9000), newcomers, taken.append, lambda: 5)
    receiver.datagram_received(data, (PHONE, 1))
    receiver.datagram_received(b"x", (PHONE, 1))
    assert (taken, receiver.refused) == ([], {NOT_ACCEPTED: 1, "not understood": 1})
    assert newcomers.waiting(1.0) == (Offer("imu", PHONE, app, 1),)
    newcomers.accept("imu", PHONE)
    receiver.datagram_received(data, (PHONE, 1))
    (reading,) = taken
    assert reading.values[:6] == pytest.approx((*apps.PARSED[app](data)[0], 0.1, -0.2, 0.3))
    assert all(map(math.isnan, reading.values[6:]))
    assert (reading.stamp_ns, reading.sent_ms) == (None, sent_ms)


def test_an_app_named_by_its_address_is_heard_from_there_alone(tmp_path: Path) -> None:
    text = f"senders: {{tracker: {{demo: {{}}}}, imu: {{app: {{name: hyperimu, port: 9000, source: {PHONE}}}}}}}"
    _, setup = study_in(tmp_path, STUDY.replace(_DEMO, text))
    taken = list[Reading]()
    receiver = apps.Receiver(*apps.expected(setup, 9000), Newcomers(), taken.append, lambda: 5)
    receiver.datagram_received(HYPERIMU, (HERE, 1))
    assert (taken, receiver.refused) == ([], {"not from its source": 1})
    receiver.datagram_received(HYPERIMU, (PHONE, 1))
    assert len(taken) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "senders: {tracker: {app: {name: zig_sim, port: 9000}}, imu: {demo: {}}}",
            "senders.tracker: app: zig_sim sends a phone's motion and no positions; use it for",
        ),
        (
            "senders: {tracker: {udp_json: {port: 9000}}, imu: {app: {name: zig_sim, port: 9000}}}",
            "senders.imu: port 9000 is that of udp_json already; choose another",
        ),
        (
            "senders: {tracker: {osc: {port: 9000, address: /hand}}, imu: {udp_json: {port: 9000}}}",
            "senders.imu: port 9000 is that of osc already; choose another",
        ),
    ],
)
def test_what_an_app_and_a_port_cannot_do_is_said_at_the_start(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(PipelineError, match=message):
        senders.check(study_in(tmp_path, STUDY.replace(_DEMO, text))[1], "study.yaml")


def test_the_start_says_where_to_send_to_and_what_is_in_the_clear(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "senders: {tracker: {udp_json: {port: 9700}}, imu: {app: {name: zig_sim, port: 9000}}}"
    _, setup = study_in(tmp_path, STUDY.replace(_DEMO, text))
    record.say_where(tmp_path)(setup, Access("http", "192.168.1.5", 8443), None)
    said = capsys.readouterr().out
    assert "tracker: by UDP to 192.168.1.5, port 9700" in said
    assert "imu: by UDP to 192.168.1.5, port 9000" in said
    assert "Without TLS a phone gives its pages no motion" in said


def test_an_app_s_readings_reach_their_stream_over_a_real_socket(tmp_path: Path) -> None:
    async def send(running: Running) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while True:
                row = HYPERIMU.replace(b"1518819953744", str(round(time.time() * 1000)).encode())
                sender.sendto(row, (HERE, running.udp_port))
                await asyncio.sleep(0.01)

    async def play(running: Running) -> None:
        async with running.page("operator") as operator:
            sending = asyncio.create_task(send(running))
            text = ""
            while not text.endswith("its orientation is not known yet: hold it still, then move it."):
                text = (await hears(operator, "lights"))["lights"]["imu"]["text"]
            sending.cancel()

    text = "senders: {tracker: {demo: {}}, imu: {app: {name: hyperimu, port: PORT}}}"
    served(tmp_path, play, STUDY.replace(_DEMO, text))
