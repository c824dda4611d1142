"""Analysis of variance of one between-factor and one to three within-factors, with groups of any sizes.

Type III squares, as afex has them in R: a within-effect is tested on the plain mean of the groups' means, whatever
their sizes. pingouin's mixed_anova weights groups by their size: of groups of 8 and 7 (case mixed_3_of_8_and_7) it
gives F = 0.861 of the condition for 1.009. Of equal groups the two are one.

Theory: an effect's scores are the values times its orthonormal contrasts (n, d), as in `anova`. Of the scores, the
within-effect is the plain mean over groups, and its interaction with the group what the groups' means differ in; both
are tested against the scores' variation within groups. The group itself is tested on participants' means.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from pipeline.statistics import ALL_ZERO, EQUAL_IN_GROUPS, NO_ERROR, NO_VARIATION, OK, TOO_FEW_VALUES
from pipeline.statistics.anova import Stratum, contrasts, effect_name, effects_of, tested
from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.diagnostics import normality
from pipeline.statistics.effect_size import hedges_correction, standardized_interval
from pipeline.statistics.groups import missing, varies
from pipeline.statistics.paired import t_paired
from pipeline.statistics.pairs import FollowUp, of_effect, of_groups
from pipeline.statistics.pairs import follow_ups as within_pairs
from pipeline.statistics.result import IntArray, Result, from_first, negligible, rounded_differences
from pipeline.statistics.tails import t_above, t_quantile
from pipeline.statistics.welch import spreads, t_welch

_METHOD = "mixed ANOVA, type III, uncorrected; sphericity corrections in details"
_POOLED = "t test of the differences, plain mean over the groups, two-sided"


def mixed_anova(values: FloatArray, codes: IntArray, between: str, factors: Sequence[str]) -> list[Result]:
    """Rows `group`, `condition`, `group:condition` of values (n, k₁, k₂, …), no cell missing, and groups 0 … (n,).

    Of several within-factors each effect is followed by its interaction with the group. Figures and details are those
    of `rm_anova`; the group's row also tells whether participants' means spread alike in all groups, and the row of a
    factor of two levels their difference, averaged over the groups, and its interval.
    """
    n, levels = values.shape[0], values.shape[1:]
    flat = values.reshape(n, int(np.prod(levels)))
    (flat, apart), _ = at_unit_scale([flat, from_first(flat)])
    groups = [np.flatnonzero(codes == code) for code in range(int(codes.max(initial=-1)) + 1)]
    details = {"n_groups": [len(rows) for rows in groups]}
    blank = Result("", "F", _METHOD, "generalized eta squared", n, details=details)
    effects = effects_of(levels)
    if status := _untestable(flat, groups):
        names = [name for effect in effects for name in _names(between, factors, effect)]
        return [replace(blank, effect=name, status=status) for name in (between, *names)]
    people = _strata(flat @ contrasts(levels, ()), groups)[1]
    within = [_strata(apart @ contrasts(levels, effect), groups) for effect in effects]
    variation = people.error + sum(of_group.error for _, of_group in within)
    results = [_group_row(replace(blank, effect=between), people, variation, flat, groups)]
    for effect, strata in zip(effects, within, strict=True):
        for name, stratum in zip(_names(between, factors, effect), strata, strict=True):
            results.append(_within_row(replace(blank, effect=name), stratum, variation, apart))
        if len(effect) == 1 and levels[effect[0]] == 2 and results[-2].status == OK:
            first, second = (values.take(level, effect[0] + 1).reshape(n, -1).mean(axis=1) for level in (0, 1))
            compared = t_in_groups(first, second, codes).details
            difference = {name: compared[name] for name in ("difference", "ci_difference")}
            results[-2] = replace(results[-2], details={**results[-2].details, **difference})
    if len(effects) == 1 and levels[0] > 2 and results[1].status == OK:
        centred = apart - apart.mean(axis=1, keepdims=True)
        residuals = np.concatenate([(centred[rows] - centred[rows].mean(axis=0)).ravel() for rows in groups])
        results[1] = replace(results[1], details={**results[1].details, **normality(residuals, "residual_")})
    return results


def _untestable(flat: FloatArray, groups: Sequence[IntArray]) -> str | None:
    """The status where no effect can be tested, else None."""
    if status := missing([flat[rows, 0] for rows in groups]):
        return status
    if len(flat) <= len(groups):
        return TOO_FEW_VALUES
    return None if varies(flat) else NO_VARIATION


def _names(between: str, factors: Sequence[str], effect: tuple[int, ...]) -> tuple[str, str]:
    """Of a within-effect and of its interaction with the group."""
    name = effect_name(factors, effect)
    return name, f"{between}:{name}"


def _strata(scores: FloatArray, groups: Sequence[IntArray]) -> tuple[Stratum, Stratum]:
    """Of scores (n, d): the plain mean of the groups' means, and what they differ in."""
    sizes = np.array([len(rows) for rows in groups])
    means = np.stack([scores[rows].mean(axis=0) for rows in groups])
    apart = np.concatenate([scores[rows] - mean for rows, mean in zip(groups, means, strict=True)])
    errors, error_df = apart.T @ apart, len(scores) - len(groups)
    plain = np.sum(means.mean(axis=0) ** 2) / np.mean(1 / sizes) * len(groups)
    differ = np.sum(sizes[:, None] * (means - scores.mean(axis=0)) ** 2)
    d = scores.shape[1]
    return Stratum(float(plain), d, errors, error_df), Stratum(float(differ), d * (len(groups) - 1), errors, error_df)


def _within_row(blank: Result, stratum: Stratum, variation: float, apart: FloatArray) -> Result:
    result = tested(blank, stratum, variation, apart)
    if result.status == NO_ERROR and negligible(stratum.explained, apart):
        return replace(result, status=ALL_ZERO)
    return result


def _group_row(
    blank: Result, stratum: Stratum, variation: float, flat: FloatArray, groups: Sequence[IntArray]
) -> Result:
    result = tested(blank, stratum, variation, flat)
    if result.status == NO_ERROR:
        return replace(result, status=EQUAL_IN_GROUPS)
    return replace(result, details={**result.details, **spreads([flat[rows].mean(axis=1) for rows in groups])})


def t_in_groups(first: FloatArray, second: FloatArray, codes: IntArray, effect: str = "condition") -> Result:
    """t of the differences first − second (n,), averaged over groups 0 … (n,) of any sizes, with their pooled variance.

    As emmeans computes contrasts of a mixed ANOVA's within-factor from its multivariate model. Of one group it is the
    paired t test. Effect size: the difference over the pooled SD of the differences.
    """
    (differences,), exponent = at_unit_scale([rounded_differences(first, second)])
    groups = [np.flatnonzero(codes == code) for code in np.unique(codes)]
    blank = Result(effect, "t", _POOLED, "Cohen's d_z", len(first))
    df = len(first) - len(groups)
    if df < 1:
        return replace(blank, status=TOO_FEW_VALUES)
    squares = sum(float(np.sum((differences[rows] - differences[rows].mean()) ** 2)) for rows in groups)
    if negligible(squares, differences):
        return replace(blank, status=NO_ERROR if np.any(differences) else ALL_ZERO)
    mean = float(np.mean([differences[rows].mean() for rows in groups]))
    sd = float(np.sqrt(squares / df))
    error = sd * float(np.sqrt(np.sum([1 / len(rows) for rows in groups]))) / len(groups)
    statistic, margin = mean / error, t_quantile(0.975, df) * error
    low, high = standardized_interval(statistic, df, error / sd)
    correction = hedges_correction(df)
    difference, *interval = (float(np.ldexp(value, exponent)) for value in (mean, mean - margin, mean + margin))
    return replace(
        blank,
        statistic=statistic,
        df2=float(df),
        p=2 * t_above(abs(statistic), df),
        effect_size=mean / sd,
        ci_low=low,
        ci_high=high,
        details={
            "hedges_gz": None if correction is None else correction * mean / sd,
            "difference": difference,
            "ci_difference": interval,
        },
    )


def follow_ups(
    values: FloatArray,
    codes: IntArray,
    between: tuple[str, Sequence[str]],
    factors: Sequence[str],
    levels: Sequence[Sequence[str]],
) -> list[FollowUp]:
    """What `mixed_anova` leaves open, effect by effect; `between` is the group factor's name and its levels.

    Of three groups or more every two, by `t_welch` of participants' means. Of a within-effect its pairs as in
    `pairs.follow_ups`, by `t_in_groups`. Of its interaction with the group the same pairs within each group, by
    `t_paired`, and every two groups at each of its levels, by `t_welch`.
    """
    name, names = between
    groups = [values[codes == code] for code in range(len(names))]
    means = [group.mean(axis=tuple(range(1, group.ndim))) for group in groups]
    pairs = of_groups(means, names, name) if len(names) > 2 else []
    rows = [FollowUp(pair, t_welch(pair.first, pair.second, name)) for pair in pairs]
    for pair in within_pairs(values, factors, levels):
        rows.append(FollowUp(pair, t_in_groups(pair.first, pair.second, codes, pair.effect)))
    for effect in effects_of([len(names) for names in levels]):
        rows += _of_interaction(groups, between, factors, levels, effect)
    return [FollowUp(row.pair, replace(row.result, contrast=row.pair.contrast)) for row in rows]


def _of_interaction(
    groups: Sequence[FloatArray],
    between: tuple[str, Sequence[str]],
    factors: Sequence[str],
    levels: Sequence[Sequence[str]],
    effect: tuple[int, ...],
) -> Iterator[FollowUp]:
    """The simple effects of a within-effect's interaction with the group."""
    name = f"{between[0]}:{effect_name(factors, effect)}"
    for group, group_name in zip(groups, between[1], strict=True):
        for pair in of_effect(group, factors, levels, effect):
            where = ", ".join([*pair.contrast.split(" | ")[1:], group_name])
            contrast = f"{pair.contrast.split(' | ')[0]} | {where}"
            named = replace(pair, effect=name, contrast=contrast)
            yield FollowUp(named, t_paired(pair.first, pair.second, name))
    outside = tuple(place + 1 for place in range(len(factors)) if place not in effect)
    for at in product(*(range(len(levels[place])) for place in effect)):
        cells = [group.mean(axis=outside)[(slice(None), *at)] for group in groups]
        where = ", ".join(levels[place][level] for place, level in zip(effect, at, strict=True))
        for pair in of_groups(cells, between[1], name, where):
            yield FollowUp(pair, t_welch(pair.first, pair.second, name))
