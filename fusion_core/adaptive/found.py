"""What the sensors turned out to be like: the scales, the clock and the phone's states at the end of a recording.

Each is a figure with an interval of 95 %. The states' are those of the filter's own covariance; the noise's is the
spread of the bank's members by weight, and as coarse as their steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusion_core.adaptive.layout import (
    ARM,
    BIAS,
    CLOCK_S,
    CLOCK_VARIANCE,
    DRIFT_VARIANCE,
    KNOWS_ARM,
    MOUNTING,
    NOISE,
    NOISE_DRIFT,
    TAKEN,
    TRACKER_VARIANCE,
    TURN,
    Memory,
    Records,
)
from fusion_core.samples import FloatArray

_NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class Found:
    """A figure, by name and unit, and the ends of its 95 % interval."""

    quantity: str
    unit: str
    value: float
    ci_low: float
    ci_high: float


def found(model: Records, memory: Memory) -> list[Found]:
    """What is known of the sensors after some readings; nothing before the first position.

    - tracker_noise (mm): its SD an axis, correlated noise included; tracker_late (s): how much later than stated its
      positions are;
    - mounting_x, _y, _z (°): how the accelerometer's axes are turned against those stated, about its own axes;
    - heading (°): how far its horizontal is turned about the vertical, and scale (%): how far its readings are too
      large; both of three axes only;
    - bias_x, _y, _z (mm/s²), and lever_arm_x, _y, _z (mm) from the phone to the tracked point: in the phone's frame.
    """
    state = memory.state[0]
    if state["count"][TAKEN] == 0:
        return []
    late, late_sd = -float(state["fact"][CLOCK_S]), float(np.sqrt(state["fact"][CLOCK_VARIANCE]))
    rows = [_noise(model, memory), _normal("tracker_late", "s", late, late_sd)]
    if not state["count"][KNOWS_ARM]:
        return rows  # no reading had an orientation, so that nothing of the phone's own frame was learned
    mean, sd = state["mean"], np.sqrt(np.maximum(np.diagonal(state["covariance"]), 0.0))
    for axis, name in enumerate("xyz"):
        turned = np.degrees([-mean[MOUNTING + axis], sd[MOUNTING + axis]])
        rows.append(_normal(f"mounting_{name}", "°", *map(float, turned)))
    if int(model["dimension"][0]) == len("xyz"):
        rows += _heading_and_scale(mean[TURN : TURN + 2], state["covariance"][TURN : TURN + 2, TURN : TURN + 2])
    for begin, quantity, unit in ((BIAS, "bias", "mm/s²"), (ARM, "lever_arm", "mm")):
        rows += [
            _normal(f"{quantity}_{name}", unit, float(mean[begin + axis]), float(sd[begin + axis]))
            for axis, name in enumerate("xyz")
        ]
    return rows


def _normal(quantity: str, unit: str, value: float, sd: float) -> Found:
    return Found(quantity, unit, value, value - _NORMAL_95 * sd, value + _NORMAL_95 * sd)


def _noise(model: Records, memory: Memory) -> Found:
    """The tracker's noise: an average of logarithms over the members that use the phone."""
    state, members = memory.state[0], int(model["first_alone"][0])
    share, of_member = state["share"][:members], model["member"][0][:, :members]
    log_sd = 0.5 * np.log(of_member[TRACKER_VARIANCE] + of_member[DRIFT_VARIANCE])
    steps = np.diff(np.unique(np.round(log_sd, 9)))
    rounded = float(np.max(steps)) ** 2 / 12  # nothing lies between two members
    spread = float(np.sqrt(share @ (log_sd - share @ log_sd) ** 2 + rounded))
    value = float(np.sqrt(state["fact"][NOISE] + state["fact"][NOISE_DRIFT]))
    low, high = (value * float(np.exp(sign * _NORMAL_95 * spread)) for sign in (-1, 1))
    return Found("tracker_noise", "mm", value, low, high)


def _heading_and_scale(turn: FloatArray, covariance: FloatArray) -> list[Found]:
    """Readings times (1 − y₁, y₂), as a complex number, are true: its angle is the heading, its inverse the scale."""
    across, along = float(turn[1]), 1.0 - float(turn[0])
    squared = along**2 + across**2
    of_angle, of_size = np.array([across, along]) / squared, np.array([along, -across]) / squared**1.5
    angle = np.degrees([np.arctan2(across, along), np.sqrt(of_angle @ covariance @ of_angle)])
    size = 100 * (squared**-0.5 - 1.0), 100 * float(np.sqrt(of_size @ covariance @ of_size))
    return [_normal("heading", "°", *map(float, angle)), _normal("scale", "%", *size)]
