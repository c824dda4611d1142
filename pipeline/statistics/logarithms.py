"""Tests of logarithms, read as ratios: for times and other values above zero that spread the more the larger they are.

The mean of logarithms is the logarithm of the geometric mean. So what a test says of a difference of logarithms is a
ratio of geometric means: its estimate and both bounds are transformed back by the exponential.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.statistics import NO_LOGARITHMS, OF_LOGARITHMS, OK, RATIO
from pipeline.statistics.anova import effect_name, effects_of, rm_anova
from pipeline.statistics.arrays import FloatArray
from pipeline.statistics.descriptive import summarize
from pipeline.statistics.paired import t_paired
from pipeline.statistics.pairs import FollowUp, follow_ups
from pipeline.statistics.result import Result
from pipeline.statistics.welch import D_AV, t_welch

_PAIRED = "paired t test, two-sided"


def logarithms(values: FloatArray) -> FloatArray | str:
    """Natural logarithms of values of any shape, or the status where one is not above zero."""
    if np.any(values <= 0):
        return NO_LOGARITHMS
    result: FloatArray = np.log(values)
    return result


def as_ratio(result: Result) -> Result:
    """A t test of logarithms as a ratio: effect size and its bounds are the exponentials of the difference and its own.

    For results with `ci_difference` in their details (t_paired, t_welch, t_in_groups, games_howell), and for those
    whose effect size is the estimate itself (mixed_model, crossover). What was the effect size stands in the details,
    and so does the logarithm of the ratio, whose bounds are numbers also where the ratio's are beyond the largest one.
    """
    named = replace(result, method=result.method + OF_LOGARITHMS, effect_size_name=RATIO)
    if result.status != OK:
        return named
    details = dict(result.details)
    if result.effect_size_name == "estimate":
        logs = [result.effect_size, result.ci_low, result.ci_high]
    else:
        low, high = details.pop("ci_difference")
        logs = [(low + high) / 2, low, high]
        name = "cohen_dav" if result.effect_size_name == D_AV else "cohen_dz"
        details |= {name: result.effect_size, f"{name}_ci": [result.ci_low, result.ci_high]}
    ratio, low, high = (exponential(log) for log in logs)
    return replace(
        named,
        effect_size=ratio,
        ci_low=low,
        ci_high=high,
        details={**details, "log_ratio": logs[0], "log_ratio_ci": logs[1:]},
    )


def exponential(log: float | None) -> float | None:
    """The exponential; None beyond the largest float."""
    with np.errstate(over="ignore"):
        result = None if log is None else float(np.exp(log))
    return result if result is not None and np.isfinite(result) else None


def t_paired_ratio(first: FloatArray, second: FloatArray, effect: str = "condition") -> Result:
    """The paired t test of logarithms: the ratio of the geometric means of first to second (n,)."""
    both = logarithms(np.stack([first, second]))
    if isinstance(both, str):
        return _without_logarithms(effect, _PAIRED, len(first))
    return as_ratio(t_paired(both[0], both[1], effect))


def t_welch_ratio(first: FloatArray, second: FloatArray, effect: str = "group") -> Result:
    """Welch's t of logarithms: the ratio of the geometric means of two groups."""
    logs = logarithms(np.concatenate([first, second]))
    if isinstance(logs, str):
        return _without_logarithms(effect, "Welch's t test, two-sided", len(first) + len(second))
    return as_ratio(t_welch(logs[: len(first)], logs[len(first) :], effect))


def _without_logarithms(effect: str, method: str, n: int) -> Result:
    return Result(effect, "t", method + OF_LOGARITHMS, RATIO, n, status=NO_LOGARITHMS)


def rm_anova_of_logarithms(values: FloatArray, factors: Sequence[str]) -> list[Result]:
    """`rm_anova` of the logarithms of values (n, k₁, k₂, …): F, p and η² are those of the logarithms."""
    logs = logarithms(values)
    if isinstance(logs, str):
        blank = rm_anova(values[:0], factors)[0]
        names = [effect_name(factors, effect) for effect in effects_of(values.shape[1:])]
        results = [replace(blank, effect=name, n=len(values), status=logs) for name in names]
    else:
        results = rm_anova(logs, factors)
    return [replace(result, method=result.method + OF_LOGARITHMS) for result in results]


def ratio_follow_ups(values: FloatArray, factors: Sequence[str], levels: Sequence[Sequence[str]]) -> list[FollowUp]:
    """The pairs of `pairs.follow_ups` as ratios; factors outside an effect are averaged by the geometric mean.

    A pair's values are the participants' geometric means. Of values that are not above zero they are the plain ones.
    """
    logs = logarithms(values)
    if isinstance(logs, str):
        return [
            FollowUp(pair, replace(_without_logarithms(pair.effect, _PAIRED, len(values)), contrast=pair.contrast))
            for pair in follow_ups(values, factors, levels)
        ]
    results = []
    for pair in follow_ups(logs, factors, levels):
        result = as_ratio(t_paired(pair.first, pair.second, pair.effect))
        means = replace(pair, first=np.exp(pair.first), second=np.exp(pair.second))
        results.append(FollowUp(means, replace(result, contrast=pair.contrast)))
    return results


def geometric_mean(values: FloatArray) -> dict[str, Any]:
    """The geometric mean of values (n,) above zero, and the bounds of its 95 % interval; None where undefined."""
    logs = logarithms(values)
    row = {} if isinstance(logs, str) or not len(values) else summarize(logs)
    names = {"geometric_mean": "mean", "geometric_ci_low": "ci_low", "geometric_ci_high": "ci_high"}
    return {name: exponential(row.get(of)) for name, of in names.items()}
