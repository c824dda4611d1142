"""One motion as every recorder would write it."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from pipeline.sessions.logs.log import USUAL, Source
from pipeline.statistics.arrays import FloatArray
from tests.pipeline.sessions.logs import flatbuffer_messages
from tests.pipeline.sessions.logs.ros_messages import IN_ROS1, IN_ROS2, POSITIONS, write_messages

COUNT, RATE_HZ = 40, 100.0
START_NS = 1_700_000_000 * 10**9


@dataclass(frozen=True)
class Motion:
    """Times in s from the beginning (n,), and places in m (n, 3)."""

    time_s: FloatArray
    place_m: FloatArray


def motion(count: int = COUNT) -> Motion:
    time_s = np.arange(count) / RATE_HZ
    place = np.column_stack([0.3 * np.sin(5 * time_s), 0.2 * np.cos(3 * time_s) + 1.1, 2.0 - 0.5 * time_s])
    return Motion(time_s, place)


@dataclass(frozen=True)
class Format:
    """How a recorder writes: the file, the topic, what study.yaml says of it, and to which resolution."""

    name: str
    write: Callable[[Path, Motion], None]
    topic: str
    source: Source = USUAL
    resolution_m: float = 0.0
    resolution_s: float = 1e-9


def _lines(rows: Sequence[str]) -> str:
    return "\n".join(rows) + "\n"


def _rows(of: Motion, digits: int, scale: float = 1.0, separator: str = ",") -> list[str]:
    return [separator.join(f"{value * scale:.{digits}f}" for value in place) for place in of.place_m]


def _stamps_ns(of: Motion) -> list[int]:
    return [START_NS + round(time * 1e9) for time in of.time_s]


def _generic(path: Path, of: Motion) -> None:
    rows = [f"{round(1e3 * time)},{place}" for time, place in zip(of.time_s, _rows(of, 3, 1e3), strict=True)]
    path.write_text(_lines(["moment,X,Y,Z", *rows]))


def _german(path: Path, of: Motion) -> None:
    rows = [f"{time:.4f};{row};0" for time, row in zip(of.time_s, _rows(of, 6, 1.0, ";"), strict=True)]
    names = '"Zeit (s)";"x (m)";"y (m)";"z (m)";"Länge"'
    path.write_bytes(_lines([names, *(row.replace(".", ",") for row in rows)]).encode("cp1252"))


def _phyphox(path: Path, of: Motion) -> None:
    rows = [f"{time:.9E},{row}" for time, row in zip(of.time_s, _rows(of, 9), strict=True)]
    path.write_text(_lines(['"Time (s)","x (m)","y (m)","z (m)"', *rows]))


def _tum(path: Path, of: Motion) -> None:
    stamps = [f"{ns // 10**9}.{ns % 10**9:09d}" for ns in _stamps_ns(of)]
    rows = [f"{stamp}  {row} 0 0 0 1" for stamp, row in zip(stamps, _rows(of, 6, 1.0, " "), strict=True)]
    path.write_text(_lines(["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw", *rows]))


def _euroc(path: Path, of: Motion) -> None:
    names = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
    rows = [f"{stamp},{row},1,0,0,0" for stamp, row in zip(_stamps_ns(of), _rows(of, 6), strict=True)]
    path.write_text(_lines([names, *rows]))


def _motive(path: Path, of: Motion) -> None:
    axes = "X,Y,Z,W,X,Y,Z,"
    head = [
        "Format Version,1.23,Take Name,Take 1,Capture Frame Rate,100,Rotation Type,Quaternion,Length Units,Millimeters",
        "",
        ",,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body",
        ",,Name,Hand,Hand,Hand,Hand,Hand,Hand,Hand,Hand",
        ",,ID,1,1,1,1,1,1,1,1",
        ",,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error",
        f"Frame,Time (Seconds),{axes}",
    ]
    # The word Type, Name, ID stands one column before the first figure; the names stand above theirs.
    head = [line.replace(",,Type,", ",Type,").replace(",,Name,", ",Name,").replace(",,ID,", ",ID,") for line in head]
    head[5] = head[5].replace(",,,", ",,")
    rows = [
        f"{index},{time:.6f},0,0,0,1,{row},0.0001"
        for index, (time, row) in enumerate(zip(of.time_s, _rows(of, 6, 1e3), strict=True))
    ]
    path.write_text(_lines([*head, *rows]))


def _qualisys(path: Path, of: Motion, with_times: bool = True) -> None:
    facts = [
        f"NO_OF_FRAMES\t{len(of.time_s)}",
        "NO_OF_CAMERAS\t8",
        "NO_OF_MARKERS\t2",
        "FREQUENCY\t100",
        "TIME_STAMP\t2023-11-14, 22:13:20.000\t1234.5",
        "DATA_INCLUDED\t3D",
        "MARKER_NAMES\thand\thead",
    ]
    if with_times:
        facts.append("Frame\tTime\thand X\thand Y\thand Z\thead X\thead Y\thead Z")
    rows = []
    for index, (time, row) in enumerate(zip(of.time_s, _rows(of, 3, 1e3, "\t"), strict=True)):
        leading = f"{index + 1}\t{time:.5f}\t" if with_times else ""
        rows.append(f"{leading}{row}\t0.000\t0.000\t0.000")
    path.write_text(_lines([*facts, *rows]))


def _qualisys_bare(path: Path, of: Motion) -> None:
    _qualisys(path, of, with_times=False)


def _vicon(path: Path, of: Motion) -> None:
    head = ["Trajectories", "100", ",,Ada:hand,,,Ada:head,,", "Frame,Sub Frame,X,Y,Z,X,Y,Z", ",,mm,mm,mm,mm,mm,mm"]
    rows = [f"{index + 1},0,{row},,," for index, row in enumerate(_rows(of, 3, 1e3))]
    path.write_text(_lines([*head, *rows, "", "Devices", "1000", "Frame,Sub Frame,Fx"]))


def _json(path: Path, of: Motion, make: Callable[[int, Sequence[float]], Mapping[str, object]]) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("hand", "json", writer.register_schema("any", "jsonschema", b"{}"))
        for stamp, place in zip(_stamps_ns(of), of.place_m.tolist(), strict=True):
            writer.add_message(channel, stamp, json.dumps(make(stamp, place)).encode(), stamp)
        writer.finish()  # type: ignore[no-untyped-call]


def _xyz(place: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyz", place, strict=True))


def _sec(stamp: int) -> dict[str, int]:
    return {"sec": stamp // 10**9, "nsec": stamp % 10**9}


def _frame_transforms(path: Path, of: Motion) -> None:
    def make(stamp: int, place: Sequence[float]) -> Mapping[str, object]:
        hand = {
            "timestamp": _sec(stamp),
            "parent_frame_id": "room",
            "child_frame_id": "hand",
            "translation": _xyz(place),
        }
        return {"transforms": [{**hand, "child_frame_id": "head", "translation": _xyz([9, 9, 9])}, hand]}

    _json(path, of, make)


def _poses_in_frame(path: Path, of: Motion) -> None:
    def make(stamp: int, place: Sequence[float]) -> Mapping[str, object]:
        other = {"position": _xyz([9, 9, 9])}
        return {"timestamp": _sec(stamp), "frame_id": "room", "poses": [other, {"position": _xyz(place)}]}

    _json(path, of, make)


def _iso_times(path: Path, of: Motion) -> None:
    def make(stamp: int, place: Sequence[float]) -> Mapping[str, object]:
        moment = str(np.datetime64(stamp, "ns"))
        return {"timestamp": f"{moment}Z", "point": _xyz(place)}

    _json(path, of, make)


def _ros(name: str, ros1: bool) -> Callable[[Path, Motion], None]:
    def write(path: Path, of: Motion) -> None:
        maker = IN_ROS1 if ros1 else IN_ROS2
        stamped = zip(_stamps_ns(of), of.place_m, strict=True)
        write_messages(path, [maker.position(name, stamp, place) for stamp, place in stamped], maker)

    return write


def _flatbuffer(name: str) -> Callable[[Path, Motion], None]:
    def write(path: Path, of: Motion) -> None:
        stamped = zip(_stamps_ns(of), of.place_m.tolist(), strict=True)
        payloads = [flatbuffer_messages.message(name, stamp, place) for stamp, place in stamped]
        flatbuffer_messages.write_log(path, name, payloads)

    return write


def xdf_chunk(tag: int, content: bytes) -> bytes:
    """A chunk of an XDF file: its length, its tag, its content (github.com/sccn/xdf/wiki/Specifications)."""
    return b"\x04" + struct.pack("<IH", len(content) + 2, tag) + content


def xdf_stream(
    number: int, name: str, kind: str, labels: Sequence[str], times: FloatArray, values: FloatArray
) -> bytes:
    """A stream of doubles with labelled channels."""
    channels = "".join(f"<channel><label>{one}</label><unit>m</unit></channel>" for one in labels)
    header = (
        f"<?xml version='1.0'?><info><name>{name}</name><type>{kind}</type><channel_count>{len(labels)}</channel_count>"
        f"<nominal_srate>{RATE_HZ:g}</nominal_srate><channel_format>double64</channel_format>"
        f"<desc><channels>{channels}</channels></desc></info>"
    )
    samples = b"".join(
        b"\x08" + struct.pack(f"<d{len(labels)}d", time, *row) for time, row in zip(times, values, strict=True)
    )
    footer = f"<?xml version='1.0'?><info><first_timestamp>{times[0]}</first_timestamp></info>"
    own = struct.pack("<I", number)
    return (
        xdf_chunk(2, own + header.encode())
        + xdf_chunk(3, own + b"\x04" + struct.pack("<I", len(times)) + samples)
        + xdf_chunk(6, own + footer.encode())
    )


XDF_HEADER = b"XDF:" + xdf_chunk(1, b"<?xml version='1.0'?><info><version>1.0</version></info>")


def _xdf(path: Path, of: Motion) -> None:
    path.write_bytes(XDF_HEADER + xdf_stream(1, "hand", "MoCap", ("x", "y", "z"), of.time_s + 5000.0, of.place_m))


OF_SEVERAL = {
    "PosesInFrame": Source(fields={"position": ("poses[1].position",)}),
    "FrameTransforms": Source(child="hand"),
}
"""Which of several places in one message is the hand's."""

FORMATS = (
    *(Format(f"{name.split('/')[-1]}.mcap", _ros(name, False), "/t") for name in POSITIONS),
    *(Format(f"ros1_{name.split('/')[-1]}.mcap", _ros(name, True), "/t") for name in POSITIONS),
    *(
        Format(f"flat_{name}.mcap", _flatbuffer(name), "/t", OF_SEVERAL.get(name, USUAL))
        for name in flatbuffer_messages.POSITIONS
    ),
    Format("frame_transforms.mcap", _frame_transforms, "hand", OF_SEVERAL["FrameTransforms"]),
    Format("poses_in_frame.mcap", _poses_in_frame, "hand", OF_SEVERAL["PosesInFrame"]),
    Format("iso_times.mcap", _iso_times, "hand"),
    Format(
        "generic.csv",
        _generic,
        "generic",
        Source(fields={"stamp": ("moment",), "position": ("X", "Y", "Z")}, scale=0.001, stamp_unit_s=0.001),
        1e-6,
        1e-3,
    ),
    Format("german.csv", _german, "german", Source(fields={"stamp": ("Zeit (s)",)}), 1e-6, 1e-4),
    Format("phyphox.csv", _phyphox, "phyphox", resolution_m=1e-9),
    Format("tum.txt", _tum, "tum", resolution_m=1e-6),
    Format("euroc.csv", _euroc, "euroc", resolution_m=1e-6),
    Format("motive.csv", _motive, "Hand", resolution_m=1e-9, resolution_s=1e-6),
    Format("qualisys.tsv", _qualisys, "hand", resolution_m=1e-6, resolution_s=1e-5),
    Format("qualisys_bare.tsv", _qualisys_bare, "hand", resolution_m=1e-6),
    Format("vicon.csv", _vicon, "hand", resolution_m=1e-6),
    Format("lsl.xdf", _xdf, "hand", resolution_s=1e-8),
)
