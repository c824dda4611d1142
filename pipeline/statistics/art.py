"""The aligned rank transform: factorial analysis of variance without a normal distribution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy import stats

from pipeline.statistics import OK, pairs
from pipeline.statistics.anova import effect_name, effects_of, rm_anova
from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.paired import t_paired
from pipeline.statistics.pairs import FollowUp
from pipeline.statistics.result import Result, degenerate, room_of, tied, too_few

_METHOD = "aligned rank transform, F in the effect's own error stratum, uncorrected"
_CONTRASTS = "ART-C contrast: paired t test of ranks aligned for the pair's factors together, two-sided"
_RANKS_DZ = "Cohen's d_z of aligned ranks"


def art_anova(values: FloatArray, factors: Sequence[str]) -> list[Result]:
    """One result per effect from values (n, k₁, k₂, …), no cell missing (Wobbrock et al. 2011).

    For each effect the values less all other effects are ranked, and the effect is tested on the ranks as in
    `rm_anova`. Effect size: partial η² of the ranks.
    """
    (values,), _ = at_unit_scale([values])
    axes = range(1, values.ndim)
    effects = [effect for size in axes for effect in combinations(axes, size)]
    results = []
    for effect, plain in zip(effects, rm_anova(values, factors), strict=True):
        if plain.status != OK:
            results.append(_on_ranks(plain))
            continue
        aligned = values - values.mean(axis=0) + _effect(values.mean(axis=0), effect)
        ranks = _ranked(aligned, values)
        results.append(_on_ranks(next(result for result in rm_anova(ranks, factors) if result.effect == plain.effect)))
    return results


def _effect(means: FloatArray, effect: tuple[int, ...]) -> FloatArray:
    """An effect's part of the cell means (k₁, k₂, …), by inclusion and exclusion of marginal means."""
    part = np.zeros_like(means)
    for size in range(len(effect) + 1):
        for subset in combinations(effect, size):
            outside = tuple(axis for axis in range(means.ndim) if axis + 1 not in subset)
            part += (-1) ** (len(effect) - size) * means.mean(axis=outside, keepdims=True)
    return part


def _on_ranks(result: Result) -> Result:
    """The test of an effect on ranks, without the figures that make no sense for ranks."""
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


def art_contrasts(values: FloatArray, factors: Sequence[str], levels: Sequence[Sequence[str]]) -> list[FollowUp]:
    """The pairs of `pairs.follow_ups` by ART-C (Elkin, Kay, Higgins and Wobbrock 2021), of values (n, k₁, k₂, …).

    `art_anova`'s ranks are aligned for an effect as a whole, and pairs of them answer another question. Here a pair's
    factors are taken as one factor, and the values less all that does not belong to it are ranked. Each pair is tested
    by the paired t of participants' mean ranks: its error is its own, as the strata of `art_anova` are. Effect size:
    d_z of these ranks.
    """
    n = len(values)
    (scaled,), _ = at_unit_scale([values])
    status = too_few(n) or degenerate(scaled.reshape(n, -1))
    follow_ups = []
    for effect in effects_of(scaled.shape[1:]):
        name = effect_name(factors, effect)
        plain = [pair for pair in pairs.follow_ups(values, factors, levels) if pair.effect == name]
        if not plain:
            continue
        ranked = pairs.of_effect(scaled if status else _ranked_together(scaled, effect), factors, levels, effect)
        for pair, of_ranks in zip(plain, ranked, strict=True):
            result = (
                Result(name, "t", "", "", n, status=status) if status else t_paired(of_ranks.first, of_ranks.second)
            )
            named = replace(result, effect=name, method=_CONTRASTS, effect_size_name=_RANKS_DZ, contrast=pair.contrast)
            follow_ups.append(FollowUp(pair, named))
    return follow_ups


def _ranked_together(values: FloatArray, effect: tuple[int, ...]) -> FloatArray:
    """Ranks (n, k₁, k₂, …) of the residuals from the cell means, plus the means of the factors' joint levels."""
    outside = tuple(place for place in range(values.ndim - 1) if place not in effect)
    means = values.mean(axis=0)
    aligned = values - means + means.mean(axis=outside, keepdims=True) - means.mean()
    return _ranked(aligned, values)


def _ranked(aligned: FloatArray, values: FloatArray) -> FloatArray:
    """Midranks of aligned values over all of them, in their shape.

    Each is made of means over all participants, so each has the round-off of the largest of the values.
    """
    room = np.broadcast_to(room_of(np.max(np.abs(values), keepdims=True)).ravel(), values.size)
    ranks: FloatArray = stats.rankdata(tied(aligned.ravel(), room)).reshape(values.shape)
    return ranks
