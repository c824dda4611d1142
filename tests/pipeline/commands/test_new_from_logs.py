"""`steadyhand new` where a folder holds logs: streams, sessions, and the tables that are none."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pytest

from tests.conftest import real, write_session
from tests.pipeline.commands.new_study import AXES, New, assert_commented, new, settings, written
from tests.pipeline.helpers import Steadyhand

__all__ = ["new"]  # a fixture


def test_logs_give_streams_with_rates_noise_and_gravity(tmp_path: Path, new: New, steadyhand: Steadyhand) -> None:
    study = tmp_path / "study"
    for person in ("P01", "P02"):
        for condition in ("kinect", "fusion"):
            write_session(study / "logs" / f"{person}_{condition}.mcap")
    made = new(study, "--conditions", "kinect,fusion")
    assert made.code == 0
    assert "which would read 4 sessions and run raw, kalman, kalman_fusion and adaptive on each" in made.out
    assert_commented(study)
    found = settings(study)
    assert found["conditions"] == ["kinect", "fusion"]
    assert found["sessions"] == "logs/{participant}_{condition}.mcap"
    assert found["events"] == {"topic": "/events"}
    assert found["streams"]["tracker"]["topic"] == "/tracker/position"
    assert found["streams"]["imu"]["gravity_mm_s2"] == [0.0, -9806.65, 0.0]
    text = (study / "study.yaml").read_text(encoding="utf-8")
    assert "the tracker, 30 Hz; if it stamps on delivery, say stamp: arrival and latency_s" in text  # too short to see
    ran = steadyhand("compare", study)
    assert ran.code == 0
    assert {row["measure"] for row in steadyhand.results()["comparisons"]} == {
        "selection_mse_mm2",
        "trial_time_s",
        "completion_time_s",
    }


def test_real_logs_give_the_trackers_latency(tmp_path: Path, new: New) -> None:
    """Three recordings of phones in hand, whose tracker was simulated with 8 mm of noise, 0.1 s late."""
    study = tmp_path / "study"
    shutil.copytree(real("phone-in-hand"), study, ignore=shutil.ignore_patterns("study.yaml"))
    assert new(study).code == 0
    tracker = settings(study)["streams"]["tracker"]
    assert (tracker["stamp"], tracker["latency_s"]) == ("arrival", pytest.approx(0.1, abs=0.01))
    assert tracker["noise_sd_mm"] == pytest.approx(8, rel=0.1)


def test_a_folder_that_is_a_session_is_one(tmp_path: Path, new: New, steadyhand: Steadyhand) -> None:
    """Logs of one name in folders that tell participants and conditions apart, as recorders leave them."""
    study = tmp_path / "study"
    for person in ("P01", "P02"):
        for condition in ("kinect", "fusion"):
            write_session(study / "data" / f"{person}_{condition}" / "log.mcap")
    written(
        study, "measures.csv", "participant,condition,time\nP01,kinect,3\nP01,fusion,4\nP02,kinect,4\nP02,fusion,6\n"
    )
    made = new(study, "--conditions", "kinect,fusion")
    assert "4 logs: data/{participant}_{condition}\n" in made.out
    assert "measures.csv: read as the measures" in made.out
    assert steadyhand("compare", study).code == 0
    assert len({row["session"] for row in steadyhand.results()["quality"]}) == 4


def test_text_logs_of_a_session_are_no_tables_of_the_study(tmp_path: Path, new: New) -> None:
    study = tmp_path / "study"
    times = [1_700_000_000 + 0.01 * at for at in range(300)]
    tracker = "Time (s),x (m),y (m),z (m)\n" + "".join(f"{t:.3f},{0.1 * (t % 1):.4f},0,1\n" for t in times[::3])
    rows = (f"{round(1e9 * t)},{t - times[0]:.3f},0.2,9.8,0.1\n" for t in times)
    phone = "time,seconds_elapsed,z,y,x\n" + "".join(rows)
    for name in ("P01_a", "P01_b", "P02_a", "P02_b"):
        written(study / "data" / name, "tracker.csv", tracker)
        written(study / "data" / name, "Accelerometer.csv", phone)
    made = new(study)
    assert made.code == 0, made.err
    assert "4 logs: data/{participant}_{condition}\n" in made.out
    assert "Not used" not in made.out
    assert settings(study)["streams"]["tracker"]["topic"] == "tracker"


def test_phyphox_beside_motive_with_several_bodies(tmp_path: Path, new: New, steadyhand: Steadyhand) -> None:
    """A take is known by its bodies' names alone; estimators are told which body, as they take one tracker."""
    phone = '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)"\n'
    phone += "".join(f"{0.01 * at:.6E},{0.1 * (at % 7)},9.8,0.1\n" for at in range(300))
    for bodies in (("Hand",), ("Hand", "Head")):
        study = tmp_path / f"{len(bodies)}"
        columns = [
            (body, quantity, axis)
            for body in bodies
            for quantity in ("Rotation", "Position")
            for axis in AXES[quantity]
        ]
        head = [
            "Format Version,1.23,Take Name,T,Length Units,Millimeters",
            ",".join(["", "Name", *(column[0] for column in columns)]),
            ",".join(["", "", *(column[1] for column in columns)]),
            ",".join(["Frame", "Time (Seconds)", *(column[2] for column in columns)]),
        ]
        figures = ",".join(["0,0,0,1,{0:.3f},200,300"] * len(bodies))
        take = "\n".join([*head, *(f"{at},{at / 60:.4f},{figures.format(3.0 * (at % 50))}" for at in range(180))])
        for name in ("P01_a", "P01_b", "P02_a", "P02_b"):
            written(study / name, "Take 1.csv", take + "\n")
            written(study / name, "Raw Data.csv", phone)
        made = new(study)
        assert made.code == 0, made.err
        streams = settings(study)["streams"]
        assert sorted(stream["topic"] for stream in streams.values()) == sorted([*bodies, "Raw Data"])
        chosen = settings(study)["estimators"]["adaptive"].get("use")
        assert chosen == (None if len(bodies) == 1 else [next(iter(streams)), "imu"])
        assert steadyhand("compare", study).code == 0


def test_sensor_logger_beside_a_tracker_of_another_clock(tmp_path: Path, new: New, steadyhand: Steadyhand) -> None:
    """It counts since 1970, the tracker since its start: then the app's seconds since its own start are taken.

    Its TotalAcceleration is the one with gravity, and its Gravity is no position.
    """
    study = tmp_path / "study"
    times = [0.01 * at for at in range(400)]
    places = "Time (s),x (m),y (m),z (m)\n" + "".join(f"{t:.3f},{(t % 1) ** 2:.4f},0.1,1\n" for t in times[::3])
    rows = "".join(f"{1_700_000_000_000_000_000 + round(1e9 * t)},{t:.3f},0.2,9.8,0.1\n" for t in times)
    for name in ("P01_a", "P01_b", "P02_a", "P02_b"):
        written(study / "data" / name, "tracker.csv", places)
        for sensor in ("Accelerometer", "Gravity", "Gyroscope", "Magnetometer", "TotalAcceleration"):
            written(study / "data" / name, f"{sensor}.csv", "time,seconds_elapsed,z,y,x\n" + rows)
    made = new(study)
    assert made.code == 0, made.err
    streams = settings(study)["streams"]
    assert {name: stream["topic"] for name, stream in streams.items()} == {
        "imu": "TotalAcceleration",
        "tracker": "tracker",
    }
    assert streams["imu"]["fields"] == {"stamp": "seconds_elapsed"}
    assert steadyhand("compare", study).code == 0
    steadyhand.out = tmp_path / "tables"
    assert steadyhand("export", study, "--to", "parquet").code == 0
    imu = pd.read_parquet(steadyhand.out / "imu.parquet")
    assert len(imu) == 4 * 400 and imu["time_ns"].max() == 3_990_000_000


def test_a_folder_of_ros_2_is_a_session(tmp_path: Path, new: New) -> None:
    study = tmp_path / "study"
    for person in ("P01", "P02"):
        for condition in ("kinect", "fusion"):
            bag = study / "bags" / f"{person}_{condition}"
            write_session(bag / f"{person}_{condition}_0.mcap")
            written(bag, "metadata.yaml", "rosbag2_bagfile_information: {}\n")
    made = new(study, "--conditions", "kinect,fusion")
    assert made.code == 0, made.err
    assert settings(study)["sessions"] == "bags/{participant}_{condition}"
    assert "which would read 4 sessions" in made.out
