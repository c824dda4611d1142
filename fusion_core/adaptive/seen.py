"""Where the hand was last seen, for times at which the tracker sees nothing.

Accelerations alone lead away: after a second a trusted phone is off by centimetres, one beyond its range by metres. A
hand stays near, and goes at its own pace. What is shown is drawn to where it was last seen, where that says more of it
than accelerations do.
"""

from __future__ import annotations

from fusion_core.adaptive import bank
from fusion_core.adaptive.layout import (
    FUSED,
    IN_A_ROW,
    PACE,
    SEEN,
    SEEN_S,
    SURPRISE,
    TAKEN,
    VELOCITY,
    Model,
    State,
)
from fusion_core.adaptive.moments import COAST_S, left_of_speed
from fusion_core.compilation import compiled
from fusion_core.samples import FloatArray

_PACES = 300  # frames over which the pace is averaged
_KNOWN_AFTER = 60  # frames, as for scores
_AGAIN_AFTER = 5  # frames after a gap, the velocity is known again


@compiled(inner=True)
def see(model: Model, state: State, time: float, position: FloatArray) -> None:
    """A frame that is a measurement: where the hand was, and how fast it goes."""
    squared = 0.0
    for axis in range(model.dimension):
        squared += state.mean[VELOCITY + axis] ** 2 / model.dimension
        state.fact[SEEN + axis] = position[axis]
    state.count[IN_A_ROW] = state.count[IN_A_ROW] + 1 if time - state.fact[SEEN_S] < model.history_s else 0
    state.fact[SEEN_S] = time
    state.fact[PACE] += max(1.0 / state.count[TAKEN], 1.0 / _PACES) * (squared - state.fact[PACE])


@compiled(inner=True)
def draw(model: Model, state: State, time: float, variance: float, answers: FloatArray) -> float:
    """The fusion's position, of that variance, drawn to where the hand was seen; returns the variance then.

    By the squares of variances, not by the variances: a pace is an average, over rest too, and a hand that was lost in
    the middle of a reach goes further.
    """
    since = max(time - state.fact[SEEN_S], 0.0)
    followed = since < model.history_s and state.count[IN_A_ROW] >= _AGAIN_AFTER
    if followed or state.count[TAKEN] < _KNOWN_AFTER:
        return variance
    variance *= max(state.fact[SURPRISE], 1.0)
    far = bank.noise(state) + _gone(state, since)
    drawn = variance**2 / (variance**2 + far**2)
    for axis in range(model.dimension):
        answers[FUSED + axis] += drawn * (state.fact[SEEN + axis] - answers[FUSED + axis])
    return float((1.0 - drawn) ** 2 * variance + drawn**2 * far)


@compiled
def _gone(state: State, seconds: float) -> float:
    """The variance, an axis, of how far a hand goes at its pace in so many seconds (Uhlenbeck and Ornstein 1930)."""
    return float(2.0 * state.fact[PACE] * COAST_S * (seconds - COAST_S * (1.0 - left_of_speed(seconds))))
