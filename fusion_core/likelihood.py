"""Parameters by maximum likelihood: how well each position is foretold from everything measured before it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusion_core.estimator import Estimator
from fusion_core.kalman import event_steps
from fusion_core.kalman.fusion import FusionKalman
from fusion_core.samples import FloatArray, Samples
from fusion_core.sensors import position_sensor

_STEP = 0.02  # of a numerical derivative, in logarithms
_TELLS = np.log(3.0) / 1.96  # an interval within a factor of three either way tells something
_OF_PRIOR = 0.5  # and so does one of half the prior's width
_ALWAYS = 1e-12  # keeps a flat curvature invertible


@dataclass(frozen=True)
class Fitted:
    """A parameter's estimate and 95 % interval; `told` says whether the data say what it is at all."""

    value: float
    low: float
    high: float
    told: bool


def foretold(estimator: FusionKalman, samples: Mapping[str, Samples], block_s: float = 5.0) -> FloatArray:
    """Log density of the positions, each given all readings measured before it, summed over blocks of time (k,).

    Accelerations count by what they foretell, not by themselves: a model of the hand's motion is only roughly right,
    and it is the position that is asked for. Raises ValueError for the fixed-gain path.
    """
    steps = estimator.event_time
    history = steps.filtered(samples)
    if history is None:
        return np.zeros(0)
    of_position = ~steps.model.biased[history.sensor]
    of_position[0] = False  # the first is where the filter begins
    axes = steps.model.observes.sum(axis=1)[history.sensor]
    squared, log_determinant = (
        history.adapted[:, event_steps.SQUARED],
        history.adapted[:, event_steps.LOG_DETERMINANT],
    )
    density = -0.5 * (squared + log_determinant + axes * np.log(2 * np.pi))
    block = ((history.time - history.time[0]) // block_s).astype(np.int64)
    return np.asarray(np.bincount(block[of_position], density[of_position]), dtype=np.float64)


def foretold_by(estimator: Estimator, samples: Mapping[str, Samples], block_s: float = 5.0) -> FloatArray:
    """The same for any estimator (k,): each position given what it makes of all readings measured before it."""
    at_once = {
        name: Samples(stream.time, stream.time, stream.value, stream.rotation)
        for name, stream in ((name, _by_time(stream)) for name, stream in samples.items())
    }
    tracker = position_sensor(estimator.sensors)
    frames, noise_sd = at_once[tracker], estimator.sensors[tracker].noise_sd
    track = estimator.replay(at_once, np.nextafter(frames.time, -np.inf))
    variance = track.sd**2 + noise_sd**2
    density = -0.5 * ((frames.value - track.mean) ** 2 / variance + np.log(2 * np.pi * variance)).sum(axis=1)
    known = np.isfinite(density)
    block = ((frames.time - frames.time[:1]) // block_s).astype(np.int64)
    return np.asarray(np.bincount(block[known], density[known]), dtype=np.float64)


def _by_time(stream: Samples) -> Samples:
    """In order of measurement."""
    order = np.argsort(stream.time, kind="stable")
    rotation = None if stream.rotation is None else stream.rotation[order]
    return Samples(stream.time[order], np.sort(stream.arrival), stream.value[order], rotation)


def maximise(
    blocks: Callable[[FloatArray], FloatArray], start: Sequence[float], prior_sd: Sequence[float]
) -> list[Fitted]:
    """The positive parameters that make the data likeliest, with intervals.

    `blocks` gives the log likelihood of each stretch of data (k,) for parameters (m,); `prior_sd` (m,) holds each
    parameter near `start`, as the SD of its logarithm (infinite: not at all). The intervals are those of a
    misspecified model: curvature and the scatter of the stretches' slopes together (White 1982, eq. 2.3), since
    a motion prior is only roughly right. Raises ValueError for a start that is not above 0.
    """
    from scipy.optimize import minimize

    centre = np.asarray(start, dtype=np.float64)
    if not np.all(centre > 0):
        raise ValueError(f"parameters must start above 0, got {list(start)}")
    origin, spread = np.log(centre), np.asarray(prior_sd, dtype=np.float64)

    def cost(logarithm: FloatArray) -> float:
        return float(np.sum(0.5 * ((logarithm - origin) / spread) ** 2) - np.sum(blocks(np.exp(logarithm))))

    found = minimize(cost, origin, method="Powell", options={"xtol": 1e-3, "ftol": 1e-8})
    best = np.atleast_1d(np.asarray(found.x, dtype=np.float64))
    sd = _sandwich(lambda logarithm: blocks(np.exp(logarithm)), best, spread)
    return [
        Fitted(
            float(np.exp(at)),
            float(np.exp(at - 1.96 * one)),
            float(np.exp(at + 1.96 * one)),
            bool(one < min(_TELLS, _OF_PRIOR * held)),
        )
        for at, one, held in zip(best, sd, spread, strict=True)
    ]


def _sandwich(blocks: Callable[[FloatArray], FloatArray], best: FloatArray, prior_sd: FloatArray) -> FloatArray:
    """SDs (m,) of a maximum: A⁻¹ B A⁻¹ with the curvature A and the scatter B of the blocks' slopes."""
    count = len(best)
    steps = _STEP * np.eye(count)
    ahead = np.array([blocks(best + step) for step in steps])
    behind = np.array([blocks(best - step) for step in steps])
    slopes = (ahead - behind) / (2 * _STEP)
    scatter = slopes @ slopes.T
    curvature = np.diag(prior_sd**-2.0) + _ALWAYS * np.eye(count)
    for row in range(count):
        for column in range(row + 1):
            both, one = steps[row] + steps[column], steps[row] - steps[column]
            corners = blocks(best + both) - blocks(best + one) - blocks(best - one) + blocks(best - both)
            bend = float(np.sum(corners)) / (4 * _STEP**2)
            curvature[row, column] -= bend
            if row != column:
                curvature[column, row] -= bend
    inverse = np.linalg.pinv(curvature, hermitian=True)
    variance = np.diag(inverse @ (scatter + np.diag(prior_sd**-2.0)) @ inverse)
    return np.where(np.diag(curvature) > 0, np.sqrt(np.maximum(variance, 0.0)), np.inf)
