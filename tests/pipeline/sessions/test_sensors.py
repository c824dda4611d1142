"""Sensors beyond a tracker and a phone, mounting, fitting, and a study without a reference: all from study.yaml."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from fusion_core.likelihood import Fitted
from pipeline.sessions.fitting import Parameter
from pipeline.sessions.logs.mcap import Message
from tests.conftest import EPOCH_NS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand, run

Folder = Callable[..., Path]
SETTINGS = """
title: T
conditions: [a]
sessions: data/{participant}_{condition}.mcap
streams:
  tracker:   {topic: /tracker/position, kind: position, stamp: arrival, latency_s: 0.1, noise_sd_mm: 8}
  imu:       {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0], noise_sd_mm_s2: 100}
  second:    {topic: /second, kind: position, noise_sd_mm: 4}
  flow:      {topic: /flow, kind: velocity, noise_sd_mm_s: 10, axes: [x]}
  moved:     {topic: /moved, kind: linear, noise_sd: 1, operator: [{weight: 1}, {weight: -1, at_s: -0.1}]}
  reference: {topic: /reference/position, kind: reference}
estimators:
  alone:    {type: fusion_kalman, use: [tracker]}
  phone:    {type: fusion_kalman, use: [tracker, imu]}
  all:      {type: fusion_kalman, use: [tracker, imu, second, flow]}
  window:   {type: window_gp, use: [tracker]}
  operator: {type: window_gp, use: [tracker, moved]}
"""


def more_sensors(seconds: float = 6.0) -> list[Message]:
    """A session with a second tracker, an optical flow of x, and a displacement over 0.1 s, of 40 Hz."""
    random = np.random.default_rng(3)
    messages = [message for message in session_messages(seconds) if message.topic != "/events"]
    for index in range(4, int(seconds * 40)):
        time = index / 40
        at = EPOCH_NS + round(time * 1e9)
        here = np.array([100 * np.sin(2 * time), 500.0, 0.0])
        before = np.array([100 * np.sin(2 * (time - 0.1)), 500.0, 0.0])
        speed = np.array([200 * np.cos(2 * time), 0.0, 0.0])
        values = {
            "/second": here + random.normal(0, 4, 3),
            "/flow": speed + random.normal(0, 10, 3),
            "/moved": here - before + random.normal(0, 1, 3),
        }
        messages += [Message(topic, "position", at, at, value / 1000) for topic, value in values.items()]
    return messages


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_more_sensors_are_a_few_lines_of_the_study(folder: Folder, steadyhand: Steadyhand) -> None:
    root = folder(SETTINGS)
    write_session(root / "data" / "P1_a.mcap", more_sensors())
    ran = steadyhand("report", root)
    assert ran.code == 0, ran.err
    error = {row["estimator"]: row["rmse_mm"] for row in steadyhand.results()["accuracy"]}
    assert error["phone"] < 0.8 * error["alone"]
    assert error["all"] < 0.7 * error["phone"]
    assert error["operator"] < 0.7 * error["window"]
    streams = {row["stream"] for row in steadyhand.results()["quality"]}
    assert {"second", "flow", "moved"} <= streams


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("axes: [x]", "axes: [w]", '"streams.flow.axes.0"'),
        ("noise_sd_mm_s: 10, ", "", '"streams.flow.noise_sd_mm_s" is missing'),
        ("derivative: 0", "derivative: 3", ""),
        ("[tracker, moved]}", "[tracker, moved], window: 0}", "estimators.operator: window must be 1 or more"),
        ("{type: fusion_kalman, use: [tracker]}", "{type: fusion_kalman, use: [flow]}", "needs a position sensor"),
        ("[tracker, imu, second, flow]}", "[tracker, moved]}", "only window_gp takes an operator with a term at"),
        ("noise_sd_mm_s2: 100}", "noise_sd_mm_s2: 100, calibrate_s: 5, lever_arm_mm: [1, 2, 3]}", "keep one"),
    ],
)
def test_what_does_not_fit_is_named(old: str, new: str, message: str, folder: Folder, steadyhand: Steadyhand) -> None:
    root = folder(SETTINGS.replace(old, new))
    write_session(root / "data" / "P1_a.mcap", more_sensors(2.0))
    if not message:
        return
    ran = steadyhand("compare", root)
    assert ran.code == 2
    assert message in ran.err


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_without_a_reference_all_readings_smoothed_stand_in_and_the_report_says_so(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    settings = yaml.safe_load(SETTINGS)
    del settings["streams"]["reference"]
    root = folder(yaml.safe_dump(settings, sort_keys=False))
    write_session(root / "data" / "P1_a.mcap", more_sensors())
    ran = steadyhand("report", root)
    assert ran.code == 0
    rows = {row["estimator"]: row for row in steadyhand.results()["accuracy"]}
    assert {row["reference"] for row in rows.values()} == {"smoothed readings"}
    assert rows["all"]["rmse_mm"] < rows["alone"]["rmse_mm"]
    page = prose((steadyhand.out / "report.html").read_text(encoding="utf-8"))
    assert "Absolute error and lag cannot be known: no reference was recorded." in page.partition("careful about")[0]
    bare = re.sub("[Nn]o reference was recorded|references.bib|Key Reference", "", page + ran.err)
    assert re.findall("[^.]*(?:[Rr]eference|closest|[Ss]mallest|sits to the left)[^.]*", bare) == []
    assert "all: " in ran.out and "mm RMS from the smoothed readings" in ran.out


def prose(page: str) -> str:
    """What of a page people read."""
    text = re.sub("<[^>]+>", " ", re.sub(r"(?s)<(style|script)\b.*?</\1>", "", page))
    return re.sub(r"\s+", " ", html.unescape(text))


def swaying(seconds: float = 40.0, arm_mm: tuple[float, float, float] = (40.0, 0.0, -20.0)) -> list[Message]:
    """A hand that sways and turns, whose tracker sees a point beside the phone's accelerometer; z points up."""
    from scipy.spatial.transform import Rotation

    random = np.random.default_rng(6)

    def turned(time: np.ndarray) -> Rotation:
        angles = np.stack([0.4 * np.sin(1.3 * time), 0.5 * np.sin(1.7 * time), 0.6 * np.sin(0.9 * time)], axis=1)
        return Rotation.from_euler("xyz", angles)

    rate, size = np.array([5.0, 4.0, 3.0]), np.array([80.0, 100.0, 60.0])

    def seen(time: np.ndarray) -> np.ndarray:
        return np.asarray(size * np.sin(time[:, None] * rate) + turned(time).apply(arm_mm))

    frames, forces = np.arange(0, seconds, 1 / 30), np.arange(0, seconds, 1 / 90)
    found = []
    for topic, value in (("/tracker/position", seen(frames) + random.normal(0, 8, (len(frames), 3))),):
        for time, one in zip(frames, value, strict=True):
            at = EPOCH_NS + round((time + 0.1) * 1e9)
            found.append(Message(topic, "position", at, at, one / 1000))
    felt = -size * rate**2 * np.sin(forces[:, None] * rate) + np.array([0, 0, 9806.65])
    body = turned(forces).inv().apply(felt) / 1000 + random.normal(0, 0.05, (len(forces), 3))
    step = (turned(forces).inv() * turned(forces + 1e-3)).as_rotvec() / 1e-3
    for time, force, rate_rad, quaternion in zip(forces, body, step, turned(forces).as_quat(), strict=True):
        at = EPOCH_NS + round(time * 1e9)
        found.append(Message("/phone/imu", "acceleration", at, at, np.concatenate([force, rate_rad, quaternion])))
    for time, one in zip(forces, seen(forces), strict=True):
        at = EPOCH_NS + round(time * 1e9)
        found.append(Message("/reference/position", "position", at, at, one / 1000))
    return found


SWAYING = """
conditions: [a]
sessions: data/{participant}_{condition}.mcap
streams:
  tracker:   {topic: /tracker/position, kind: position, stamp: arrival, latency_s: 0.1, noise_sd_mm: 8}
  imu:       {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, 0, -9806.65], noise_sd_mm_s2: 100}
  reference: {topic: /reference/position, kind: reference}
estimators:
  fusion: {type: fusion_kalman}
  window: {type: window_gp}
"""


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_a_lever_arm_is_learned_or_given_and_either_helps(folder: Folder, steadyhand: Steadyhand) -> None:
    found, messages = {}, swaying(25.0)
    for name, more in (
        ("plain", ""),
        ("learned", ", calibrate_s: 10"),
        ("given", ", lever_arm_mm: [40, 0, -20]"),
    ):
        root = folder(SWAYING.replace("noise_sd_mm_s2: 100", f"noise_sd_mm_s2: 100{more}"), name)
        write_session(root / "data" / "P1_a.mcap", messages)
        assert steadyhand("report" if name == "learned" else "compare", root).code == 0
        rows = {row["estimator"]: row["rmse_mm"] for row in steadyhand.results()["accuracy"]}
        found[name] = rows["fusion"]
        if name == "learned":
            (phone,) = steadyhand.results()["phones"]
            assert phone["lever_arm_x_mm"] == pytest.approx(40, abs=3 * phone["lever_arm_sd_x_mm"])
            assert "Lever arm x, y, z (mm)" in (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert found["given"] < 0.9 * found["plain"]
    assert found["learned"] < found["plain"]


def test_fit_prints_what_the_recordings_say(
    folder: Folder, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The block is YAML that can be pasted; what the data cannot tell is said."""
    stated = SWAYING.replace("latency_s: 0.1, noise_sd_mm: 8", "latency_s: 0.08, noise_sd_mm: 12")
    root = folder(stated.replace("noise_sd_mm_s2: 100", "noise_sd_mm_s2: 100, lever_arm_mm: [0, 0, 0]"))
    write_session(root / "data" / "P1_a.mcap", swaying(30.0, (0.0, 0.0, 0.0)))
    ran = run(capsys, monkeypatch, "fit", root, "--first", "20", "--cache", tmp_path / "cache", "--jobs", "1")
    assert ran.code == 0, ran.err
    block = yaml.safe_load(ran.out)
    assert block["streams"]["tracker"]["noise_sd_mm"] == pytest.approx(8, rel=0.1)
    assert block["streams"]["tracker"]["latency_s"] == pytest.approx(0.1, abs=0.006)
    assert "# RMSE in mm on the rest of each session, with study.yaml's values -> with the fitted ones:" in ran.out
    lines = [line for line in ran.out.splitlines() if "P1_a  fusion:" in line]
    before, after = (float(part) for part in lines[0].split(": ")[1].split(" -> "))
    assert after < before
    assert "which agrees with [" in ran.out
    assert "With stamp: arrival this is latency_s; with stamp: measurement it should be 0" in ran.out
    assert "fitting: 5 steps" in ran.err  # the sensors, one session's alone, two estimators, one session's score
    assert "tracker.latency_s: or it is right as stated and imu is stamped 20 ms too early" in ran.out


def test_fit_holds_gravity_against_study_yaml_and_takes_no_bound(
    folder: Folder, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    wrong = SWAYING.replace("[0, 0, -9806.65]", "[0, 0, 9806.65]")
    assert wrong != SWAYING
    root = folder(wrong)
    write_session(root / "data" / "P1_a.mcap", swaying(8.0, (0.0, 0.0, 0.0)))
    ran = run(capsys, monkeypatch, "fit", root, "--first", "6", "--cache", tmp_path / "cache", "--jobs", "1")
    assert "gravity, orientation or accelerometer is wrong" in ran.out
    assert "# P1_a: red, mean acceleration: imu: " in ran.out
    off = Parameter("streams.tracker", "noise_sd_mm", 8.0, Fitted(0.001, 0.0009, 0.0011, True))
    assert off.at_bound
    assert not off.usable
    lost = Parameter("streams.tracker", "noise_sd_mm", 8.0, Fitted(9.0, 8.5, 9.5, True), -0.1)
    assert lost.worse
    assert not lost.usable


def test_fit_without_logs_says_so(
    folder: Folder, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    root = folder(
        "conditions: [a, b]\nmeasures: measures.csv\n",
        **{"measures__csv": "participant,condition,measure,value\nP1,a,m,1\nP1,b,m,2\n"},
    )
    ran = run(capsys, monkeypatch, "fit", root, "--cache", tmp_path / "cache", "--jobs", "1")
    assert ran.code == 2
    assert "has no session to fit to" in ran.err
