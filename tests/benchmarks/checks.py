"""How often a check fires on sessions without a fault, and what the checks cost: `python -m tests.benchmarks.checks`.

Sessions differ in rates, stamps, gravity, movement, turning and noise. A false alarm is as bad as a silence, so the
number of sessions in which anything is not green is the figure; it must be 0.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads of small products wait for each other, and count

import sys
import time

import numpy as np

from pipeline.sessions.checks import checked
from pipeline.sessions.checks.of_log import of_log
from tests.pipeline.sessions.checks.hand import Hand, session

AXES = ((0, 0, -1), (0, -1, 0), (-1, 0, 0), (0, 0, 1), (0, 1, 0), (0.6, 0, -0.8), (0.36, 0.48, -0.8))
SPANS = ((300, 250, 150), (400, 200, 0), (250, 0, 0), (50, 50, 50), (15, 15, 15), (2, 2, 2), (900, 700, 300))


def drawn(seed: int) -> Hand:
    """A session without a fault, drawn from the sorts there are."""
    random = np.random.default_rng([seed, 1])
    stamp = str(random.choice(["arrival", "measurement"]))
    return Hand(
        seed=seed,
        seconds=float(random.choice([8.0, 20.0, 45.0, 90.0])),
        tracker_hz=float(random.choice([15.0, 30.0, 60.0, 120.0])),
        imu_hz=float(random.choice([50.0, 90.0, 100.0, 200.0, 400.0])),
        latency_s=float(random.choice([0.0, 0.03, 0.1, 0.2])),
        stamp=stamp,
        noise_mm=float(random.choice([0.5, 2.0, 8.0, 15.0])),
        imu_noise_mm_s2=float(random.choice([10.0, 60.0, 150.0])),
        gravity=AXES[random.integers(len(AXES))],
        reach_s=float(random.choice([0.4, 0.8, 1.5])),
        span_mm=SPANS[random.integers(len(SPANS))],
        turn_rad=float(random.choice([0.0, 0.1, 0.4, 1.0])),
        tilt_error_rad=float(random.choice([0.0, 0.015, 0.03])),
        jitter_s=float(random.choice([0.0, 0.001, 0.004])),
        lost=float(random.choice([0.0, 0.01, 0.1])),
        oriented=bool(random.random() < 0.8),
    )


def main(count: int) -> None:
    """Print each alarm, their number, and the cost per minute of log."""
    fired, cost_s, length_s = 0, 0.0, 0.0
    for seed in range(count):
        hand = drawn(seed)
        log, study = session(hand)
        began = time.process_time()
        findings = checked(of_log(log, study))
        if seed:  # the first loads what others find loaded
            cost_s, length_s = cost_s + time.process_time() - began, length_s + hand.seconds
        alarms = [one for one in findings if one.status != "green"]
        fired += bool(alarms)
        for one in alarms:
            print(f"{seed}: {one.status} {one.check}: {one.found} ({one.expected}) {hand}")
    print(f"false alarms in {fired} of {count} sessions; {1e3 * cost_s / length_s * 60:.0f} ms per minute of log")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
