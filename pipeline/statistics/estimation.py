"""Estimates in addition to a test: bootstrap intervals, a permutation p, and intervals within participants."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy import stats

from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.result import rounded_differences
from pipeline.statistics.tails import t_quantile

RESAMPLES = 9_999
PERMUTATIONS = 99_999
EXACT_UP_TO = 40  # participants: a million sums of each half
_FROM = 5  # participants: of fewer, too many resamples are one person alone
_AT_ONCE = 2**14
_ROUND_OFF = 1e-12
TOO_FEW_TO_RESAMPLE = f"no bootstrap: it needs {_FROM} participants"
ALL_EQUAL = "no bootstrap: all differences are equal"
UNBOUNDED = "no bootstrap interval: too many resamples have no spread"


def bootstrap(first: FloatArray, second: FloatArray, seed: int, level: float = 0.95) -> dict[str, Any]:
    """For `details`: BCa intervals (Efron 1987) of the mean of first − second and of d_z, participants resampled.

    `bootstrap_ci_difference` and `bootstrap_ci_dz`, each [low, high] or None with `no_bootstrap` saying why, and
    `bootstrap_resamples`, `bootstrap_seed`. The same for the same seed.
    """
    (values,), exponent = at_unit_scale([rounded_differences(first, second)])
    details: dict[str, Any] = {"bootstrap_resamples": RESAMPLES, "bootstrap_seed": seed}
    reason = TOO_FEW_TO_RESAMPLE if len(values) < _FROM else ALL_EQUAL if np.ptp(values) == 0 else None
    if reason is not None:
        return {"bootstrap_ci_difference": None, "bootstrap_ci_dz": None, **details, "no_bootstrap": reason}
    mean, dz = bca((values,), _mean, seed, level), bca((values,), _dz, seed, level)
    if mean is None or dz is None:
        details["no_bootstrap"] = UNBOUNDED
    return {
        "bootstrap_ci_difference": None if mean is None else [float(np.ldexp(bound, exponent)) for bound in mean],
        "bootstrap_ci_dz": dz,
        **details,
    }


def _mean(values: FloatArray, axis: int = -1) -> FloatArray:
    mean: FloatArray = np.mean(values, axis=axis)
    return mean


def _dz(values: FloatArray, axis: int = -1) -> FloatArray:
    """Infinite where all values are equal, as those of a resample can be; 0 where they are zero."""
    mean, sd = np.mean(values, axis=axis), np.std(values, axis=axis, ddof=1)
    flat = np.ptp(values, axis=axis) == 0
    ratio: FloatArray = mean / np.where(flat, 1.0, sd)
    return np.where(flat & (mean != 0), np.copysign(np.inf, mean), ratio)


def bca(samples: tuple[FloatArray, ...], statistic: Any, seed: int, level: float) -> list[float] | None:
    """The BCa interval of a statistic of one or more samples, each resampled by itself; None where it is unbounded."""
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        resampled = stats.bootstrap(
            samples,
            statistic,
            n_resamples=RESAMPLES,
            confidence_level=level,
            method="BCa",
            rng=np.random.default_rng(seed),
        )
    bounds = [float(resampled.confidence_interval.low), float(resampled.confidence_interval.high)]
    return bounds if np.isfinite(bounds).all() else None


def permutation(first: FloatArray, second: FloatArray, seed: int) -> dict[str, Any]:
    """For `details`: two-sided p of the mean difference if each participant's two values are exchangeable.

    `permutation_p`; `permutation_exact` is true if all 2ⁿ exchanges are counted, as with up to 40 participants. With
    more, 99,999 are drawn at random and the observed one is counted too (Phipson and Smyth 2010);
    `permutation_p_error` is the standard error of that. `permutation_count` is their number. p is None for nobody.
    """
    (values,), _ = at_unit_scale([rounded_differences(first, second)])
    n = len(values)
    if n <= EXACT_UP_TO:
        p = _exact_p(values) if n else None
        return {"permutation_p": p, "permutation_exact": True, "permutation_count": 2**n, "permutation_p_error": None}
    permuted = stats.permutation_test(
        (values,),
        _mean,
        permutation_type="samples",
        vectorized=True,
        n_resamples=PERMUTATIONS,
        batch=_AT_ONCE,
        rng=np.random.default_rng(seed),
    )
    p = float(permuted.pvalue)
    return {
        "permutation_p": p,
        "permutation_exact": False,
        "permutation_count": PERMUTATIONS,
        "permutation_p_error": error_of_drawn(p),
        "permutation_seed": seed,
    }


def error_of_drawn(p: float) -> float:
    """The standard error of a p from permutations that were drawn."""
    return float(np.sqrt(p * (1 - p) / PERMUTATIONS))


def _exact_p(values: FloatArray) -> float:
    """The share of all sign patterns whose sum is as far from zero as the observed one.

    SciPy's permutation test goes through them one by one, which of 20 participants takes ten seconds. A sum is one of
    half of the participants plus one of the others: each half's sums are few, and sorted they are counted at once.
    """
    observed = abs(float(values.sum())) - _ROUND_OFF * float(np.abs(values).sum())
    half = len(values) // 2
    first_half, second_half = _signed_sums(values[:half]), np.sort(_signed_sums(values[half:]))
    reaching = np.sum(
        len(second_half) - np.searchsorted(second_half, observed - first_half, side="left"), dtype=np.float64
    )
    return float(min(1.0, 2 * reaching / (float(len(first_half)) * len(second_half))))


def _signed_sums(values: FloatArray) -> FloatArray:
    """The sums (2ⁿ,) of the values under all sign patterns."""
    sums = np.zeros(1)
    for value in values:
        sums = np.concatenate([sums + value, sums - value])
    return sums


def within_intervals(
    values: FloatArray, level: float = 0.95, bounded: bool = False
) -> list[tuple[float, float] | None]:
    """Intervals of each condition's mean without the differences between participants, of values (n, k); for figures.

    Cousineau's (2005) normalization with Morey's (2008) correction √(k/(k − 1)): t intervals of the values less their
    participant's mean. They show what a paired test rests on and are no intervals of the conditions' own means. None
    for fewer than two participants or conditions. `bounded`: they are of shares, and are cut at 0 and 1.
    """
    n, k = values.shape
    if n < 2 or k < 2:
        return [None] * k
    (scaled,), exponent = at_unit_scale([values])
    normalized = scaled - scaled.mean(axis=1, keepdims=True)
    error = np.std(normalized, axis=0, ddof=1) * np.sqrt(k / (k - 1) / n)
    margin = t_quantile((1 + level) / 2, n - 1) * error
    means = scaled.mean(axis=0)
    low, high = np.ldexp(means - margin, exponent), np.ldexp(means + margin, exponent)
    if bounded:
        low, high = np.clip(low, 0, 1), np.clip(high, 0, 1)
    return [(float(start), float(end)) for start, end in zip(low, high, strict=True)]
