"""The same recording through other libraries: the fusion filter's own model, one step a reading, or a plain window.

Each does as much of the job as it can: three axes, position, velocity and acceleration with a bias that each axis has
for itself, frames taken in as they come. None of them goes back for a late frame, which favours them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from fusion_core import Samples, Sensor, WindowGP
from pipeline.statistics.arrays import FloatArray
from tests.fusion_core.kalman.reference import wiener_acceleration

JERK_PSD_MM2_S5, BIAS_WALK = 1e7, 30.0
_STATES, _FRAME, _FORCE = 4, np.array([[1.0, 0, 0, 0]]), np.array([[0, 0, 1.0, 1.0]])


@lru_cache
def _model(step_s: float) -> tuple[FloatArray, FloatArray]:
    """Transition and process noise of one axis."""
    transition, noise = np.eye(_STATES), np.zeros((_STATES, _STATES))
    transition[:3, :3], noise[:3, :3] = wiener_acceleration(step_s, JERK_PSD_MM2_S5)
    noise[3, 3] = BIAS_WALK**2 * step_s
    return transition, noise


def _merged(samples: dict[str, Samples]) -> tuple[FloatArray, list[tuple[bool, FloatArray]]]:
    """Times and readings by measurement time; whether each is a frame."""
    rows = [(time, True, value) for time, value in zip(samples["tracker"].time, samples["tracker"].value, strict=True)]
    rows += [(time, False, value) for time, value in zip(samples["imu"].time, samples["imu"].value, strict=True)]
    rows.sort(key=lambda row: row[0])
    return np.array([row[0] for row in rows]), [(row[1], row[2]) for row in rows]


def filterpy(samples: dict[str, Samples]) -> Callable[[], object]:
    """Its KalmanFilter with all twelve states, one predict and update a reading."""
    from filterpy.kalman import KalmanFilter

    times, readings = _merged(samples)

    @lru_cache
    def of_space(step_s: float) -> tuple[FloatArray, FloatArray]:
        transition, process = _model(step_s)
        whole = np.eye(3)
        return np.asarray(np.kron(transition, whole), np.float64), np.asarray(np.kron(process, whole), np.float64)

    def run() -> object:
        kalman = KalmanFilter(dim_x=3 * _STATES, dim_z=3)
        kalman.P *= 1e4
        observe = {True: np.kron(_FRAME, np.eye(3)), False: np.kron(_FORCE, np.eye(3))}
        noise = {True: 64.0 * np.eye(3), False: 1e4 * np.eye(3)}
        before = times[0]
        for time, (is_frame, value) in zip(times, readings, strict=True):
            transition, process = of_space(round(time - before, 6))
            kalman.predict(F=transition, Q=process)
            kalman.update(value, R=noise[is_frame], H=observe[is_frame])
            before = time
        return kalman.x

    return run


def simdkalman(samples: dict[str, Samples]) -> Callable[[], object]:
    """Its vectorised filter on a grid of accelerations, three axes at once, frames missing where there is none."""
    import simdkalman as library

    imu, tracker = samples["imu"], samples["tracker"]
    transition, process = _model(float(np.median(np.diff(imu.time))))
    kalman = library.KalmanFilter(
        state_transition=transition,
        process_noise=process,
        observation_model=np.vstack([_FRAME, _FORCE]),
        observation_noise=np.diag([64.0, 1e4]),
    )
    grid = np.full((3, len(imu), 2), np.nan)
    grid[:, :, 1] = imu.value.T
    grid[:, np.searchsorted(imu.time, tracker.time - 1e-6).clip(max=len(imu) - 1), 0] = tracker.value.T

    def run() -> object:
        return kalman.compute(grid, 0, filtered=True, smoothed=False)

    return run


def statsmodels(samples: dict[str, Samples]) -> Callable[[], object]:
    """Its compiled filter on the same grid, an axis after the other."""
    from statsmodels.tsa.statespace.kalman_filter import KalmanFilter

    imu, tracker = samples["imu"], samples["tracker"]
    transition, process = _model(float(np.median(np.diff(imu.time))))
    grid = np.full((3, len(imu), 2), np.nan)
    grid[:, :, 1] = imu.value.T
    grid[:, np.searchsorted(imu.time, tracker.time - 1e-6).clip(max=len(imu) - 1), 0] = tracker.value.T

    def run() -> object:
        found = []
        for axis in grid:
            kalman = KalmanFilter(k_endog=2, k_states=_STATES)
            kalman.bind(np.asfortranarray(axis.T))
            kalman["design"], kalman["obs_cov"] = np.vstack([_FRAME, _FORCE]), np.diag([64.0, 1e4])
            kalman["transition"], kalman["selection"], kalman["state_cov"] = transition, np.eye(_STATES), process
            kalman.initialize_known(np.zeros(_STATES), 1e4 * np.eye(_STATES))
            found.append(kalman.filter())
        return found

    return run


def dense_windows(samples: dict[str, Samples], times: FloatArray) -> Callable[[], object]:
    """The paper's window with a solve of its own for each instant, plain NumPy."""
    estimator = WindowGP(_sensors(), path="event_time")

    def run() -> object:
        frames, forces = samples["tracker"], samples["imu"]
        found = []
        for now in times:
            last, end = np.searchsorted(frames.arrival, now, "right"), np.searchsorted(forces.arrival, now, "right")
            first = max(last - 5, 0)
            if last == 0:
                continue
            begin = np.searchsorted(forces.time, frames.time[first])
            lag = np.concatenate([frames.time[first:last], forces.time[begin:end]]) - now
            weights, _ = estimator.gains(lag, ["tracker"] * (last - first) + ["imu"] * (end - begin))
            found.append(weights @ np.concatenate([frames.value[first:last], forces.value[begin:end]]))
        return found

    return run


def numpy_fir(samples: dict[str, Samples]) -> Callable[[], object]:
    """The ceiling of fixed weights in plain NumPy: 22 accelerations and 5 positions an instant, no bookkeeping."""
    frames, forces = samples["tracker"].value, samples["imu"].value
    weights = np.random.default_rng(0).normal(0, 1, 27)

    def run() -> object:
        windows = np.lib.stride_tricks.sliding_window_view(forces, 22, axis=0)
        positions = np.lib.stride_tricks.sliding_window_view(frames, 5, axis=0) @ weights[:5]
        return windows @ weights[5:] + np.repeat(positions, 3, axis=0)[: len(windows)]

    return run


def _sensors() -> dict[str, Sensor]:
    return {"tracker": Sensor("position", 8.0, 0.1), "imu": Sensor("acceleration", 100.0)}
