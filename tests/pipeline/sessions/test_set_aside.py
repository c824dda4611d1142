"""What one bad session, or a file that is none, does to the others: nothing, and it is said."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from pipeline.sessions.logs.mcap import Message
from tests.conftest import session_messages, write_session
from tests.pipeline.helpers import Steadyhand
from tests.pipeline.sessions.four_sessions import (
    SETTINGS,
    Folder,
    compared,
    listed,
    set_back,
    study,
    with_values,
    without,
)

__all__ = ["compared", "study"]  # fixtures


BAD_SESSIONS: dict[str, tuple[Callable[[list[Message]], list[Message]], str]] = {
    "missing topic": (without("/tracker/position"), 'stream "tracker": topic /tracker/position is not in the log'),
    "clock backwards": (set_back, 'stream "imu": the clock went backwards by 0.489 s'),
    "all NaN": (with_values(np.nan, 1), "holds no usable sample: 120 samples left out: NaN or infinite"),
    "no reference": (without("/reference/position"), 'stream "reference": topic /reference/position is not in the log'),
}


@pytest.mark.parametrize("name", list(BAD_SESSIONS))
def test_one_bad_session_does_not_stop_the_others(study: Path, steadyhand: Steadyhand, name: str) -> None:
    change, reason = BAD_SESSIONS[name]
    write_session(study / "data" / "P1_a.mcap", change(session_messages()))
    ran = steadyhand("compare", study)
    assert ran.code == 1
    assert reason in ran.err
    listed = {row["session"]: row for row in steadyhand.results()["exclusions"] if row["session"]}
    assert reason in listed["P1_a"]["reason"]
    usable = name == "no reference"
    assert listed["P1_a"]["what"] == ("session read in part" if usable else "session set aside")
    assert {row["session"] for row in steadyhand.results()["quality"]} == {"P1_b", "P2_a", "P2_b"} | (
        {"P1_a"} if usable else set()
    )
    assert steadyhand.results()["comparisons"][0]["n"] == (2 if usable else 1)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("P3_a.mcap", b"not a log", "not an MCAP file"),
        ("P3_a.mcap", b"", "the file is empty"),
        ("P3_c.mcap", None, 'condition "c" is not in study.yaml'),
    ],
)
def test_a_file_that_cannot_be_a_session_is_set_aside(
    study: Path, steadyhand: Steadyhand, name: str, content: bytes | None, reason: str
) -> None:
    path = study / "data" / name
    if content is None:
        write_session(path)
    else:
        path.write_bytes(content)
    ran = steadyhand("compare", study)
    assert ran.code == 1
    assert reason in ran.err
    assert len(steadyhand.results()["quality"]) == 4 * 4


def test_a_log_cut_in_the_middle_is_used_as_far_as_it_goes(study: Path, steadyhand: Steadyhand) -> None:
    path = study / "data" / "P2_b.mcap"
    path.write_bytes(path.read_bytes()[:-20_000])
    ran = steadyhand("compare", study)
    assert ran.code == 1
    assert "session P2_b read in part: the log is cut off" in ran.err
    rows = [row for row in steadyhand.results()["quality"] if row["session"] == "P2_b"]
    assert rows[0]["messages_lost"] is None
    assert 0 < rows[0]["messages_read"] < 120


def test_metadata_and_name_that_disagree_set_the_session_aside(study: Path, steadyhand: Steadyhand) -> None:
    write_session(study / "data" / "P1_a.mcap", participant="P7")
    ran = steadyhand("compare", study)
    assert ran.code == 1
    assert 'its name says participant "P1", its metadata "P7"' in ran.err


def test_some_samples_that_are_not_finite_are_left_out_and_said(study: Path, steadyhand: Steadyhand) -> None:
    write_session(study / "data" / "P1_a.mcap", with_values(np.inf, 10)(session_messages()))
    assert steadyhand("compare", study).code == 0
    row = next(r for r in steadyhand.results()["quality"] if r["session"] == "P1_a" and r["stream"] == "tracker")
    assert "12 samples left out: NaN or infinite" in row["note"]
    assert row["messages_read"] == 120


def test_no_usable_session_and_no_tables_is_an_error(folder: Folder, steadyhand: Steadyhand) -> None:
    root = folder(SETTINGS)
    ran = steadyhand("report", root)
    assert ran.code == 2
    assert "no file matches sessions" in ran.err
    (root / "data").mkdir()
    (root / "data" / "P1_a.mcap").write_bytes(b"x")
    ran = steadyhand("report", root)
    assert ran.code == 2
    assert "no session can be used:\n  P1_a: not an MCAP file" in ran.err


def test_files_beside_the_sessions_are_not_passed_over_in_silence(study: Path, steadyhand: Steadyhand) -> None:
    data = study / "data"
    (data / "P5-a.mcap").touch()
    (data / "P6_a.MCAP").touch()
    (data / "P7_a.mcap").symlink_to(data / "nowhere")
    (data / "linked").symlink_to(study.parent, target_is_directory=True)
    (data / "notes.txt").touch()
    assert steadyhand("compare", study).code == 1
    assert listed(steadyhand, "file not used") == [
        ("data/P5-a.mcap", "its name does not fit the pattern of study.yaml"),
        ("data/P6_a.MCAP", "its name does not fit the pattern of study.yaml"),
        ("data/linked", "a link to a folder is not followed"),
    ]
    assert listed(steadyhand, "session set aside") == [("data/P7_a.mcap", "it is not a file that can be read")]


def test_a_condition_that_the_pattern_cannot_match_is_an_error(study: Path, steadyhand: Steadyhand) -> None:
    path = study / "study.yaml"
    path.write_text(path.read_text().replace("conditions: [a, b]", "conditions: [a, b_2]"))
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert 'no log can be of "b_2"' in ran.err


def test_a_bad_study_does_not_stop_the_next(study: Path, folder: Folder, steadyhand: Steadyhand) -> None:
    bad = folder("conditions: [a]\n", name="bad")
    ran = steadyhand("compare", bad, str(study))
    assert ran.code == 2
    assert f"{bad / 'study.yaml'}: has no data" in ran.err
    assert (steadyhand.out / "study" / "results.json").is_file()


def test_a_stream_without_samples_sets_the_session_aside(study: Path, steadyhand: Steadyhand) -> None:
    from mcap.reader import make_reader
    from mcap.writer import Writer

    path = study / "data" / "P1_a.mcap"
    content = path.read_bytes()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        known: dict[int, int] = {}
        for schema, channel, message in make_reader(BytesIO(content)).iter_messages():
            if channel.id not in known:
                assert schema is not None
                copied = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, copied)
            if channel.topic != "/tracker/position":
                writer.add_message(known[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()  # type: ignore[no-untyped-call]
    ran = steadyhand("compare", study)
    assert ran.code == 1
    assert 'session P1_a set aside: stream "tracker": topic /tracker/position holds no samples' in ran.err
