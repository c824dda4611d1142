"""Every two groups after an analysis of variance, all of one spread: Tukey's test, of unequal groups Kramer's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy import stats

from pipeline.statistics.arrays import FloatArray, at_unit_scale
from pipeline.statistics.effect_size import standardized_interval
from pipeline.statistics.groups import untestable
from pipeline.statistics.result import Result

METHOD = "Tukey and Kramer's test, p over all pairs, one SD of all groups"


def tukey_kramer(groups: Sequence[FloatArray], names: Sequence[str], effect: str = "group") -> list[Result]:
    """Every two of groups (n₁,), (n₂,), …, whose p and interval of the difference hold for all pairs together.

    t is over the SD within all groups (N − k degrees of freedom), p of the studentized range (Kramer 1956). Effect
    size: Cohen's d over that SD, with the noncentral t's interval for the pair alone. Where groups spread differently
    neither holds: then it is Games and Howell's test that does (`welch.games_howell`).
    """
    scaled, exponent = at_unit_scale(groups)
    df = sum(len(group) for group in groups) - len(groups)
    status = untestable(scaled)
    found = None if status else stats.tukey_hsd(*scaled)
    results = []
    for i, j in combinations(range(len(groups)), 2):
        blank = Result(effect, "t", METHOD, "Cohen's d", len(groups[i]) + len(groups[j]))
        blank = replace(blank, contrast=f"{names[i]} - {names[j]}")
        if found is None:
            results.append(replace(blank, status=str(status)))
            continue
        sd = float(np.sqrt(sum(np.sum((group - group.mean()) ** 2) for group in scaled) / df))
        difference, share = float(found.statistic[i, j]), float(np.sqrt(1 / len(groups[i]) + 1 / len(groups[j])))
        bounds = found.confidence_interval()
        low, high = standardized_interval(difference / (sd * share), df, share)
        results.append(
            replace(
                blank,
                statistic=difference / (sd * share),
                df2=float(df),
                p=float(found.pvalue[i, j]),
                effect_size=difference / sd,
                ci_low=low,
                ci_high=high,
                details={
                    "ci_difference": [
                        float(np.ldexp(np.asarray(end)[i, j], exponent)) for end in (bounds.low, bounds.high)
                    ],
                    "n_groups": [len(groups[i]), len(groups[j])],
                },
            )
        )
    return results
