"""Simulated participants: how fast they are, whether chance alone makes a difference, and pointing under lag.

`python -m tests.benchmarks.people` alone, or as a part of `make bench`.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from scipy.stats import binomtest, ttest_rel

from pipeline.simulation.session import Setting, simulate
from pipeline.study.folder import load_study
from pipeline.study.settings import Study
from tests.conftest import CLONE

STUDIES, PEOPLE = 200, 8
LAGS_S = (0.0083, 0.025, 0.075, 0.225)
MACKENZIE_WARE_S = (0.911, 0.934, 1.059, 1.493)  # their Table 1: a movement, by lag

_STREAMS: dict[str, dict[str, Any]] = {
    "tracker": {"topic": "/t", "kind": "position", "stamp": "arrival", "latency_s": 0.1, "rate_hz": 30},
    "imu": {"topic": "/i", "kind": "acceleration", "gravity_mm_s2": [0, -9806.65, 0], "rate_hz": 90},
}


def _study(task: dict[str, Any], streams: dict[str, Any], **simulation: Any) -> Study:
    return Study.model_validate(
        {
            "title": "people",
            "conditions": ["first", "second"],
            "sessions": "data/{participant}_{condition}.mcap",
            "axes": ["x", "y"],
            "streams": streams,
            "estimators": {"kinect": {"type": "position_kalman"}, "raw": {"type": "raw"}},
            "shown": {"first": "kinect", "second": "kinect"},
            "task": task,
            "simulation": {"kind": "selection", "seed": 0, "participants": PEOPLE, "longest_s": 60, **simulation},
        }
    )


def speed() -> None:
    """Simulated seconds a second of one core, sensors and estimator included."""
    setting = Setting(load_study(CLONE / "studies" / "peephole", to_be_made=True), "studies/peephole")
    print("Simulated participants, the bundled study: real time a core")
    for condition in setting.study.conditions:
        simulate(setting, "P01", condition)  # compiles
        began = time.process_time()
        seconds = sum(simulate(setting, f"P{number:02d}", condition).ends_s for number in range(1, 7))
        print(f"  {condition:<10}{seconds / (time.process_time() - began):>10,.0f} x")


def false_positives() -> None:
    """The same estimator in both conditions: how often a paired t test of completion times finds a difference."""
    task = {"targets_mm": [[0, 500], [100, 500], [0, 450], [60, 560]]}
    positives = 0
    for seed in range(STUDIES):
        setting = Setting(_study(task, _STREAMS, seed=seed), "bench")
        times = [
            [simulate(setting, f"P{number}", condition).completion_time_s for number in range(PEOPLE)]
            for condition in ("first", "second")
        ]
        positives += bool(ttest_rel(times[0], times[1]).pvalue < 0.05)
    low, high = binomtest(positives, STUDIES).proportion_ci(0.95)
    verdict = "with" if low <= 0.05 <= high else "WITHOUT"
    print(
        f"Same estimator in both conditions, {STUDIES} studies of {PEOPLE}: false positives {positives / STUDIES:.3f},"
    )
    print(f"  95 % interval [{low:.3f}, {high:.3f}], {verdict} .05 in it")


def pointing_under_lag() -> None:
    """Movement times behind four lags beside MacKenzie and Ware's (1993)."""
    ring = {"rings": [{"centre_mm": [0, 500], "diameter_mm": 75, "targets": 13, "target_diameter_mm": 4}]}
    print("Pointing behind a lag: time a movement, and beside the least lag; MacKenzie and Ware (1993)")
    first = 0.0
    for lag_s, theirs_s in zip(LAGS_S, MACKENZIE_WARE_S, strict=True):
        streams = {
            "tracker": {**_STREAMS["tracker"], "latency_s": lag_s, "noise_sd_mm": 0.01, "rate_hz": 125},
            "imu": {**_STREAMS["imu"], "rate_hz": 125},
        }
        study = _study(ring, streams, instruments={"tracker_rate_hz": 125, "imu_rate_hz": 125})
        setting = Setting(study.model_copy(update={"shown": {"first": "raw", "second": "raw"}}), "bench")
        outcomes = [simulate(setting, f"P{number}", "first") for number in range(24)]
        ours_s = float(np.mean([np.diff(outcome.taps[:, 0]).mean() for outcome in outcomes]))
        first = first or ours_s
        more, theirs = ours_s - first, theirs_s - MACKENZIE_WARE_S[0]
        print(f"  {1000 * lag_s:>5.0f} ms {ours_s:>7.2f} s {more:>+7.2f} s   theirs {theirs_s:.2f} s {theirs:>+6.2f} s")


def people() -> None:
    """All of them."""
    speed()
    false_positives()
    pointing_under_lag()


if __name__ == "__main__":
    people()
