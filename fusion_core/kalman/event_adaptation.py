"""What the event-time filter learns about its sensors, compiled: which positions to reject, noise and jerk in use.

All of it stands in `History.adapted`, in each row, so that going back to an earlier row restores what was known there.
"""

from __future__ import annotations

import numpy as np

from fusion_core.compilation import compiled
from fusion_core.kalman.event_history import JERK_PSD, LOG_NOISE, LOW_PASSED, MEASURED_AT, MEASURED_JERK_PSD, REJECTED
from fusion_core.samples import FloatArray

_LARGEST_SURPRISE = 3.0  # of a squared innovation over its expected value, so that no single reading decides
_LARGEST_LOG_NOISE = 14.0  # a thousand times the stated SD
_LOG_NOISE_OF_DOUBT = 3.0  # from here on the measured jerk is used in full; below, the less the smaller the log noise
_LOW_PASS_S = 0.05
_JERK_HORIZON_S = 1.0
_REJECTED_IN_A_ROW = 3  # then the hand really has moved that far, and the next reading is accepted


@compiled(inner=True)
def measure_jerk(
    axes: tuple[int, ...],
    adapted: FloatArray,
    row: int,
    time: float,
    value: FloatArray,
    noise_variance: float,
    least: float,
) -> None:
    """Measures the jerk's spectral density q and sets the one in use; `value` (n, dimension) are accelerations.

    A Wiener process differs from its own low-pass of time constant τ by a variance of q·τ/2, so q follows from how far
    the accelerations are from their low-pass. The result is used only as far as positions are further off than
    expected (the log noise): a smooth motion, however fast, is predicted well without it. `least` is the prior's q.
    """
    dt = time - adapted[row, MEASURED_AT]
    adapted[row, MEASURED_AT] = time
    if np.isnan(dt):
        for axis in range(len(axes)):
            adapted[row, LOW_PASSED + axis] = value[row, axis]
    else:
        share, squared = dt / (dt + _LOW_PASS_S), 0.0
        for axis in range(len(axes)):
            ahead = value[row, axis] - adapted[row, LOW_PASSED + axis]
            squared += ahead * ahead
            adapted[row, LOW_PASSED + axis] += share * ahead
        density = 2.0 / _LOW_PASS_S * (squared / len(axes) - noise_variance)
        measured = adapted[row, MEASURED_JERK_PSD]
        measured += dt / (dt + _JERK_HORIZON_S) * (density - measured)
        adapted[row, MEASURED_JERK_PSD] = measured
        share = min(adapted[row, LOG_NOISE] / _LOG_NOISE_OF_DOUBT, 1.0)
        adapted[row, JERK_PSD] = least * (max(measured, least) / least) ** share if share > 0.0 else least


@compiled(inner=True)
def judge(adapted: FloatArray, row: int, squared: float, seen: int, gate: float, adaptation: float) -> bool:
    """Whether a position is accepted by the gate; also adapts the accelerations' noise to its squared innovation.

    `squared` is νᵀS⁻¹ν over the `seen` axes, whose expected value is `seen`: more than that means that the
    accelerations, from which the position was predicted, are noisier than assumed (Mehra 1970).
    """
    rejected = adapted[row, REJECTED]
    accepted = squared <= gate or rejected >= _REJECTED_IN_A_ROW
    adapted[row, REJECTED] = 0.0 if accepted else rejected + 1.0
    if accepted or rejected > 0.0:  # a single stray reading says nothing about the accelerations
        log_noise = adapted[row, LOG_NOISE] + adaptation * (min(squared / seen, _LARGEST_SURPRISE) - 1.0)
        adapted[row, LOG_NOISE] = min(max(log_noise, 0.0), _LARGEST_LOG_NOISE)
    return accepted
