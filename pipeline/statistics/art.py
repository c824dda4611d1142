"""The aligned rank transform: factorial analysis of variance without a normal distribution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy import stats

from pipeline.statistics import OK
from pipeline.statistics.anova import rm_anova
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.result import Result, rounded

_METHOD = "aligned rank transform, F in the effect's own error stratum, uncorrected"


def art_anova(values: FloatArray, factors: Sequence[str]) -> list[Result]:
    """One result an effect from values (n, k₁, k₂, …), no cell missing (Wobbrock et al. 2011).

    For each effect the values less all other effects are ranked, and the effect is tested on the ranks as in
    `rm_anova`. Effect size: partial η² of the ranks.
    """
    axes = range(1, values.ndim)
    effects = [effect for size in axes for effect in combinations(axes, size)]
    found = []
    for effect, plain in zip(effects, rm_anova(values, factors), strict=True):
        if plain.status != OK:
            found.append(_on_ranks(plain))
            continue
        aligned = values - values.mean(axis=0) + _effect(values.mean(axis=0), effect)
        ranks = stats.rankdata(rounded(aligned, values)).reshape(values.shape)
        found.append(_on_ranks(next(result for result in rm_anova(ranks, factors) if result.effect == plain.effect)))
    return found


def _effect(means: FloatArray, effect: tuple[int, ...]) -> FloatArray:
    """An effect's part of the cell means (k₁, k₂, …), by inclusion and exclusion of marginal means."""
    part = np.zeros_like(means)
    for size in range(len(effect) + 1):
        for kept in combinations(effect, size):
            outside = tuple(axis for axis in range(means.ndim) if axis + 1 not in kept)
            part += (-1) ** (len(effect) - size) * means.mean(axis=outside, keepdims=True)
    return part


def _on_ranks(result: Result) -> Result:
    """An effect's test on the ranks, with what of it applies to ranks."""
    low, high = result.details.get("partial_eta_squared_ci", (None, None))
    return replace(
        result,
        method=_METHOD,
        effect_size_name="partial eta squared",
        effect_size=result.details.get("partial_eta_squared"),
        ci_low=low,
        ci_high=high,
        details={name: result.details[name] for name in ("p_gg", "epsilon_gg") if name in result.details},
    )
