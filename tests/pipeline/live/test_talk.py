"""What is read of rosbridge, Foxglove's protocol and LSL, without a socket: readings, refusals, and what is said."""

from __future__ import annotations

import base64
import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import PipelineError
from pipeline.live import senders
from pipeline.live.adapters import foxglove, rosbridge
from pipeline.live.adapters.feeds import Feed, feed, figures_of, of_numbers
from pipeline.live.adapters.lsl_outlets import Found, unfit
from pipeline.live.units import in_si, units
from pipeline.study.recording import Demo, Foxglove, Lsl, Rosbridge, Sender
from tests.pipeline.live.servers import (
    CDR_IMU,
    CDR_POSITION,
    FORCE_M_S2,
    IMU,
    PLACE_M,
    POSITION,
    UPRIGHT,
    advertised,
    cdr,
    data,
    imu,
    point_stamped,
    published,
    stamp,
    xyz,
)
from tests.pipeline.live.studies import STUDY, study_in
from tests.pipeline.protobuf_types import FOXGLOVE, message_class, schema_of

URL = "ws://127.0.0.1:9090"
AT_NS = 1_764_350_000_123_456_000
AT_MS = AT_NS / 1e6
NOW = AT_NS + 5_000_000
MOTION = (*FORCE_M_S2, 0.0, 0.0, 0.0)


def feeds(content: str, **sender: Any) -> Feed:
    return Feed("hand", content, units(Sender(**({"rosbridge": ROS} | sender))))


ROS = {"url": URL, "topic": POSITION, "type": "geometry_msgs/PointStamped"}


def ros(of_type: str, topic: str = POSITION, **sender: Any) -> rosbridge.Talk:
    content = "acceleration" if of_type.endswith("Imu") else "position"
    return rosbridge.Talk(feeds(content, **sender), Rosbridge(url=URL, topic=topic, type=of_type))


def fox(content: str = "position", topic: str = POSITION) -> foxglove.Talk:
    talk = foxglove.Talk(feeds(content), Foxglove(url=URL, topic=topic))
    assert talk.begin("foxglove.websocket.v1").problem is None
    return talk


# --- rosbridge


@pytest.mark.parametrize("package", ["geometry_msgs/", "geometry_msgs/msg/"])
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("PointStamped", {"point": xyz(PLACE_M)}),
        ("PoseStamped", {"pose": {"position": xyz(PLACE_M), "orientation": xyz(UPRIGHT)}}),
        ("TransformStamped", {"child_frame_id": "hand", "transform": {"translation": xyz(PLACE_M)}}),
    ],
)
def test_positions_come_by_rosbridge_in_metres_with_the_header_s_stamp(
    package: str, name: str, message: dict[str, Any]
) -> None:
    talk = ros(package + name)
    asked = json.loads(talk.begin(None).answers[0])
    assert (asked["op"], asked["topic"], asked["type"]) == ("subscribe", POSITION, package + name)
    (reading,) = talk.take(published(POSITION, {"header": stamp(AT_NS), **message}), NOW).readings
    assert (reading.stream, reading.values, reading.arrival_ns) == ("hand", PLACE_M, NOW)
    assert reading.sent_ms == pytest.approx(AT_MS, abs=1e-3)


def test_axes_unit_rotation_and_translation_hold_for_rosbridge_too() -> None:
    talk = ros("geometry_msgs/PointStamped", axes=["x", "-z", "y"], unit="cm", translation_mm=[100, 0, 0])
    (reading,) = talk.take(published(POSITION, point_stamped(AT_NS, (1.0, 2.0, 3.0))), NOW).readings
    assert reading.values == pytest.approx((0.11, -0.03, 0.02))


def test_an_imu_of_rosbridge_has_its_orientation_where_it_is_known() -> None:
    talk = ros("sensor_msgs/msg/Imu", IMU)
    ros1 = {"stamp": {"secs": AT_NS // 10**9, "nsecs": AT_NS % 10**9}}
    (known,) = talk.take(published(IMU, imu(AT_NS, header=ros1)), NOW).readings
    assert known.values == pytest.approx((*MOTION, *UPRIGHT))
    assert known.sent_ms == pytest.approx(AT_MS, abs=1e-3)
    for changes in ({"orientation_covariance": [-1.0] + [0.0] * 8}, {"orientation": xyz((0.0, 0.0, 0.0, 0.0))}):
        (unknown,) = talk.take(published(IMU, imu(0, **changes)), NOW).readings
        assert unknown.values[:6] == MOTION and all(math.isnan(part) for part in unknown.values[6:])
        assert unknown.sent_ms is None  # a stamp of zero is none
    none = talk.take(published(IMU, imu(AT_NS, linear_acceleration_covariance=[-1.0] + [0.0] * 8)), NOW)
    assert (none.readings, none.refused) == ((), "not understood")


GOOD = published(POSITION, point_stamped(AT_NS))
HOSTILE: list[str | bytes] = [
    "",
    "null",
    "[]",
    "{",
    "[" * 60_000,
    '{"op":"publish","topic":"/hand","msg":' * 20 + "1" + "}" * 20,
    GOOD.replace("1.2", "NaN"),
    GOOD.replace("1.2", "null"),  # what rosbridge makes of NaN
    GOOD.replace("1.2", "1e308"),
    GOOD.replace("1.2", '"1.2"'),
    GOOD.replace("1.2", "true"),
    GOOD.replace('"point"', '"pose"'),
    GOOD.replace('"sec"', '"second"'),
    GOOD.replace('"nanosec": ', '"nanosec": -'),
    GOOD + " " * 70_000,
    b"\xff" * 100,
]


@pytest.mark.parametrize("frame", HOSTILE)
def test_hostile_frames_of_rosbridge_are_counted_and_nothing_else(frame: str | bytes) -> None:
    talk = ros("geometry_msgs/PointStamped")
    heard = talk.take(frame, NOW)
    assert (heard.readings, heard.answers, heard.problem, heard.refused) == ((), (), None, "not understood")
    assert talk.take(GOOD, NOW).readings


@settings(max_examples=40)
@given(st.one_of(st.text(), st.binary(), st.recursive(st.none() | st.floats() | st.text(), st.lists).map(json.dumps)))
def test_random_frames_are_inert(frame: str | bytes) -> None:
    assert ros("geometry_msgs/PointStamped").take(frame, NOW).readings == ()
    assert fox().take(frame, NOW).readings == ()


def test_what_a_rosbridge_server_says_is_passed_on_with_the_remedy() -> None:
    talk = ros("geometry_msgs/PointStamped")
    said = talk.take(json.dumps({"op": "status", "level": "error", "msg": "another type" + "!" * 999}), NOW).problem
    assert (
        said is not None and "/hand: “another type!" in said and "`ros2 topic info /hand`" in said and len(said) < 300
    )
    assert talk.take(json.dumps({"op": "status", "level": "info", "msg": "fine"}), NOW).problem is None
    assert "`ros2 topic hz /hand`" in talk.nothing_yet()


@pytest.mark.parametrize(
    ("sender", "said"),
    [
        (
            "{rosbridge: {url: 'ws://h:9090', topic: /hand, type: std_msgs/String}}",
            "senders.tracker: rosbridge: ws://h:9090: type: std_msgs/String is not read as a position; use"
            " geometry_msgs/PointStamped, geometry_msgs/PoseStamped, geometry_msgs/TransformStamped",
        ),
        ("{lsl: {name: Hand, channels: [0, 1]}}", "lsl: channels: 2 are named, position needs 3"),
    ],
)
def test_a_sender_that_can_never_feed_its_stream_is_refused_at_the_start(
    tmp_path: Path, sender: str, said: str
) -> None:
    text = STUDY.replace("senders: {tracker: {demo: {}}", f"senders: {{tracker: {sender}")
    _, setup = study_in(tmp_path, text)
    with pytest.raises(PipelineError, match=r"^study\.yaml: recording: ") as refused:
        senders.check(setup, "study.yaml")
    assert said in str(refused.value)


@pytest.mark.parametrize(
    "url", ["http://h:1", "h:9090", "ws://", "ws://h:99999", "ws://h:0", "ws://[::1", f"ws://{'a' * 300}:80"]
)
def test_what_is_no_address_of_a_server_is_said_when_study_yaml_is_read(url: str) -> None:
    for made in (lambda: Rosbridge(url=url, topic="/t", type="t"), lambda: Foxglove(url=url, topic="/t")):
        with pytest.raises(ValueError, match="is no address of a WebSocket; write ws://HOST:PORT"):
            made()


# --- Foxglove


def test_a_topic_of_foxglove_s_protocol_is_subscribed_to_and_read() -> None:
    for topic, channel, values in (
        (POSITION, CDR_POSITION, PLACE_M),
        (IMU, CDR_IMU, (*MOTION, *UPRIGHT)),
    ):
        talk = fox("position" if topic == POSITION else "acceleration", topic)
        asked = talk.take(advertised({"id": 3, "topic": "/x"}, {"id": 9, **channel}), NOW)
        assert json.loads(asked.answers[0]) == {"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 9}]}
        (reading,) = talk.take(data(cdr(topic, AT_NS)), NOW).readings
        assert reading.values == pytest.approx(values)
        assert reading.sent_ms == pytest.approx(AT_MS, abs=1e-3)


def test_json_and_protobuf_are_read_as_in_a_log() -> None:
    name = "foxglove.Point3InFrame"
    made = message_class(name, FOXGLOVE)()
    made.timestamp.seconds, made.timestamp.nanos = divmod(AT_NS, 10**9)
    made.point.x, made.point.y, made.point.z = PLACE_M
    schema = base64.b64encode(schema_of(type(made))).decode()
    in_json = {"timestamp": {"sec": AT_NS // 10**9, "nsec": AT_NS % 10**9}, "point": xyz(PLACE_M)}
    for channel, payload in (
        ({"encoding": "protobuf", "schema": schema}, made.SerializeToString()),
        ({"encoding": "json", "schema": ""}, json.dumps(in_json).encode()),
    ):
        talk = fox()
        assert talk.take(advertised({"id": 1, "topic": POSITION, "schemaName": name, **channel}), NOW).answers
        (reading,) = talk.take(data(payload), NOW).readings
        assert reading.values == PLACE_M
        assert reading.sent_ms == pytest.approx(AT_MS, abs=1e-3)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"encoding": "morse"}, 'its encoding is "morse", not one of cdr, protobuf, json, ros1, flatbuffer'),
        ({"schemaName": "std_msgs/msg/String", "schema": "string data"}, "it holds std_msgs/msg/String"),
        ({"schemaEncoding": "omgidl"}, "its schema is written as"),
        ({"encoding": "protobuf", "schemaEncoding": "protobuf", "schema": "§"}, "its schema is not in base64"),
    ],
)
def test_a_channel_that_cannot_be_read_is_named_with_what_can(changes: dict[str, str], said: str) -> None:
    schema = {**CDR_POSITION, "schemaName": "geometry_msgs/msg/Other"} if "schemaEncoding" in changes else CDR_POSITION
    heard = fox().take(advertised({"id": 1, **schema, **changes}), NOW)
    assert heard.answers == () and heard.problem is not None
    assert heard.problem.startswith(f"/hand cannot be read as a position: {said}")
    assert heard.problem.endswith("Name another topic, or have it sent as geometry_msgs/msg/PointStamped.")
    assert "fields:" not in heard.problem


def test_a_wrong_topic_is_said_with_those_there_are_and_one_that_ends_too() -> None:
    talk = fox()
    assert "it has none" in talk.nothing_yet()
    talk.take(advertised(*({"id": number, "topic": f"/t{number:02}"} for number in range(20))), NOW)
    assert talk.nothing_yet().startswith("has no topic /hand; it has /t00, /t01,")
    assert "/t11 …. Correct the topic" in talk.nothing_yet()
    talk.take(advertised({"id": 50, **CDR_POSITION}), NOW)
    assert talk.nothing_yet().startswith("is connected, and nothing comes on /hand.")
    ended = talk.take(json.dumps({"op": "unadvertise", "channelIds": [50]}), NOW)
    assert ended.problem == "does not send /hand any more. See whether its sender runs."
    assert talk.take(advertised({"id": 51, **CDR_POSITION}), NOW).answers
    assert talk.take(json.dumps({"op": "status", "level": 2, "message": "no"}), NOW).problem == (
        "says “no”. See the server's own output."
    )


def test_a_server_of_another_protocol_is_told_apart() -> None:
    for spoken in (None, "other"):
        said = foxglove.Talk(feeds("position"), Foxglove(url=URL, topic=POSITION)).begin(spoken).problem
        assert said is not None and "does not speak foxglove.websocket.v1; start foxglove_bridge" in said
    assert foxglove.Talk(feeds("position"), Foxglove(url=URL, topic=POSITION)).begin("foxglove.sdk.v1").problem is None


def test_hostile_frames_of_foxglove_s_protocol_are_counted_and_nothing_else() -> None:
    talk = fox()
    for frame in ("[" * 5000, "[]", "1", '{"op":"advertise"}', '{"op":"advertise","channels":[1]}', "{"):
        assert talk.take(frame, NOW).refused == "not understood"
    assert talk.take(data(cdr(POSITION, AT_NS)), NOW).refused == "not asked for"
    talk.take(advertised({"id": 9, **CDR_POSITION}), NOW)
    whole = cdr(POSITION, AT_NS)
    infinite = whole[:-8] + b"\0\0\0\0\0\0\xf0\x7f"
    for payload in (b"", whole[:-1], b"\xff" * 60, whole + b"\0" * 70_000, infinite):
        heard = talk.take(data(payload), NOW)
        assert (heard.readings, heard.refused) == ((), "not understood")
    assert talk.take(data(whole, subscription=2), NOW).refused == "not asked for"
    assert talk.take(b"", NOW) == talk.take(b"\x02" + b"\0" * 8, NOW) == talk.take(b"\x01\0", NOW)
    assert talk.take(data(whole), NOW).readings
    assert talk.take(data(b""), NOW).problem is None  # one damaged among many is no reason to alarm


# --- Lab Streaming Layer


def test_numbers_of_channels_are_a_reading_if_they_are_as_many_as_it_has() -> None:
    position = of_numbers("hand", "position", PLACE_M)
    assert position is not None and position.position == PLACE_M
    motion = of_numbers("imu", "acceleration", [*MOTION, *UPRIGHT])
    assert motion is not None and (motion.acceleration, motion.orientation) == (FORCE_M_S2, UPRIGHT)
    for numbers in ([1.0, 2.0], [1.0, 2.0, math.nan], [1.0, 2.0, 1e9], [1.0, 2.0, "3"], [1.0, 2.0, True]):
        assert of_numbers("hand", "position", numbers) is None


@pytest.mark.parametrize(
    ("outlets", "said"),
    [
        ([], 'no LSL stream is named "Hand"; there is none at all. Start it, or correct the name; see the firewall'),
        (
            [Found("Eye", 3, "a"), Found("EEG", 3, "a")],
            'is named "Hand"; found EEG, Eye. Start it, or correct the name',
        ),
        (
            [Found("Hand", 3, "b"), Found("Hand", 3, "a")],
            '2 LSL streams are named "Hand" (on a and b); end all but one',
        ),
        ([Found("Hand", 2, "a")], 'the LSL stream "Hand" has 2 channels; channels: names number 2, counted from 0.'),
        ([Found("Hand", 3, "a", is_text=True)], 'the LSL stream "Hand" holds text; name one that holds numbers.'),
        ([Found("Eye", 1, "a"), Found("Hand", 3, "a")], ""),
    ],
)
def test_what_is_wrong_with_the_outlets_that_are_there_is_said(outlets: list[Found], said: str) -> None:
    assert said in unfit(Lsl(name="Hand"), outlets)
    assert bool(said) == bool(unfit(Lsl(name="Hand"), outlets))


def test_a_feed_is_that_of_its_stream_and_sender(tmp_path: Path) -> None:
    sender = "{lsl: {name: Hand}, unit: cm}"
    _, setup = study_in(tmp_path, STUDY.replace("senders: {tracker: {demo: {}}", f"senders: {{tracker: {sender}"))
    of = feed(setup, "tracker")
    assert (of.stream, of.content, of.units.metres, of.unstamped) == ("tracker", "position", 0.01, True)


def test_what_points_down_at_rest_is_turned_about_and_what_turns_is_not() -> None:
    figures = figures_of("imu", None, ((0.0, 0.0, -1.0), (1.0, 2.0, 3.0)))
    values = in_si(units(Sender(demo=Demo(), unit="-g")), "acceleration", figures)
    assert values is not None
    assert values[:6] == pytest.approx((0.0, 0.0, 9.80665, 1.0, 2.0, 3.0))
