"""How near fusion comes to the floor: simulated motion with the paper's noise, many runs, and how fast it settles.

`python -m tests.benchmarks.floor FILE.svg` prints the table and draws the settling.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fusion_core import Estimator, FusionKalman, Samples, Sensor, WindowGP
from pipeline.statistics.arrays import FloatArray

RUNS = 200
LENGTH_S, MOVES_AT_S = 12.0, 8.0
FLOOR_MM = 3.40  # an axis, over all accelerations: the posterior SD with all the past
SENSORS = {"tracker": Sensor("position", 8.0, 0.1, 1), "imu": Sensor("acceleration", 100.0, 0.0, 1)}
Motion = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def reach(time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Position and acceleration of a minimum-jerk reach of 200 mm in 0.9 s, from 8 s on (Flash and Hogan 1985)."""
    length, distance = 0.9, 200.0
    u = np.clip((time - MOVES_AT_S) / length, 0.0, 1.0)
    position = distance * (10 * u**3 - 15 * u**4 + 6 * u**5)
    return position, distance / length**2 * (60 * u - 180 * u**2 + 120 * u**3)


def sine(time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Position and acceleration of a sine of 2 Hz and 50 mm, from 8 s on.

    It sets off at full speed, so the acceleration is that averaged over a reading's interval, which feels the jolt.
    """
    step = 1 / 90
    before, here, after = (
        50.0 * np.sin(4 * np.pi * np.maximum(time + by - MOVES_AT_S, 0.0)) for by in (-step, 0, step)
    )
    return here, (after - 2 * here + before) / step**2


@dataclass(frozen=True)
class Trouble:
    """What goes wrong in a run: a bias, stray frames of 150 mm, jitter of the stamps' times, lost frames."""

    bias_mm_s2: float = 0.0
    outliers: float = 0.0
    jitter_s: float = 0.0
    dropped: float = 0.0


def run(motion: Motion, trouble: Trouble, seed: int) -> tuple[dict[str, Samples], FloatArray, FloatArray]:
    """One recording, its instants (every acceleration) and the true positions at them."""
    random = np.random.default_rng(seed)
    frames, forces = np.arange(0, LENGTH_S, 1 / 30), np.arange(0, LENGTH_S, 1 / 90)
    frames = np.sort(frames + random.normal(0, trouble.jitter_s, len(frames)))
    frames = frames[random.random(len(frames)) >= trouble.dropped]
    seen = motion(frames)[0] + random.normal(0, 8.0, len(frames))
    stray = random.random(len(frames)) < trouble.outliers
    seen[stray] += random.normal(0, 150.0, int(stray.sum()))
    felt = motion(forces)[1] + trouble.bias_mm_s2 + random.normal(0, 100.0, len(forces))
    samples = {
        "tracker": Samples(frames, frames + 0.1, seen[:, None]),
        "imu": Samples(forces, forces, felt[:, None]),
    }
    return samples, forces, motion(forces)[0]


def errors(estimator: Estimator, motion: Motion, trouble: Trouble, runs: int = RUNS) -> FloatArray:
    """Errors in mm at every acceleration, (runs, n)."""
    found = []
    for seed in range(runs):
        samples, times, truth = run(motion, trouble, seed)
        found.append(estimator.replay(samples, times).mean[:, 0] - truth)
    return np.array(found)


def scored(error: FloatArray) -> float:
    """Root mean square over the last 4 s of all runs."""
    return float(np.sqrt(np.mean(error[:, int(MOVES_AT_S * 90) :] ** 2)))


def lag_s(error: FloatArray, motion: Motion) -> float:
    """The shift that minimises the squared error to first order: the mean error's part along minus the velocity."""
    times = np.arange(0, LENGTH_S, 1 / 90)
    velocity = (motion(times + 1e-4)[0] - motion(times - 1e-4)[0]) / 2e-4
    begin = int(MOVES_AT_S * 90)
    return float(-np.sum(error.mean(axis=0)[begin:] * velocity[begin:]) / np.sum(velocity[begin:] ** 2))


CASES: dict[str, tuple[dict[str, float], Trouble, float]] = {
    "without a bias state": ({"bias_walk_mm_s2_per_sqrt_s": 0.0, "initial_bias_sd_mm_s2": 0.0}, Trouble(), 3.7),
    "bias state, bias 300 mm/s²": ({"bias_walk_mm_s2_per_sqrt_s": 3.0}, Trouble(bias_mm_s2=300.0), 4.0),
    "5 % stray frames of 150 mm": ({"bias_walk_mm_s2_per_sqrt_s": 3.0}, Trouble(outliers=0.05), 4.4),
    "5 ms jitter": ({"bias_walk_mm_s2_per_sqrt_s": 3.0}, Trouble(jitter_s=0.005), 4.4),
    "30 % of frames lost": ({"bias_walk_mm_s2_per_sqrt_s": 3.0}, Trouble(dropped=0.3), 4.4),
}
"""Settings, trouble, and the most that is allowed, in mm."""
MOTIONS: dict[str, Motion] = {"reach": reach, "sine": sine}


def table(runs: int = RUNS) -> None:
    """RMSE and lag of each case."""
    print(f"fusion_kalman, {runs} runs of {LENGTH_S:.0f} s, RMSE of the last 4 s in mm (floor {FLOOR_MM}), lag in ms")
    for name, (settings, trouble, most) in CASES.items():
        cells = []
        for motion in MOTIONS.values():
            error = errors(FusionKalman(SENSORS, **settings), motion, trouble, runs)  # type: ignore[arg-type]
            cells.append(f"{scored(error):.2f} ({1e3 * lag_s(error, motion):+.1f})")
        print(f"  {name:<28}{'  '.join(cells)}   at most {most}")


def draw_settling(path: Path, runs: int = RUNS) -> None:
    """Root mean square error over runs against the time since the first frame's arrival, from a cold start."""
    import matplotlib as mpl

    mpl.use("svg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.3, 3.2), layout="constrained")
    lines: dict[str, tuple[Estimator, Trouble, str]] = {
        "window_gp, L = 5": (WindowGP(SENSORS), Trouble(bias_mm_s2=300.0), "#D55E00"),
        "fusion_kalman, default": (FusionKalman(SENSORS), Trouble(bias_mm_s2=300.0), "#0072B2"),
        "fusion_kalman, no bias to learn": (
            FusionKalman(SENSORS, bias_walk_mm_s2_per_sqrt_s=0.0, initial_bias_sd_mm_s2=0.0),
            Trouble(),
            "#009E73",
        ),
    }
    time = np.arange(0, LENGTH_S, 1 / 90) - 0.1
    for index, (label, (estimator, trouble, colour)) in enumerate(lines.items()):
        shown = (time > 0.01) & (time < MOVES_AT_S)
        spread = np.sqrt(np.mean(errors(estimator, reach, trouble, runs)[:, shown] ** 2, axis=0))
        style = ("-", (0, (5, 2)), (0, (1, 1)))[index]
        axes.semilogy(time[shown], spread, color=colour, linestyle=style, label=label)
    axes.axhline(FLOOR_MM, color="black", linewidth=0.8)
    axes.set_ylim(2.5, 50)
    axes.annotate(
        "floor: posterior SD with all the past", (MOVES_AT_S, 0.94 * FLOOR_MM), ha="right", va="top", fontsize=8
    )
    axes.set(xlabel="time since the first frame arrived (s)", ylabel=f"RMSE of {runs} runs, one axis (mm)")
    axes.set_yticks([3, 5, 10, 20, 50], ["3", "5", "10", "20", "50"])
    axes.minorticks_off()
    axes.legend(frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    mpl.rcParams["svg.hashsalt"] = "settling"
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    table()
    if len(sys.argv) > 1:
        draw_settling(Path(sys.argv[1]))
