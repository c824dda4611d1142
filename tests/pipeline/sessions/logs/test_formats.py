"""The same motion in every format gives the same samples; the quirks of each recorder, and what a user is told."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import SessionError
from pipeline.sessions.logs import read_log, read_logs
from pipeline.sessions.logs.log import USUAL, Limits, Readings, Source, Wanted
from tests.pipeline.sessions.logs.motion_formats import FORMATS, XDF_HEADER, Format, motion, xdf_chunk, xdf_stream


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_the_same_motion_in_every_format(form: Format, tmp_path: Path) -> None:
    path, truth = tmp_path / form.name, motion()
    form.write(path, truth)
    wanted = Wanted(form.topic, "position", form.source)
    log = read_log(path, [wanted])
    readings = log.topics[wanted.key]
    assert (log.faults, readings.notes, readings.lost) == ((), (), 0)
    np.testing.assert_allclose(readings.values, truth.place_m, rtol=1e-15, atol=0.5 * form.resolution_m + 1e-15)
    since_first = (readings.stamp_ns - readings.stamp_ns[0]) * 1e-9
    np.testing.assert_allclose(since_first, truth.time_s, rtol=0, atol=form.resolution_s)
    every = read_log(path, [])
    assert every.topics[form.topic].read == len(truth.time_s)


def read_table(folder: Path, topic: str, source: Source | None = None, content: str = "position") -> Readings:
    wanted = Wanted(topic, content, source or Source())  # type: ignore[arg-type]
    return read_log(folder, [wanted]).topics[wanted.key]


def write(folder: Path, **files: str) -> Path:
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    return folder


def test_sensor_logger(tmp_path: Path) -> None:
    """Columns z, y, x; every sensor in a file of its own; the angular velocity is the last one known."""
    folder = write(
        tmp_path,
        TotalAcceleration="time,seconds_elapsed,z,y,x\n1700000000000000001,0.5,9.8,2,1\n1700000000010000001,0.51,9.9,2,1\n",
        Gyroscope="time,seconds_elapsed,z,y,x\n1700000000000000000,0.4,0.3,0.2,0.1\n1700000000010000002,0.52,3,2,1\n",
        Orientation="time,seconds_elapsed,qz,qy,qx,qw,roll,pitch,yaw\n1700000000000000001,0.5,0,0.6,0,0.8,0,0,0\n",
    )
    readings = read_table(folder, "TotalAcceleration", content="acceleration")
    assert readings.values.tolist() == [
        [1, 2, 9.8, 0.1, 0.2, 0.3, 0, 0.6, 0, 0.8],
        [1, 2, 9.9, 0.1, 0.2, 0.3, 0, 0.6, 0, 0.8],
    ]
    assert readings.stamp_ns.tolist() == [1700000000000000001, 1700000000010000001]
    elapsed = read_table(folder, "TotalAcceleration", Source(fields={"stamp": ("seconds_elapsed",)}), "acceleration")
    assert elapsed.stamp_ns.tolist() == [500_000_000, 510_000_000]


def test_an_ios_phone_in_g_with_turning_in_degrees(tmp_path: Path) -> None:
    folder = write(tmp_path, phone="t,ax,ay,az,wx,wy,wz\n0.0,0,0,-1,180,0,0\n")
    source = Source(scale=-9.80665, turning_scale=np.pi / 180, stamp_unit_s=1.0)
    (row,) = read_table(folder / "phone.csv", "phone", source, "acceleration").values
    np.testing.assert_allclose(row[:6], [0, 0, 9.80665, np.pi, 0, 0], atol=1e-12)
    assert np.isnan(row[6:]).all()


def test_tables_of_two_clocks_are_refused(tmp_path: Path) -> None:
    folder = write(
        tmp_path,
        Accelerometer="time,seconds_elapsed,z,y,x\n1700000000000000000,0.0,9.8,0,0\n",
        tracker='"Time (s)","x (m)","y (m)","z (m)"\n0.0,1,2,3\n',
    )
    wanted = [Wanted("Accelerometer", "acceleration"), Wanted("tracker", "position")]
    with pytest.raises(SessionError, match=r"more than a day apart.*fields: \{stamp: …\}"):
        read_log(folder, wanted)
    wanted[0] = Wanted("Accelerometer", "acceleration", Source(fields={"stamp": ("seconds_elapsed",)}))
    assert [one.read for one in read_log(folder, wanted).topics.values()] == [1, 1]


def test_what_a_recorder_did_not_see(tmp_path: Path) -> None:
    """Empty cells in Motive and Vicon, zeros in Qualisys: a reading without a place, which ingest leaves out."""
    forms = {form.name: form for form in FORMATS}
    for name in ("motive.csv", "vicon.csv", "qualisys.tsv"):
        path = tmp_path / name
        forms[name].write(path, motion())
        lines = path.read_text().splitlines()
        at = next(
            index for index, line in enumerate(lines) if line[:1].isdigit() and line.count(",") + line.count("\t") > 3
        )
        if name == "qualisys.tsv":
            lines[at] = "1\t0.0\t0.000\t0.000\t0.000\t1.0\t1.0\t1.0"
        else:
            cells = lines[at].split(",")
            cells[2:9] = [""] * len(cells[2:9])
            lines[at] = ",".join(cells)
        path.write_text("\n".join(lines) + "\n")
        values = read_log(path, [Wanted(forms[name].topic, "position")]).topics[forms[name].topic].values
        assert np.isnan(values[0]).all() and np.isfinite(values[1:]).all()


def test_events_in_a_table(tmp_path: Path) -> None:
    folder = write(tmp_path, events="time_s,type,trial,x\n0.5,trial_start,1,\n0.75,selection,1,0.25\n")
    readings = read_table(folder / "events.csv", "events", content="events")
    assert readings.events == ({"type": "trial_start", "trial": 1}, {"type": "selection", "trial": 1, "x": 0.25})
    assert readings.arrival_ns.tolist() == [500_000_000, 750_000_000]
    folder = write(tmp_path, other="time_s,type\n0.5,click\n")
    assert '"click" is no type of an event' in read_table(folder / "other.csv", "other", content="events").notes[0]


@pytest.mark.parametrize(
    ("text", "source", "message"),
    [
        ("time,x,y,z\n1,2,3,4\n", USUAL, 'the unit of the times in "time" is not known; say it by `stamp_unit: s`'),
        (
            "when,x,y,z\n1,2,3,4\n",
            Source(),
            "no column of times is known; name it by `fields: {stamp: …}` (there:",
        ),
        ("time_s,a,b,c\n1,2,3,4\n", USUAL, "no columns of a position are known; name them by `fields: {position:"),
        (
            "time_s,a,b,c\n1,2,3,4\n",
            Source(fields={"position": ("a", "b", "C")}),
            'there is no column "C" for fields: position',
        ),
        ("time_s,x,y,z\n,2,3,4\n", USUAL, '1 cells of "time_s" are empty, and a reading needs a time'),
        ("time_s,x,y,z\nsoon,2,3,4\n", USUAL, '"time_s" holds cells that are no times'),
        (
            "time_s,x (mm),y (mm),z (mm)\n1,2,3,4\n",
            Source(scale=0.01),
            "study.yaml states another `unit` than the file",
        ),
    ],
)
def test_a_table_that_does_not_say_enough(text: str, source: Source, message: str, tmp_path: Path) -> None:
    readings = read_table(write(tmp_path, a=text) / "a.csv", "a", source)
    assert readings.read == 0
    assert message in readings.notes[-1]


def test_lines_of_another_length_are_left_out_and_counted(tmp_path: Path) -> None:
    text = "time_s,x,y,z\n0,1,2,3\n1,1,2\n2,1,2,3\n"
    readings = read_table(write(tmp_path, a=text) / "a.csv", "a")
    assert (readings.read, readings.lost) == (2, 1)
    assert "1 lines are left out: they have more or fewer cells" in readings.notes[0]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"", "the file is empty"),
        ("a.csv", b"\x00\x01\x02", "it is no text"),
        ("a.csv", b"version https://git-lfs.github.com/spec/v1\n", "run: git lfs pull"),
        ("a.csv", b"Format Version,1.2,Length Units,Parsecs\n", 'no known length as "Length Units": "Parsecs"'),
        ("a.csv", b"Format Version,1.2,Length Units,Meters\n", 'no line that begins with "Frame"'),
        ("a.tsv", b"NO_OF_FRAMES\t3\n", "it names no MARKER_NAMES or BODY_NAMES"),
        ("a.csv", b"Trajectories\nfast\n,,a\nFrame,Sub Frame,X\n,,mm\n1,0,2\n", 'its second line is no rate: "fast"'),
        ("a.xdf", b"", "the file is empty"),
        ("a.xdf", b"text", "not an XDF file"),
    ],
)
def test_what_is_no_table_is_refused(name: str, content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(SessionError, match=re.escape(message)):
        read_log(path, [Wanted("a", "position")])


def test_a_table_beyond_the_limit(tmp_path: Path) -> None:
    write(tmp_path, a="time_s,x,y,z\n" + "0,1,2,3\n" * 1000)
    with pytest.raises(SessionError, match=r"log_limits: \{unpacked_mib: N\}"):
        read_logs([tmp_path / "a.csv"], [], Limits(unpacked_bytes=100))


def test_clock_offsets_of_lab_streaming_layer(tmp_path: Path) -> None:
    """A stream of another computer, whose clock is 100 s behind, as LSL measured every few seconds."""
    truth = motion()
    offsets = b"".join(xdf_chunk(4, struct.pack("<Idd", 1, time, 100.0)) for time in (4900.0, 4905.0, 4910.0, 4915.0))
    stream = xdf_stream(1, "hand", "MoCap", ("x", "y", "z"), truth.time_s + 4900.0, truth.place_m)
    (tmp_path / "a.xdf").write_bytes(
        XDF_HEADER + stream[: stream.index(b"</info>") + 7] + offsets + stream[stream.index(b"</info>") + 7 :]
    )
    readings = read_log(tmp_path / "a.xdf", [Wanted("hand", "position")]).topics["hand"]
    np.testing.assert_allclose(readings.stamp_ns * 1e-9, truth.time_s + 5000.0, atol=1e-6)


def test_markers_of_lab_streaming_layer_are_events(tmp_path: Path) -> None:
    header = (
        b"<?xml version='1.0'?><info><name>events</name><type>Markers</type><channel_count>1</channel_count>"
        b"<nominal_srate>0</nominal_srate><channel_format>string</channel_format></info>"
    )
    texts = [b'{"type": "selection", "trial": 3, "x": 0.5}', b"trial_start", b"coffee"]
    samples = b"".join(
        b"\x08" + struct.pack("<d", 10.0 + at) + b"\x01" + bytes([len(text)]) + text for at, text in enumerate(texts)
    )
    own = struct.pack("<I", 1)
    footer = b"<?xml version='1.0'?><info><first_timestamp>10</first_timestamp></info>"
    content = xdf_chunk(2, own + header) + xdf_chunk(3, own + b"\x01\x03" + samples) + xdf_chunk(6, own + footer)
    (tmp_path / "a.xdf").write_bytes(XDF_HEADER + content)
    readings = read_log(tmp_path / "a.xdf", [Wanted("events", "events")]).topics["events"]
    assert [one["type"] for one in readings.events] == ["selection", "trial_start"]
    assert readings.events[0]["x"] == 0.5
    assert readings.arrival_ns.tolist() == [10 * 10**9, 11 * 10**9]
    assert readings.lost == 1
    assert "1 markers cannot be read: it is not an event" in readings.notes[0]


def test_a_trajectory_aligned_with_spaces_from_some_line_on(tmp_path: Path) -> None:
    rows = [f"170000000{at // 10}.{at % 10}00000001 {at} 2 3 0 0 0 1" for at in range(90)]
    rows[80:] = [f"  {row.replace(' 2 ', '    2	 ')} " for row in rows[80:]]
    path = tmp_path / "a.txt"
    path.write_text("\n".join(["# timestamp tx ty tz qx qy qz qw", *rows]) + "\n")
    readings = read_log(path, [Wanted("a", "position")]).topics["a"]
    assert readings.values.tolist() == [[at, 2, 3] for at in range(90)]
    assert readings.stamp_ns[-1] == 1_700_000_008_900_000_001


def test_cells_of_another_kind_far_below(tmp_path: Path) -> None:
    """A figure that is written otherwise costs itself alone, wherever it stands."""
    rows = [f"{at},{at},2,3" for at in range(5000)]
    rows[4000] = "4000,n/a,2.5,3"
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["time_ms,x,y,z", *rows]))
    readings = read_log(path, [Wanted("a", "position")]).topics["a"]
    assert np.flatnonzero(np.isnan(readings.values[:, 0])).tolist() == [4000]
    assert readings.values[4000:4002, 1].tolist() == [2.5, 2.0]
    assert readings.stamp_ns[-1] == 4_999_000_000
