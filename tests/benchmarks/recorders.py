"""Ten minutes of motion in each recorder's format to stamps and places, by the stock reader of it, beside ours."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyxdf
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin

from pipeline.sessions.logs import read_log
from pipeline.sessions.logs.log import USUAL, Source, Wanted
from tests.benchmarks.timing import fastest
from tests.pipeline.sessions.logs.motion_formats import FORMATS, Motion, motion
from tests.pipeline.sessions.logs.ros_messages import IN_ROS1, IN_ROS2
from tests.pipeline.sessions.logs.test_bags import write_bag1, write_bag2

COUNT = 60_000
ROWS_OF_BAGS = 10_000  # their writers are slow
Arrays = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Case:
    """A file in a format, what it holds for us, and the stock reader of it."""

    name: str
    path: Path
    topic: str
    source: Source
    stock: Callable[[Path], Arrays]


def recorders() -> None:
    """Milliseconds of each way, and how many times faster ours is."""
    print(f"Reading {COUNT} positions ({ROWS_OF_BAGS} of bags): milliseconds of the stock reader, ours, times faster")
    with tempfile.TemporaryDirectory() as folder:
        for case in [*_tables(Path(folder)), *_bags(Path(folder))]:
            wanted = Wanted(case.topic, "position", case.source)
            read = read_log(case.path, [wanted]).topics[wanted.key]
            stamps, places = case.stock(case.path)
            assert len(stamps) == read.read
            np.testing.assert_allclose(places, read.values, atol=1e-9)
            ours = fastest(lambda c=case, w=wanted: read_log(c.path, [w]), 15)  # type: ignore[misc]
            stock = fastest(lambda c=case: c.stock(c.path), 15)  # type: ignore[misc]
            print(f"  {case.name:<36}{1e3 * stock:>8.1f}{1e3 * ours:>8.1f}{stock / ours:>8.1f} x")


def _tables(folder: Path) -> list[Case]:
    long = motion(COUNT)
    forms = {form.name: form for form in FORMATS}
    cases = []
    for name, stock in STOCK.items():
        form = forms[name]
        form.write(folder / name, long)
        if name == "tum.txt":  # most tools write single spaces
            (folder / name).write_text((folder / name).read_text().replace("  ", " "))
        cases.append(Case(name, folder / name, form.topic, form.source, stock))
    return cases


def _bags(folder: Path) -> list[Case]:
    of = motion(ROWS_OF_BAGS)
    sent2, sent1 = ([("/t", time, message) for time, message in _messages(of, maker)] for maker in (IN_ROS2, IN_ROS1))
    paths = {
        "rosbag2 (.db3)": write_bag2(folder / "db3", sent2, StoragePlugin.SQLITE3),
        "rosbag2 (.mcap)": write_bag2(folder / "mcap", sent2, StoragePlugin.MCAP),
        "ROS 1 (.bag)": write_bag1(folder / "one.bag", sent1),
    }
    return [Case(name, path, "/t", USUAL, _rosbags) for name, path in paths.items()]


def _messages(of: Motion, maker: Any) -> list[tuple[int, Any]]:
    name = "geometry_msgs/msg/PoseStamped"
    times = [1_700_000_000 * 10**9 + round(time * 1e9) for time in of.time_s.tolist()]
    return [(time, maker.position(name, time, place)) for time, place in zip(times, of.place_m.tolist(), strict=True)]


def _rosbags(path: Path) -> Arrays:
    stamps, places = [], []
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            message: Any = reader.deserialize(data, connection.msgtype)
            stamp, place = message.header.stamp, message.pose.position
            stamps.append(stamp.sec * 10**9 + stamp.nanosec)
            places.append([place.x, place.y, place.z])
    return np.array(stamps), np.array(places)


def _xdf(path: Path) -> Arrays:
    streams, _ = pyxdf.load_xdf(str(path), dejitter_timestamps=False)
    return streams[0]["time_stamps"], streams[0]["time_series"]


def _pandas(time: int | None, first: int, unit_m: float = 1.0, **options: Any) -> Callable[[Path], Arrays]:
    """Times and places by their columns' numbers. Options are those with which pandas reads the file as it should."""

    def read(path: Path) -> Arrays:
        table = pd.read_csv(path, **options)
        times = np.arange(len(table)) if time is None else table.iloc[:, time].to_numpy()
        return times, table.iloc[:, first : first + 3].to_numpy() * unit_m

    return read


STOCK: Mapping[str, Callable[[Path], Arrays]] = {
    "generic.csv": _pandas(0, 1, 1e-3),
    "german.csv": _pandas(0, 1, sep=";", decimal=",", encoding="cp1252"),
    "phyphox.csv": _pandas(0, 1),
    "tum.txt": _pandas(0, 1, sep=r"\s+", comment="#", header=None),
    "euroc.csv": _pandas(0, 1),
    "motive.csv": _pandas(1, 6, 1e-3, skiprows=6),
    "qualisys.tsv": _pandas(1, 2, 1e-3, sep="\t", skiprows=7),
    "vicon.csv": _pandas(None, 2, 1e-3, skiprows=5, header=None, names=list("abcdefgh"), nrows=COUNT),
    "lsl.xdf": _xdf,
}
