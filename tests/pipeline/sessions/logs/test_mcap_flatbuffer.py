"""Foxglove's flatbuffers, held against the accessors that flatc generates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flatbuffers import Builder
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import Content, Readings, Source, Wanted
from pipeline.sessions.logs.mcap import flatbuffer, flatbuffer_schema, templates
from tests.pipeline.sessions.logs.flatbuffer_messages import POSITIONS, generated, get_schema, message, table, write_log
from tests.pipeline.sessions.logs.motion_formats import OF_SEVERAL

PLACES = [(0.5 + at, -1.25 * at, 3.0) for at in range(6)]


def read_topic(path: Path, source: Source | None = None, content: Content = "position") -> Readings:
    wanted = Wanted("/t", content, source or Source())
    return read_log(path, [wanted]).topics[wanted.key]


@pytest.mark.parametrize("name", POSITIONS)
def test_positions_of_every_type(name: str, tmp_path: Path) -> None:
    sent = [message(name, 10**9 * at + 5, place) for at, place in enumerate(PLACES)]
    readings = read_topic(write_log(tmp_path / "a.mcap", name, sent), OF_SEVERAL.get(name))
    assert readings.values.tolist() == [list(place) for place in PLACES]
    assert readings.stamp_ns.tolist() == [10**9 * at + 5 for at in range(6)]
    assert (readings.lost, readings.notes) == (0, ())
    assert (readings.claims.frames, readings.claims.frame.tolist()) == (("room",), [0] * 6)


def test_a_bare_vector_has_no_stamp(tmp_path: Path) -> None:
    builder = Builder(0)
    builder.Finish(table(builder, "Point3", X=1.0, Y=2.0, Z=3.0))
    path = write_log(tmp_path / "a.mcap", "Point3", [bytes(builder.Output())] * 3)
    assert "`stamp: log_time`" in read_topic(path).notes[0]
    readings = read_topic(path, Source(unstamped=True))
    assert (readings.values.tolist(), readings.stamp_ns.tolist()) == ([[1, 2, 3]] * 3, [0, 1000, 2000])


def test_accelerations_by_the_fields_that_study_yaml_names(tmp_path: Path) -> None:
    """Foxglove has no type of an IMU: a velocity of an Odometry stands for any vector in any table."""
    builder = Builder(0)
    twist = table(builder, "Vector3", X=1.0, Z=9.8)
    odometry = table(builder, "Odometry", LinearVelocity=twist, Timestamp=10**9 + 7, FrameId="room")
    builder.Finish(odometry)
    path = write_log(tmp_path / "a.mcap", "Odometry", [bytes(builder.Output())])
    readings = read_topic(path, Source(fields={"acceleration": ("linear_velocity",)}), "acceleration")
    assert readings.values[:, :3].tolist() == [[1, 0, 9.8]]
    assert readings.stamp_ns.tolist() == [10**9 + 7]


def by_the_generated_accessors(payload: bytes) -> tuple[int, list[float], str]:
    decoded = generated("FrameTransform").FrameTransform.GetRootAs(payload)
    stamp, place = decoded.Timestamp(), decoded.Translation()
    values = [place.X(), place.Y(), place.Z()]
    return stamp.Sec() * 10**9 + stamp.Nsec(), values, decoded.ChildFrameId().decode()


FIGURES = st.sampled_from([0.0, 1.0]) | st.floats(-1e3, 1e3)


@settings(deadline=None, max_examples=40)
@given(
    drawn=st.lists(
        st.tuples(st.integers(0, 2**32 * 10**9 - 1), st.tuples(FIGURES, FIGURES, FIGURES)), min_size=1, max_size=8
    )
)
def test_random_messages_as_the_generated_accessors_read_them(
    drawn: list[tuple[int, Any]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A coordinate of 0 is not sent, so that such messages are laid out otherwise."""
    sent = [message("FrameTransform", stamp, place) for stamp, place in drawn]
    path = write_log(tmp_path_factory.getbasetemp() / "random.mcap", "FrameTransform", sent)
    fast, expected = read_topic(path), [by_the_generated_accessors(payload) for payload in sent]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(templates, "TEMPLATES", 0)
        slow = read_topic(path)
    for readings in (fast, slow):
        assert readings.values.tolist() == [values for _, values, _ in expected]
        assert readings.stamp_ns.tolist() == [stamp for stamp, _, _ in expected]


@settings(deadline=None, max_examples=60)
@given(data=st.data(), name=st.sampled_from(POSITIONS))
def test_damaged_messages_are_read_or_named_and_nothing_else(
    data: st.DataObject, name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Flipped or missing bytes: the fast way and the slow one agree, whatever they make of it."""
    payload = bytearray(message(name, 5, (1.0, 2.0, 3.0)))
    for _ in range(data.draw(st.integers(1, 3))):
        payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    damaged = bytes(payload)[: len(payload) - data.draw(st.integers(0, 9))]
    path = write_log(tmp_path_factory.getbasetemp() / "damaged.mcap", name, [damaged] * 2)
    fast = read_topic(path, OF_SEVERAL.get(name))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(templates, "TEMPLATES", 0)
        slow = read_topic(path, OF_SEVERAL.get(name))
    np.testing.assert_array_equal(fast.values, slow.values)
    assert (fast.stamp_ns.tolist(), fast.lost, fast.notes) == (slow.stamp_ns.tolist(), slow.lost, slow.notes)


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_a_damaged_schema_is_followed_or_refused(data: st.DataObject) -> None:
    schema = bytearray(get_schema("FrameTransforms"))
    for _ in range(data.draw(st.integers(1, 3))):
        schema[data.draw(st.integers(0, len(schema) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        types = flatbuffer_schema.parse("foxglove.FrameTransforms", bytes(schema))
        types.leaves()
        flatbuffer.places(message("FrameTransforms", 5, (1.0, 2.0, 3.0)), types)
    except ValueError:
        pass


@pytest.mark.parametrize(
    ("name", "schema", "reason"),
    [
        ("PoseInFrame", b"", "its schema is no binary schema of flatbuffers"),
        ("PoseInFrame", b"table PoseInFrame { pose: Pose; }", "its schema is no binary schema of flatbuffers"),
        ("PoseInFrame", get_schema("Point3InFrame"), "its schema does not describe foxglove.PoseInFrame"),
        ("Log", get_schema("Log"), "it holds foxglove.Log, and a stream of kind position needs"),
    ],
)
def test_what_cannot_be_followed_costs_its_topic(name: str, schema: bytes, reason: str, tmp_path: Path) -> None:
    readings = read_topic(write_log(tmp_path / "a.mcap", name, [message("PoseInFrame", 5, (1, 2, 3))], schema))
    assert (readings.read, readings.lost) == (0, 1)
    assert reason in readings.notes[0]


def test_a_message_without_its_place_is_lost_and_said(tmp_path: Path) -> None:
    builder = Builder(0)
    builder.Finish(table(builder, "PoseInFrame", Timestamp=5, FrameId="room"))
    readings = read_topic(write_log(tmp_path / "a.mcap", "PoseInFrame", [bytes(builder.Output())]))
    assert readings.notes == ("1 messages cannot be read: it has no pose.position.x",)


def test_messages_are_not_walked_through_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    walked: list[bytes] = []
    walk = flatbuffer.places

    def counting(payload: bytes, *rest: Any) -> Any:
        walked.append(payload)
        return walk(payload, *rest)

    monkeypatch.setattr(flatbuffer, "places", counting)
    sent = [message("PoseInFrame", at, (at + 1, 2, 3), frame) for at in range(300) for frame in ("a", "bcdefgh")]
    assert read_topic(write_log(tmp_path / "a.mcap", "PoseInFrame", sent)).read == 600
    assert len(walked) == 2
