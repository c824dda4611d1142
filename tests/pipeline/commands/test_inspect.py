"""What `inspect` says of a log's topics, and that what it proposes for study.yaml is taken."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from mcap.writer import Writer

from tests.conftest import write_session
from tests.pipeline.helpers import Steadyhand, run
from tests.pipeline.report.test_checks import SETTINGS
from tests.pipeline.sessions.checks.hand import Hand, messages, session
from tests.pipeline.sessions.checks.spoilt import FAULTS

Capsys = pytest.CaptureFixture[str]
Patch = pytest.MonkeyPatch


def block_of(out: str) -> dict[str, object]:
    """The lines for study.yaml, as YAML reads them."""
    lines = out.split("For study.yaml, as this log has it:\n")[1].split("Checks:", maxsplit=1)[0]
    found: dict[str, object] = yaml.safe_load(lines)
    return found


def test_it_says_what_each_topic_is_usable_as_and_how_study_yaml_would_name_it(
    tmp_path: Path, capsys: Capsys, monkeypatch: Patch
) -> None:
    log, study = session(Hand())
    path = write_session(tmp_path / "P01_a.mcap", messages(log))
    ran = run(capsys, monkeypatch, "inspect", path)
    assert ran.code == 0
    assert 'geometry_msgs/msg/PointStamped (cdr), frame_id "tracker"; usable as position' in ran.out
    assert "sensor_msgs/msg/Imu (cdr)" in ran.out
    assert "steadyhand.Event (json); usable as events" in ran.out
    block = block_of(ran.out)
    assert block["events"] == {"topic": "/events"}
    streams = block["streams"]
    assert isinstance(streams, dict)
    assert {name: stream["kind"] for name, stream in streams.items()} == {
        name: stream.kind for name, stream in study.streams.items()
    }
    assert streams["imu"]["gravity_mm_s2"] == pytest.approx([0, 0, -9806.65])
    assert streams["tracker"]["stamp"] == "arrival"
    assert streams["tracker"]["latency_s"] == pytest.approx(0.1, abs=0.015)
    assert streams["tracker"]["noise_sd_mm"] == pytest.approx(8, rel=0.1)
    assert "Checks: 0 contradictions" in ran.out


def test_the_checks_are_made_without_a_study(tmp_path: Path, capsys: Capsys, monkeypatch: Patch) -> None:
    log, _ = next(one for one in FAULTS if one.name == "accelerometer in g").spoil(*session(Hand()))
    ran = run(capsys, monkeypatch, "inspect", write_session(tmp_path / "P01_a.mcap", messages(log)))
    assert "red, specific force: imu: found 1" in ran.out
    assert "they are in g" in ran.out


def test_gravity_that_the_log_does_not_tell_is_called_a_guess(
    tmp_path: Path, capsys: Capsys, monkeypatch: Patch
) -> None:
    said = {}
    for oriented in (True, False):
        log, _ = session(Hand(oriented=oriented))
        ran = run(capsys, monkeypatch, "inspect", write_session(tmp_path / f"{oriented}.mcap", messages(log)))
        said[oriented] = "# gravity_mm_s2 is a guess: the log has no orientation" in ran.out
        assert isinstance(block_of(ran.out)["streams"], dict)
    assert said == {True: False, False: True}


def test_a_log_that_no_study_can_use_ends_with_1_and_says_why(
    tmp_path: Path, capsys: Capsys, monkeypatch: Patch
) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("nav_msgs/msg/OccupancyGrid", "ros2msg", b"float64 x\n")
        channel = writer.register_channel("/map", "cdr", schema)
        writer.add_message(channel, 10**9, b"\0\1\0\0" + bytes(8), 10**9)
        writer.finish()  # type: ignore[no-untyped-call]
    ran = run(capsys, monkeypatch, "inspect", path)
    assert ran.code == 1
    assert "nav_msgs/msg/OccupancyGrid (cdr); not usable, because its type is none of those that are read" in ran.out
    assert "no topic is usable as position, acceleration or events" in ran.err


def test_a_misspelt_topic_is_answered_with_the_nearest_and_all(
    folder: Callable[..., Path], steadyhand: Steadyhand
) -> None:
    study = folder(SETTINGS.replace("/tracker/position", "/traker/position"))
    write_session(study / "data" / "P01_a.mcap", messages(session(Hand(seconds=5.0))[0]))
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert 'did you mean "/tracker/position"?' in ran.err + ran.out
    assert (
        "(there: /display/position, /events, /phone/imu, /reference/position, /tracker/position)" in ran.err + ran.out
    )
