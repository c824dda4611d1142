"""`make bench`: the batch paths against the plain loop, reading a log, and the command's start."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fusion_core import ESTIMATORS, Samples, Sensor, replay_loop
from pipeline.formats import read_log
from pipeline.formats.log import Wanted
from tests.conftest import CLONE, session_messages, write_session

SESSION_S = 60.0
REPEATS = 3


def fastest(function: Callable[[], object], repeats: int = REPEATS) -> float:
    """Seconds of the fastest of some runs: the one the machine disturbed least."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return min(times)


def session() -> tuple[dict[str, Samples], np.ndarray]:
    """One minute of both sensors, and the instants to be shown at."""
    random = np.random.default_rng(0)
    frames, forces = np.arange(0, SESSION_S, 1 / 30), np.arange(0, SESSION_S, 1 / 90)
    samples = {
        "tracker": Samples(frames, frames + 0.1, random.normal(0, 8, (len(frames), 3))),
        "imu": Samples(forces, forces, random.normal(0, 100, (len(forces), 3))),
    }
    return samples, forces


def estimators() -> None:
    """Samples a second of each estimator's replay, and how much faster it is than one update at a time."""
    sensors = {"tracker": Sensor("position", 8.0, 0.1), "imu": Sensor("acceleration", 100.0)}
    samples, times = session()
    count = sum(len(stream) for stream in samples.values())
    print(f"Replay of one session of {SESSION_S:.0f} s ({count} samples)")
    print(f"  {'estimator':<18}{'samples/s':>12}{'loop':>12}{'ratio':>8}")
    for name, kind in ESTIMATORS.items():
        estimator = kind(sensors)
        estimator.replay(samples, times[:50])  # compiles
        batch = fastest(lambda e=estimator: e.replay(samples, times))  # type: ignore[misc]
        loop = fastest(lambda e=estimator: replay_loop(e, samples, times), 1)  # type: ignore[misc]
        print(f"  {name:<18}{count / batch:>12,.0f}{count / loop:>12,.0f}{loop / batch:>8.1f}")


def reading() -> None:
    """Seconds to read one session's log."""
    wanted = [Wanted("/tracker/position", "position"), Wanted("/phone/imu", "acceleration")]
    with tempfile.TemporaryDirectory() as folder:
        path = write_session(Path(folder) / "a.mcap", session_messages(SESSION_S))
        print(f"Reading that session's log: {1000 * fastest(lambda: read_log(path, wanted)):.0f} ms")


def starting() -> None:
    """Seconds until the command answers, and until a second report of an unchanged study is done."""
    command = [sys.executable, "-m", "pipeline"]
    report = [*command, "report", str(CLONE / "studies" / "feng2016"), "--jobs", "1"]

    def run(words: list[str]) -> float:
        return fastest(lambda: subprocess.run(words, capture_output=True, check=True, cwd=CLONE))

    print(f"steadyhand --help: {run([*command, '--help']):.2f} s")
    with tempfile.TemporaryDirectory() as folder:
        report += ["--out", f"{folder}/out", "--cache", f"{folder}/cache"]
        first = fastest(lambda: subprocess.run(report, capture_output=True, check=True, cwd=CLONE), 1)
        print(f"report of feng2016: {first:.2f} s; again, unchanged: {run(report):.2f} s")


if __name__ == "__main__":
    estimators()
    reading()
    starting()
