"""`make bench`: estimators beside other libraries and a plain loop, reading logs, the start, archives, error rates."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fusion_core import ESTIMATORS, Estimator, FusionAdaptive, FusionKalman, Samples, Sensor, WindowGP, replay_loop
from tests.benchmarks import archive, coverage, peers
from tests.benchmarks.error_rates import error_rates
from tests.benchmarks.live.__main__ import latency as live_latency
from tests.benchmarks.people import people
from tests.benchmarks.reading import reading
from tests.benchmarks.recorders import recorders
from tests.benchmarks.stress import stress
from tests.benchmarks.timing import fastest
from tests.conftest import CLONE

SESSION_S = 60.0


def session() -> tuple[dict[str, Samples], np.ndarray]:
    """One minute of both sensors, and the instants to be shown at."""
    random = np.random.default_rng(0)
    frames, forces = (np.round(np.arange(0, SESSION_S, 1 / rate), 9) for rate in (30, 90))  # stamps are in ns
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
    print(f"Replay of one session of {SESSION_S:.0f} s ({count} samples, three axes)")
    print(f"  {'estimator':<18}{'samples/s':>12}{'loop':>12}{'ratio':>8}")
    for name, kind in ESTIMATORS.items():
        estimator = kind(sensors)
        estimator.replay(samples, times[:50])  # compiles, as the next does
        replay_loop(estimator, samples, times[:50])
        batch = fastest(lambda e=estimator: e.replay(samples, times))  # type: ignore[misc]
        loop = fastest(lambda e=estimator: replay_loop(e, samples, times), 1)  # type: ignore[misc]
        print(f"  {name:<18}{count / batch:>12,.0f}{count / loop:>12,.0f}{loop / batch:>8.1f}")


RATED = {
    "tracker": Sensor("position", 8.0, 0.1, rate_hz=30.0),
    "imu": Sensor("acceleration", 100.0, rate_hz=90.0),
}
OURS: dict[str, Estimator] = {
    "window_gp, regular path": WindowGP(RATED),
    "window_gp, event time": WindowGP(RATED, path="event_time"),
    "fusion_kalman, fixed gain": FusionKalman(
        RATED, bias_frame="tracker", gate_sd=0.0, adaptation=0.0, path="fixed_gain"
    ),
    "fusion_adaptive": FusionAdaptive(RATED),
    "fusion_kalman, event time, body-frame bias": FusionKalman(RATED),
}


def beside_others() -> None:
    """The same recording through other libraries, in one run; what is missing is said."""
    samples, times = session()
    count = sum(len(stream) for stream in samples.values())
    runs: dict[str, Callable[[], object]] = {
        name: (lambda e=estimator: e.replay(samples, times))  # type: ignore[misc]
        for name, estimator in OURS.items()
    }
    in_order = {**samples, "tracker": replace(samples["tracker"], arrival=samples["tracker"].time)}
    runs["the same, no frame late, as for filterpy"] = lambda: OURS[next(reversed(OURS))].replay(in_order, times)
    runs["plain NumPy FIR, fixed weights"] = peers.numpy_fir(samples)
    runs["a dense solve for every window"] = peers.dense_windows(samples, times)
    for name in ("filterpy", "simdkalman", "statsmodels"):
        try:
            runs[name] = getattr(peers, name)(samples)
        except ImportError:
            print(f"  ({name} is not installed; `make bench` installs it)")
    speed = {}
    for name, run in runs.items():
        run()  # compiles
        speed[name] = count / fastest(run)
    print("Beside others, the same recording, one thread, samples/s and times filterpy")
    for name, value in speed.items():
        ratio = f"{value / speed['filterpy']:>9.1f} x" if "filterpy" in speed else ""
        print(f"  {name:<44}{value:>14,.0f}{ratio}")


def many_sessions(sessions: int = 1000) -> None:
    """A thousand sessions, one after the other: does anything pile up?"""
    samples, times = session()
    count = sum(len(stream) for stream in samples.values())
    print(f"{sessions} sessions of {SESSION_S:.0f} s, samples/s")
    for name, estimator in OURS.items():
        number = sessions if "regular" in name or "fixed" in name else sessions // 50
        began = time.perf_counter()
        for _ in range(number):
            estimator.replay(samples, times)
        print(f"  {name:<44}{count * number / (time.perf_counter() - began):>14,.0f}   ({number} sessions)")


def streaming() -> None:
    """One reading at a time, as a live session does: half and 99 % of steps take no longer."""
    samples, _ = session()
    readings = sorted(
        ((name, stream[index]) for name, stream in samples.items() for index in range(len(stream))),
        key=lambda reading: reading[1].arrival,
    )
    print("A live step (update and predict), microseconds: median, 99th percentile")
    for name, estimator in OURS.items():
        state, taken = estimator.start(), []
        for sensor, sample in readings:
            began = time.perf_counter()
            state = estimator.update(state, sensor, sample)
            estimator.predict(state, sample.arrival)
            taken.append(time.perf_counter() - began)
        half, most = np.percentile(1e6 * np.array(taken[300:]), [50, 99])
        print(f"  {name:<44}{half:>10.1f}{most:>10.1f}")


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
    beside_others()
    many_sessions()
    streaming()
    reading(SESSION_S)
    recorders()
    starting()
    people()
    coverage.rank_biserial()
    coverage.errors_and_counts()
    archive.measure(archive.SMALL)
    error_rates()
    stress()
    live_latency()
