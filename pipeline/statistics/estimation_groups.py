"""Estimates beside a test of two groups: a bootstrap interval and a permutation p of the difference of their means."""

from __future__ import annotations

from math import comb
from typing import Any

import numpy as np
from scipy import stats

from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.estimation import PERMUTATIONS, RESAMPLES, UNBOUNDED, bca, error_of_drawn

_FROM = 5  # participants in each group, as for pairs
_AT_ONCE = 2**12
_BEYOND = 1e100
TOO_FEW_IN_A_GROUP = f"no bootstrap: it needs {_FROM} participants in each group"
ALL_ALIKE = "no bootstrap: all values of each group are equal"


def bootstrap(first: FloatArray, second: FloatArray, seed: int, level: float = 0.95) -> dict[str, Any]:
    """For `details`: the BCa interval (Efron 1987) of mean(first) − mean(second), each group resampled by itself.

    `bootstrap_ci_difference`, [low, high] or None with `no_bootstrap` saying why, and `bootstrap_resamples`,
    `bootstrap_seed`. The same for the same seed.
    """
    (one, other), exponent = _centred(first, second)
    details: dict[str, Any] = {"bootstrap_resamples": RESAMPLES, "bootstrap_seed": seed}
    if min(len(one), len(other)) < _FROM:
        return {"bootstrap_ci_difference": None, **details, "no_bootstrap": TOO_FEW_IN_A_GROUP}
    if np.ptp(one) == 0 and np.ptp(other) == 0:
        return {"bootstrap_ci_difference": None, **details, "no_bootstrap": ALL_ALIKE}
    bounds = bca((one, other), _difference, seed, level)
    if bounds is None:
        return {"bootstrap_ci_difference": None, **details, "no_bootstrap": UNBOUNDED}
    # The differences of the centred values are those of the values: their common mean is taken off both.
    return {"bootstrap_ci_difference": [float(np.ldexp(bound, exponent)) for bound in bounds], **details}


def permutation(first: FloatArray, second: FloatArray, seed: int) -> dict[str, Any]:
    """For `details`: two-sided p of Welch's t if the participants are exchangeable between the groups.

    Of t and not of the difference: so the p also holds, the better the larger the groups, where the groups differ in
    spread alone (Janssen 1997). `permutation_exact`: are all ways to split the participants counted, as up to 99,999
    of them? Else so many are drawn at random, the one found counted among them (Phipson and Smyth 2010), and
    `permutation_p_error` is the standard error of that. `permutation_count` is how many. p is None for an empty group.
    """
    (one, other), _ = _centred(first, second)
    splits = comb(len(one) + len(other), len(one))
    exact = splits <= PERMUTATIONS
    details: dict[str, Any] = {"permutation_exact": exact, "permutation_count": splits if exact else PERMUTATIONS}
    if min(len(one), len(other)) < 2:
        return {"permutation_p": None, **details, "permutation_p_error": None}
    with np.errstate(divide="ignore", invalid="ignore"):
        found = stats.permutation_test(
            (one, other),
            _size_of_welch_t,
            permutation_type="independent",
            alternative="greater",
            vectorized=True,
            n_resamples=PERMUTATIONS,
            batch=_AT_ONCE,
            rng=np.random.default_rng(seed),
        )
    p = float(found.pvalue)
    if exact:
        return {"permutation_p": p, **details, "permutation_p_error": None}
    return {"permutation_p": p, **details, "permutation_p_error": error_of_drawn(p), "permutation_seed": seed}


def _centred(first: FloatArray, second: FloatArray) -> tuple[list[FloatArray], int]:
    """Both less their common mean, near 1 in size, and the power of two that was taken off."""
    scaled, exponent = at_unit_scale([first, second])
    middle = float(np.mean(np.concatenate(scaled))) if len(first) + len(second) else 0.0
    return [values - middle for values in scaled], exponent


def _difference(first: FloatArray, second: FloatArray, axis: int = -1) -> FloatArray:
    difference: FloatArray = np.mean(first, axis=axis) - np.mean(second, axis=axis)
    return difference


def _size_of_welch_t(first: FloatArray, second: FloatArray, axis: int = -1) -> FloatArray:
    """|t|; a number beyond all others where no value varies within its group and the means differ."""
    difference = np.abs(_difference(first, second, axis))
    shares = (np.var(values, axis=axis, ddof=1) / values.shape[axis] for values in (first, second))
    t: FloatArray = np.where(difference == 0, 0.0, np.minimum(difference / np.sqrt(sum(shares)), _BEYOND))
    return t
