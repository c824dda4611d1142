"""Tracker by UDP, the phone's own sensors, and fingers: two tasks from the first reading to the report."""

from __future__ import annotations

import json
import math
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.browser.chromium import Tab, tab
from tests.browser.live.acts import is_seen, text, touch, value, wait_for
from tests.browser.live.server import until
from tests.browser.live.whole_study import Operator, opened_as, recorder
from tests.conftest import CLONE

STUDY = """
title: By sensors
data_origin: simulated
conditions: [quokka, wombat]
participants: participants.csv
sessions: data/{participant}_{condition}.mcap
axes: [x, y]
streams:
  tracker: {topic: /tracker/position, kind: position, noise_sd_mm: 2, rate_hz: 30}
  imu: {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0], noise_sd_mm_s2: 100, rate_hz: 60}
  display: {topic: /display/position, kind: display}
events: {topic: /events}
display: {px_per_mm: 10, unit: px}
estimators:
  jackdaw: {type: position_kalman}
  magpie: {type: fusion_kalman}
shown: {quokka: jackdaw, wombat: magpie}
task:
  window_mm: [85.4, 48]
  path_mm: [[-100, 500], [100, 600]]
  targets_mm: [[-80, 500], [0, 560], [90, 600]]
comparisons: [{measure: selection_mse_mm2, test: t_paired}]
recording:
  countdown_s: 1
  senders: {tracker: {udp_json: {port: PORT}, unit: mm}, imu: {phone: motion}}
"""
_TARGETS_MM = ((-80.0, 500.0), (0.0, 560.0), (90.0, 600.0))
_ERROR_MM = (6.0, -3.0)  # how far beside each target the hand rests
_SWEEPS = ((0.11, 0.7), (0.05, 1.1), (0.04, 0.9))  # of x, y, z: how far in m, and Hz
_GRAVITY_M_S2 = 9.80665
_STEP_S = 1e-3
_PATIENCE_S = 90.0
Place = tuple[float, float, float]


class Hand:
    """A hand whose place in m is a function of time; a thread says to the recorder what a tracker sees of it."""

    def __init__(self, key: str, port: int) -> None:
        self.at: Callable[[float], Place] = lambda _: (-0.08, 0.5, 1.2)
        self._known, self._ends = (key, port), threading.Event()
        self._thread = threading.Thread(target=self._track, daemon=True)

    def __enter__(self) -> Hand:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()

    def _track(self) -> None:
        key, port = self._known
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            number = 0
            while not self._ends.wait(1 / 30):
                now = time.time()
                position = [1e3 * part for part in self.at(now)]
                reading = {"key": key, "stream": "tracker", "seq": number, "t": now, "position": position}
                sender.sendto(json.dumps(reading).encode(), ("127.0.0.1", port))
                number += 1

    def feels(self, now: float) -> Place:
        """The specific force of a phone that lies level, its x along the tracker's: its z is up, the tracker's y is."""
        before, here, after = (self.at(now + step) for step in (-_STEP_S, 0.0, _STEP_S))
        x, y, z = ((a - 2 * b + c) / _STEP_S**2 for a, b, c in zip(before, here, after, strict=True))
        return x, -z, y + _GRAVITY_M_S2

    def sweeps(self) -> None:
        """To and fro from where it is, from now on."""
        start, began = self.at(time.time()), time.time()

        def at(now: float) -> Place:
            since = max(now - began, 0.0)
            moved = [far * (1 - math.cos(2 * math.pi * pace * since)) for far, pace in _SWEEPS]
            return start[0] + moved[0], start[1] + moved[1], start[2] + moved[2]

        self.at = at

    def goes_to(self, place: Place, seconds: float) -> None:
        """There, by the least jerk (Flash and Hogan 1985)."""
        start, began = self.at(time.time()), time.time()

        def at(now: float) -> Place:
            part = min(max((now - began) / seconds, 0.0), 1.0)
            share = part**3 * (10 - 15 * part + 6 * part**2)
            x, y, z = (a + share * (b - a) for a, b in zip(start, place, strict=True))
            return x, y, z

        self.at = at


def _reads(phone: Tab, force: Place) -> None:
    reading = {"xyz": dict(zip("xyz", force, strict=True))}
    phone.call("Emulation.setSensorOverrideReadings", type="accelerometer", reading=reading)


def _sensors(phone: Tab) -> None:
    for kind in ("accelerometer", "linear-acceleration", "gyroscope", "relative-orientation"):
        phone.call("Emulation.setSensorOverrideEnabled", enabled=True, type=kind)
    for kind in ("linear-acceleration", "gyroscope"):
        reading = {"xyz": {"x": 0.0, "y": 0.0, "z": 0.0}}
        phone.call("Emulation.setSensorOverrideReadings", type=kind, reading=reading)
    level = {"quaternion": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    phone.call("Emulation.setSensorOverrideReadings", type="relative-orientation", reading=level)
    _reads(phone, (0.0, 0.0, _GRAVITY_M_S2))


def _moves(phone: Tab, hand: Hand, seconds: float) -> None:
    """For so long the phone feels what the hand does."""
    ends = time.time() + seconds
    while time.time() < ends:
        _reads(phone, hand.feels(time.time()))
        time.sleep(0.008)


def _finds_heading(operator: Operator, phone: Tab, hand: Hand) -> None:
    _moves(phone, hand, 2.0)  # at rest: which way is up
    hand.sweeps()
    deadline = time.monotonic() + _PATIENCE_S
    while "Connected." not in text(operator.page, "#light-list") or "not known yet: hold" in text(
        operator.page, "#light-list"
    ):
        assert time.monotonic() < deadline, text(operator.page, "#light-list")
        _moves(phone, hand, 1.0)
    _moves(phone, hand, 2.0)


def _task(operator: Operator, phone: Tab, hand: Hand) -> None:
    hand.goes_to((-0.08, 0.5, 1.2), 1.0)
    _moves(phone, hand, 1.5)
    operator.start()
    until(lambda: not value(phone, "#select", "it.disabled"), "it runs", _PATIENCE_S)
    for x, y in _TARGETS_MM:
        hand.goes_to(((x + _ERROR_MM[0]) / 1e3, (y + _ERROR_MM[1]) / 1e3, 1.2), 1.0)
        _moves(phone, hand, 2.5)
        touch(phone, "#select")
        time.sleep(0.3)
    until(lambda: not operator.runs(), "the task is over", _PATIENCE_S)


def plays_by_sensors() -> None:
    """What the hand did beside each target is what the report says, by a tracker's datagrams and a phone's motion."""
    with tempfile.TemporaryDirectory() as made:
        port = free_udp_port()
        study = Path(made) / "sensors"
        study.mkdir()
        (study / "study.yaml").write_text(STUDY.replace("PORT", str(port)), encoding="utf-8")
        with recorder(study) as words, tab() as opened:
            address, key = words.group(1), re.search(r'"key": "([^"]+)"', words.string)
            assert key is not None
            operator = Operator(opened, address)
            with Hand(key[1], port) as hand:
                phone = opened_as(operator, "phone", 854, 480, before=_sensors)
                wait_for(phone, "#start")
                touch(phone, "#start")
                until(lambda: "No phone" not in text(opened, "#light-list"), "the phone is connected")
                _finds_heading(operator, phone, hand)
                said = ""
                for _ in range(2):
                    _task(operator, phone, hand)
                    said = operator.agreement(unlike=said)
                    assert "⁻" in said or "at most 0 mm" in said
                assert not is_seen(operator.page, "#reason")
        _comes_out(study)


def free_udp_port() -> int:
    """A port that nobody listens on."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def _comes_out(study: Path) -> None:
    out = study / "out"
    where = ["--out", str(out), "--cache", str(out / "cache")]
    command = [sys.executable, "-m", "pipeline", "compare", str(study), *where]
    ran = subprocess.run(command, cwd=CLONE, capture_output=True, text=True, check=False)
    assert ran.returncode in (0, 1), ran.stderr
    results: dict[str, Any] = json.loads(next(out.rglob("results.json")).read_text(encoding="utf-8"))
    assert [row["max_mm"] <= 1e-9 for row in results["replay_agreement"]] == [True, True]
    squared = _ERROR_MM[0] ** 2 + _ERROR_MM[1] ** 2
    for row in results["descriptives"]:
        if row["measure"] == "selection_mse_mm2":
            assert math.isclose(row["mean"], squared, rel_tol=0.3), (row["condition"], row["mean"])
    read = {(row["session"], row["stream"]): row["messages_read"] for row in results["quality"]}
    assert read["P01_wombat", "imu"] > 200
    assert len(results["recorders"]) == 2
