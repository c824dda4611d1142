"""Messages of pages and senders: what is understood, and that everything else is refused and nothing more."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.live import messages
from pipeline.live.messages import Datagram, Do, Exchange, Hello, MessageError, Motion, Ping, parse, parse_datagram
from pipeline.live.outgoing import Say, Shown, Whole, to_json

MOTION = '{"type":"motion","seq":812,"t":1764350000013.4,"a":[0.1,9.8,0.3],"l":null,"r":[28.6,14.3,-7.2],"i":16}'
FRAMES = {
    "phone": [
        MOTION,
        '{"type":"hello","page":"phone","version":1,"agent":"x","screen":{"w":854,"h":480,"ratio":2.6},"secure":true}',
        '{"type":"ping","t1":1.5,"last":{"t1":1,"t2":2,"t3":3,"t4":4}}',
        '{"type":"orientation","seq":1,"t":1,"q":[0,0,0,1],"absolute":false}',
        '{"type":"drawn","n":4711,"t":1764350000021.0}',
        '{"type":"select","n":4711,"t":1764350000019.7,"pressed_ms":84}',
        '{"type":"mouse","t":1,"x":-548.2,"y":500.9}',
        '{"type":"visible","visible":false,"t":1}',
        '{"type":"battery","level":0.81}',
    ],
    "questionnaire": [
        '{"type":"answer","questionnaire":"nasa_tlx","item":"mental","value":7,"id":"a1"}',
        '{"type":"submit","questionnaire":"nasa_tlx","id":"a9"}',
    ],
    "operator": ['{"type":"do","what":"start","text":"","id":"d1"}'],
}


def test_messages_are_read_field_by_field() -> None:
    assert parse("phone", MOTION) == Motion(812, 1764350000013.4, (0.1, 9.8, 0.3), None, (28.6, 14.3, -7.2), 16.0)
    assert parse("phone", FRAMES["phone"][2]) == Ping(1.5, Exchange(1, 2, 3, 4))
    assert parse("operator", FRAMES["operator"][0]) == Do("start", "", "d1")
    screen = (854.0, 480.0, 2.6)
    assert parse("phone", FRAMES["phone"][1]) == Hello("phone", 1, "x", screen, "", secure=True, wake_lock=False)
    for role, frames in FRAMES.items():
        for frame in frames:
            parse(role, frame.encode())


def test_a_role_may_send_its_own_messages_only() -> None:
    for role in FRAMES:
        for other, frames in FRAMES.items():
            for frame in frames if other != role and "hello" not in frames else ():
                if json.loads(frame)["type"] != "hello":
                    with pytest.raises(MessageError, match="may not send"):
                        parse(role, frame)


@pytest.mark.parametrize(
    ("frame", "why"),
    [
        ("{", "not JSON"),
        ("[]", "an object"),
        ('{"type":"launch"}', "may not send"),
        ('{"type":"drawn","n":-1,"t":1}', "whole number"),
        ('{"type":"drawn","n":1.5,"t":1}', "whole number"),
        ('{"type":"drawn","n":true,"t":1}', "whole number"),
        ('{"type":"drawn","n":1,"t":NaN}', "not JSON"),
        ('{"type":"drawn","n":1,"t":1e308}', "out of range"),
        ('{"type":"drawn","n":1,"t":-1}', "negative"),
        ('{"type":"drawn","n":1,"t":"1"}', "a number"),
        (f'{{"type":"drawn","n":{2**60},"t":1}}', "whole number"),
        ('{"type":"orientation","seq":1,"t":1,"q":[0,0,0,0]}', "quaternion"),
        ('{"type":"orientation","seq":1,"t":1,"q":[0,0,1]}', "4 numbers"),
        ('{"type":"motion","seq":1,"t":1,"a":[1,2,1e7]}', "out of range"),
        ('{"type":"battery","level":1.5}', "out of range"),
        ('{"type":"hello","page":"phone","version":1,"x":[[[[[1]]]]]}', "nested"),
        ('{"type":"hello","page":"' + "x" * 5000 + '"}', "too long"),
        ("[" * 2000, "not JSON"),
    ],
)
def test_what_does_not_fit_is_refused_with_the_reason(frame: str, why: str) -> None:
    with pytest.raises(MessageError, match=why):
        parse("phone", frame)


def test_a_datagram_is_one_reading_or_several() -> None:
    one = '{"key":"k","stream":"tracker","seq":912,"t":1764350000.0134,"position":[-548.2,500.9,1203.0]}'
    assert parse_datagram(one.encode()) == (
        Datagram("k", "tracker", 912, 1764350000.0134, (-548.2, 500.9, 1203.0), None, None, None),
    )
    assert len(parse_datagram(f"[{one},{one}]".encode())) == 2
    for bad in (b"[1]", b'{"stream":"t"}', b'{"stream":"t","position":[1,2]}', b'{"stream":"","position":[1,2,3]}'):
        with pytest.raises(MessageError):
            parse_datagram(bad)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=20,
)


@given(st.binary(max_size=300) | JSON.map(lambda value: json.dumps(value).encode()))
def test_random_bytes_and_random_json_do_nothing_but_be_refused(frame: bytes) -> None:
    for role in FRAMES:
        with pytest.raises(MessageError):
            parse(role, frame)
    with pytest.raises(MessageError):
        parse_datagram(frame)


@given(st.sampled_from([(role, frame) for role, frames in FRAMES.items() for frame in frames]), st.data())
def test_any_field_may_be_anything(known: tuple[str, str], data: st.DataObject) -> None:
    role, frame = known
    content = json.loads(frame)
    content[data.draw(st.sampled_from(sorted(set(content) - {"type"})))] = data.draw(JSON)
    try:
        parse(role, json.dumps(content))
    except MessageError as error:
        assert str(error)


def test_what_goes_out_is_json_of_the_same_names() -> None:
    assert json.loads(to_json(Shown(7, 1.5, -2.0, 1))) == {"type": "show", "n": 7, "x": 1.5, "y": -2.0, "trial": 1}
    assert json.loads(to_json(Whole("lights", {"drawn_hz": 60}))) == {"type": "lights", "drawn_hz": 60}
    assert json.loads(to_json(Say("Please wait.", "wait"))) == {"type": "say", "text": "Please wait.", "what": "wait"}
    with pytest.raises(ValueError, match="finite"):
        to_json(Shown(7, float("nan"), 0.0, 1))
    assert messages.FRAME_BYTES == 4096
