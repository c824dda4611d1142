"""When the simulated sensors measure, with what noise, and how the phone is held: everything except the hand.

Each kind of draw has a random generator of its own, so that a shorter session gets the same draws as the first part of
a longer one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.statistics.arrays import FloatArray
from pipeline.study.simulation import Instruments
from pipeline.study.streams import AccelerationStream, PositionStream
from pipeline.tables.columns import NS_PER_S

IntArray = npt.NDArray[np.int64]
Draws = Callable[[str], np.random.Generator]
_WOBBLE_S = 0.5


@dataclass(frozen=True)
class Frames:
    """The tracker's readings: when they were measured and arrive, in ns, and their noise (n, 3) in mm."""

    time_ns: IntArray
    arrival_ns: IntArray
    noise_mm: FloatArray


@dataclass(frozen=True)
class Phone:
    """The phone's readings: times as above; `force = to_body (a − gravity) + error`, in the body's frame.

    `logged_xyzw` (n, 4) is the orientation that the phone logs, which is slightly wrong.
    """

    time_ns: IntArray
    arrival_ns: IntArray
    to_body: FloatArray
    error_mm_s2: FloatArray
    logged_xyzw: FloatArray


def frames(stream: PositionStream, instruments: Instruments, length_s: float, draws: Draws) -> Frames:
    """A tracker over a session."""
    time_ns = _times(instruments.tracker_rate_hz, instruments, length_s, draws, "tracker")
    noise = draws("tracker noise").normal(0.0, stream.noise_sd_mm, (len(time_ns), 3))
    return Frames(time_ns, time_ns + round(stream.latency_s * NS_PER_S), noise)


def phone(stream: AccelerationStream, instruments: Instruments, length_s: float, draws: Draws) -> Phone:
    """An inertial sensor in a hand that tilts and wobbles a little, with an orientation that is slightly wrong."""
    from scipy.spatial.transform import Rotation

    time_ns = _times(instruments.imu_rate_hz, instruments, length_s, draws, "imu")
    count, step_s = len(time_ns), 1.0 / instruments.imu_rate_hz
    held = np.radians(instruments.held_tilt_sd_deg) * draws("held").standard_normal(3)
    wobble = np.radians(instruments.wobble_sd_deg) * _smooth(draws("wobble"), count, step_s)
    true = Rotation.from_rotvec(held + wobble)
    wrong = np.tile(np.radians(instruments.tilt_error_sd_deg) * draws("tilt error").standard_normal(3), (count, 1))
    walk = np.radians(instruments.heading_walk_deg_per_sqrt_s) * np.sqrt(step_s)
    wrong[:, 1] += np.cumsum(walk * draws("heading").standard_normal(count))
    logged = Rotation.from_rotvec(wrong) * true
    bias = draws("bias").normal(0.0, instruments.imu_bias_sd_mm_s2, 3)
    noise = draws("imu noise").normal(0.0, stream.noise_sd_mm_s2, (count, 3))
    return Phone(
        time_ns,
        time_ns + round(stream.latency_s * NS_PER_S),
        true.inv().as_matrix(),
        noise + bias,
        logged.as_quat(),
    )


def gyroscope(held: Phone) -> FloatArray:
    """What the gyroscope reads (n, 3) in rad/s in the body's frame: the mean turn since the previous reading."""
    from scipy.spatial.transform import Rotation

    found = np.zeros((len(held.time_ns), 3))
    if len(found) > 1:
        turns = held.to_body[:-1] @ held.to_body[1:].transpose(0, 2, 1)
        found[1:] = Rotation.from_matrix(turns).as_rotvec() / np.diff(held.time_ns)[:, None] * NS_PER_S
        found[0] = found[1]
    return found


def _times(rate_hz: float, instruments: Instruments, length_s: float, draws: Draws, name: str) -> IntArray:
    """When a sensor measures (n,) in ns: regular from a random phase, with jitter and losses if stated."""
    phase_s = draws(f"{name} phase").uniform(0.0, 1.0 / rate_hz)
    count = int((length_s - phase_s) * rate_hz)
    time = phase_s + np.arange(count) / rate_hz
    if instruments.jitter_sd_s:
        strayed = draws(f"{name} jitter").normal(0.0, instruments.jitter_sd_s, count)
        time += np.clip(strayed, -0.4 / rate_hz, 0.4 / rate_hz)  # none overtakes another
    if instruments.lost:
        time = time[draws(f"{name} losses").random(count) >= instruments.lost]
    return np.rint(np.maximum(time, 0.0) * NS_PER_S).astype(np.int64)


def _smooth(random: np.random.Generator, count: int, step_s: float) -> FloatArray:
    """Noise (count, 3) with SD 1, smoothed by two equal first-order low-passes."""
    from scipy.signal import lfilter

    keep = np.exp(-step_s / _WOBBLE_S)
    settled = np.sqrt((1 + keep**2) / (1 - keep**2) ** 3) * (1 - keep) ** 2  # SD of the filtered noise
    white = random.standard_normal((count, 3))
    found: FloatArray = lfilter([(1 - keep) ** 2], [1.0, -2 * keep, keep**2], white, axis=0) / settled
    return found
