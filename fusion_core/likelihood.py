"""Parameters by maximum likelihood: how well each position is predicted from everything measured before it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fusion_core.estimator import Estimator
from fusion_core.kalman.event_history import LOG_DETERMINANT, SQUARED
from fusion_core.kalman.fusion import FusionKalman
from fusion_core.samples import FloatArray, Samples
from fusion_core.sensors import position_sensor

_STEP = 0.02  # of a numerical derivative, in logarithms
_LARGEST_SD = np.log(3.0) / 1.96  # of a parameter that counts as identified: within a factor of three either way,
_LARGEST_SHARE_OF_PRIOR = 0.5  # and its SD at most this share of the prior's
_FEW_BLOCKS = 12
_WIDEST = 50.0  # of half an interval of a logarithm: anything is possible, and its exponential still a number
_RIDGE = 1e-12  # keeps a flat curvature invertible


@dataclass(frozen=True)
class Fitted:
    """A parameter's estimate and 95 % interval; `identified` says whether the data determine it at all."""

    value: float
    low: float
    high: float
    identified: bool


def position_log_likelihood(
    estimator: FusionKalman, samples: Mapping[str, Samples], block_s: float = 5.0
) -> FloatArray:
    """Log density of the positions, each given all readings measured before it, summed over blocks of time (k,).

    Accelerations count only through the positions they predict: the model of the hand's motion is only roughly right,
    and the position is what the estimator is for. Readings are taken in order of measurement, whatever their arrival.
    """
    steps = estimator.event_time
    history = steps.filtered(samples)
    if history is None:
        return np.zeros(0)
    of_position = ~steps.model.biased[history.sensor]
    of_position[0] = False  # the first is where the filter begins
    axes = steps.model.observes.sum(axis=1)[history.sensor]
    squared, log_determinant = history.adapted[:, SQUARED], history.adapted[:, LOG_DETERMINANT]
    density = -0.5 * (squared + log_determinant + axes * np.log(2 * np.pi))
    block = ((history.time - history.time[0]) // block_s).astype(np.int64)
    return np.asarray(np.bincount(block[of_position], density[of_position]), dtype=np.float64)


def log_likelihood_by_replay(estimator: Estimator, samples: Mapping[str, Samples], block_s: float = 5.0) -> FloatArray:
    """The same (k,) for any estimator: each position given the estimate from all readings measured before it.

    The estimate's SD and the tracker's noise together are taken as the SD of the position.
    """
    at_once = {
        name: Samples(stream.time, stream.time, stream.value, stream.rotation, stream.force)
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
    """The readings in order of measurement."""
    order = np.argsort(stream.time, kind="stable")
    rotation = None if stream.rotation is None else stream.rotation[order]
    force = None if stream.force is None else stream.force[order]
    return Samples(stream.time[order], np.sort(stream.arrival), stream.value[order], rotation, force)


def maximise(
    blocks: Callable[[FloatArray], FloatArray], start: Sequence[float], prior_sd: Sequence[float]
) -> list[Fitted]:
    """The positive parameters that make the data likeliest, with intervals.

    `blocks` gives the log likelihood (k,) of each stretch of data for parameters (m,). `prior_sd` (m,) is the SD of
    each parameter's logarithm around that of `start` before any data; infinite means that nothing is known. The
    intervals are those of a misspecified model (White 1982, eq. 2.3), since a motion prior is only roughly right: they
    combine the curvature of the likelihood with the scatter of the stretches' slopes. Raises ValueError for a start
    that is not above 0.
    """
    from scipy.optimize import minimize

    centre = np.asarray(start, dtype=np.float64)
    if not np.all(centre > 0):
        raise ValueError(f"parameters must start above 0, got {list(start)}")
    origin, spread = np.log(centre), np.asarray(prior_sd, dtype=np.float64)

    def cost(logarithm: FloatArray) -> float:
        return float(np.sum(0.5 * ((logarithm - origin) / spread) ** 2) - np.sum(blocks(np.exp(logarithm))))

    optimum = minimize(cost, origin, method="Powell", options={"xtol": 1e-3, "ftol": 1e-8})
    best = np.atleast_1d(np.asarray(optimum.x, dtype=np.float64))
    sd = _sandwich(lambda logarithm: blocks(np.exp(logarithm)), best, spread)
    half = np.minimum(1.96 * sd, _WIDEST)
    return [
        Fitted(
            float(np.exp(log_value)),
            float(np.exp(log_value - half_width)),
            float(np.exp(log_value + half_width)),
            bool(log_sd < min(_LARGEST_SD, _LARGEST_SHARE_OF_PRIOR * log_prior_sd)),
        )
        for log_value, half_width, log_sd, log_prior_sd in zip(best, half, sd, spread, strict=True)
    ]


def _sandwich(blocks: Callable[[FloatArray], FloatArray], best: FloatArray, prior_sd: FloatArray) -> FloatArray:
    """SDs (m,) of a maximum: A⁻¹ B A⁻¹ with the curvature A and the scatter B of the blocks' slopes.

    A few blocks' slopes scatter little by chance (two that sum to nothing are opposite, whatever they are): then no SD
    is below that of a model taken for right, which is A⁻¹'s.
    """
    count = len(best)
    steps = _STEP * np.eye(count)
    ahead = np.array([blocks(best + step) for step in steps])
    behind = np.array([blocks(best - step) for step in steps])
    slopes = (ahead - behind) / (2 * _STEP)
    scatter = slopes @ slopes.T
    curvature = np.diag(prior_sd**-2.0) + _RIDGE * np.eye(count)
    for row in range(count):
        for column in range(row + 1):
            both, opposite = steps[row] + steps[column], steps[row] - steps[column]
            corners = blocks(best + both) - blocks(best + opposite) - blocks(best - opposite) + blocks(best - both)
            bend = float(np.sum(corners)) / (4 * _STEP**2)
            curvature[row, column] -= bend
            if row != column:
                curvature[column, row] -= bend
    inverse = np.linalg.pinv(curvature, hermitian=True)
    variance = np.diag(inverse @ (scatter + np.diag(prior_sd**-2.0)) @ inverse)
    if ahead.shape[1] < _FEW_BLOCKS:
        variance = np.maximum(variance, np.diag(inverse))
    return np.where(np.diag(curvature) > 0, np.sqrt(np.maximum(variance, 0.0)), np.inf)
